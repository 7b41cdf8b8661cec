"""Trials at raw poses when a model is compiled: they choose between fixed planes and bounded faces for each pair.

They also decide how deep bodies may penetrate each other in an answer, and how accurate measures are.
"""

import itertools
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.compilation.functions import NamedFunction
from tolcontact.discretization import ContactPoints, Nominal, raised_places
from tolcontact.errors import ContactWarning, ModelError
from tolcontact.geometry.meeting import Meeting, Reach, meeting
from tolcontact.interference import Watch, ordered
from tolcontact.limits import GAP_ACCURACY
from tolcontact.mechanics.groups import Group
from tolcontact.method import Method
from tolcontact.texts import shown
from tolcontact.variation import Draws

TRIALS = 1024  # raw poses
TRIAL_SEED = 2_718_281_828
ALLOWED_SHARE = 1 / 2000  # of the smallest tolerance range: accepted error of fixed planes
FACET_FACTOR = 4  # times the deviation of triangles from the analytic surfaces: smaller errors are due to the triangles
COARSE_SHARE = 1 / 20  # of the smallest tolerance range: triangles that deviate by more are taken as the body
TRAVEL_FACTOR = 2  # times the largest travel of the trial: search range of contact points
POSES_AT_ONCE = 64
THREADS = 2  # that compare poses: the search for contact points releases the interpreter lock
MIN_TRAVEL_SHARE = 1e-6  # of the size of the face
PLANES_FACTOR = 3.0  # times the error that a trial allows: allowed penetration of faces on fixed planes
MEASURE_TRIALS, MEASURE_SEED = 16, 2_718_281  # raw poses at which measures are differentiated
STEP = 1e-5  # mm, rad: displacements of the differences
LEVER_FACTOR = 2.0  # a gap error of 1 at the end of a contact span rotates the part by up to 2 / span


class Trial(NamedTuple):
    """The trial of a pair: the largest error of its fixed planes in the depth of contact, and the allowed error, both [mm].

    Errors are NaN for a pair without a choice: a one-sided locator, round faces, springs, unbounded tolerances, or too many
    edges.
    """

    error: float
    allowed: float


def bounded_pairs(
    watch: Watch, groups: Sequence[Group], draws: Draws, place: NamedFunction, observe: NamedFunction, method: Method
) -> tuple[dict[int, Meeting], dict[int, Trial]]:
    """Decide by trial draws which pairs need bounded faces: return their meetings, and the trials of all pairs of faces.

    Both are empty unless the search is bounded.
    """
    nominal = watch.nominal
    if not nominal.pairs or not method.is_bounded:
        return {}, {}
    deviations = draws(seed=TRIAL_SEED, start=0, stop=TRIALS)
    poses = place(deviations=deviations)["poses"]
    relative = observe(poses=poses, deviations=deviations)["relative"].reshape(len(poses), len(nominal.pairs), pose.ENTRIES)
    is_finite = np.isfinite(relative).all(axis=(1, 2))
    relative, deviations, presses = relative[is_finite], deviations[is_finite], method.minimizes.presses
    pushes = [push(pair, relative[:, k], deviations, presses=presses) for k, pair in enumerate(nominal.pairs)]
    decisions = {}
    for group in groups:
        pushed = sum(pushes[k] for k in group.pairs)
        for k in group.pairs:
            room = pushed if presses else pushed - pushes[k]
            decisions[k] = _bounded_pair(watch, k, relative[:, k], deviations, pushed=pushed, room=room)
    meetings = {k: meeting for k, (meeting, _) in decisions.items() if meeting is not None}
    return meetings, {k: trial for k, (_, trial) in decisions.items()}


def push(pair: ContactPoints, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], *, presses: bool) -> float:
    """Return how far [mm] contact of a pair may push its parts, from raw trial poses X_RM (n, 12).

    deviations   (n, contributor)
    presses      whether forces also close the gaps
    """
    return pair.raw_depth(X_RM, deviations) + (pair.clearance if presses else 0.0)


