"""Tolerances without the effect that they seem to have: points and locators on a face that do not follow it, unused faces."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.declaration import Feature, Measure, Pattern, Point
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.discretization.measured_geometry import Combined, Heights, NominalMeasurement
from tolcontact.features import FaceDeviation, NominalFeature
from tolcontact.features.freedoms import FEATURE, FORM, VARIABLE
from tolcontact.geometry.tolerances import ON_FACE
from tolcontact.plausibility.declared_points import location_designation
from tolcontact.plausibility.trial_draws import SIGMAS, TrialDraws

MIN_MOTION = 1e-9  # mm, at three sigma
MIN_COSINE = 1e-6  # of a face's normal and a measured direction: smaller ones are rounding
LISTED = 3  # features by name


class Use(NamedTuple):
    """A point (3,) [mm] of a part of the nominal assembly, a direction (3,) that counts there, and the face that it follows."""

    part: NominalPart
    point: np.ndarray
    direction: np.ndarray
    followed: FaceDeviation | None


def unfollowed_by_measures(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each measure with a point that lies on a deviating face, and belongs to the part alone."""
    nominal = draws.program.nominal
    owned = [
        (measure, use)
        for model in nominal.scenes or (nominal,)
        for measure, measurement in zip(model.measures, model.measurements, strict=True)
        for use in _measured_points(model, measure, measurement)
    ]
    doubtful = set[Measure]()
    for number, feature, motion in _unfollowed(draws, [use for _, use in owned]):
        measure, use = owned[number]
        if measure not in doubtful:
            doubtful.add(measure)
            R_WP, t_WP = use.part.placement
            place = ", ".join(f"{coordinate:.6g}" for coordinate in np.round((use.point - t_WP) @ R_WP, 9) + 0.0)
            yield (
                f'{measure.designation}: its point ({place}) of part "{use.part.name}" lies on {_named(feature)}, which '
                f"deviates there by {motion:.3g} mm (3 sigma), but the point does not follow it; take it from the feature, as "
                f"in {feature.feature.name}.point({place}), if the face is meant"
            )


