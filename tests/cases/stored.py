"""Bodies without clearance, turned in space and far from the origin, as files store them."""

from dataclasses import dataclass
from pathlib import Path

import manifold3d
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.ends import prism

MILLIMETRES = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8}  # of a unit
FAR = (3000.0, -1800.0, 900.0)  # mm
FLANK = np.array([4.0, 0.0, 3.0]) / 5  # normal of a flank of the dovetail


def solid(mesh):
    """The solid within a mesh, in double precision."""
    return manifold3d.Manifold(manifold3d.Mesh64(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.uint64)))


def box(low, high):
    return solid(trimesh.creation.box(bounds=[low, high]))


def dovetail():
    """A slider that fills the dovetail groove of a shorter block."""
    outline = [(-8, 0), (8, 0), (5, 4), (-5, 4)]
    slider, tool = (solid(trimesh.convex.convex_hull(prism(outline, -end, end))) for end in (12, 30))
    return slider, box((-20, -10, -6), (20, 10, 4)) - tool


def key():
    """A key that fills its keyway along three axes."""
    return box((-4, -10, -3), (4, 10, 5)), box((-15, -20, -12), (15, 20, 2)) - box((-4, -10, -3), (4, 10, 8))


@dataclass(frozen=True)
class Scene:
    """Bodies, the points and directions of the moving part's locators, and the outward normals of its faces in contact."""

    bodies: object
    locators: tuple
    normals: tuple


SCENES = {
    "dovetail": Scene(
        dovetail,
        (
            *(((x, y, 0), (0, 0, 1)) for x, y in ((-4, -9), (4, -9), (0, 9))),
            *(((-6.5, y, 2), (1, 0, 0)) for y in (-9, 9)),
            ((0, -12, 2), (0, 1, 0)),
        ),
        ((0, 0, -1), FLANK * (-1, 1, 1), FLANK),
    ),
    "key": Scene(
        key,
        (
            *(((x, y, -3), (0, 0, 1)) for x, y in ((-3, -9), (3, -9), (0, 9))),
            *(((-4, y, 0), (1, 0, 0)) for y in (-9, 9)),
            ((0, -10, 0), (0, 1, 0)),
        ),
        ((0, 0, -1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0)),
    ),
}


def ascii_stl(mesh, number):
    """The text of an STL file that prints numbers like `number`."""
    facets = [
        "\n".join(f"vertex {' '.join(number % float(x) for x in corner)}" for corner in facet) for facet in mesh.triangles
    ]
    text = "\n".join(f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet" for corners in facets)
    return f"solid body\n{text}\nendsolid body\n"


def stored(mesh, path, units="mm", number=""):
    """A mesh in a file with these units; a text, if numbers are printed like `number`."""
    scaled = trimesh.Trimesh(mesh.vertices / MILLIMETRES[units], mesh.faces, process=False)
    if number:
        path.write_text(ascii_stl(scaled, number))
    else:
        scaled.export(path)
    return tc.Mesh(path, units=units)


def stored_case(name, folder: Path | None, suffix="stl", *, seed=1, at=FAR, faces=False, **options):
    """The assembly of a scene from files in a folder, or from meshes in memory; whole bodies are paired, or single faces."""
    scene, R = SCENES[name], Rotation.random(random_state=seed).as_matrix()
    geometries = []
    for role, body in zip((name, "block"), scene.bodies(), strict=True):
        made = body.to_mesh64()
        mesh = trimesh.Trimesh(made.vert_properties[:, :3] @ R.T + at, made.tri_verts, process=False)
        geometries.append(tc.Mesh(mesh) if folder is None else stored(mesh, folder / f"{role}.{suffix}", **options))
    a = tc.Assembly(name)
    moving, block = a.part(name, geometries[0]), a.part("block", geometries[1], fixed=True)
    locators = [tc.Locator(f"L{k}", tuple(R @ p + at), tuple(R @ d)) for k, (p, d) in enumerate(scene.locators)]
    a.locate(moving, locators, tolerance=0.1)
    if faces:
        for k, n in enumerate(np.array(scene.normals, dtype=float) @ R.T):
            a.contact(
                f"{name} {k}", moving=moving.face(tc.select.Facing(tuple(n))), reference=block.face(tc.select.Facing(tuple(-n)))
            )
    else:
        a.contact(name, moving=moving.face(), reference=block.face())
    a.measure("height", moving.point(*(R @ (0, 0, 3) + at)), along=tuple(R[:, 2]), tolerance=1)
    return a