def _bounded_pair(
    watch: Watch,
    index: int,
    X_RM: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    *,
    pushed: float,
    room: float,
) -> tuple[Meeting | None, Trial]:
    """Return where the bounded faces of a pair can touch, or None if fixed planes represent its reference face well.

    X_RM      (n, 12): raw trial poses, for `deviations` (n, contributor)
    pushed    [mm]: how far all contact of the group may push its parts
    room      [mm]: how far other contact, or forces, may push; gaps below it are compared, and below the range of all gaps
    """
    nominal, pair = watch.nominal, watch.nominal.pairs[index]
    smallest = nominal.assembly.smallest_zone()
    nothing = None, Trial(np.nan, np.nan)
    if not pair.may_miss_ends or not np.isfinite(smallest):
        return nothing
    assert pair.moving_face is not None and pair.reference_face is not None and pair.reference is not None
    travel = pair.travel(X_RM) + pair.highest(deviations)
    tilt = float(pose.turn(X_RM, pose.AT_REST[None]).max())
    size = float(np.ptp(pair.moving_face.mesh.vertices, axis=0).max())
    bodies = nominal.parts[pair.moving].body, nominal.parts[pair.reference].body
    depth = max(-float(pair.least_gap(pose.AT_REST[None])[0]), 0.0)  # contact points suggest one for disjoint bodies, too
    reach = Reach(
        travel=TRAVEL_FACTOR * travel + pushed + MIN_TRAVEL_SHARE * size,
        tilt=tilt + pushed / size,
        spread=travel,
        overlap=pair.coordinate_error + (depth if depth > 0 and watch.overlap(pair.moving, pair.reference) else 0.0),
        clearance=pair.clearance,
    )
    pair_meeting = meeting((pair.moving_face, pair.reference_face), bodies, reach, has_form=pair.has_form)
    if pair_meeting is None:
        warnings.warn(
            f'contact pair "{shown(pair.name)}": its faces have too many edges to find contact where they end; '
            "use coarser meshes, or choose smaller faces",
            ContactWarning,
            stacklevel=2,
        )
        return nothing
    _check_corners(nominal, pair, pair_meeting)
    error = _error_of_planes(pair, pair_meeting, X_RM, deviations, room)
    bulge = max(pair.moving_face.bulge, pair.reference_face.bulge)
    represents_curves = FACET_FACTOR * bulge <= COARSE_SHARE * smallest
    allowed = max(ALLOWED_SHARE * smallest, FACET_FACTOR * bulge if represents_curves else 0.0)
    return (pair_meeting if error > allowed else None), Trial(error, allowed)


def _check_corners(nominal: Nominal, pair: ContactPoints, pair_meeting: Meeting) -> None:
    """Raise ModelError if a face has no corners: then more than two triangles of its body meet at each of its edges."""
    for face, index in ((pair_meeting.moving, pair.moving), (pair_meeting.reference, pair.reference)):
        if index is not None and not len(face.vertices):
            part = nominal.parts[index].name
            fault = (
                f'contact pair "{shown(pair.name)}": the face of part "{shown(part)}" has no ends, since more than two '
                "triangles meet at each of its edges; the mesh holds several bodies in one place: export one of them"
            )
            raise ModelError(nominal.assembly.name, [fault])


def _error_of_planes(
    pair: ContactPoints, pair_meeting: Meeting, X_RM: np.ndarray, deviations: np.ndarray, room: float
) -> float:
    """Return the largest error [mm] of the fixed planes in the depth of contact."""
    fixed = pair.least_gap(X_RM, deviations)
    room = max(room, float(np.ptp(fixed)))  # poses that are rarer than in the trial may be deeper by this range

    def compared(rows: slice) -> float:
        bounded = raised_places(pair, pair_meeting, X_RM[rows], deviations[rows]).actual_gaps.min(axis=1, initial=np.inf)
        differences = np.minimum(bounded, room) - np.minimum(fixed[rows], room)
        return float(np.abs(differences).max(initial=0))

    blocks = [slice(k, k + POSES_AT_ONCE) for k in range(0, len(X_RM), POSES_AT_ONCE)]
    with ThreadPoolExecutor(THREADS) as pool:
        return max(pool.map(compared, blocks), default=0.0)


