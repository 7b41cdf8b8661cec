"""Candidate contacts of bounded faces, with the heights of their form deviations there.

Bounded planes touch at the corners of their overlap. With form they also touch between these, so contact points over the
reference face are candidates, too, and so are minima of the gap between them. The height of a face refers to its point over the
other face's point at the pose.
"""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.discretization.fixed_contact import ContactPoints
from tolcontact.discretization.form_points import PairForm
from tolcontact.discretization.plane_minima import with_former
from tolcontact.geometry import region_kernel
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.places import PLAIN, Look, Places

FIRST_POINT = 1 << 40  # label of the first contact point
EXACT_SHARE = 0.1  # of the largest dip of the gap between points: heights in smaller gaps are exact, others from splines
POINT_GROUPS = 12  # of neighbouring contact points; the lowest of each group counts


def raised_places(
    pair: ContactPoints,
    meeting: Meeting,
    X_RM: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    look: Look = PLAIN,
    depth: float = np.inf,
) -> Places:
    """Return the candidate contacts of a pair at X_RM (n, 12), see Meeting.at, for deviations (n, contributor).

    Minima of the gap between contact points are among them if they are deeper than `depth` [mm]. Ceilings are of gaps between
    faces that have grown; with form they do not count.
    """
    grown = pair.heights(deviations)[:, None]
    form = pair.form(deviations)
    if form is None:
        ceilings = None if look.ceilings is None else look.ceilings + grown[:, 0]
        places = meeting.at(X_RM, look._replace(ceilings=ceilings))
    else:
        retained = look.retained
        at_ends = None if retained is None else np.where(retained < FIRST_POINT, retained, -1)
        ends = meeting.at(X_RM, look._replace(retained=at_ends, ceilings=None))
        row, place = np.nonzero(np.isfinite(ends.gaps))
        ends.heights[row, place] = form.at(row, ends.P_m[row, place], ends.P_r[row, place])
        places = ends.followed_by(*_points(pair, form, X_RM, deviations, retained, depth))
    return places._replace(heights=grown + places.heights)


def rim_points(pair: ContactPoints, X_RM: Float[Array, "n 12"]) -> tuple[Float[Array, "n point 3"], Float[Array, "n point"]]:
    """Return the points of the moving plane across from the rim points of the reference plane of a pair at X_RM (n, 12).

    These are P_m (n, point, 3) [mm] of the nominal plane, and gaps (n, point) [mm] along the normal of the reference face.
    """
    assert pair.moving_face is not None
    rim, n = pair.reference_rim, pair.n_r[0]
    m, corner = pair.moving_face.corner_normals[0, 0], pair.moving_face.vertices[0]
    back, along = pose.apply(pose.inverse(X_RM), rim), n @ pose.rotation(X_RM)  # (n, rim point, 3), (n, 3)
    heights = ((corner - back) @ m) / (along @ m)[:, None]
    return back + heights[..., None] * along[:, None], heights


