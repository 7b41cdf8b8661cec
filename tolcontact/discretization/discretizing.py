"""Discretize: an assembly becomes its nominal model, or a list of all its faults."""

import logging
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Locator, Part, ThreeTwoOne, Tolerance, has_supports, is_free, movers
from tolcontact.discretization.contact_points import contact_points
from tolcontact.discretization.doubtful_sizes import warn_of_units
from tolcontact.discretization.faces import Meshes
from tolcontact.discretization.fault import GeometryFault, where
from tolcontact.discretization.locators import Locators
from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.shape_files.reading import read_files
from tolcontact.discretization.shapes import field_surface, shape
from tolcontact.discretization.three_two_one import lay_out
from tolcontact.errors import ModelError

log = logging.getLogger(__name__)


def discretize(assembly: Assembly) -> Nominal:
    """The nominal model of an assembly.

    Raises ModelError with every fault of the declaration and of its geometry.
    """
    faults = list(assembly.faults())
    clean = not faults
    clear = [part for part in assembly.parts if not any(part.geometry.faults())]
    log.info("reading the shapes of %d parts", len(clear))
    contents = read_files(part.geometry for part in clear)
    attempts = {part: _attempt(faults, where("part", part), shape, part.geometry, contents) for part in clear}
    shapes = {part: found for part, found in attempts.items() if found is not None}
    meshes = {part: found.mesh for part, found in shapes.items()}
    parts = [_nominal_part(assembly, part, meshes, faults) for part in assembly.parts]
    placed = {part: nominal for part, nominal in zip(assembly.parts, parts, strict=True) if nominal is not None}
    pairs = [
        _attempt(faults, where("contact pair", pair), contact_points, assembly, pair, placed, meshes)
        for pair in assembly.pairs
        if not any(pair.faults()) and all(part in placed for part in (*pair.moving.parts, *pair.reference.parts))
    ]
    if clean:
        faults.extend(_immovable(assembly))
    labels = [label for nominal in placed.values() for label in nominal.locators.labels]
    faults.extend(
        f'locator "{label}" is declared {labels.count(label)} times; its draws would be the same, so rename part or locator'
        for label in dict.fromkeys(labels)
        if labels.count(label) > 1 and clean
    )
    faults.extend(
        f"{where('contact pair', pair)}: its name is reserved for the one-sided locators of a part; rename it"
        for pair in assembly.pairs
        if any(pair.name == _supports(part) for part in assembly.parts if has_supports(assembly, part))
    )
    if faults:
        raise ModelError(assembly.name, list(dict.fromkeys(faults)))
    warn_of_units(assembly, shapes)
    found = tuple(part for part in parts if part is not None)
    return Nominal(assembly, found, (*(pair for pair in pairs if pair is not None), *_support_pairs(found)), assembly.measures)


def _supports(part: Part) -> str:
    return f"supports of {part.name}"


def _support_pairs(parts: tuple[NominalPart, ...]) -> Iterator[ContactPoints]:
    """The one-sided locators of each free part, as a contact pair."""
    first = 0
    for index, part in enumerate(parts):
        own = np.flatnonzero(part.locators.one_sided)
        if part.free and own.size:
            P, n = part.locators.points[own], part.locators.directions[own]
            yield ContactPoints(_supports(part.part), index, part.parent, P, P, n, Offsets(first + own, np.eye(len(own))))
        first += len(part.locators)


def _attempt(faults: list[str], where: str, build: Callable[..., Any], *arguments: Any) -> Any:
    """What `build` gives; None, and a fault noted, if the geometry does not allow it."""
    try:
        return build(*arguments)
    except GeometryFault as fault:
        faults.append(f"{where}: {fault}")
        return None


def _nominal_part(assembly: Assembly, part: Part, meshes: Meshes, faults: list[str]) -> NominalPart | None:
    if part not in meshes or any(part.faults()):
        return None
    mesh = meshes[part]
    R_WP = Rotation.from_rotvec(part.rotation).as_matrix()
    t_WP = np.array(part.at)
    vertices, faces = field_surface(mesh)
    location = assembly.location_of(part)
    locators: tuple[Locator, ...] = ()
    if location is not None and not any(location.faults()):
        if isinstance(location.scheme, ThreeTwoOne):
            if all(mentioned in meshes for mentioned in location.mentioned):
                locators = _attempt(faults, where("part", part), lay_out, location.scheme, meshes) or ()
        else:
            locators = location.scheme
    common = location.tolerance if location else None
    nominal = _locators(part, locators, common, R_WP, t_WP)
    if len(nominal):
        _attempt(faults, where("part", part), nominal.check_independent)
    parent = location.on if location else None
    return NominalPart(
        name=part.name,
        part=part,
        placement=(R_WP, t_WP),
        mesh=mesh,
        vertices=vertices @ R_WP.T + t_WP,
        faces=faces,
        locators=nominal,
        parent=assembly.parts.index(parent) if parent in assembly.parts else None,
        free=is_free(assembly, part),
    )


def _locators(
    part: Part, declared: Sequence[Locator], common: Tolerance | None, R_WP: np.ndarray, t_WP: np.ndarray
) -> Locators:
    return Locators(
        labels=tuple(f"{part.name}.{locator.name}" for locator in declared),
        points=np.array([locator.point for locator in declared]).reshape(-1, 3) @ R_WP.T + t_WP,
        directions=np.array([locator.direction for locator in declared]).reshape(-1, 3) @ R_WP.T,
        tolerances=tuple(locator.tolerance or common or Tolerance(0.0) for locator in declared),
        stiffness=np.array([float(locator.stiffness) for locator in declared]),
        one_sided=np.array([locator.one_sided for locator in declared], dtype=bool),
    )


def _immovable(assembly: Assembly) -> list[str]:
    """Pairs that no free part could ever open."""
    return [
        f"{where('contact pair', pair)}: contact cannot move its sides relative to each other; "
        f'declare part "{pair.moving.part.name}" free (fixed=False)'
        for pair in assembly.pairs
        if movers(assembly, pair.moving.part) == movers(assembly, pair.reference.part)
    ]
