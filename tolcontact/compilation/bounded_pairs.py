"""Which pairs need contact of bodies as they end: a trial at raw poses, pair by pair, when the model is compiled."""

import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.discretization import ContactPoints, Nominal, raised_places
from tolcontact.errors import ContactWarning, ModelError, shown
from tolcontact.geometry.curvature import is_flat
from tolcontact.geometry.meeting import Meeting, Reach, meeting
from tolcontact.interference import Watch

TRIALS = 1024  # raw poses
TRIAL_SEED = 2_718_281_828
ALLOWED_SHARE = 1 / 2000  # of the smallest tolerance range: error of fixed planes that is accepted
FACET_FACTOR = 4  # times the distance of triangles from the analytic surfaces for which they stand: smaller errors are theirs
COARSE_SHARE = 1 / 20  # of the smallest tolerance range: where triangles are off by more, they are the body
TRAVEL_FACTOR = 2  # times the largest travel of the trial: how far places are looked for
POSES_AT_ONCE = 64
THREADS = 2  # that compare poses: the search for places releases the interpreter
MIN_TRAVEL_SHARE = 1e-6  # of the size of the face


class Trial(NamedTuple):
    """The trial of a pair: the largest error of its fixed planes in the depth of contact, and the one allowed, both [mm].

    `places` is the largest number of places at which its faces could touch. Errors are NaN for a pair that has no choice:
    one-sided locators, round faces, springs, tolerances without an end, or too many edges.
    """

    error: float
    allowed: float
    places: int = 0


def push(pair: ContactPoints, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], *, presses: bool) -> float:
    """Return how far [mm] contact of a pair may push its parts, from raw trial poses X_RM (n, 12).

    deviations   (n, contributor)
    presses      whether forces close the gaps, too
    """
    depth = _travel(pair, X_RM) if pair.round is not None else max(-float(pair.least_gap(X_RM, deviations).min()), 0.0)
    return depth + (clearance(pair) if presses else 0.0)


def bounded_pair(
    watch: Watch,
    index: int,
    X_RM: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    *,
    pushed: float,
    room: float,
) -> tuple[Meeting | None, Trial]:
    """Return where the faces of a pair can touch as they end, or None if fixed planes represent its reference face well.

    X_RM      (n, 12), raw, at trial poses, for `deviations` (n, contributor)
    pushed    [mm]: how far all contact together may push its parts
    room      [mm]: how far other contact, or forces, may: gaps below it are compared, and below the range of all gaps
    """
    nominal, pair = watch.nominal, watch.nominal.pairs[index]
    smallest = nominal.assembly.smallest_zone()
    nothing = None, Trial(np.nan, np.nan)
    if pair.moving_face is None or pair.reference_face is None or pair.reference is None or pair.round is not None:
        return nothing
    is_smooth = not pair.has_form or (is_flat(pair.moving_face) and is_flat(pair.reference_face))
    if pair.is_springy or not np.isfinite(smallest) or not is_smooth:
        return nothing
    highest = float(np.abs(pair.heights(deviations)).max())
    if pair.has_form:
        highest += float(pair.form(deviations).highest().sum(axis=0).max())
    travel = _travel(pair, X_RM) + highest
    tilt = float(pose.turn(X_RM, pose.AT_REST[None]).max())
    size = float(np.ptp(pair.moving_face.mesh.vertices, axis=0).max())
    bodies = nominal.parts[pair.moving].body, nominal.parts[pair.reference].body
    reach = Reach(
        travel=TRAVEL_FACTOR * travel + pushed + MIN_TRAVEL_SHARE * size,
        tilt=tilt + pushed / size,
        spread=travel,
        overlap=pair.coordinate_error + _overlap(watch, pair),
        clearance=clearance(pair),
    )
    places = meeting((pair.moving_face, pair.reference_face), bodies, reach)
    if places is not None:
        _check_corners(nominal, pair, places)
    else:
        warnings.warn(
            f'contact pair "{shown(pair.name)}": its faces have too many edges to find contact where they end; '
            "use coarser meshes, or choose smaller faces",
            ContactWarning,
            stacklevel=2,
        )
        return nothing
    error, most = _error_of_planes(pair, places, X_RM, deviations, room)
    bulge = max(pair.moving_face.bulge, pair.reference_face.bulge)
    stands_for_curves = FACET_FACTOR * bulge <= COARSE_SHARE * smallest
    allowed = max(ALLOWED_SHARE * smallest, FACET_FACTOR * bulge if stands_for_curves else 0.0)
    trial = Trial(error, allowed, most)
    return (places if trial.error > trial.allowed else None), trial


def _overlap(watch: Watch, pair: ContactPoints) -> float:
    """Return how deep [mm] the bodies of a pair lie in each other nominally: contact points of whole bodies only seem to."""
    depth = max(-float(pair.least_gap(pose.AT_REST[None])[0]), 0.0)
    return depth if depth > 0 and pair.reference is not None and watch.overlap(pair.moving, pair.reference) else 0.0


def _check_corners(nominal: Nominal, pair: ContactPoints, places: Meeting) -> None:
    """Raise ModelError if a face has no corners: then more than two triangles of its body meet at each of its edges."""
    for face, number in ((places.moving, pair.moving), (places.reference, pair.reference)):
        if number is not None and not len(face.vertices):
            part = nominal.parts[number].name
            fault = (
                f'contact pair "{shown(pair.name)}": the face of part "{shown(part)}" has no ends, since more than two '
                "triangles meet at each of its edges; the mesh holds several bodies in one place: export one of them"
            )
            raise ModelError(nominal.assembly.name, [fault])


def _error_of_planes(
    pair: ContactPoints, places: Meeting, X_RM: np.ndarray, deviations: np.ndarray, room: float
) -> tuple[float, int]:
    """Return the largest error [mm] of the fixed planes of a pair in the depth of contact, and the largest number of places."""
    fixed = pair.least_gap(X_RM, deviations)
    room = max(room, float(np.ptp(fixed)))  # rarer poses than those of the trial may be as much deeper

    def judged(rows: slice) -> tuple[float, int]:
        gaps = raised_places(pair, places, X_RM[rows], deviations[rows]).gaps
        bounded = gaps.min(axis=1, initial=np.inf)
        differences = np.minimum(bounded, room) - np.minimum(fixed[rows], room)
        return float(np.abs(differences).max(initial=0)), int(np.isfinite(gaps).sum(axis=1).max())

    blocks = [slice(k, k + POSES_AT_ONCE) for k in range(0, len(X_RM), POSES_AT_ONCE)]
    with ThreadPoolExecutor(THREADS) as pool:
        errors, counts = zip((0.0, 0), *pool.map(judged, blocks), strict=True)
    return max(errors), max(counts)


def _travel(pair: ContactPoints, X_RM: np.ndarray) -> float:
    """Return how far [mm] the moving face, or the contact points of a pair without one, travel from their nominal places."""
    bounds = pair.moving_face.mesh.bounds if pair.moving_face is not None else [pair.P_m.min(axis=0), pair.P_m.max(axis=0)]
    corners = np.array(np.meshgrid(*np.array(bounds).T)).reshape(3, -1).T
    return float(np.linalg.norm(pose.apply(X_RM - pose.AT_REST, corners), axis=2).max())


def clearance(pair: ContactPoints) -> float:
    """Return the least nominal distance [mm] of contact points from their feet."""
    return float(np.linalg.norm(pair.P_m - pair.P_r, axis=1).min())