def _points(
    pair: ContactPoints, form: PairForm, X_RM: np.ndarray, deviations: np.ndarray, retained: np.ndarray | None, depth: float
) -> tuple[Places, Places]:
    """Return points inside the rims of the faces as candidates, and minima of the gap between them, with the forms there.

    The points are the `retained` ones, and the lowest of each group: contact points, and after these points of the rim. The
    minima are deeper than `depth` [mm].
    """
    assert pair.reference_face is not None and pair.moving_face is not None and pair.minima is not None
    regions, minima = (pair.reference_face.region, pair.moving_face.region), pair.minima
    poses, count, rim = np.ascontiguousarray(X_RM), len(pair.P_m), pair.reference_rim
    across, rim_gaps = rim_points(pair, X_RM)
    total = count + len(rim)
    groups = np.cumsum([0, *map(len, np.array_split(np.arange(total), min(POINT_GROUPS, total)))])
    gaps, heights = np.empty((len(poses), total)), np.zeros((len(poses), total))
    P_m, feet = np.ascontiguousarray(pair.P_m), np.ascontiguousarray(across)
    region_kernel.plane_gaps(poses, P_m, *(np.ascontiguousarray(values) for values in (pair.P_r, pair.n_r)), gaps)
    gaps[:, count:], heights[:, :count] = rim_gaps, pair.form_heights(deviations)
    between = kept = np.zeros((len(poses), 0), dtype=np.int64)
    if retained is not None:
        is_point = (retained >= FIRST_POINT) & (retained < FIRST_POINT + total)
        kept = np.where(is_point, retained - FIRST_POINT, -1)[:, is_point.any(axis=0)]
        between = np.where(retained >= FIRST_PLACE, retained, -1)
        region_kernel.keep_over(poses, P_m, feet, *regions, kept)
    bounds = np.stack([minima.projection_error(poses, deviations), minima.bound(deviations)], axis=1)
    is_promising = np.zeros(gaps.shape, dtype=bool)
    region_kernel.write_promising(poses, P_m, feet, gaps - heights, bounds, groups, *regions, kept, is_promising)
    if bounds[:, 0].any():
        at_feet = minima.heights(poses, deviations, P_m[None], is_promising[:, :count])
        heights[:, :count] = np.where(is_promising[:, :count], at_feet, heights[:, :count])
    heights[:, count:] = minima.heights(poses, deviations, feet, is_promising[:, count:])
    raised = gaps - heights
    raised[:, count:][~is_promising[:, count:]] = np.inf
    lowest = np.empty((len(poses), len(groups) - 1), dtype=np.int64)
    region_kernel.lowest_over(poses, P_m, feet, raised, groups, *regions, lowest)
    rows = np.arange(len(poses))[:, None]
    if np.isfinite(depth):
        grown, limits = pair.heights(deviations), minima.bulge(deviations)
        raised -= grown[:, None]
        region_kernel.leave_low(poses, P_m, feet, raised, limits, *regions)
        points = np.concatenate([np.broadcast_to(P_m, (len(poses), *P_m.shape)), feet], axis=1)
        between = with_former(minima.find(poses, deviations, grown, points, raised, limits, depth), between)
    numbers = np.concatenate([kept, lowest], axis=1)
    for column in range(1, numbers.shape[1]):
        numbers[(numbers[:, :column] == numbers[:, column, None]).any(axis=1), column] = -1
    is_point, on_rim = numbers >= 0, np.nonzero(numbers >= count)
    labels, gaps = np.where(is_point, numbers + FIRST_POINT, -1), np.where(is_point, gaps[rows, numbers], np.inf)
    of_pair, of_rim = np.where(numbers < count, numbers, 0), numbers[on_rim] - count
    P_m, P_r = pair.P_m[of_pair], pair.P_r[of_pair]
    P_m[on_rim], P_r[on_rim] = feet[on_rim[0], of_rim], rim[of_rim]
    n_r = np.broadcast_to(pair.n_r[0], (*numbers.shape, 3))
    heights = heights[rows, numbers] * is_point
    row, place = _exact(gaps - heights, minima.bulge(deviations))
    moved = pose.apply(poses[row], P_m[row, place, None])[:, 0]
    true_feet = moved - ((moved - P_r[row, place]) @ pair.n_r[0])[:, None] * pair.n_r[0]
    heights[row, place] = form.at(row, P_m[row, place], true_feet)
    return Places(labels, gaps, P_m, P_r, n_r, heights), minima.at(poses, deviations, between)


def _exact(gaps: np.ndarray, bulge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the row and place (k,) of gaps (n, place) [mm] that may close or be the least: their heights must be exact."""
    least = np.maximum(gaps.min(axis=1, initial=np.inf), 0)
    row, place = np.nonzero((gaps <= (least + EXACT_SHARE * bulge)[:, None]) & np.isfinite(gaps))
    return row, place
