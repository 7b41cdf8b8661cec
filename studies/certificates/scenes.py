"""Random assemblies, wider than anything a person would declare: what a certificate must survive."""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tolcontact.method import OBJECTIVES

SOLIDS = ("box", "wedge", "cylinder", "sphere")


def scene(seed: int) -> tuple[tc.Assembly, tc.Method]:
    """Return a tower or row of two to four parts in a random frame and size, and a method that resolves it."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-1, 3.5)  # of the first part [mm]
    turn = Rotation.from_rotvec(rng.normal(size=3) * rng.choice([0, 1]))
    shift = rng.normal(size=3) * size * rng.choice([0, 1, 100])
    ranges = size * rng.choice([0, 1e-4, 1e-3, 1e-2, 3e-2], size=3, p=[0.15, 0.2, 0.3, 0.25, 0.1])
    resolution = str(rng.choice(["exact", "exact", "linearized"]))
    objective = str(rng.choice(tuple(OBJECTIVES)))
    a = tc.Assembly(f"scene {seed}")
    count = int(rng.integers(2, 5))
    below, top = None, 0.0
    parts: list[tc.Part] = []
    for k in range(count):
        scale = size * rng.uniform(0.5, 1.0) * (1.0 if k else 1.3)
        kind = (
            str(rng.choice(SOLIDS, p=[0.6, 0.25, 0.1, 0.05]))
            if k == count - 1
            else str(rng.choice(["box", "wedge"], p=[0.7, 0.3]))
        )
        mesh = solid(kind, scale, rng)
        low, high = mesh.bounds
        nominal_gap = size * float(rng.choice([0, 0, 1e-3, -1e-3]))
        offset = np.array([0, 0, top - low[2] + nominal_gap * bool(k)]) + np.array([*rng.normal(size=2) * 0.02 * size, 0])
        fixed = None if k else bool(rng.integers(2)) or None
        part = a.part(
            f"part {k}", tc.Mesh(mesh), at=turn.apply(offset) + shift, rotation=turn.as_rotvec(), fixed=True if fixed else None
        )
        on = parts[int(rng.integers(len(parts)))] if parts and rng.random() < 0.3 else None
        six = locators(low, high, ranges, rng, supports=objective == "seating" or rng.random() < 0.2)
        a.locate(part, six, on=on)
        tolerance(part, kind, mesh, max(float(ranges.max()), 1e-4 * size), np.random.default_rng([seed, k]))
        if below is not None:
            a.contact(f"joint {k}", moving=part.face(lambda c, n: n[:, 2] < -0.3), reference=below.face("+z"))
            a.force(f"weight {k}", at=part.point(*((low + high) / 2)), vector=turn.apply((0.1, -0.05, -1.0)))
        if rng.random() < 0.3 and below is not None and kind == "box":
            wall = tc.Box(*([0.3 * size, 1.5 * size, 1.5 * size]))
            x = high[0] + offset[0] + size * float(rng.choice([0, 1e-3, -1e-3]))
            at = turn.apply(np.array([x, -0.2 * size, offset[2]])) + shift
            stop = a.part(f"wall {k}", wall, at=at, rotation=turn.as_rotvec(), fixed=True)
            a.contact(f"side {k}", moving=part.face("+x"), reference=stop.face("-x"))
        parts.append(part)
        below, top = part, offset[2] + high[2]
    a.measure("top", parts[-1].point(*high), along=turn.apply((0, 0, 1)), tolerance=max(float(ranges.max()), 1e-3 * size))
    a.measure("aside", parts[-1].point(*high), along=turn.apply((1, 0, 0)))
    return a, tc.Method(resolution=resolution, objective=objective)


def tolerance(part: tc.Part, kind: str, mesh: trimesh.Trimesh, width: float, rng: np.random.Generator) -> None:
    """Features of about half of the parts: top and foot of boxes tilt, and balls and cylinders vary in diameter."""
    if rng.random() < 0.5 or kind == "wedge":
        return
    width *= rng.uniform(0.1, 1.0)
    if kind == "box":
        part.feature("side", part.face("-y"), datum="A")
        part.feature("end", part.face("-x"), datum="B")
        for name, face in (("top", "+z"), ("foot", "-z")):
            part.feature(name, part.face(face), tc.Perpendicularity(width, "A|B"))
    else:
        round_face = part.face(tc.select.Cylinder()) if kind == "cylinder" else part.face()
        diameter = float(mesh.bounds[1][2] - mesh.bounds[0][2])
        part.feature("skin", round_face, tc.Size(diameter, width, -width))


def solid(kind: str, scale: float, rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a closed body of about the size `scale` [mm], with its lower side down."""
    x, y, z = scale * rng.uniform(0.6, 1.0, size=3)
    if kind == "box":
        return trimesh.creation.box(bounds=[[0, 0, 0], [x, y, z]])
    if kind == "wedge":
        lean = rng.uniform(0, 0.3) * x
        corners = [(0, 0, 0), (x, 0, 0), (0, y, 0), (x, y, 0), (lean, 0, z), (x - lean, 0, z), (lean, y, z), (x - lean, y, z)]
        return trimesh.Trimesh(corners).convex_hull
    if kind == "cylinder":
        lying = trimesh.creation.cylinder(radius=z / 3, height=x, sections=64)
        lying.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
        lying.apply_translation((x / 2, y / 2, 0))
        return lying
    ball = trimesh.creation.icosphere(3, z / 3)
    ball.apply_translation((x / 2, y / 2, 0))
    return ball


def locators(
    low: np.ndarray, high: np.ndarray, ranges: np.ndarray, rng: np.random.Generator, *, supports: bool
) -> list[tc.Locator]:
    """Three points below, two at the side, one at the end; those below one-sided if they are supports, and then a fourth."""

    def at(*share: float) -> tuple[float, ...]:
        return tuple(float(c) for c in low + np.array(share) * (high - low))

    feet = [at(0.1, 0.1, 0), at(0.9, 0.1, 0), at(0.5, 0.9, 0)] + ([at(0.1, 0.9, 0)] if supports and rng.random() < 0.3 else [])
    found = [tc.Locator(f"A{k}", p, "z", float(ranges[0]), one_sided=supports) for k, p in enumerate(feet)]
    found += [
        tc.Locator("B1", at(0.1, 0, 0.5), "y", float(ranges[1])),
        tc.Locator("B2", at(0.9, 0, 0.5), "y", float(ranges[1])),
    ]
    return [*found, tc.Locator("C", at(0, 0.5, 0.5), "x", float(ranges[2]))]
