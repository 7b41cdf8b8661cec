"""RA2: two U-shaped plates with stamped holes, one set down in the other. How much of a hole's variation does contact leave?

The paper's second reference assembly: only the inner plate varies, the outer one is the reference; range 5 mm, 3000 contact
points, flanges not orthogonal to the web, the measure at a hole's centre. The paper prints no dimensions; those below were
chosen so that the figures of its Table 1 come out (studies/paper): the measure lies along the channel, where contact takes the
rotations away and leaves the translation; the flanges lean outwards, so that one linear step can open all gaps; and the channel
narrows by 2 degrees to each side, so that contact pushes the inner plate towards its wide end: a small negative shift.

Needs the extra `tolcontact[solids]`. Lengths in mm, angles in degrees. A tolerance is the full width of its zone.
"""

import manifold3d
import numpy as np
import trimesh

import tolcontact as tc

LENGTH, WIDTH, HEIGHT, SHEET = 100.0, 60.0, 30.0, 2.0  # width of the inner plate's web, outside, at half its length
LEAN, NARROW = np.tan(np.radians([15.0, 2.0]))  # of a flange: outwards per height, inwards per length
SLOPE = np.sqrt(1 + LEAN**2 + NARROW**2)  # distance along y of two parallel flange faces 1 mm apart
FLANGE_HOLE = (LENGTH / 2, 15.0)  # x, z
HOLES = [(30.0, 0.0), (70.0, 0.0)]  # x, y in the web


def side(x: float, z: float, outside: float = 0.0) -> float:
    """Return the y of the right flange's contact face, or of the plane `outside` mm outside of it."""
    return WIDTH / 2 - NARROW * (x - LENGTH / 2) + LEAN * z + SLOPE * outside


def trough(outside: float, top: float, over: float = 0.0) -> trimesh.Trimesh:
    """Return the body between planes `outside` mm outside of the contact faces, `over` mm longer at both ends."""
    corners = [(x, z) for x in (-over, LENGTH + over) for z in (-outside, top)]
    return trimesh.convex.convex_hull([(x, sign * side(x, z, outside), z) for x, z in corners for sign in (-1, 1)])


def plate(outside: float) -> trimesh.Trimesh:
    """Return a plate whose outer faces lie `outside` mm outside of the contact faces, with its holes stamped through."""
    x, z = FLANGE_HOLE
    stamps = [trimesh.creation.cylinder(6, 20, transform=trimesh.transformations.translation_matrix((*xy, 0))) for xy in HOLES]
    for sign in (-1, 1):
        across = trimesh.geometry.align_vectors((0, 0, 1), (NARROW, sign, -LEAN))
        across[:3, 3] = (x, sign * side(x, z), z)
        stamps.append(trimesh.creation.cylinder(5, 20, transform=across))
    cut = solid(trough(outside, HEIGHT))
    for tool in (trough(outside - SHEET, HEIGHT + 1, over=1), *stamps):
        cut -= solid(tool)
    made = cut.to_mesh64()
    return trimesh.Trimesh(made.vert_properties[:, :3], made.tri_verts)


def solid(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    """Return the solid within a mesh in double precision: booleans of trimesh use single precision, which tilts faces."""
    return manifold3d.Manifold(manifold3d.Mesh64(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint64)))


def assembly() -> tc.Assembly:
    ra2 = tc.Assembly("RA2", method=tc.Method(resolution="linearized"))
    outer = ra2.part("outer", tc.Mesh(plate(SHEET)), fixed=True)
    inner = ra2.part("inner", tc.Mesh(plate(0)))
    ra2.locate(
        inner,
        [
            tc.Locator("A1", (25, -18, 0), "z"),
            tc.Locator("A2", (75, -18, 0), "z"),
            tc.Locator("A3", (50, 18, 0), "z"),
            tc.Locator("B1", (37, -side(37, 15), 15), "y"),
            tc.Locator("B2", (63, -side(63, 15), 15), "y"),
            tc.Locator("C1", (0, -8, 0), "x"),
        ],
        tolerance=5,
    )
    floor = tc.select.Inside((0, -WIDTH, -1), (LENGTH, WIDTH, 1))  # not the rims of the flanges, which face upwards, too
    ra2.contact("web", moving=inner.face("-z"), reference=outer.face("+z", floor), points=1480)
    for name, normal in {"left": (NARROW, -1, -LEAN), "right": (NARROW, 1, -LEAN)}.items():
        facing = outer.face(tc.select.Facing([-component for component in normal]))
        ra2.contact(name, moving=inner.face(tc.select.Facing(normal)), reference=facing, points=760)
    x, z = FLANGE_HOLE
    ra2.measure("hole position", inner.point(x, side(x, z), z), along="x", tolerance=1)
    return ra2


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/ra2.py
