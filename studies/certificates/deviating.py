"""Random blocks, or frusta, on each other, whose flat faces deviate: shifted and tilted within their zones.

The rims of a frustum move along its slanted walls. The simulation computes that to first order: what it leaves out is about
the deviation of the face, times the slant of the walls, times the angle between the faces.
"""

from collections.abc import Callable

import numpy as np
import trimesh
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.polyhedra import Body, Polyhedron

RANGES = 0.1, 0.6  # mm: of the zones of faces, and of locators
HEIGHT = 4.0  # mm
ON_PLANE = 1e-9  # mm


def block(rng: np.random.Generator, *, face_up: bool, slanted: bool) -> np.ndarray:
    """Return the corners (8, 3) of a block or a frustum with a face at height 0, on its top or its underside."""
    half, share = rng.uniform(3, 9, 2), rng.choice([0.8, 1.2]) if slanted else 1.0
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    corners = np.concatenate([np.column_stack([square, np.zeros(4)]), np.column_stack([share * square, np.full(4, HEIGHT)])])
    turned = Rotation.from_rotvec([0, 0, rng.choice([0.0, np.pi / 4, rng.uniform(0, np.pi)])]).apply(corners)
    return turned * [1, 1, -1] if face_up else turned


def facing(direction: np.ndarray) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return what chooses the triangles of a face with a normal."""
    return lambda centres, normals: np.asarray(normals @ direction > 0.999)


def scene(seed: int, *, slanted: bool = False, pressed: bool = False) -> tuple[tc.Assembly, list[np.ndarray]]:
    """Return an assembly of a base with one or two bodies on it, turned in space, and their corners in the assembly.

    Forces press on bodies that are `pressed`, and the locators below them are one-sided.
    """
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed) if seed % 3 == 0 else Rotation.identity()
    assembly, bodies = tc.Assembly(f"scene {seed}"), list[np.ndarray]()
    for k in range(2 + seed % 2):
        corners = block(rng, face_up=k == 0, slanted=slanted) + (rng.uniform(-6, 6, 3) * [1, 1, 0] if k else 0)
        bodies.append(turn.apply(corners))
        part = assembly.part(f"body {k}", tc.Mesh(trimesh.convex.convex_hull(bodies[-1])), fixed=k == 0)
        up, sign = turn.apply([0, 0, 1.0]), 1.0 if k == 0 else -1.0
        part.feature("back", part.face(facing(-sign * up)), datum="A")
        width = float(rng.uniform(*RANGES))
        face = part.feature("face", part.face(facing(sign * up)), tc.Profile(width, "A"))
        if k == 0:
            base = face
            continue
        feet = (((-9, -9, 0), "z"), ((9, -9, 0), "z"), ((0, 9, 0), "z"), ((-9, 0, 0), "y"), ((9, 0, 0), "y"), ((0, 0, 0), "x"))
        axes = dict(zip("xyz", turn.as_matrix().T, strict=True))
        range_ = float(rng.uniform(*RANGES))
        assembly.locate(
            part,
            [
                tc.Locator(f"L{j}", turn.apply(p), axes[along], range_, one_sided=pressed and along == "z")
                for j, (p, along) in enumerate(feet)
            ],
        )
        if pressed:
            at = corners.mean(axis=0) + rng.uniform(-1, 1, 3) * corners.std(axis=0)
            assembly.force(f"press {k}", at=part.point(*turn.apply(at)), vector=turn.apply([0, 0, -10.0]))
        assembly.contact(f"joint {k}", moving=face, reference=base, within=50)
        assembly.measure(f"height {k}", part.point(0, 0, 0), along="z", tolerance=1)
    return assembly, bodies


def deviated(bodies: list[Body], program: tc.Program, deviations: np.ndarray) -> list[Body]:
    """Return convex bodies with the deviations (contributor,) of their faces: half-spaces whose planes shift and tilt.

    Of the simulation's bodies only the heights of corners over the nominal planes are used.
    """
    found = []
    for number, (piece,) in enumerate(bodies):
        solid = program.watch.solid(number)
        assert solid is not None
        moved, motions = solid.motions
        corners, motion = solid.vertices[moved], motions @ deviations[solid.columns]
        halfspaces = np.column_stack([piece.normals, -piece.offsets])
        for k, n in enumerate(piece.normals):
            of_face = np.abs(corners @ n - piece.offsets[k]) < ON_PLANE
            heights = motion[of_face] @ n
            if np.abs(heights).max(initial=0) > ON_PLANE:
                points = corners[of_face] + heights[:, None] * n
                normal = np.linalg.svd(points - points.mean(axis=0))[2][-1]
                normal *= np.sign(normal @ n)
                halfspaces[k] = [*normal, -normal @ points.mean(axis=0)]
        found.append([Polyhedron(HalfspaceIntersection(halfspaces, piece.centre).intersections)])
    return found