def allowed_depths(
    nominal: Nominal, meetings: Mapping[int, Meeting], trials: Mapping[int, Trial]
) -> dict[tuple[int, int], float]:
    """Return the allowed penetration [mm] of bodies of contact pairs, where it exceeds the default.

    Fixed planes err by the error allowed in their trial, at raw poses; other contact tilts parts more. Faces on springs
    penetrate each other, and form is not part of a solid. Parts that are declared to overlap may penetrate to any depth. Bodies
    in the watch have flat planes, but fixed contact points lie on triangles, with coordinates rounded by the file.
    """
    depths = dict[tuple[int, int], float]()
    for k, pair in enumerate(nominal.pairs):
        if pair.reference is not None and pair.moving_face is not None:
            bodies = ordered(pair.moving, pair.reference)
            is_fixed = k in trials and k not in meetings and np.isfinite(trials[k].allowed)
            planes = PLANES_FACTOR * trials[k].allowed if is_fixed else 0.0
            rounding = 0.0 if k in meetings else pair.coordinate_error
            depths[bodies] = max(depths.get(bodies, 0.0), np.inf if pair.may_interfere else planes + rounding)
    for overlap in nominal.assembly.overlaps:
        indices = [index for index, part in enumerate(nominal.parts) if part.part in overlap.parts]
        for left, right in itertools.combinations(indices, 2):
            if nominal.parts[left].station == nominal.parts[right].station:
                depths[left, right] = np.inf
    return depths


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
    deviations = draws(seed=MEASURE_SEED, start=0, stop=MEASURE_TRIALS)
    poses = place(deviations=deviations)["poses"]
    initial = observe(poses=poses, deviations=deviations)["measured"]
    initial[~np.isfinite(initial)] = np.nan  # a difference of infinities is a warning of NumPy
    gains = np.zeros(len(nominal.measures))
    for group in groups:
        for mover, free in enumerate(group.free):
            parts = [part for part, mobility in zip(group.parts, group.mobilities, strict=True) if mover in mobility.movers]
            points = np.concatenate([
                points
                for pair in (nominal.pairs[k] for k in group.pairs)
                for points, owner in ((pair.P_m, pair.moving), (pair.P_r, pair.reference))
                if owner == free
            ] or [nominal.parts[free].vertices])  # fmt: skip
            nominal_centre = (points.min(axis=0) + points.max(axis=0)) / 2
            span = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
            slopes = np.zeros((2, 3, len(initial), len(gains)))
            for kind, axis in itertools.product(range(2), range(3)):
                moved = poses.reshape(len(poses), -1, 12).copy()
                centre = pose.apply(moved[:, free], nominal_centre[None])[:, 0]
                direction = STEP * np.eye(3)[axis]
                R = Rotation.from_rotvec(kind * direction).as_matrix()
                shift = centre - centre @ R.T if kind else np.broadcast_to(direction, centre.shape)
                displacement = pose.pose(np.broadcast_to(R, (len(centre), 3, 3)), shift)[:, None]
                moved[:, parts] = pose.compose(displacement, moved[:, parts])
                displaced = observe(poses=moved.reshape(poses.shape), deviations=deviations)["measured"]
                slopes[kind, axis] = (displaced - initial) / STEP
            sizes = np.sqrt((slopes**2).sum(axis=1))
            gains += np.nan_to_num((sizes[0] + LEVER_FACTOR / span * sizes[1]), nan=0.0, posinf=0.0).max(axis=0)
    return np.asarray(GAP_ACCURACY * np.maximum(gains, [1 / measure.unit for measure in nominal.measures]))
