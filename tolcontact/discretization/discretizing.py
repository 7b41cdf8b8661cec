"""Discretize: an assembly becomes its nominal model, or a list of all its faults."""

import difflib
import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Locator, Part, ThreeTwoOne, Tolerance, has_supports, is_free, movers
from tolcontact.discretization.contact_points import contact_points
from tolcontact.discretization.locators import Locators
from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.three_two_one import lay_out
from tolcontact.discretization.unit_check import warn_of_units
from tolcontact.errors import GeometryFault, ModelError, designation
from tolcontact.features.nominal_features import Features, datum_order
from tolcontact.geometry.faces import Meshes
from tolcontact.geometry.files.reading import read_files
from tolcontact.geometry.shapes import field_surface, shape

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
    attempts = {part: _attempt(faults, designation("part", part), shape, part.geometry, contents) for part in clear}
    shapes = {part: found for part, found in attempts.items() if found is not None}
    meshes = {part: found.mesh for part, found in shapes.items()}
    parts = [_nominal_part(assembly, part, meshes, faults) for part in assembly.parts]
    features = Features(sum(len(part.locators) for part in parts if part is not None))
    if clean and None not in parts:
        _add_features(assembly, meshes, features, faults)
        parts = [_on_features(part, features, meshes, faults) for part in parts if part is not None]
    placed = {part: nominal for part, nominal in zip(assembly.parts, parts, strict=True) if nominal is not None}
    pairs = [
        _attempt(faults, designation("contact pair", pair), contact_points, assembly, pair, placed, meshes, features)
        for pair in assembly.pairs
        if not any(pair.faults()) and all(part in placed for part in (*pair.moving.parts, *pair.reference.parts))
    ]
    if clean:
        faults.extend(_immovable(assembly))
    labels = [label for nominal in placed.values() for label in nominal.locators.labels]
    labels += [*features.labels, *(each.name for each in assembly.variables)]
    if clean:
        faults.extend(
            f'contributor "{label}" is declared {labels.count(label)} times; its draws would be the same, so rename part, '
            "locator, feature or variable"
            for label in dict.fromkeys(labels)
            if labels.count(label) > 1
        )
    if clean and not faults:
        faults.extend(_strange_contributors(assembly, labels))
    faults.extend(
        f"{designation('contact pair', pair)}: its name is reserved for the one-sided locators of a part; rename it"
        for pair in assembly.pairs
        if any(pair.name == _supports(part) for part in assembly.parts if has_supports(assembly, part))
    )
    if faults:
        raise ModelError(assembly.name, list(dict.fromkeys(faults)))
    warn_of_units(assembly, shapes)
    found = tuple(part for part in parts if part is not None)
    made = tuple(pair for pair in pairs if pair is not None)
    return Nominal(assembly, found, (*made, *_support_pairs(found)), assembly.measures, features)


def _add_features(assembly: Assembly, meshes: Meshes, features: Features, faults: list[str]) -> None:
    for index, part in enumerate(assembly.parts):
        ordered, circular = datum_order(part)
        for feature in ordered:
            _attempt(faults, f'part "{part.name}": {designation("feature", feature)}', features.add, feature, index, meshes)
        if circular:
            names = ", ".join(f'"{feature.name}"' for feature in circular)
            faults.append(
                f'part "{part.name}": features {names}: their datums refer to each other in a circle, or to a datum that could '
                "not be made; leave one of the references out"
            )


def _on_features(part: NominalPart, features: Features, meshes: Meshes, faults: list[str]) -> NominalPart:
    """The part, with what its locators stand against."""
    location = part.scheme
    if location is None or not part.part.features:
        return part
    if isinstance(location, ThreeTwoOne):
        found = [
            _attempt(faults, designation("part", part.part), features.face_at, f, meshes, part.placement)
            for f in location.faces
        ]
        faces = tuple(found[k] for k in (0, 0, 0, 1, 1, 2))
    else:
        faces = tuple(own.on and features.face_of(own.on, np.array(own.point), part.placement) for own in location)
    return replace(part, locators=replace(part.locators, faces=faces))


