"""Doubts about units: files of triangles do not state theirs, and a model may state wrong ones."""

import itertools
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.declaration.geometry import STEP, UNITS
from tolcontact.errors import UnitsWarning, designation
from tolcontact.geometry.files.reading import Shape

PLAUSIBLE_SIZES = (1.0, 10_000.0)  # of a part [mm]
MAX_SIZE_RATIO = 10.0  # of parts that touch
MESH_MARGIN = 0.1  # of a mesh's size: distance up to which points count as on the mesh
MIN_POINT_REACH = 0.25  # of a mesh in a probable unit: the least reach of points, since a mesh large enough holds any points


def warn_of_units(assembly: Assembly, shapes: Mapping[Part, Shape]) -> None:
    """Warn of meshes without stated units whose points lie on them in another unit, or whose size is implausible.

    A size is implausible by itself, or beside a part that the mesh touches. One warning is issued for each mesh.
    """
    for part, shape in shapes.items():
        if isinstance(part.geometry, Mesh):
            point_doubts = _far_point(assembly, part, part.geometry, shape)
            size_doubts = _implausible_size(assembly, part, part.geometry, shapes)
            for doubt in itertools.islice(itertools.chain(point_doubts, size_doubts), 1):
                warnings.warn(f"{designation('part', part)}: {part.geometry} is {doubt}", UnitsWarning, stacklevel=4)


def _far_point(assembly: Assembly, part: Part, geometry: Mesh, shape: Shape) -> Iterator[str]:
    """Yield the point that lies farthest off the mesh, if all points would lie on it in another unit."""
    location = assembly.location_of(part)
    scheme = location.scheme if location and not location.joint and isinstance(location.scheme, tuple) else ()
    declared = [
        *((f'its locator "{locator.name}"', locator.point) for locator in scheme),
        *(
            (f'the point of measurement "{m.name}"', p.position)
            for m in assembly.measures
            for p in m.points
            if p.part is part and p.position
        ),
        *((f'the point of force "{f.name}"', f.at.position) for f in assembly.forces if f.at.part is part and f.at.position),
    ]
    points = np.array([point for _, point in declared]).reshape(-1, 3)
    distances, size = _distances(points, shape.mesh.bounds), float(shape.mesh.scale)
    if not (distances > size).any():
        return
    (name, _), distance = declared[int(distances.argmax())], float(distances.max())
    if unit := probable_unit(points, geometry, shape.mesh):
        yield f"{size:.4g} mm across, but {name} lies {distance:.4g} mm away from it; {_advice(geometry, size, unit)}"


def probable_unit(points: np.ndarray, geometry: Mesh, mesh: trimesh.Trimesh) -> str | None:
    """Return the unit with which all points (point, 3) [mm] lie on the mesh, if most of them are off it."""
    bounds, size = mesh.bounds, float(mesh.scale)
    distances = _distances(points, bounds)
    if _states_units(geometry) or np.median(distances) <= MESH_MARGIN * size:
        return None
    for unit in sorted(UNITS, key=UNITS.__getitem__):
        factor = UNITS[unit] / _assumed_unit(geometry)
        is_on_mesh = (_distances(points, factor * bounds) <= MESH_MARGIN * factor * size).all()
        if is_on_mesh and distances.max() >= MIN_POINT_REACH * factor * size:
            return unit
    return None


def _states_units(geometry: Mesh) -> bool:
    """Return whether the source states its own units."""
    source = geometry.source
    is_file = isinstance(source, str | Path)
    return Path(source).suffix.lower() in STEP if is_file else getattr(source, "units", None) is not None


def _assumed_unit(geometry: Mesh) -> float:
    """Return the unit [mm] that is assumed for a mesh that does not state one."""
    by_custom = "m" if str(geometry.source).lower().endswith((".glb", ".gltf")) else "mm"
    return UNITS[geometry.units or by_custom]


def _advice(geometry: Mesh, size: float, unit: str) -> str:
    length = size * UNITS[unit] / _assumed_unit(geometry)
    return f'if the file is in other units, state them: with tc.Mesh(..., units="{unit}") it would be {length:.4g} mm'


def _distances(points: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return how far (point,) [mm] points (point, 3) lie outside the box with these corners (2, 3)."""
    lower, upper = bounds
    return np.linalg.norm(np.maximum(0, np.maximum(lower - points, points - upper)), axis=1)


def _implausible_size(assembly: Assembly, part: Part, geometry: Mesh, shapes: Mapping[Part, Shape]) -> Iterator[str]:
    """Yield a size of a mesh that is implausible by itself, or beside a part that it touches."""
    if not shapes[part].unsure:
        return
    size = float(shapes[part].mesh.scale)
    if not PLAUSIBLE_SIZES[0] <= size <= PLAUSIBLE_SIZES[1]:
        yield f"{size:.4g} mm across, which is unusual for a part; {_advice(geometry, size, 'in')}"
    sides = [(pair.moving.part, pair.reference.part) for pair in assembly.pairs]
    for neighbour in [b if a is part else a for a, b in sides if part in (a, b)]:
        if neighbour in shapes:
            neighbour_size = float(shapes[neighbour].mesh.scale)
            if max(size, neighbour_size) > MAX_SIZE_RATIO * min(size, neighbour_size):
                comparison = f'but "{neighbour.name}", which it touches, is {neighbour_size:.4g} mm across'
                yield f"{size:.4g} mm across, {comparison}; {_advice(geometry, size, 'in')}"
