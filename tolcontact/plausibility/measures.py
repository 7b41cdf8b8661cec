"""Numbers that are probably mistakes: limits of measures, reach of clearances, rotations, and wide tolerances."""

import math
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.declaration import Measure, Point, Size
from tolcontact.declaration.scale import COARSEST, CONSTANT_SHARE, FINEST, grade_width
from tolcontact.declaration.values import is_length
from tolcontact.discretization import NominalPart
from tolcontact.discretization.measured_geometry import Combined, MeshClearance, NominalMeasurement
from tolcontact.features import Freedom
from tolcontact.plausibility.declared_points import location_designation, parts_in_other_units
from tolcontact.plausibility.trial_draws import SIGMAS, TrialDraws, spread

WIDE_SHARE = 0.5  # of a part's largest extent, or of a size: the width of a zone
MAX_LEVERAGE = 25.0  # displacement of a corner of a part for a unit deviation of a locator
MAX_TILT = math.radians(45)  # by the locators, at three sigma
FAR_SIGMAS = 100.0  # limits this far from the nominal value do not matter
MIN_SHIFTS, CANCELLED = 2, 0.5  # mean shifts that may cancel; what they lose in doing so, as a share of their sum
NEAR_SIGMAS = 0.1  # limits this close together are in other units than what varies
MIN_SHARE = 1e-6  # of that distance: smaller variation is rounding


