"""Measures: limits that do not fit their nominal values, and faces that move beyond the triangles compared."""

import math
from collections.abc import Iterator

import numpy as np

from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.declaration import Measure, Point
from tolcontact.discretization.measured_geometry import Combined, MeshClearance, NominalMeasurement
from tolcontact.plausibility.trial_draws import TrialDraws, spread

FAR_SIGMAS = 100.0  # limits this far from the nominal value do not matter
MIN_SHARE = 1e-6  # of that distance: smaller variation is rounding


def measure_limits(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each measure whose limits exclude its nominal value, or lie too far from it to matter."""
    program = draws.program
    is_floating = any(location.floating for location in program.nominal.assembly.locations)
    pushed = math.inf if is_floating else sum(draws.pushes)
    for k, measure in enumerate(program.nominal.measures):
        nominal, limits = float(program.nominal_measures[k]), program.limits(k)
        if limits.are_open or not math.isfinite(nominal):
            continue
        place = measure.designation
        stated = f"limits ({_side(limits.lower)} to {_side(limits.upper)} {measure.units})"
        if limits.outside(np.array(nominal)):
            yield f"{place}: its nominal value {_number(nominal)} is outside of its {stated}; {_cause(program, k, nominal)}"
            continue
        values = draws.measured[np.isfinite(draws.measured[:, k]), k]
        sigma = float(spread(values)) if len(values) else 0.0
        distance = min(side for side in (nominal - limits.lower, limits.upper - nominal) if math.isfinite(side))
        if MIN_SHARE * distance < sigma and distance > FAR_SIGMAS * sigma + pushed:
            yield (
                f"{place}: its {stated} are {distance / sigma:.2g} sigma away from its nominal value {_number(nominal)}; check "
                "their units, and the units of the tolerances"
            )


def _cause(program: Program, k: int, value: float) -> str:
    """Return the likely cause of the limits of measure k that exclude its nominal value."""
    measure = program.nominal.measures[k]
    limits = program.limits(k)
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


def _number(value: float) -> str:
    return f"{round(value, 9) + 0.0:.6g}"


def _side(limit: float) -> str:
    return f"{limit:g}" if math.isfinite(limit) else "open"


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
        place = measure.designation
        yield (
            f"{place}: its faces move by more than {spare:.3g} mm in {count} of {len(motion)} draws "
            "without contact; triangles that are not compared may then be nearer, so the clearance is only a lower bound; "
            "choose smaller faces, or read the parts with a larger chord"
        )


def _clearances(measurement: NominalMeasurement | int | None) -> Iterator[MeshClearance]:
    if isinstance(measurement, MeshClearance):
        yield measurement
    elif isinstance(measurement, Combined):
        for operand in measurement.operands:
            yield from _clearances(operand)
