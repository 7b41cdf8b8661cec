"""Points that lie off their part, and directions of locators that do not fit the surface there."""

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tolcontact.declaration import Mesh, Part
from tolcontact.discretization import NominalPart
from tolcontact.discretization.unit_check import probable_unit
from tolcontact.errors import designation
from tolcontact.plausibility.designations import location_designation
from tolcontact.plausibility.trial_draws import TrialDraws

FAR_SHARE = 0.25  # of a part's size: how far off its box a point may lie
ON_SURFACE = 1e-4  # of a part's size
OUTWARD, ALONG = 0.5, 0.2  # cosines of the angle between a direction and the normal into the part


class DeclaredPoint(NamedTuple):
    """A point of a part and the declaration that states it."""

    owner: str
    position: np.ndarray


def far_points(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with declared points far off its body, about the farthest one."""
    points = _declared_points(draws)
    for nominal in draws.program.nominal.last_parts:
        declared = points[nominal.part]
        if not declared or _is_in_other_units(nominal, declared):
            continue
        positions = np.array([point.position for point in declared])
        size = float(nominal.mesh.scale)
        distances = _outside(positions, nominal.mesh.bounds)
        farthest = int(distances.argmax())
        if distances[farthest] <= FAR_SHARE * size:
            continue
        others = int((distances > FAR_SHARE * size).sum()) - 1
        yield (
            f"{declared[farthest].owner}: its point ({_row(positions[farthest])}) lies {distances[farthest]:.4g} mm off part "
            f'"{nominal.name}", which is {size:.4g} mm across'
            + (f", as do {others} more points of it" if others > 1 else ", as does one more point of it" if others else "")
            + f"; {_cause(nominal, positions[farthest])}"
        )


def unfit_directions(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with locators on its surface whose directions are probably those of the assembly.

    All of them would then point into the part, while some lie along its surface as they are stated. One-sided locators that
    point out of the part have a sentence each.
    """
    for nominal in draws.program.nominal.parts:
        scheme = nominal.scheme
        if not isinstance(scheme, tuple) or nominal.owners:
            continue
        R_WP = nominal.placement[0]
        place = location_designation(draws.program.nominal.assembly, nominal.part, nominal.station)
        normals = [-_normals_at(nominal, np.array(locator.point)) for locator in scheme]
        on_surface = [(locator, inward) for locator, inward in zip(scheme, normals, strict=True) if len(inward)]
        fits = [bool((inward @ (R_WP.T @ np.array(locator.direction))).max() > 1 - ALONG) for locator, inward in on_surface]
        for locator, inward in on_surface:
            direction = np.array(locator.direction)
            if np.abs(inward @ direction).max() < ALONG and all(fits):
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
    """Return the parts of which a UnitsWarning says that their file is probably in other units."""
    points, parts = _declared_points(draws), draws.program.nominal.last_parts
    return [nominal.part for nominal in parts if _is_in_other_units(nominal, points[nominal.part])]


def _is_in_other_units(nominal: NominalPart, declared: list[DeclaredPoint]) -> bool:
    geometry, positions = nominal.part.geometry, np.array([point.position for point in declared])
    return isinstance(geometry, Mesh) and bool(declared) and probable_unit(positions, geometry, nominal.mesh) is not None


def _declared_points(draws: TrialDraws) -> "defaultdict[Part, list[DeclaredPoint]]":
    """Return the points that are declared by their coordinates, by part, in the part's own frame."""
    assembly = draws.program.nominal.assembly
    points: defaultdict[Part, list[DeclaredPoint]] = defaultdict(list)
    for nominal in draws.program.nominal.parts:
        for locator in nominal.scheme if isinstance(nominal.scheme, tuple) else ():
            place = location_designation(assembly, nominal.part, nominal.station)
            points[locator.part or nominal.part].append(
                DeclaredPoint(f'{place}: locator "{locator.name}"', np.array(locator.point))
            )
    for measure in assembly.measures:
        for point in measure.points:
            if point.position is not None:
                points[point.part].append(DeclaredPoint(designation(measure.noun, measure), np.array(point.position)))
    for force in assembly.forces:
        if force.at.position is not None:
            points[force.at.part].append(DeclaredPoint(designation("force", force), np.array(force.at.position)))
    return points


def _cause(nominal: NominalPart, point: np.ndarray) -> str:
    """Return the likely cause of a point that lies off its part."""
    R_WP, t_WP = nominal.placement
    meant = (point - t_WP) @ R_WP
    if _outside(meant[None], nominal.mesh.bounds)[0] <= ON_SURFACE * nominal.mesh.scale:
        return f"points are stated in the part's own frame; for this point of the assembly write ({_row(meant)})"
    return "check the coordinates, which are in the part's own frame [mm]"


def _outside(points: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return how far (point,) [mm] points (point, 3) lie outside the box with these corners (2, 3)."""
    return np.asarray(np.linalg.norm(np.maximum(0, np.maximum(bounds[0] - points, points - bounds[1])), axis=1))


def _normals_at(nominal: NominalPart, point: np.ndarray) -> np.ndarray:
    """Return the normals (triangle, 3) of the triangles on which a point (3,) [mm] of a part lies."""
    corners, normals = np.asarray(nominal.mesh.triangles), np.asarray(nominal.mesh.face_normals)
    margin = ON_SURFACE * nominal.mesh.scale
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
