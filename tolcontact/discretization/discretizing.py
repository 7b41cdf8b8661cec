"""Discretize: an assembly becomes its nominal model, or a list of all its faults."""

import difflib
import logging
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from tolcontact.declaration import Assembly, Face, Feature, Location, Locator, Part, ThreeTwoOne, Tolerance
from tolcontact.declaration.locator import FIRST_ORDER, USUAL_STIFFNESS
from tolcontact.discretization.contact_points import contact_points, support_pairs
from tolcontact.discretization.fixed_contact import ContactPoints
from tolcontact.discretization.locators import FACES_OF_SCHEME, Locators, NominalPart, scheme_locators
from tolcontact.discretization.measurements import nominal_measurements
from tolcontact.discretization.nominal import Nominal
from tolcontact.discretization.scales import scale_faults
from tolcontact.discretization.scenes import Scene, joint_indices, scenes_of
from tolcontact.discretization.weld_pairs import welds_and_pairs
from tolcontact.errors import Faults, designation, nearest_name
from tolcontact.features import Features, Placement, datum_order
from tolcontact.features.freedoms import DATUM
from tolcontact.geometry.faces import Meshes
from tolcontact.geometry.files.reading import Shape, read_files
from tolcontact.geometry.shapes import field_surface, placement_of, shape
from tolcontact.geometry.triangle_mesh import oriented

log = logging.getLogger(__name__)

MANY_PAIRS = 100


def discretize(assembly: Assembly, *, incomplete: bool = False, presses: bool | None = None) -> Nominal:
    """Return the nominal model of an assembly.

    An `incomplete` model may lack what only a run needs: measures, and locations of parts. Two-sided locators with a stiffness
    are compliant if the objective `presses`, by default the objective of the assembly's own method.
    Raises ModelError with every fault of the declaration and of its geometry.
    """
    omissions = tuple(assembly.omissions()) if incomplete else ()
    faults = Faults(fault for fault in assembly.faults() if fault not in omissions)
    is_sound = not faults
    assembly = assembly.in_station_order if is_sound else assembly
    meshes = _shapes(assembly, faults)
    presses = assembly.effective_method.minimizes.presses if presses is None else presses
    scenes = scenes_of(assembly, presses=presses) if is_sound or not assembly.stations else ()
    entries = [(scene, part) for scene in scenes for part in scene.assembly.parts]
    parts = [_nominal_part(scene, part, meshes, faults) for scene, part in entries]
    mated = frozenset(face for pair in assembly.pairs for face in (pair.moving, pair.reference))
    features = Features(sum(len(part.locators) for part in parts if part is not None), mated, assembly.variables)
    if is_sound and None not in parts:
        _add_features(assembly, {part: number for number, (_, part) in enumerate(entries)}, meshes, features, faults)
        features.use_touched([part.placement for part in parts if part is not None])
        placements = {part.part: part.placement for part in parts if part is not None}
        parts = [
            replace(
                _on_features(part, scene.assembly.location_of(part.part), features, meshes, placements, faults),
                carried=joint_indices(scenes, scene, part.part),
            )
            for (scene, _), part in zip(entries, parts, strict=True)
            if part is not None
        ]
    nominal_parts = tuple(part for part in parts if part is not None)
    if len(assembly.pairs) > MANY_PAIRS:
        log.warning("%d contact pairs: to prepare them takes about a tenth of a second each", len(assembly.pairs))
    pairs = [
        faults.attempt(designation("contact pair", pair), contact_points, scene, pair, placed, meshes, features)
        for scene in scenes
        for placed in [{nominal.part: nominal for nominal in nominal_parts if nominal.station == scene.station}]
        for pair in scene.assembly.pairs
        if not any(pair.faults()) and all(part in placed for part in (*pair.moving.parts, *pair.reference.parts))
    ]
    labels = [label for nominal in nominal_parts for label in nominal.locators.labels]
    labels += [*(freedom.label for freedom in features.freedoms), *(variable.name for variable in assembly.variables)]
    if is_sound:
        faults.extend(fault for scene in scenes for fault in _immovable_pairs(scene))
        faults.extend(_repeated_labels(labels))
    shifts = {freedom.label for freedom in features.freedoms if freedom.source == DATUM}
    unsure = tuple(owner.name for owner in (*assembly.parts, *assembly.joints)) if faults else ()
    faults.extend([*_contributor_faults(assembly, labels, shifts, unsure), *(() if faults else _effect_faults(assembly))])
    faults.extend(fault for scene in scenes for fault in _reserved_names(scene))
    Faults(dict.fromkeys(faults)).refuse(assembly.name)
    pairs += support_pairs(nominal_parts, scenes)
    welds, all_pairs = welds_and_pairs(assembly, scenes, nominal_parts, features, pairs, len(labels))
    nominal = replace(_nominal(assembly, scenes, nominal_parts, all_pairs, features), welds=welds)
    Faults(scale_faults(nominal)).refuse(assembly.name)
    return nominal


