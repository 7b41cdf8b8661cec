"""The accuracy of measures: the possible error of a measure for gaps with errors up to their accuracy."""

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.compilation.functions import NamedFunction
from tolcontact.discretization import Nominal
from tolcontact.limits import GAP_ACCURACY
from tolcontact.mechanics.groups import Group
from tolcontact.variation import Draws

TRIALS = 16  # raw poses at which measures are differentiated
TRIAL_SEED = 2_718_281
STEP = 1e-5  # mm, rad: displacements of the differences
LEVER_FACTOR = 2.0  # a gap error of 1 at the end of a contact span rotates the part by up to 2 / span


def measure_accuracies(
    nominal: Nominal, groups: list[Group], draws: Draws, place: NamedFunction, observe: NamedFunction
) -> Float[Array, " measure"]:
    """Return the accuracy of each measure in its units: the accuracy of gaps, times the gain of the measure if that exceeds 1.

    The gain is the error of a measure for an error of 1 mm in the gaps. Each free part is displaced, with the parts that are
    located on it. Its contribution is the derivative of the measure by its translation, plus the derivative by its rotation
    about the centre of its contact points times 2 / span. The largest value at some raw poses counts.
    """
    if not nominal.measures:
        return np.zeros(0)
    deviations = draws(seed=TRIAL_SEED, start=0, stop=TRIALS)
    poses = place(deviations=deviations)["poses"]
    initial = observe(poses=poses, deviations=deviations)["measured"]
    initial[~np.isfinite(initial)] = np.nan  # a difference of infinities is a warning of NumPy
    gains = np.zeros(len(nominal.measures))
    for group in groups:
        for mover, free in enumerate(group.free):
            parts = [part for part, mobility in zip(group.parts, group.mobilities, strict=True) if mover in mobility.movers]
            nominal_centre, span = _contact_of(nominal, group, free)
            slopes = np.zeros((2, 3, len(initial), len(gains)))
            for kind, axis in itertools.product(range(2), range(3)):
                moved = poses.reshape(len(poses), -1, 12).copy()
                centre = pose.apply(moved[:, free], nominal_centre[None])[:, 0]
                moved[:, parts] = pose.compose(_displacement(centre, axis, STEP, rotates=kind == 1), moved[:, parts])
                displaced = observe(poses=moved.reshape(poses.shape), deviations=deviations)["measured"]
                slopes[kind, axis] = (displaced - initial) / STEP
            sizes = np.sqrt((slopes**2).sum(axis=1))
            gains += np.nan_to_num((sizes[0] + LEVER_FACTOR / span * sizes[1]), nan=0.0, posinf=0.0).max(axis=0)
    return np.asarray(GAP_ACCURACY * np.maximum(gains, [1 / measure.unit for measure in nominal.measures]))


def _contact_of(nominal: Nominal, group: Group, part: int) -> tuple[np.ndarray, float]:
    """Return the nominal centre (3,) [mm] and the span [mm] of the contact points of a part."""
    points = np.concatenate([
        points
        for pair in (nominal.pairs[k] for k in group.pairs)
        for points, owner in ((pair.P_m, pair.moving), (pair.P_r, pair.reference))
        if owner == part
    ] or [nominal.parts[part].vertices])  # fmt: skip
    return (points.min(axis=0) + points.max(axis=0)) / 2, float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0


def _displacement(centre: np.ndarray, axis: int, step: float, *, rotates: bool) -> np.ndarray:
    """Return poses (n, 1, 12) that shift by a step along an axis, or rotate by it about a centre (n, 3)."""
    direction = step * np.eye(3)[axis]
    R = Rotation.from_rotvec(direction if rotates else np.zeros(3)).as_matrix()
    shift = centre - centre @ R.T if rotates else np.broadcast_to(direction, centre.shape)
    return pose.pose(np.broadcast_to(R, (len(centre), 3, 3)), shift)[:, None]
