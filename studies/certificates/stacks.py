"""Stacks of two or three bodies, and the solids that they are made of.

A body is a list of convex pieces, corners (point, 3) [mm]. The lowest body comes first; bodies meet near the height 0, and a
third one near the height 6. Nothing is located, turned or simulated here.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

GRID = (-10.0, -5.0, 0.0, 5.0, 10.0)  # mm
HEIGHT = 6.0  # mm, of the second body of three
Pieces = list[np.ndarray]


@dataclass
class Stack:
    """Bodies, from the lowest one up, the pairs (upper, lower) that may touch, and whether one grips behind another one."""

    bodies: list[Pieces]
    pairs: tuple[tuple[int, int], ...] = ((1, 0),)
    undercut: bool = False


def box(low, high) -> np.ndarray:
    """Return the corners of a box."""
    return np.array(list(itertools.product(*zip(low, high, strict=True))), dtype=float)


def prism(outline, bottom: float, top: float) -> np.ndarray:
    """Return the corners of an upright prism over an outline (corner, 2)."""
    return np.array([(x, y, z) for x, y in outline for z in (bottom, top)], dtype=float)


def bar(profile, start: float, end: float) -> np.ndarray:
    """Return the corners of a prism along x with a profile (corner, 2) of y and z."""
    return np.array([(x, y, z) for y, z in profile for x in (start, end)], dtype=float)


def turned(pieces: Pieces, quarters: float) -> Pieces:
    """Return pieces turned about the vertical axis by a number of quarter turns, which are exact."""
    R = Rotation.from_rotvec([0, 0, quarters * np.pi / 2]).as_matrix()
    return [points @ (np.round(R) if quarters % 1 == 0 else R).T for points in pieces]


def clearance(rng) -> float:
    """Return no clearance, or some [mm]."""
    return float(rng.choice([0, 0, 0.01, 0.1, 0.3]))