def _strange_contributors(assembly: Assembly, labels: Sequence[str]) -> Iterator[str]:
    """References to contributors that there are not, and contributors that two things would draw."""
    known = set(labels)
    variables = {each.name for each in assembly.variables}
    drawn: dict[str, str] = {}
    for kind, name, line, named in (
        *(("variable", each.name, each.declared_at, tuple(each.drives)) for each in assembly.variables),
        *(("correlation", each.name, each.declared_at, each.labels) for each in assembly.correlations),
        *(("population", each.name, each.declared_at, each.columns) for each in assembly.populations),
    ):
        who = f'{kind} "{name}" ({line})'
        for label in named:
            if label not in known:
                near = difflib.get_close_matches(label, labels, 3, 0.3) or list(labels[:3])
                yield f'{who}: unknown contributor "{label}"; contributors are, for example: {", ".join(near)}'
            elif kind == "variable" and label in variables:
                yield f'{who}: it drives the variable "{label}"; a variable drives locators and features alone'
            elif kind != "variable" and label in drawn:
                yield f'{who}: contributor "{label}" is drawn by {drawn[label]} already; leave it out of one of them'
            elif kind != "variable":
                drawn[label] = who


def _supports(part: Part) -> str:
    return f"supports of {part.name}"


def _support_pairs(parts: tuple[NominalPart, ...]) -> Iterator[ContactPoints]:
    """The one-sided locators of each free part, as a contact pair."""
    first = 0
    for index, part in enumerate(parts):
        own = np.flatnonzero(part.locators.one_sided)
        if part.free and own.size:
            P, n = part.locators.points[own], part.locators.directions[own]
            yield ContactPoints(
                _supports(part.part), index, part.parent, P, P, n, _raised(part.locators, first, own), locators=first + own
            )
        first += len(part.locators)


def _raised(locators: Locators, first: int, own: np.ndarray) -> Offsets:
    """What supports stand out by: their own deviations, columns `first` on, and what their faces come out of the part."""
    every = [Offsets(first + own, np.eye(len(own)))]
    for place, number in enumerate(own):
        columns, factors = locators.pushes(number)
        if columns.size:
            matrix = np.zeros((len(columns), len(own)))
            matrix[:, place] = factors
            every.append(Offsets(columns, matrix))
    return Offsets.joined(every, len(own)) if len(every) > 1 else every[0]


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
                locators = _attempt(faults, designation("part", part), lay_out, location.scheme, meshes) or ()
        else:
            locators = location.scheme
    common = location.tolerance if location else None
    nominal = _locators(part, locators, common, R_WP, t_WP)
    if location is not None and location.floating:
        nominal = replace(nominal, floating=(_middle(mesh) @ R_WP.T + t_WP, float(mesh.scale)))
    if len(nominal):
        _attempt(faults, designation("part", part), nominal.check_independent)
    parent = location.on if location else None
    return NominalPart(
        name=part.name,
        part=part,
        placement=(R_WP, t_WP),
        mesh=mesh,
        vertices=vertices @ R_WP.T + t_WP,
        faces=faces,
        locators=nominal,
        scheme=location.scheme if len(nominal) and location is not None else None,
        parent=assembly.parts.index(parent) if parent in assembly.parts else None,
        free=is_free(assembly, part),
    )


def _middle(mesh: Any) -> np.ndarray:
    """The middle (3,) of a mesh's surface."""
    return np.asarray(mesh.area_faces @ mesh.triangles_center / mesh.area)


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
        faces=(None,) * len(declared),
    )


def _immovable(assembly: Assembly) -> list[str]:
    """Pairs that no free part could ever open."""
    return [
        f"{designation('contact pair', pair)}: contact cannot move its sides relative to each other; "
        f'declare part "{pair.moving.part.name}" free (fixed=False)'
        for pair in assembly.pairs
        if movers(assembly, pair.moving.part) == movers(assembly, pair.reference.part)
    ]
