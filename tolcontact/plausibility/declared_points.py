"""Points off their part, meshes in other units, and directions that do not fit the surface of their part."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tolcontact.declaration import Mesh, Part
from tolcontact.declaration.geometry import STEP, UNITS
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.geometry.tolerances import ON_FACE
from tolcontact.geometry.triangle_mesh import coordinate_spacing
from tolcontact.plausibility.trial_draws import TrialDraws

FAR_SHARE = 0.25  # of a part's size: how far off its box a point may lie
SPACING_SHARE = 0.1  # of the smallest tolerance: the spacing of stored coordinates
USUAL_SIZE = 100.0  # of a part [mm]
PLAUSIBLE_SIZES = (1.0, 10_000.0)  # of a part [mm]
MAX_SIZE_RATIO = 10.0  # of parts that touch
MESH_MARGIN = 0.1  # of a mesh's size: largest distance of a point on the mesh
MIN_POINT_REACH = 0.25  # of a mesh in a probable unit: the least reach of points, since a mesh large enough holds any points
OUTWARD, ALONG = 0.5, 0.2  # cosines of the angle between a direction and the normal into the part


class DeclaredPoint(NamedTuple):
    """A point of a part and the declaration that states it: as a message begins with it, and within a sentence."""

    owner: str
    phrase: str
    position: np.ndarray


def location_designation(nominal: Nominal, part: NominalPart) -> str:
    """Return the name of a part's location in a warning: the part, and the line of the script that locates it there."""
    locations = (entry for entry in nominal.assembly.locations if entry.part is part.part and entry.station == part.station)
    return f'part "{part.name}" ({next(locations, part.part).declared_at})'


