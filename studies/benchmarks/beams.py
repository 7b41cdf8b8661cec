"""Beams for reference solutions: stiffness by Hermite elements, with NumPy alone."""

import numpy as np


def beam_stiffness(length: float, elements: int, bending: float) -> np.ndarray:
    """Return the stiffness of a beam with E I = `bending` [N mm²]: deflection [mm] and slope of each node in turn."""
    h = length / elements
    one = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    two = np.array([[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])
    stiffness = np.zeros((2 * elements + 2, 2 * elements + 2))
    for k in range(elements):
        stiffness[2 * k : 2 * k + 4, 2 * k : 2 * k + 4] += bending / h**3 * np.vstack([one, two])
    return stiffness


def condensed(stiffness: np.ndarray, kept: list[int]) -> np.ndarray:
    """Return the stiffness of the `kept` freedoms, the others free of forces."""
    outer, inner = np.array(kept), np.setdiff1d(np.arange(len(stiffness)), kept)
    coupling = stiffness[np.ix_(outer, inner)]
    return stiffness[np.ix_(outer, outer)] - coupling @ np.linalg.solve(stiffness[np.ix_(inner, inner)], coupling.T)
