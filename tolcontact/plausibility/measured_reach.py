"""Motions of faces beyond the triangles that their clearance compares."""

from collections.abc import Iterator

import numpy as np

from tolcontact import poses as pose
from tolcontact.declaration import Measure
from tolcontact.discretization.measured_geometry import Combined, MeshClearance, NominalMeasurement
from tolcontact.errors import designation
from tolcontact.plausibility.trial_draws import TrialDraws


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
        place = designation(measure.noun, measure)
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
