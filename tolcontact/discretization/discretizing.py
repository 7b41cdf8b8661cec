"""Discretize: an assembly becomes its nominal model, or a list of all its faults."""

import difflib
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import (
    Assembly,
    DatumTargets,
    Feature,
    Location,
    Locator,
    Part,
    ThreeTwoOne,
    Tolerance,
    has_supports,
    is_free,
    movers,
)
from tolcontact.discretization.contact_points import contact_points
from tolcontact.discretization.locators import Locators, scheme_locators
from tolcontact.discretization.measurements import nominal_measurements
from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart, Offsets
from tolcontact.discretization.partial_surfaces import warn_of_partial_surfaces
from tolcontact.discretization.unit_check import warn_of_units
from tolcontact.errors import GeometryFault, ModelError, designation
from tolcontact.features import Features, Placement, datum_order
from tolcontact.geometry.faces import Meshes
from tolcontact.geometry.files.reading import Shape, read_files
from tolcontact.geometry.shapes import field_surface, shape

log = logging.getLogger(__name__)

MANY_PAIRS = 100


class _Faults(list[str]):
    """The faults of an assembly."""

    def attempt(self, place: str, build: Callable[..., Any], *arguments: Any) -> Any:
        """Return what `build` returns; None, and a fault at `place`, if the geometry does not allow it."""
        try:
            return build(*arguments)
        except GeometryFault as fault:
            self.append(f"{place}: {fault}")
            return None


def discretize(assembly: Assembly, *, incomplete: bool = False) -> Nominal:
    """Return the nominal model of an assembly.

    An `incomplete` model may lack what only a run needs: measures, and locations of parts.
    Raises ModelError with every fault of the declaration and of its geometry.
    """
    omissions = tuple(assembly.omissions()) if incomplete else ()
    faults = _Faults(fault for fault in assembly.faults() if fault not in omissions)
    is_sound = not faults
    shapes = _shapes(assembly, faults)
    meshes = {part: read.mesh for part, read in shapes.items()}
    parts = [_nominal_part(assembly, part, meshes, faults) for part in assembly.parts]
    features = Features(sum(len(part.locators) for part in parts if part is not None))
    if is_sound and None not in parts:
        _add_features(assembly, meshes, features, faults)
        placements = {part.part: part.placement for part in parts if part is not None}
        parts = [
            _on_ground(_on_features(part, features, meshes, faults), assembly.location_of(part.part), features, placements)
            for part in parts
            if part is not None
        ]
    nominal_parts = tuple(part for part in parts if part is not None)
    placed = {nominal.part: nominal for nominal in nominal_parts}
    if len(assembly.pairs) > MANY_PAIRS:
        log.warning("%d contact pairs: to prepare them takes about a tenth of a second each", len(assembly.pairs))
    pairs = [
        faults.attempt(designation("contact pair", pair), contact_points, assembly, pair, placed, meshes, features)
        for pair in assembly.pairs
        if not any(pair.faults()) and all(part in placed for part in (*pair.moving.parts, *pair.reference.parts))
    ]
    if is_sound:
        faults.extend(_immovable_pairs(assembly))
        labels = [label for nominal in nominal_parts for label in nominal.locators.labels]
        labels += [*features.labels, *(variable.name for variable in assembly.variables)]
        faults.extend(_repeated_labels(labels))
        if not faults:
            shifts = {labels[column] for pattern in features.patterns for column in pattern.leans}
            faults.extend(_contributor_faults(assembly, labels, shifts))
    faults.extend(_reserved_names(assembly))
    if faults:
        raise ModelError(assembly.name, list(dict.fromkeys(faults)))
    warn_of_units(assembly, shapes)
    warn_of_partial_surfaces(assembly, meshes)
    nominal = Nominal(assembly, nominal_parts, (*pairs, *_support_pairs(nominal_parts)), assembly.measures, features)
    return replace(nominal, measurements=nominal_measurements(nominal))


def _shapes(assembly: Assembly, faults: _Faults) -> dict[Part, Shape]:
    """Return the shapes of the parts that can be read."""
    readable = [part for part in assembly.parts if not any(part.geometry.faults())]
    log.info("reading the shapes of %d parts", len(readable))
    contents = read_files(part.geometry for part in readable)
    attempts = {part: faults.attempt(designation("part", part), shape, part.geometry, contents) for part in readable}
    return {part: read for part, read in attempts.items() if read is not None}


def _add_features(assembly: Assembly, meshes: Meshes, features: Features, faults: _Faults) -> None:
    for index, part in enumerate(assembly.parts):
        ordered, circular = datum_order(part)
        for declared in ordered:
            place = f'part "{part.name}": {designation(declared.noun, declared)}'
            if isinstance(declared, DatumTargets):
                faults.attempt(place, features.add_targets, declared, index)
            else:
                faults.attempt(place, features.add, declared, index, meshes)
        if circular:
            names = ", ".join(f'"{declared.name}"' for declared in circular)
            faults.append(
                f'part "{part.name}": features {names}: their datums refer to each other in a circle, or to a datum that could '
                "not be made; leave one of the references out"
            )


