"""The accuracy of measures: how far a measure may be off if gaps of contact are off by their accuracy."""

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
LEVERS = 2.0  # a gap that is off by 1 at the end of a span of contact turns the part by up to 2 / span


def measure_accuracies(
    nominal: Nominal, groups: list[Group], draws: Draws, place: NamedFunction, observe: NamedFunction
) -> Float[Array, " measure"]:
    """Return the accuracy of each measure in its units: that of gaps, times what an error of 1 mm in gaps does to it if more.

    A free part is displaced with what is located on it. What it does to a measure is the sum of the derivatives by its
    translation, and by its turn about the middle of its contact times 2 over their span, the largest at some raw poses.
    """
    if not nominal.measures:
        return np.zeros(0)
    deviations = draws(seed=TRIAL_SEED, start=0, stop=TRIALS)
    poses = place(deviations=deviations)["poses"]
    before = observe(poses=poses, deviations=deviations)["measured"]
    gains = np.zeros(len(nominal.measures))
    for group in groups:
        for number, free in enumerate(group.free):
            carried = [part for part, mobility in zip(group.parts, group.mobilities, strict=True) if number in mobility.movers]
            middle, span = _contact_of(nominal, group, free)
            slopes = np.zeros((2, 3, len(before), len(gains)))
            for kind, axis in itertools.product(range(2), range(3)):
                moved = poses.reshape(len(poses), -1, 12).copy()
                centre = pose.apply(moved[:, free], middle[None])[:, 0]
                moved[:, carried] = pose.compose(_displacement(centre, axis, STEP, turns=kind == 1), moved[:, carried])
                after = observe(poses=moved.reshape(poses.shape), deviations=deviations)["measured"]
                slopes[kind, axis] = (after - before) / STEP
            sizes = np.sqrt((slopes**2).sum(axis=1))
            gains += np.nan_to_num((sizes[0] + LEVERS / span * sizes[1]), nan=0.0, posinf=0.0).max(axis=0)
    return np.asarray(GAP_ACCURACY * np.maximum(gains, 1.0))


def _contact_of(nominal: Nominal, group: Group, part: int) -> tuple[np.ndarray, float]:
    """Return the middle (3,), in the nominal place, and the span [mm] of the contact points of a part."""
    points = np.concatenate([
        points
        for pair in (nominal.pairs[k] for k in group.pairs)
        for points, owner in ((pair.P_m, pair.moving), (pair.P_r, pair.reference))
        if owner == part
    ] or [nominal.parts[part].vertices])  # fmt: skip
    return (points.min(axis=0) + points.max(axis=0)) / 2, float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0


def _displacement(centre: np.ndarray, axis: int, step: float, *, turns: bool) -> np.ndarray:
    """Return poses (n, 1, 12) that shift by a step along an axis, or turn by it about a centre (n, 3)."""
    direction = step * np.eye(3)[axis]
    R = Rotation.from_rotvec(direction if turns else np.zeros(3)).as_matrix()
    shift = centre - centre @ R.T if turns else np.broadcast_to(direction, centre.shape)
    return pose.pose(np.broadcast_to(R, (len(centre), 3, 3)), shift)[:, None]