def doubtful_units(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each mesh that is probably in other units, since its file states none, or the model wrong ones.

    All declared points would lie on it in another unit, or its size is implausible: alone, or compared with a part that it
    touches.
    """
    points, nominal = _declared_points(draws), draws.program.nominal
    for part in nominal.last_parts:
        geometry = part.part.geometry
        if isinstance(geometry, Mesh):
            doubts = chain(_far_point(part, geometry, points[part.part]), _implausible_size(nominal, part, geometry))
            for doubt in islice(doubts, 1):
                yield f"{part.part.designation}: {geometry} is {float(part.mesh.scale):.4g} mm across, {doubt}"


def _far_point(nominal: NominalPart, geometry: Mesh, declared: list[DeclaredPoint]) -> Iterator[str]:
    """Yield the point that lies farthest off the mesh, if all points would lie on it in another unit."""
    if unit := _probable_unit(nominal, declared):
        distances = _outside(declared, nominal.mesh.bounds)
        if distances.max() > nominal.mesh.scale:
            point = declared[int(distances.argmax())].phrase
            advice = _advice(geometry, float(nominal.mesh.scale), unit)
            yield f"but {point} lies {distances.max():.4g} mm away from it; {advice}"


def _probable_unit(nominal: NominalPart, declared: list[DeclaredPoint]) -> str | None:
    """Return the unit with which all declared points lie on the mesh of a part, if most of them are off it."""
    geometry, bounds, size = nominal.part.geometry, nominal.mesh.bounds, float(nominal.mesh.scale)
    if not declared or not isinstance(geometry, Mesh) or _states_units(geometry):
        return None
    distances = _outside(declared, bounds)
    if np.median(distances) <= MESH_MARGIN * size:
        return None
    for unit in sorted(UNITS, key=UNITS.__getitem__):
        factor = UNITS[unit] / _assumed_unit(geometry)
        is_on_mesh = (_outside(declared, factor * bounds) <= MESH_MARGIN * factor * size).all()
        if is_on_mesh and distances.max() >= MIN_POINT_REACH * factor * size:
            return unit
    return None


def _states_units(geometry: Mesh) -> bool:
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


def _unit_for(geometry: Mesh, size: float, expected: float) -> str:
    """Return the unit in which a mesh of a size [mm] is nearest to the expected size [mm]."""
    return min(UNITS, key=lambda unit: abs(np.log(size * UNITS[unit] / _assumed_unit(geometry) / expected)))


def stored_coordinates(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part whose file stores coordinates more coarsely than the smallest tolerance allows."""
    finest = draws.program.nominal.assembly.smallest_zone()
    for part in draws.program.nominal.last_parts:
        spacing = float(coordinate_spacing(part.mesh).max())
        if spacing > SPACING_SHARE * finest:
            yield (
                f"{part.part.designation}: {part.part.geometry} stores coordinates {spacing:.2g} mm apart, compared with a "
                f"smallest tolerance of {finest:.4g} mm; export it near the origin of its frame, or as STEP"
            )


def _implausible_size(nominal: Nominal, part: NominalPart, geometry: Mesh) -> Iterator[str]:
    """Yield why the size of a mesh file without stated units is implausible: alone, or compared with a part that it touches."""
    if geometry.units or not isinstance(geometry.source, str | Path) or _states_units(geometry):
        return
    size = float(part.mesh.scale)
    if not PLAUSIBLE_SIZES[0] <= size <= PLAUSIBLE_SIZES[1]:
        yield f"which is unusual for a part; {_advice(geometry, size, _unit_for(geometry, size, USUAL_SIZE))}"
    sides = [(pair.moving.part, pair.reference.part) for pair in nominal.assembly.pairs]
    for neighbour in [b if a is part.part else a for a, b in sides if part.part in (a, b)]:
        neighbour_size = float(nominal.meshes[neighbour].scale)
        if max(size, neighbour_size) > MAX_SIZE_RATIO * min(size, neighbour_size):
            advice = _advice(geometry, size, _unit_for(geometry, size, neighbour_size))
            yield f'but "{neighbour.name}", which it touches, is {neighbour_size:.4g} mm across; {advice}'


def far_points(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with declared points far off its body, about the farthest one."""
    points = _declared_points(draws)
    for nominal in draws.program.nominal.last_parts:
        declared, size = points[nominal.part], float(nominal.mesh.scale)
        if not declared or _probable_unit(nominal, declared):
            continue
        distances = _outside(declared, nominal.mesh.bounds)
        farthest = declared[int(distances.argmax())]
        others = int((distances > FAR_SHARE * size).sum()) - 1
        if others >= 0:
            yield (
                f"{farthest.owner}: its point ({_row(farthest.position)}) lies {distances.max():.4g} mm off part "
                f'"{nominal.name}", which is {size:.4g} mm across'
                + (f", as do {others} more points of it" if others > 1 else ", as does one more point of it" if others else "")
                + f"; {_cause(nominal, farthest.position)}"
            )


def unfit_directions(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with locators on its surface whose directions are probably stated in the assembly frame.

    All of them would then point into the part, while some lie along its surface as they are stated. Each one-sided locator that
    points out of the part has its own sentence.
    """
    for nominal in draws.program.nominal.parts:
        scheme = nominal.scheme
        if not isinstance(scheme, tuple) or nominal.owners:
            continue
        R_WP = nominal.placement[0]
        place = location_designation(draws.program.nominal, nominal)
        normals = [-_normals_at(nominal, np.array(locator.point)) for locator in scheme]
        on_surface = [(locator, inward) for locator, inward in zip(scheme, normals, strict=True) if len(inward)]
        fits = [bool((inward @ (R_WP.T @ np.array(locator.direction))).max() > 1 - ALONG) for locator, inward in on_surface]
        for locator, inward in on_surface if all(fits) else ():
            direction = np.array(locator.direction)
            if np.abs(inward @ direction).max() < ALONG:
                yield (
                    f'{place}: the direction ({_row(direction)}) of locator "{locator.name}" lies along the surface of the '
                    f"part; directions are stated in the part's own frame; for this direction of the assembly write "
                    f"({_row(R_WP.T @ direction)})"
                )
                break
        for locator, inward in on_surface:
            if locator.one_sided and (inward @ np.array(locator.direction)).max() < -OUTWARD:
                yield (
                    f'{place}: the direction ({_row(np.array(locator.direction))}) of the one-sided locator "{locator.name}" '
                    "points out of the part; a one-sided locator pushes its part along its direction: state the direction "
                    "into the part"
                )


def parts_in_other_units(draws: TrialDraws) -> list[Part]:
    """Return the parts whose file is probably in other units; another warning says so."""
    points = _declared_points(draws)
    return [nominal.part for nominal in draws.program.nominal.last_parts if _probable_unit(nominal, points[nominal.part])]


def _declared_points(draws: TrialDraws) -> "defaultdict[Part, list[DeclaredPoint]]":
    """Return the points that are declared by their coordinates, by part, in the part's own frame."""
    model, points = draws.program.nominal, defaultdict[Part, list[DeclaredPoint]](list)
    for nominal in model.parts:
        for locator in nominal.scheme if isinstance(nominal.scheme, tuple) else ():
            name = f'locator "{locator.name}"'
            point = DeclaredPoint(f"{location_designation(model, nominal)}: {name}", f"its {name}", np.array(locator.point))
            points[locator.part or nominal.part].append(point)
    for owner, phrase, declared in (
        *((measure, f'measurement "{measure.name}"', point) for measure in model.assembly.measures for point in measure.points),
        *((force, f'force "{force.name}"', force.at) for force in model.assembly.forces),
    ):
        if declared.position is not None:
            place = DeclaredPoint(owner.designation, f"the point of {phrase}", np.array(declared.position))
            points[declared.part].append(place)
    return points


def _cause(nominal: NominalPart, point: np.ndarray) -> str:
    """Return the likely cause of a point that lies off its part."""
    R_WP, t_WP = nominal.placement
    meant = (point - t_WP) @ R_WP
    if _outside([DeclaredPoint("", "", meant)], nominal.mesh.bounds)[0] <= ON_FACE * nominal.mesh.scale:
        return f"points are stated in the part's own frame; for this point of the assembly write ({_row(meant)})"
    return "check the coordinates, which are in the part's own frame [mm]"


def _outside(points: Sequence[DeclaredPoint], bounds: np.ndarray) -> np.ndarray:
    """Return how far (point,) [mm] points lie outside the box with these corners (2, 3)."""
    positions = np.array([point.position for point in points])
    return np.asarray(np.linalg.norm(np.maximum(0, np.maximum(bounds[0] - positions, positions - bounds[1])), axis=1))


def _normals_at(nominal: NominalPart, point: np.ndarray) -> np.ndarray:
    """Return the normals (triangle, 3) of the triangles at a point (3,) [mm] of a part."""
    corners, normals = np.asarray(nominal.mesh.triangles), np.asarray(nominal.mesh.face_normals)
    margin = ON_FACE * nominal.mesh.scale
    nearby = np.flatnonzero(
        ((corners.min(axis=1) - margin <= point) & (corners.max(axis=1) + margin >= point)).all(axis=1)
        & (np.abs(((point - corners[:, 0]) * normals).sum(axis=1)) <= margin)
    )
    inside = np.full(len(nearby), True)
    for k in range(3):
        edge = corners[nearby, (k + 1) % 3] - corners[nearby, k]
        inward = np.cross(normals[nearby], edge)
        height = ((point - corners[nearby, k]) * inward).sum(axis=1)
        inside &= height >= -margin * np.linalg.norm(inward, axis=1)
    return normals[nearby[inside]]


def _row(values: np.ndarray) -> str:
    return ", ".join(f"{value:.4g}" for value in np.round(values, 9) + 0.0)
