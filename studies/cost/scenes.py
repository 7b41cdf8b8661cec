"""Assemblies of any number of free bodies: a tower, a tree, a ring, a star; one of a STEP file; a slab of many points.

Lengths in mm. A tolerance is the full width of its zone.
"""

from collections.abc import Callable

import numpy as np
import trimesh

import tolcontact as tc
from models import tower
from studies.cad import as1_nine

HEIGHT, FIXTURE = 10.0, 1.0
ROOT = 320.0  # width of the lowest block of a tree
SMALL, PITCH = 30.0, 40.0  # width of a block of a star, and its distance from the next
LONG, WIDE, THICK = 50.0, 25.0, 10.0  # of a slab
CLEARANCE, ARC, THICKNESS = 0.2, 40.0, 20.0  # of a ring: between wedges, length of a wedge along it, and across it


def tree(bodies: int) -> tc.Assembly:
    """Return blocks that each carry two smaller ones, the lowest on a fixed one."""
    model = tc.Assembly(f"tree of {bodies}")
    ground = model.part("ground", tc.Box(ROOT, ROOT, HEIGHT), at=(-ROOT / 2, -ROOT / 2, -HEIGHT), fixed=True)
    places = [(np.zeros(3), np.full(2, ROOT))]  # of each block: centre of its lower face, and widths
    blocks: list[tc.Part] = []
    for k in range(bodies):
        centre, widths = places[k]
        corner = centre - [*widths / 2, 0]
        blocks.append(_block(model, f"block {k + 1}", (*widths, HEIGHT), corner))
        below = blocks[(k - 1) // 2] if k else ground
        model.contact(f"joint {k + 1}", moving=blocks[k].face("-z"), reference=below.face("+z"), points=30)
        axis = (k + 1).bit_length() % 2  # along which its two blocks stand: levels alternate
        shift = np.zeros(3)
        shift[axis] = widths[axis] / 4
        smaller = widths * 0.9
        smaller[axis] /= 2
        places += [(centre + sign * shift + [0, 0, HEIGHT], smaller) for sign in (-1, 1)]
    model.measure("last block", blocks[-1].point(0, 0, HEIGHT), along="z", tolerance=1)
    return model


def ring(bodies: int) -> tc.Assembly:
    """Return wedges around an axis, each with some room to the next: the loop of contacts closes. It takes three or more."""
    model = tc.Assembly(f"ring of {bodies}")
    half, middle = np.pi / bodies, bodies * ARC / (2 * np.pi)
    out, along = np.array([np.cos(half), np.sin(half), 0]), np.array([-np.sin(half), np.cos(half), 0])
    edge = [r * out - CLEARANCE / 2 * along for r in (middle - THICKNESS / 2, middle + THICKNESS / 2)]
    mirror = np.array([1, -1, 1])
    corners = [point * turn + [0, 0, z] for point in edge for turn in (1, mirror) for z in (0, HEIGHT)]
    wedge = trimesh.Trimesh(corners).convex_hull
    inner, outer, side = edge[0][0], edge[1][0], (edge[0] + edge[1]) / 2 * mirror
    locators = [
        tc.Locator("A1", (inner + 2, 0, 0), "z"), tc.Locator("A2", (outer - 2, -5, 0), "z"),
        tc.Locator("A3", (outer - 2, 5, 0), "z"), tc.Locator("B1", (inner, -5, 5), "x"), tc.Locator("B2", (inner, 5, 5), "x"),
        tc.Locator("C1", (side[0], side[1], 5), "y"),
    ]  # fmt: skip
    parts = []
    for k in range(bodies):
        parts.append(model.part(f"wedge {k + 1}", tc.Mesh(wedge), rotation=(0, 0, 2 * half * k), fixed=False))
        model.locate(parts[-1], locators, tolerance=FIXTURE)
    for k, part in enumerate(parts):
        ahead, behind = part.face(_towards(along)), parts[(k + 1) % bodies].face(_towards(along * mirror))
        model.contact(f"joint {k + 1}", moving=ahead, reference=behind, points=30)
    model.measure("width", parts[0].point(inner, 0, 5), to=parts[bodies // 2].point(inner, 0, 5), along="x", tolerance=1)
    return model


def star(bodies: int) -> tc.Assembly:
    """Return one free plate on a fixed one, with all other bodies on it."""
    model = tc.Assembly(f"star of {bodies}")
    columns = max(int(np.ceil(np.sqrt(bodies - 1))), 1)
    size = (PITCH * columns, PITCH * columns, HEIGHT)
    ground = model.part("ground", tc.Box(*size), at=(0, 0, -HEIGHT), fixed=True)
    plate = _block(model, "plate", size, np.zeros(3))
    model.contact("plate on ground", moving=plate.face("-z"), reference=ground.face("+z"), points=30)
    last = plate
    for k in range(bodies - 1):
        row, column = divmod(k, columns)
        corner = PITCH * np.array([column, row, 0]) + [(PITCH - SMALL) / 2, (PITCH - SMALL) / 2, HEIGHT]
        last = _block(model, f"block {k + 1}", (SMALL, SMALL, HEIGHT), corner)
        model.contact(f"joint {k + 1}", moving=last.face("-z"), reference=plate.face("+z"), points=30)
    model.measure("last block", last.point(0, 0, HEIGHT), along="z", tolerance=1)
    return model


def slab(points: int, radius: float = np.inf) -> tc.Assembly:
    """Return a slab set down on a base. Both faces are part of a sphere, or flat where `radius` [mm] is infinite."""
    across = max(round(np.sqrt(points / 2)), 2)
    a = tc.Assembly(f"slab of {points}")
    base = a.part("base", tc.Mesh(_shell(LONG + 10, WIDE + 10, 60, 35, radius, -THICK)), fixed=True)
    top = a.part("slab", tc.Mesh(_shell(LONG, WIDE, max(round(points / across), 2), across, radius, THICK)))
    places = {
        "Z1": ((-20, -10, 0), "z", 2), "Z2": ((20, -10, 0), "z", 2), "Z3": ((0, 10, 0), "z", 2),
        "Y1": ((-20, 0, 5), "y", 0.5), "Y2": ((20, 0, 5), "y", 0.5), "X1": ((0, 0, 5), "x", 0.5),
    }  # fmt: skip
    a.locate(top, [tc.Locator(name, *place) for name, place in places.items()])
    a.contact("interface", moving=top.face(_contact_side), reference=base.face(_contact_side), points="vertices", within=0.5)
    a.measure("corner", top.point(LONG / 2, WIDE / 2, THICK), along="z", tolerance=1)
    return a


SCENES: dict[str, tuple[int, Callable[[int], tc.Assembly]]] = {  # with the least number of bodies
    "tower": (1, tower.assembly),
    "tree": (1, tree),
    "ring": (3, ring),
    "star": (1, star),
}
AS1, AS1_BODIES = "as1", 8  # of a STEP file, as it is: two brackets, a rod, two nuts, three bolts


def scene(name: str, bodies: int) -> tc.Assembly:
    """Return a scene with this number of free bodies; as1 has its own."""
    return as1_nine.assembly() if name == AS1 else SCENES[name][1](bodies)


def _block(model: tc.Assembly, name: str, size: tuple[float, float, float], corner: np.ndarray) -> tc.Part:
    """Declare a free block by its lowest corner, with a fixture that holds three of its faces."""
    block = model.part(name, tc.Box(*size), at=tuple(corner), fixed=False)
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=4), tolerance=FIXTURE)
    return block


def _towards(direction: np.ndarray) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda centres, normals: normals @ direction > 0.99


def _shell(long: float, wide: float, along: int, across: int, radius: float, thickness: float) -> trimesh.Trimesh:
    """Return the body between the sphere and a plane at height `thickness`."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-0.5, 0.5, along) * long, np.linspace(-0.5, 0.5, across) * wide))
    z = radius - np.sqrt(radius**2 - x**2 - y**2) if np.isfinite(radius) else np.zeros_like(x)
    first = (np.arange(across - 1)[:, None] * along + np.arange(along - 1)).ravel()
    sheet = np.concatenate([np.column_stack([first, first + 1, first + along]),
                            np.column_stack([first + 1, first + along + 1, first + along])])  # fmt: skip
    count = along * across
    right, back, left = (
        np.arange(2 * along - 1, count, along),
        np.arange(count - 2, count - along - 1, -1),
        np.arange(count - 2 * along, 0, -along),
    )
    edge = np.concatenate([np.arange(along), right, back, left])
    after = np.roll(edge, -1)
    wall = np.concatenate([np.column_stack([edge, edge + count, after]), np.column_stack([after, edge + count, after + count])])
    vertices = np.concatenate([np.column_stack([x, y, z]), np.column_stack([x, y, np.full(count, thickness)])])
    mesh = trimesh.Trimesh(vertices, np.concatenate([sheet, sheet[:, ::-1] + count, wall]), process=False)
    mesh.fix_normals()
    return mesh


def _contact_side(centres: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return np.asarray((np.abs(normals[:, 2]) > 0.3) & (np.abs(centres[:, 2]) < THICK - 1e-6))