def unfollowed_by_locators(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with a locator on a deviating face that the part does not follow."""
    nominal = draws.program.nominal
    for part in nominal.parts:
        owned = list(_located_points(nominal, part))
        for number, feature, motion in _unfollowed(draws, [use for _, _, use in owned]):
            label, advice, _ = owned[number]
            if not _is_in_contact(nominal, part, feature):
                yield (
                    f"{location_designation(nominal, part)}: locator "
                    f'"{label.rpartition(".")[2]}" lies on {_named(feature)}, which deviates there by {motion:.3g} mm '
                    f"(3 sigma), but the part does not follow it; {advice.format(feature.feature.name)}"
                )
                break


def unvaried(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence if nothing varies, on measures that do not, and for each such correlation and variable."""
    nominal = draws.program.nominal
    if not len(draws.deviations):
        return
    varies = dict(zip(nominal.contributors, np.ptp(draws.deviations, axis=0) > 0, strict=True))
    if not any(varies.values()):
        yield (
            "nothing varies, since all tolerances are 0: each realization is the nominal assembly; give locators, features or "
            "variables a tolerance"
        )
        return
    yield from _unvaried_measures(draws)
    causes = [(correlation, correlation.labels) for correlation in nominal.assembly.correlations]
    for cause, labels in (*causes, *((variable, (variable.name,)) for variable in nominal.assembly.variables)):
        if still := [label for label in labels if not varies[label]]:
            yield f'{cause.designation}: "{still[0]}" does not vary, so it has no effect; give it a tolerance, or leave it out'


def _unvaried_measures(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence on the measures that no tolerance changes, on parts that contact does not move."""
    program, nominal, measured = draws.program, draws.program.nominal, draws.measured.T
    still = [k for k, x in enumerate(measured) if len(x) and np.isfinite(x).all() and np.ptp(x) <= MIN_MOTION]
    on_pose = _dependence(program, "observe", "poses", "measured") if still else np.zeros(0)
    owners = {k: np.flatnonzero(on_pose[k].reshape(-1, pose.ENTRIES).any(axis=1)) for k in still}
    unmoved = [k for k, parts in owners.items() if not any(nominal.may_differ(int(part)) for part in parts)]
    if unmoved:
        parts = " and ".join(f'"{nominal.parts[part].name}"' for part in owners[unmoved[0]][:LISTED])
        others = f", nor do {len(unmoved) - 1} more measurements" if len(unmoved) > 1 else ""
        reason = (
            f"no tolerance changes it, and contact does not move {parts}; measure what varies, or give these parts tolerances"
            if parts
            else "what it depends on has no tolerance, or cancels; let it depend on what varies, or leave it out"
        )
        yield f"{nominal.measures[unmoved[0]].designation}: it does not vary{others}: {reason}"


def unused_features(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence on the features whose tolerances displace nothing that is measured, located or in contact."""
    nominal = draws.program.nominal
    numbers = {label: number for number, label in enumerate(nominal.contributors)}
    columns = defaultdict[Feature | Pattern, list[int]](list)
    for pattern in nominal.patterns:
        drawn = [freedom.label for freedom in pattern.freedoms if freedom.source in (FEATURE, FORM)]
        columns[pattern.declared] += [numbers[label] for label in drawn]
    varied = {declared: drawn for declared, drawn in columns.items() if draws.deviations[:, drawn].std(axis=0).any()}
    used = _used_columns(draws.program) if varied else np.zeros(0)
    unused = [declared for declared, drawn in varied.items() if not used[drawn].any()]
    if unused:
        names = ", ".join(f'"{declared.name}" of {declared.part.name}' for declared in unused[1 : 1 + LISTED])
        others = f", nor do those of {len(unused) - 1} more ({names}{', ...' * (len(unused) > LISTED + 1)})" if names else ""
        yield (
            f'part "{unused[0].part.name}": {unused[0].designation}: its tolerances have no effect on any measurement or '
            f"contact{others}; measure a point of the feature, or let contact and locators use its face"
        )


def _used_columns(program: Program) -> np.ndarray:
    """Return which deviations (contributor,) any measure or any gap depends on."""
    by_place = _dependence(program, "place", "deviations", "poses")
    used = np.zeros(by_place.shape[1], dtype=bool)
    for output in ("measured", "relative"):
        used |= _dependence(program, "observe", "deviations", output).any(axis=0)
        used |= by_place[_dependence(program, "observe", "poses", output).any(axis=0)].any(axis=0)
    for pair in program.nominal.pairs:
        for columns in (pair.offsets.columns, *(face.columns for face in pair.deviating if face is not None)):
            used[columns[columns < len(used)]] = True  # later inputs are gaps that welds keep
    return used


def _dependence(program: Program, function: str, argument: str, result: str) -> np.ndarray:
    """Return which entries of a result depend on which entries of an argument of a function of the program."""
    evaluated = getattr(program, function).function
    pattern = evaluated.jac_sparsity(evaluated.index_out(result), evaluated.index_in(argument))
    dependence = np.zeros((evaluated.numel_out(result), evaluated.numel_in(argument)), dtype=bool)
    dependence[tuple(np.array(indices, dtype=int) for indices in pattern.get_triplet())] = True
    return dependence


def _measured_points(model: Nominal, measure: Measure, measurement: NominalMeasurement | None) -> Iterator[Use]:
    """Yield the points of a measure, in the direction that it counts."""
    if measurement is not None:
        operands = measurement.operands if isinstance(measurement, Combined) else ()
        for operand in operands:
            if isinstance(operand, NominalMeasurement):
                yield from _measured_points(model, measure, operand)
        for point, wall in measurement.points if isinstance(measurement, Heights) else ():
            direction = wall.surface.distance(point.position[None])[1][0]
            yield Use(model.parts[point.part], point.position, direction, point.deviation)
    elif isinstance(measure.of, Point):
        for end in measure.points:
            part = model.parts[model.part_index(end.part)]
            yield Use(part, model.position(end), np.array(measure.along), model.face_at(end))


def _located_points(nominal: Nominal, part: NominalPart) -> Iterator[tuple[str, str, Use]]:
    """Yield the points of the locators of a part, on it and on the part that it is located on, with labels and advice."""
    locators = part.locators
    for number, (label, point, direction) in enumerate(zip(locators.labels, locators.points, locators.directions, strict=True)):
        owner = nominal.parts[part.owners[number]] if part.owners else part
        yield label, "give the locator on={}", Use(owner, point, direction, locators.faces[number])
        if part.parent is not None:
            ground = locators.grounds[number]
            columns = () if ground is None else ground.columns
            is_on_feature = any(nominal.freedoms[column].source != VARIABLE for column in columns)
            advice = "add this to the tolerance of the locator" if is_on_feature else "locate the part with on={}"
            yield label, advice, Use(nominal.parts[part.parent], point, direction, ground)


def _unfollowed(draws: TrialDraws, uses: Sequence[Use]) -> list[tuple[int, NominalFeature, float]]:
    """Return points that follow no face, but lie on one that deviates: indices, features, motion at three sigma [mm]."""
    still = [k for k, use in enumerate(uses) if use.followed is None or _motion(draws, use.followed, use, use.direction) == 0]
    doubts = list[tuple[int, NominalFeature, float]]()
    for feature in draws.program.nominal.features:
        numbers = [k for k in still if uses[k].part.part is feature.feature.part and feature.varies]
        for index, surface in enumerate(feature.surfaces if numbers else ()):
            R_WP, t_WP = placement = uses[numbers[0]].part.placement
            places = np.array([(uses[k].point - t_WP) @ R_WP for k in numbers])
            numbers_of_triangles, feet = surface.nearest(places)
            normals, distances = surface.normals(numbers_of_triangles, feet) @ R_WP.T, np.linalg.norm(feet - places, axis=1)
            for row in np.flatnonzero(distances <= ON_FACE * surface.mesh.scale):
                use, normal = uses[numbers[row]], normals[row]
                cosine = abs(float(normal @ use.direction))
                motion = _motion(draws, feature.deviation(index, placement), use, normal) * cosine
                doubts += [(numbers[row], feature, motion)] * (motion > MIN_MOTION and cosine > MIN_COSINE)
    return sorted(doubts, key=lambda doubt: doubt[0])


def _motion(draws: TrialDraws, deviation: FaceDeviation, use: Use, direction: np.ndarray) -> float:
    """Return how far a face moves along a direction (3,) at a point, at three sigma [mm]; 0 if that is rounding."""
    outward = deviation.outward(use.point[None], direction[None])[0]
    freedoms = [draws.program.nominal.freedoms[column] for column in deviation.columns]
    outward[[freedom.source == VARIABLE for freedom in freedoms]] = 0.0  # a part that expands follows none of its features
    motion = SIGMAS * float((draws.deviations[:, deviation.columns] @ outward).std())
    return motion if motion > MIN_MOTION else 0.0


def _is_in_contact(nominal: Nominal, part: NominalPart, feature: NominalFeature) -> bool:
    """Return whether contact of a part with the face of a feature decides where it comes to lie."""
    pairs = [
        pair for pair in nominal.pairs if part in [nominal.parts[k] for k in (pair.moving, pair.reference) if k is not None]
    ]
    return feature.label in [face.name for pair in pairs for face in pair.deviating if face is not None]


def _named(feature: NominalFeature) -> str:
    return f'feature "{feature.feature.name}" of {feature.feature.part.name}'