def _nominal(
    assembly: Assembly,
    scenes: Sequence[Scene],
    parts: tuple[NominalPart, ...],
    pairs: tuple[ContactPoints, ...],
    features: Features,
) -> Nominal:
    """Return the nominal model with its measurements, station by station."""
    models = [
        Nominal(scene.assembly, parts, pairs, scene.assembly.measures, features, station=scene.station) for scene in scenes
    ]
    models = [replace(model, measurements=nominal_measurements(model)) for model in models]
    if not assembly.stations:
        return models[0]
    measures = tuple(measure for model in models for measure in model.measures)
    measurements = tuple(measurement for model in models for measurement in model.measurements)
    return Nominal(assembly, parts, pairs, measures, features, measurements, tuple(models))


def _shapes(assembly: Assembly, faults: Faults) -> dict[Part, Shape]:
    """Return the shapes of the parts that can be read."""
    readable = [part for part in assembly.parts if not any(part.geometry.faults())]
    log.info("reading the shapes of %d parts", len(readable))
    contents = read_files(part.geometry for part in readable)
    attempts = {part: faults.attempt(designation("part", part), shape, part.geometry, contents) for part in readable}
    return {part: read for part, read in attempts.items() if read is not None}


def _add_features(assembly: Assembly, indices: Mapping[Part, int], meshes: Meshes, features: Features, faults: Faults) -> None:
    for part in assembly.parts:
        ordered, circular = datum_order(part)
        for declared in ordered:
            place = f'part "{part.name}": {designation(declared.noun, declared)}'
            faults.attempt(place, features.add, declared, indices[part], meshes)
        if circular:
            names = ", ".join(f'"{declared.name}"' for declared in circular)
            faults.append(
                f'part "{part.name}": features {names}: their datums refer to each other in a circle, or to a datum that could '
                "not be made; leave one of the references out"
            )


def _on_features(
    part: NominalPart,
    location: Location | None,
    features: Features,
    meshes: Meshes,
    placements: Mapping[Part, Placement],
    faults: Faults,
) -> NominalPart:
    """Return the part with the faces of features that its locators touch, and the feature of another part that they are on."""
    scheme, locators = part.scheme, part.locators
    sides: Sequence[Face | Locator] = scheme if isinstance(scheme, tuple) else ()
    if isinstance(scheme, ThreeTwoOne):
        sides = [scheme.faces[k] for k in FACES_OF_SCHEME]
    if any((side.part or part.part).features for side in sides):
        if isinstance(scheme, ThreeTwoOne):
            place = designation("part", part.part)
            deviations = [
                faults.attempt(place, features.face_at, face, meshes, placement_of(face.part)) for face in scheme.faces
            ]
            faces = tuple(deviations[k] for k in FACES_OF_SCHEME)
        else:
            faces = tuple(
                locator.on and features.face_of(locator.on, np.array(locator.point), placement_of(locator.part or part.part))
                for locator in scheme or ()
            )
        locators = replace(locators, faces=faces)
    if location is not None and isinstance(location.on, Feature):
        grounds = features.grounds(location.on, locators.points, locators.directions, placements[location.on.part])
        locators = replace(locators, grounds=grounds)
    if features.causes:
        owners = [side.part or part.part for side in sides]
        at_points = map(features.at_point, locators.faces, owners, locators.points, map(placement_of, owners))
        locators = replace(locators, faces=tuple(at_points))
        if location is not None and (ground := location.parent) is not None:
            grounds = tuple(
                features.at_point(face, ground, point, placements[ground])
                for face, point in zip(locators.grounds, locators.points, strict=True)
            )
            locators = replace(locators, grounds=grounds)
    return replace(part, locators=locators)


