"""Doubts about units: files of triangles do not state theirs, and a model may state wrong ones."""

import itertools
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.declaration.geometry import STEP, UNITS
from tolcontact.errors import UnitsWarning
from tolcontact.geometry.files.reading import Shape

PLAUSIBLE = (1.0, 10_000.0)  # size of a part [mm]
UNLIKE = 10.0  # ratio of sizes of parts that touch
NEAR = 0.1  # of a mesh's size: points up to there lie on it, or on what it leaves out
FAR = 0.25  # of a mesh's size: how far its points reach at least; a mesh that is large enough holds anything


def warn_of_units(assembly: Assembly, shapes: Mapping[Part, Shape]) -> None:
    """Warn of points that lie far off their mesh, and of meshes of implausible size if no units are given.

    A size is implausible by itself, or beside a part that the mesh touches. One warning for each mesh.
    """
    for part, shape in shapes.items():
        if isinstance(part.geometry, Mesh):
            size = _strange_size(assembly, part, part.geometry, shapes)
            for doubt in itertools.islice(itertools.chain(_far_point(assembly, part, part.geometry, shape), size), 1):
                told = f'part "{part.name}" ({part.declared_at}): {part.geometry} is {doubt}'
                warnings.warn(told, UnitsWarning, stacklevel=4)


def _far_point(assembly: Assembly, part: Part, geometry: Mesh, shape: Shape) -> Iterator[str]:
    """The point that lies farthest off the mesh, if that is farther than the mesh is large."""
    location = assembly.location_of(part)
    scheme = location.scheme if location and isinstance(location.scheme, tuple) else ()
    declared = [
        *((f'its locator "{locator.name}"', locator.point) for locator in scheme),
        *(
            (f'the point of measure "{m.name}"', p.position)
            for m in assembly.measures
            for p in m.points
            if p.part is part and p.position
        ),
        *((f'the point of force "{f.name}"', f.at.position) for f in assembly.forces if f.at.part is part and f.at.position),
    ]
    points = np.array([point for _, point in declared]).reshape(-1, 3)
    away, size = _away(points, shape.mesh.bounds), float(shape.mesh.scale)
    if not (away > size).any():
        return
    (what, point), far = declared[int(away.argmax())], float(away.max())
    doubt = f"{size:.4g} mm across, but {what} lies {far:.4g} mm away from it"
    unit = _explanation(points, geometry, shape)
    if unit:
        yield f"{doubt}; {_advice(geometry, size, unit)}"
    else:
        yield f"{doubt}; check the coordinates ({', '.join(f'{c:g}' for c in point)}), which are in the part's own frame"


def _explanation(points: np.ndarray, geometry: Mesh, shape: Shape) -> str | None:
    """The unit that the file may be in: with it all points (point, 3) [mm] lie on the mesh, of which most are off it."""
    bounds, size = shape.mesh.bounds, float(shape.mesh.scale)
    away = _away(points, bounds)
    if _states_units(geometry) or np.median(away) <= NEAR * size:
        return None
    for unit in sorted(UNITS, key=UNITS.__getitem__):
        factor = UNITS[unit] / _counted_in(geometry)
        if (_away(points, factor * bounds) <= NEAR * factor * size).all() and away.max() >= FAR * factor * size:
            return unit
    return None


def _states_units(geometry: Mesh) -> bool:
    """Whether the source states its own units."""
    source = geometry.source
    is_file = isinstance(source, str | Path)
    return Path(source).suffix.lower() in STEP if is_file else getattr(source, "units", None) is not None


def _counted_in(geometry: Mesh) -> float:
    """The unit [mm] that a mesh is taken to be in if it does not state one."""
    by_custom = "m" if str(geometry.source).lower().endswith((".glb", ".gltf")) else "mm"
    return UNITS[geometry.units or by_custom]


def _advice(geometry: Mesh, size: float, unit: str) -> str:
    length = size * UNITS[unit] / _counted_in(geometry)
    return f'if the file is in other units, state them: with tc.Mesh(..., units="{unit}") it would be {length:.4g} mm'


def _away(points: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """How far (point,) [mm] points (point, 3) lie outside the box with these corners (2, 3)."""
    lower, upper = bounds
    return np.asarray(np.linalg.norm(np.maximum(0, np.maximum(lower - points, points - upper)), axis=1))


def _strange_size(assembly: Assembly, part: Part, geometry: Mesh, shapes: Mapping[Part, Shape]) -> Iterator[str]:
    """What is implausible about the size of a mesh by itself, or beside a part that it touches."""
    if not shapes[part].unsure:
        return
    size = float(shapes[part].mesh.scale)
    if not PLAUSIBLE[0] <= size <= PLAUSIBLE[1]:
        yield f"{size:.4g} mm across, which is unusual for a part; {_advice(geometry, size, 'in')}"
    sides = [(pair.moving.part, pair.reference.part) for pair in assembly.pairs]
    for other in [b if a is part else a for a, b in sides if part in (a, b)]:
        if other in shapes:
            beside = float(shapes[other].mesh.scale)
            if max(size, beside) > UNLIKE * min(size, beside):
                touched = f'but "{other.name}", which it touches, is {beside:.4g} mm across'
                yield f"{size:.4g} mm across, {touched}; {_advice(geometry, size, 'in')}"
