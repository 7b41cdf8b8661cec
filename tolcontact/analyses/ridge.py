"""A step along the kinks of a measure: a linear program maximizes the minimum of several linear functions."""

import numpy as np
import scipy

from tolcontact.analyses.allowed_space import AllowedRegion


def ridge_end(
    region: AllowedRegion,
    center: np.ndarray,
    half_widths: np.ndarray,
    points: np.ndarray,
    values: np.ndarray,
    slopes: np.ndarray,
) -> np.ndarray:
    """Return the point (contributor,) of the region near `center` (contributor,) that maximizes the least linear function.

    half_widths  (contributor,): largest distance of the point from the center
    points, values, slopes  (n, contributor), (n,), (n, contributor): function k is values_k + slopes_k (x - points_k)

    The center is returned if there is no such point, or no value.
    """
    rows, columns = np.flatnonzero(np.isfinite(values)), np.flatnonzero(half_widths > 0)
    if not rows.size or not columns.size:
        return center
    scale = half_widths[columns]  # the solver's tolerances are absolute
    at_center = values[rows] + ((center - points[rows]) * slopes[rows]).sum(axis=1)
    size = max(float(np.ptp(at_center)), float(np.abs(slopes[rows][:, columns] * scale).sum(axis=1).max()), 1e-300)
    functions = np.column_stack([-slopes[rows][:, columns] * scale / size, np.ones(len(rows))])
    planes, limits = region.planes()
    planes, limits = planes[:, columns] * scale, limits - planes @ center
    has_part = np.abs(planes).any(axis=1)
    planes = np.column_stack([planes[has_part], np.zeros(int(has_part.sum()))])
    lower, upper = ((end[columns] - center[columns]) / scale for end in (region.lower, region.upper))
    solution = scipy.optimize.linprog(
        np.append(np.zeros(len(columns)), -1.0),
        np.vstack([functions, planes]),
        np.concatenate([(at_center - at_center.min()) / size, np.maximum(limits[has_part], 0.0)]),
        bounds=[*zip(np.maximum(lower, -1.0).clip(max=0), np.minimum(upper, 1.0).clip(min=0), strict=True), (None, None)],
    )
    if solution.x is None:
        return center
    step = np.zeros(len(center))
    step[columns] = scale * solution.x[:-1]
    return np.asarray(region.enclosed((center + step)[None])[0])
