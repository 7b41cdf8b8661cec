"""Coulomb's friction for reference solutions: the least coefficient at which contacts can hold a body, with SciPy alone."""

from collections.abc import Sequence

import numpy as np
from scipy import optimize

FACETS = 1440  # of a cone in three dimensions: they make the coefficient too large by 2.4e-6 of it at most


def _cone(normal: np.ndarray, mu: float) -> np.ndarray:
    """Return the edges (n, dimension) of a friction cone about a unit normal, as a pyramid around it in three dimensions."""
    if len(normal) == 2:
        across = np.array([-normal[1], normal[0]])
        return np.array([normal + mu * across, normal - mu * across])
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    angles = 2 * np.pi * np.arange(FACETS) / FACETS
    return normal + mu * (np.outer(np.cos(angles), first) + np.outer(np.sin(angles), np.cross(normal, first)))


def _wrench(point: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return force and moment [N, N mm] of forces (n, dimension) at a point."""
    moment = np.cross(point, force) if len(point) == 3 else point[0] * force[..., 1:] - point[1] * force[..., :1]
    return np.concatenate([force, moment], axis=-1)


def is_held(contacts: Sequence[tuple[Sequence[float], Sequence[float]]], loads: Sequence[tuple], mu: float) -> bool:
    """Return whether reactions within the cones of contacts (point, normal) balance the loads (point, force)."""
    columns = [_wrench(np.array(point), _cone(np.array(normal, dtype=float), mu)) for point, normal in contacts]
    load = sum(_wrench(np.array(point), np.array(force, dtype=float)) for point, force in loads)
    matrix = np.concatenate(columns).T
    return bool(optimize.linprog(np.zeros(matrix.shape[1]), A_eq=matrix, b_eq=-np.asarray(load)).status == 0)


def least_coefficient(contacts: Sequence[tuple], loads: Sequence[tuple], high: float = 4.0) -> float:
    """Return the least coefficient of friction, the same at all contacts, at which they hold the loads, by bisection."""
    low = 0.0
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (low, middle) if is_held(contacts, loads, middle) else (middle, high)
    return high