def rotations(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part whose rotation is more than a turn, or more than half a turn in whole numbers."""
    for nominal in draws.program.nominal.last_parts:
        rotation = np.array(nominal.part.rotation)
        angle = float(np.linalg.norm(rotation))
        if angle > 2 * math.pi * (1 + 1e-6) or (angle > math.pi * (1 + 1e-6) and (rotation == np.round(rotation)).all()):
            numbers = ", ".join(f"{component:g}" for component in rotation)
            yield (
                f"{nominal.part.designation}: its rotation ({numbers}) is in rad, a turn by {math.degrees(angle):.4g} "
                f"degrees; if these are degrees, write rotation=tc.degrees({numbers})"
            )


def wide_tolerances(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with a zone too wide or too narrow for it, or with locators too close together."""
    in_other_units = parts_in_other_units(draws)
    for nominal in draws.program.nominal.parts:
        if nominal.part in in_other_units:
            continue
        place = location_designation(draws.program.nominal, nominal)
        zones = list(_zones(nominal, place))
        widest = max(zones, key=lambda zone: zone.width / zone.largest, default=None)
        narrowest = min(zones, key=lambda zone: zone.width / zone.smallest, default=None)
        if widest is not None and widest.width > widest.largest:
            yield (
                f"{widest.owner}: its tolerance of {widest.width:.4g} mm is wide compared with {widest.extent_in_words}; a "
                "tolerance is the full width of its zone, in mm"
            )
        elif narrowest is not None and narrowest.width < narrowest.smallest:
            yield (
                f"{narrowest.owner}: its tolerance of {narrowest.width:.4g} mm is narrower than the finest standard grade for "
                f"{narrowest.extent_in_words}; tolerances are in mm, not in metres"
            )
        elif len(nominal.locators):
            yield from islice(_weak_locators(nominal, place), 1)


class Zone(NamedTuple):
    """A declared zone.

    owner              how a message names it
    width              [mm]
    extent_in_words    the length that it is compared with
    largest, smallest  plausible widths [mm]
    """

    owner: str
    width: float
    extent_in_words: str
    largest: float
    smallest: float


def _zones(nominal: NominalPart, place: str) -> Iterator[Zone]:
    """Yield the zones of a part that vary. Locators place parts as wide as people do, features are machined."""
    extent = float(np.ptp(nominal.mesh.bounds, axis=0).max())
    part = f'part "{nominal.name}", which is {extent:.4g} mm long'
    for label, tolerance in zip(nominal.locators.labels, nominal.locators.tolerances, strict=True):
        if tolerance.range and tolerance.width > CONSTANT_SHARE * extent:
            owner = f'{place}: locator "{label.rpartition(".")[2]}"'
            yield Zone(owner, tolerance.width, part, WIDE_SHARE * extent, grade_width(FINEST, extent))
    for declared in nominal.part.toleranced:
        for control in declared.tolerances:
            if isinstance(control, Size):
                width, length, phrase = control.upper - control.lower, control.nominal, f"a size of {control.nominal:.4g} mm"
            else:
                width, length, phrase = control.width, extent, part
            if is_length(width) and width > CONSTANT_SHARE * extent:
                owner = f'part "{nominal.name}": {declared.designation}: {control.kind}'
                largest = min(grade_width(COARSEST, length), WIDE_SHARE * length)
                yield Zone(owner, float(width), phrase, largest, grade_width(FINEST, length))


def _weak_locators(nominal: NominalPart, place: str) -> Iterator[str]:
    """Yield that locators rotate their part by more than MAX_TILT, or displace a corner by many times their own deviation."""
    locators = nominal.locators
    matrix, centre = locators.placing_matrix
    apart = np.linalg.norm(locators.points[:, None] - locators.points[None], axis=2)
    closest = f"(the closest ones are {apart[apart > 0].min(initial=np.inf):.3g} mm apart)"
    sigmas = np.array([tolerance.width / 6 for tolerance in locators.tolerances])
    tilt = SIGMAS * float(np.sqrt(((matrix[3:] * sigmas) ** 2).sum()))
    if tilt > MAX_TILT:
        yield (
            f"{place}: its locators turn the part by {math.degrees(tilt):.0f} degrees (3 sigma) with tolerances of up to "
            f"{6 * sigmas.max():.3g} mm; move them apart {closest}, or check the tolerances, which are in mm"
        )
    arms = nominal.vertices - centre
    motions = np.linalg.norm(matrix[:3].T[:, None] + np.cross(matrix[3:].T[:, None], arms[None]), axis=2)
    row, corner = np.unravel_index(int(motions.argmax()), motions.shape)
    if motions[row, corner] > MAX_LEVERAGE:
        name = locators.labels[row].rpartition(".")[2]
        yield (
            f'{place}: 1 mm at locator "{name}" is {motions[row, corner]:.3g} mm at a corner of the part;'
            f" move its locators apart {closest}"
        )


def measure_limits(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each measure whose limits exclude its nominal value, or lie too far from it to matter."""
    program = draws.program
    is_floating = any(location.floating for location in program.nominal.assembly.locations)
    pushed = math.inf if is_floating else sum(draws.pushes)
    for k, measure in enumerate(program.nominal.measures):
        nominal, limits = float(program.nominal_measures[k]), program.limits(k)
        if limits.are_open or not math.isfinite(nominal):
            continue
        place, width = measure.designation, limits.upper - limits.lower
        ends = [f"{limit:g}" if math.isfinite(limit) else "open" for limit in (limits.lower, limits.upper)]
        stated, value = f"limits ({' to '.join(ends)} {measure.units})", f"{round(nominal, 9) + 0.0:.6g}"
        if limits.outside(np.array(nominal)):
            yield f"{place}: its nominal value {value} is outside of its {stated}; {_cause(program, k, nominal)}"
            continue
        values = draws.measured[np.isfinite(draws.measured[:, k]), k]
        sigma = float(spread(values)) if len(values) else 0.0
        distance = min(side for side in (nominal - limits.lower, limits.upper - nominal) if math.isfinite(side))
        if sigma > 0 and width < NEAR_SIGMAS * sigma:
            yield (
                f"{place}: its {stated} are {width / sigma:.2g} sigma wide; check their units, and the units of the tolerances"
            )
        elif MIN_SHARE * distance < sigma and distance > FAR_SIGMAS * sigma + pushed:
            yield (
                f"{place}: its {stated} are {distance / sigma:.2g} sigma away from its nominal value {value}; check "
                "their units, and the units of the tolerances"
            )


def _cause(program: Program, k: int, value: float) -> str:
    """Return the likely cause of the limits of measure k that exclude its nominal value."""
    measure, limits = program.nominal.measures[k], program.limits(k)
    if measure.units == "rad" and limits.lower <= math.degrees(value) <= limits.upper:
        return "they are probably in degrees: write tc.degrees(...) around each limit"
    if not isinstance(measure.of, Point) or measure.along is None:
        return "check the limits and the declared points"
    lower, upper = measure.bounds(value)
    if measure.quantity == "displacement" and lower <= program.nominal.position(measure.of) @ np.array(measure.along) <= upper:
        return "it measures the displacement from the nominal place; absolute=True measures the coordinate"
    if measure.quantity == "distance" and lower <= 0 <= upper:
        return "it measures the distance; absolute=False measures its deviation from the nominal distance"
    if lower <= -value <= upper:
        return "it has the opposite sign: turn along, or exchange the points"
    return "check the limits, and the places of the parts"


def assumed_sides(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each measure on which mean shifts without a side cancel that are all assumed to go up."""
    program = draws.program
    shifts = np.array([_assumed_shift(freedom) for freedom in program.draws.contributors])
    columns = np.flatnonzero(shifts)
    if len(columns) < MIN_SHIFTS:
        return
    deviations = np.zeros((len(columns) + 1, len(shifts)))
    deviations[np.arange(len(columns)), columns] = shifts[columns]
    measured = program.observe(poses=program.place(deviations=deviations)["poses"], deviations=deviations)["measured"]
    effects = measured[:-1] - measured[-1]
    for measure, effect in zip(program.nominal.measures, effects.T, strict=True):
        largest, assumed = float(np.abs(effect).sum()), round(float(effect.sum()), 9) + 0.0
        if np.isfinite(largest) and largest > (1 + CANCELLED) * abs(assumed):
            count = int((np.abs(effect) > MIN_SHARE * largest).sum())
            yield (
                f"{measure.designation}: the means of {count} contributors are assumed to be above the centre by cpk, which "
                f"moves it by {assumed:.3g} {measure.units}; if their sides are unknown, by up to ±{largest:.3g}; state them, "
                'side="up", "down" or "either"'
            )


def _assumed_shift(freedom: Freedom) -> float:
    """Return the shift of a mean by cpk whose side is not stated; 0 without one."""
    if freedom.tolerance is not None:
        return freedom.tolerance.capability_shift if freedom.tolerance.side is None else 0.0
    control = freedom.geometric
    return freedom.mean - freedom.middle if control is not None and control.cpk is not None and control.side is None else 0.0


def measured_reach(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each clearance by triangles that is only a lower bound in some draws."""
    nominal = draws.program.nominal
    for measure, measurement in zip(nominal.measures, nominal.measurements, strict=True):
        for clearance in _clearances(measurement):
            yield from _doubts(measure, clearance, draws.poses)


def _doubts(measure: Measure, clearance: MeshClearance, X: np.ndarray) -> Iterator[str]:
    moved = [pose.apply(X[:, face.part], clearance.box) for face in (clearance.moving, clearance.reference)]
    motion = np.linalg.norm(moved[0] - moved[1], axis=2).max(axis=1)
    spare = (clearance.elements.horizon - float(np.linalg.norm(clearance.lines[0, 1] - clearance.lines[0, 0]))) / 2
    if count := int((motion > spare).sum()):
        yield (
            f"{measure.designation}: its faces move by more than {spare:.3g} mm in {count} of {len(motion)} draws "
            "without contact; triangles that are not compared may then be nearer, so the clearance is only a lower bound; "
            "choose smaller faces, or read the parts with a larger chord"
        )


def _clearances(measurement: NominalMeasurement | int | None) -> Iterator[MeshClearance]:
    if isinstance(measurement, MeshClearance):
        yield measurement
    elif isinstance(measurement, Combined):
        for operand in measurement.operands:
            yield from _clearances(operand)
