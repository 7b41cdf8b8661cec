"""Beams for reference solutions: stiffness by elements whose nodes are exact, with NumPy alone."""

import numpy as np


def beam_stiffness(length: float, elements: int, bending: float, shear: float = np.inf) -> np.ndarray:
    """Return the stiffness of a beam: deflection [mm] and slope of each node in turn.

    E I = `bending` [N mm²], and kappa G A = `shear` [N], by Timoshenko's theory; by default it does not shear.
    """
    h = length / elements
    p = 12 * bending / shear / h**2
    one = np.array([[12, 6 * h, -12, 6 * h], [6 * h, (4 + p) * h * h, -6 * h, (2 - p) * h * h]])
    two = np.array([[-12, -6 * h, 12, -6 * h], [6 * h, (2 - p) * h * h, -6 * h, (4 + p) * h * h]])
    stiffness = np.zeros((2 * elements + 2, 2 * elements + 2))
    for k in range(elements):
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += bending / (1 + p) / h**3 * np.vstack([one, two])
    return stiffness


def condensed(stiffness: np.ndarray, kept: list[int]) -> np.ndarray:
    """Return the stiffness of the `kept` freedoms, the others free of forces."""
    outer, inner = np.array(kept), np.setdiff1d(np.arange(len(stiffness)), kept)
    coupling = stiffness[np.ix_(outer, inner)]
    return stiffness[np.ix_(outer, outer)] - coupling @ np.linalg.solve(stiffness[np.ix_(inner, inner)], coupling.T)
