"""Displacement energies of sets of points, from their ten moments.

The moments of points P about a nominal centre c are N, sum (P - c) and the six distinct entries of
sum (P - c)(P - c)'. They suffice for every weighting and any number of points.
"""

import casadi as ca
import numpy as np

from tolcontact.mechanics.pose import Pose, Vector, constant

MOMENTS = 10
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def moment_table(P: np.ndarray, centre: np.ndarray, radii: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the moments (moment, point) of each of the points P (point, 3) [mm] about `centre`.

    A point represents all points of a sphere around it, with a radius from `radii` (point,) [mm].
    """
    p, mean_square = (P - centre).T, np.asarray(radii) ** 2 / 3  # of a coordinate on a sphere
    return np.vstack([np.ones(len(P)), p, *(p[i] * p[j] + (mean_square if i == j else 0.0) for i, j in _UPPER)])


def moments_about(centre: np.ndarray, moments: np.ndarray, other_centre: np.ndarray) -> np.ndarray:
    """Return the moments (10,) of points about a centre (3,) [mm] from their `moments` (10,) about another centre (3,)."""
    count, first_moment, offset = moments[0], moments[1:4], other_centre - centre
    change = np.outer(offset, first_moment) + np.outer(first_moment, offset) + count * np.outer(offset, offset)
    return np.concatenate([[count], first_moment + count * offset, moments[4:] + [change[i, j] for i, j in _UPPER]])


def central_moments(centre: np.ndarray, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centre (3,) [mm] of points with given `moments` (10,) about another one, and their mean products (3, 3)."""
    offset, products = moments[1:4] / moments[0], np.zeros((3, 3))
    for value, (i, j) in zip(moments[4:], _UPPER, strict=True):
        products[i, j] = products[j, i] = value
    return centre + offset, products / moments[0] - np.outer(offset, offset)


def displacement_energy(moments: ca.SX, centre: Vector, start: Pose, end: Pose) -> ca.SX:
    """Return 1/2 sum |x_end - x_start|^2 [mm^2] over the points with the given `moments` (10, 1); it is quadratic in `end`.

    The displacement is x_end - x_start = a + D (P - c), with the displacement a of the centre and the difference D of the
    rotations.
    """
    count, first_moment = moments[0], moments[1:4]
    second_moment = ca.SX.zeros(3, 3)
    for k, (i, j) in enumerate(_UPPER):
        second_moment[i, j] = second_moment[j, i] = moments[4 + k]
    a = end.apply(constant(centre)) - start.apply(constant(centre))
    D = end.R - start.R
    return count * ca.dot(a, a) / 2 + ca.dot(a, D @ first_moment) + ca.trace(D @ second_moment @ D.T) / 2