def _repeated_labels(labels: Sequence[str]) -> Iterator[str]:
    for label in dict.fromkeys(labels):
        if labels.count(label) > 1:
            yield (
                f'contributor "{label}" is declared {labels.count(label)} times; its draws would be the same, so rename part, '
                "locator, feature or variable"
            )


def _contributor_faults(assembly: Assembly, labels: Sequence[str], shifts: Set[str], unsure: Sequence[str]) -> Iterator[str]:
    """Yield references to unknown contributors, or to `shifts` that follow from others, and contributors drawn twice.

    If there are other faults, `labels` are incomplete: what may be a contributor of the `unsure` parts and joints is left out,
    and so are the faults of known contributors.
    """
    recognized, variables = set(labels), {variable.name for variable in assembly.variables}
    sources, of_unsure = dict[str, str](), tuple(f"{name}." for name in unsure)
    for kind, place, references in (
        *(("variable", designation("variable", cause), tuple(cause.drives)) for cause in assembly.variables),
        *(("correlation", designation("correlation", copula), copula.labels) for copula in assembly.correlations),
        *(("population", designation("population", table), table.columns) for table in assembly.populations),
    ):
        for label in references:
            if unsure and (label in recognized or not isinstance(label, str) or label.startswith(of_unsure)):
                continue
            if label not in recognized:
                similar = difflib.get_close_matches(label, labels, 3, 0.3) or list(labels[:3])
                yield f'{place}: unknown contributor "{label}"; contributors are, for example: {", ".join(similar) or "none"}'
            elif label in shifts:
                yield f'{place}: "{label}" follows from the tilts of its datum, or from its form; leave it out, and state those'
            elif kind == "variable" and label in variables:
                yield f'{place}: it drives the variable "{label}"; a variable drives locators and features alone'
            elif kind != "variable" and label in sources:
                yield f'{place}: contributor "{label}" is drawn by {sources[label]} already; leave it out of one of them'
            elif kind != "variable":
                sources[label] = place


def _effect_faults(assembly: Assembly) -> Iterator[str]:
    """Yield what variables expand or load that is unknown, or elastic."""
    for cause in assembly.variables:
        parts = {part.name: part for part in assembly.parts}
        forces = {force.name: force.at.part for force in assembly.forces}
        for verb, kind, names, owners in (("expands", "part", cause.expands, parts), ("loads", "force", cause.loads, forces)):
            for name in names:
                place = f"{designation('variable', cause)}: it {verb} {kind} "
                if name not in owners:
                    listed = ", ".join(owners) or "none"
                    yield f'{place}"{name}", which is unknown{nearest_name(name, owners)}; expected one of: {listed}'
                elif owners[name].elasticity is not None:
                    what = f'"{name}", and part "{owners[name].name}"' if kind == "force" else f'"{name}", which'
                    yield f"{place}{what} is elastic; it does so with rigid parts alone, so leave one of the two out"


def _reserved_names(scene: Scene) -> Iterator[str]:
    rigid = replace(scene, presses=False)
    reserved = {scene.supports_name(part) for part in scene.assembly.parts if rigid.has_supports(part)}
    for pair in scene.assembly.pairs:
        if pair.name in reserved:
            place = designation("contact pair", pair)
            yield f"{place}: its name is reserved for the one-sided locators of a part; rename it"