def _on_features(part: NominalPart, features: Features, meshes: Meshes, faults: _Faults) -> NominalPart:
    """Return the part with the faces of features that its locators stand against."""
    scheme = part.scheme
    if scheme is None or not part.part.features:
        return part
    if isinstance(scheme, ThreeTwoOne):
        place = designation("part", part.part)
        deviations = [faults.attempt(place, features.face_at, face, meshes, part.placement) for face in scheme.faces]
        faces = tuple(deviations[k] for k in (0, 0, 0, 1, 1, 2))
    else:
        faces = tuple(
            locator.on and features.face_of(locator.on, np.array(locator.point), part.placement) for locator in scheme
        )
    return replace(part, locators=replace(part.locators, faces=faces))


def _on_ground(
    part: NominalPart, location: Location | None, features: Features, placements: Mapping[Part, Placement]
) -> NominalPart:
    """Return the part with the feature of another part that its locators are on."""
    if location is None or not isinstance(location.on, Feature):
        return part
    ground = features.middle_of(location.on, placements[location.on.part])
    return replace(part, locators=replace(part.locators, grounds=(ground,) * len(part.locators)))


def _repeated_labels(labels: Sequence[str]) -> Iterator[str]:
    for label in dict.fromkeys(labels):
        if labels.count(label) > 1:
            yield (
                f'contributor "{label}" is declared {labels.count(label)} times; its draws would be the same, so rename part, '
                "locator, feature or variable"
            )


def _contributor_faults(assembly: Assembly, labels: Sequence[str], shifts: Set[str]) -> Iterator[str]:
    """Yield references to unknown contributors, or to `shifts` that follow from others, and contributors drawn twice."""
    recognized, variables = set(labels), {variable.name for variable in assembly.variables}
    sources: dict[str, str] = {}
    for kind, place, references in (
        *(("variable", designation("variable", cause), tuple(cause.drives)) for cause in assembly.variables),
        *(("correlation", designation("correlation", copula), copula.labels) for copula in assembly.correlations),
        *(("population", designation("population", table), table.columns) for table in assembly.populations),
    ):
        for label in references:
            if label not in recognized:
                similar = difflib.get_close_matches(label, labels, 3, 0.3) or list(labels[:3])
                yield f'{place}: unknown contributor "{label}"; contributors are, for example: {", ".join(similar)}'
            elif label in shifts:
                yield f'{place}: "{label}" follows from the tilts of its datum; leave it out, and state those tilts'
            elif kind == "variable" and label in variables:
                yield f'{place}: it drives the variable "{label}"; a variable drives locators and features alone'
            elif kind != "variable" and label in sources:
                yield f'{place}: contributor "{label}" is drawn by {sources[label]} already; leave it out of one of them'
            elif kind != "variable":
                sources[label] = place


def _reserved_names(assembly: Assembly) -> Iterator[str]:
    reserved = {_supports_name(part) for part in assembly.parts if has_supports(assembly, part)}
    for pair in assembly.pairs:
        if pair.name in reserved:
            place = designation("contact pair", pair)
            yield f"{place}: its name is reserved for the one-sided locators of a part; rename it"


def _supports_name(part: Part) -> str:
    return f"supports of {part.name}"


def _support_pairs(parts: tuple[NominalPart, ...]) -> Iterator[ContactPoints]:
    """Yield the one-sided locators of each free part as a contact pair."""
    start = 0
    for index, part in enumerate(parts):
        supports = np.flatnonzero(part.locators.one_sided)
        if part.free and supports.size:
            P, n = part.locators.points[supports], part.locators.directions[supports]
            offsets = _support_offsets(part.locators, start, supports)
            name = _supports_name(part.part)
            yield ContactPoints(name, index, part.parent, P, P, n, offsets, locators=start + supports)
        start += len(part.locators)


def _support_offsets(locators: Locators, start: int, supports: np.ndarray) -> Offsets:
    """Return the heights of supports: their own deviations, columns `start` on, and those of the faces they stand against."""
    offsets = [Offsets(start + supports, np.eye(len(supports)))]
    for place, number in enumerate(supports):
        columns, factors = locators.pushes(number)
        if columns.size:
            matrix = np.zeros((len(columns), len(supports)))
            matrix[:, place] = factors
            offsets.append(Offsets(columns, matrix))
    return Offsets.joined(offsets, len(supports)) if len(offsets) > 1 else offsets[0]


def _nominal_part(assembly: Assembly, part: Part, meshes: Meshes, faults: _Faults) -> NominalPart | None:
    """Return a part in its nominal place with its locators; None if it has no shape or is badly declared."""
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
                locators = faults.attempt(designation("part", part), scheme_locators, location.scheme, meshes) or ()
        else:
            locators = location.scheme
    common = location.tolerance if location else None
    nominal = _locators(part, locators, common, R_WP, t_WP)
    if location is not None and location.floating:
        nominal = replace(nominal, floating=(_middle(mesh) @ R_WP.T + t_WP, float(mesh.scale)))
    if len(nominal):
        faults.attempt(designation("part", part), nominal.check_independent)
    parent = location.parent if location else None
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
    """Return the middle (3,) of a mesh's surface."""
    return mesh.area_faces @ mesh.triangles_center / mesh.area


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
        grounds=(None,) * len(declared),
    )


def _immovable_pairs(assembly: Assembly) -> list[str]:
    """Return a fault for each pair that no free part can open."""
    return [
        f"{designation('contact pair', pair)}: contact cannot move its sides relative to each other; "
        f'declare part "{pair.moving.part.name}" free (fixed=False)'
        for pair in assembly.pairs
        if movers(assembly, pair.moving.part) == movers(assembly, pair.reference.part)
    ]