def _nominal_part(scene: Scene, part: Part, meshes: Meshes, faults: Faults) -> NominalPart | None:
    """Return a part in its nominal pose with its locators; None if it has no shape or is badly declared."""
    if part not in meshes or any(part.faults()):
        return None
    mesh = meshes[part]
    R_WP, t_WP = placement_of(part)
    vertices, faces = field_surface(mesh)
    location = scene.assembly.location_of(part)
    locators: tuple[Locator, ...] = ()
    if location is not None and not any(location.faults()):
        if isinstance(location.scheme, ThreeTwoOne):
            if all(mentioned in meshes for mentioned in location.mentioned):
                placements = [placement_of(face.part) for face in location.faces] if location.joint else ()
                place = designation(location.noun, location if location.joint else part)
                locators = faults.attempt(place, scheme_locators, location.scheme, meshes, placements) or ()
        else:
            locators = location.scheme
    common = location.tolerance if location else None
    nominal = _locators(scene, location, locators, common, part)
    if location is not None and location.floating:
        centroid = mesh.area_faces @ mesh.triangles_center / mesh.area
        nominal = replace(nominal, floating=(centroid @ R_WP.T + t_WP, float(mesh.scale)))
    if len(nominal):
        place = designation("joint", location) if location and location.joint else designation("part", part)
        faults.attempt(place, nominal.check_independent)
    return NominalPart(
        name=part.name,
        part=part,
        placement=(R_WP, t_WP),
        mesh=mesh,
        vertices=vertices @ R_WP.T + t_WP,
        faces=oriented(faces, R_WP),
        locators=nominal,
        scheme=location.scheme if len(nominal) and location is not None else None,
        parent=scene.parent(part),
        free=scene.is_free(part),
        located=scene.label(location.name if location else part.name),
        movers=scene.movers(part),
        station=scene.station,
        owners=tuple(scene.index(locator.part or part) for locator in locators) if location and location.joint else (),
    )


def _locators(
    scene: Scene, location: Location | None, declared: Sequence[Locator], common: Tolerance | None, part: Part
) -> Locators:
    points = np.array([locator.point for locator in declared]).reshape(-1, 3)
    directions = np.array([locator.direction for locator in declared]).reshape(-1, 3)
    owners = [locator.part or part for locator in declared]
    for owner in dict.fromkeys(owners):
        rows = [other is owner for other in owners]
        R_WP, t_WP = placement_of(owner)
        points[rows], directions[rows] = points[rows] @ R_WP.T + t_WP, directions[rows] @ R_WP.T
    may_give = np.array([locator.one_sided or scene.presses for locator in declared], dtype=bool)
    return Locators(
        labels=tuple(scene.label(f"{location.name if location else part.name}.{locator.name}") for locator in declared),
        points=points,
        directions=directions,
        tolerances=tuple(locator.tolerance or common or Tolerance(0.0) for locator in declared),
        stiffness=np.array([float(locator.stiffness or USUAL_STIFFNESS) for locator in declared]),
        one_sided=np.array([locator.one_sided for locator in declared], dtype=bool),
        springy=np.array([locator.stiffness is not None for locator in declared], dtype=bool) & may_give,
        elastic=np.full(len(declared), scene.is_elastic(part)),
        faces=(None,) * len(declared),
        grounds=(None,) * len(declared),
        placing=location.placing if location else FIRST_ORDER,
    )


def _immovable_pairs(scene: Scene) -> list[str]:
    """Return a fault for each pair that no free part can open."""
    return [
        f"{designation('contact pair', pair)}: contact cannot move its sides relative to each other; "
        f"{_way_to_open(scene, pair.moving.part, pair.reference.part)}"
        for pair in scene.assembly.pairs
        if scene.movers(pair.moving.part) == scene.movers(pair.reference.part)
    ]


def _way_to_open(scene: Scene, moving: Part, reference: Part) -> str:
    """Return the end of a message: how contact may move two parts relative to each other."""
    joint = next((joint for joint in scene.assembly.joints if {moving, reference} <= set(joint.members)), None)
    if joint is None and moving.fixed and not reference.fixed:
        return f'exchange the sides, since part "{moving.name}" is fixed and part "{reference.name}" may move'
    if joint is None:
        return f'declare part "{moving.name}" free (fixed=False)'
    return (
        f'both parts belong to joint "{joint.name}", which keeps them as station "{joint.station}" left them; declare the pair '
        f'in station "{joint.station}", or leave it out'
    )
