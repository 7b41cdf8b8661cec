"""Families of stacks that lie on each other: hulls, boxes, bars, roofs, tips and wedges, each from a random generator."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from studies.certificates.stacks import GRID, HEIGHT, Stack, box, turned

LEAST_VOLUME = 100.0  # mm^3, of a random hull


def span(rng) -> np.ndarray:
    """Return two different lines of the grid."""
    return np.sort(rng.choice(GRID, 2, replace=False))


def lattice_hull(rng, bottom: float, top: float, most: int = 4) -> np.ndarray:
    """Return a random hull with corners on the grid, at two heights."""
    while True:
        points = np.array([(*rng.choice(GRID, 2), z) for z in (bottom, top) for _ in range(rng.integers(1, most + 1))])
        try:
            if ConvexHull(points).volume > LEAST_VOLUME:
                return points
        except QhullError:
            continue


def three_pairs(rng) -> tuple[tuple[int, int], ...]:
    return ((1, 0), (2, 1), (2, 0)) if rng.random() < 0.3 else ((1, 0), (2, 1))


def lattice(rng) -> Stack:
    """Draw two hulls with corners on a grid."""
    return Stack([[lattice_hull(rng, -10, 0)], [lattice_hull(rng, 0, 8)]])


def lattice_of_three(rng) -> Stack:
    """Draw three hulls with corners on a grid, one on the other."""
    return Stack([[lattice_hull(rng, *heights)] for heights in ((-10, 0), (0, 6), (6, 12))], three_pairs(rng))


def lattice_unions(rng) -> Stack:
    """Draw unions of two or three hulls with corners on a grid."""
    heights = ((-10, 0), (0, 8))
    return Stack([[lattice_hull(rng, *pair) for _ in range(rng.integers(1, 4))] for pair in heights])


def boxes(rng) -> Stack:
    """Draw boxes with faces on a grid; some of them equal, some thin."""
    count, bodies = int(rng.integers(2, 4)), []
    thin, equal = rng.random(3) < 0.2, rng.random() < 0.3
    x, y = span(rng), span(rng)
    for k in range(count):
        if not equal:
            x, y = span(rng), span(rng)
        bottom = HEIGHT * (k - 1)
        low, high = (bottom + HEIGHT - 0.1, bottom + HEIGHT) if thin[k] and k == 0 else (bottom, bottom + HEIGHT)
        if thin[k] and k == count - 1:
            high = low + 0.1
        bodies.append([box((x[0], y[0], low), (x[1], y[1], high))])
    return Stack(bodies, three_pairs(rng) if count == 3 else ((1, 0),))


def crossed_bars(rng) -> Stack:
    """Draw equal bars, each turned by 90 degrees against the one below."""
    half, width = float(rng.choice([5, 10])), float(rng.choice([1, 2.5, 5, 10]))
    offset = np.array([*rng.choice([0, 0, half - width, 2.5], 2), 0])
    bars = [box((-half, -width, HEIGHT * (k - 1)), (half, width, HEIGHT * k)) + offset for k in range(3)]
    bodies = [turned([points], k * int(rng.choice([1, 1, 2, 3]))) for k, points in enumerate(bars)][: rng.integers(2, 4)]
    return Stack(bodies, three_pairs(rng) if len(bodies) == 3 else ((1, 0),))


def plate(rng, half: float) -> np.ndarray:
    return box((-half, -half, 0), (half, half, float(rng.choice([0.1, 1, 3, 8]))))


def ridges(rng) -> Stack:
    """Draw a plate or an inverted roof on a roof, whose ridge ends at, beyond or short of its ends."""
    half, width = 10.0, float(rng.choice([5, 10]))

    def roof() -> np.ndarray:
        ends = half + rng.choice([0, 0, -0.01, -0.5, -5, 0.01, 0.5, 2], 2) * 1.0
        over = float(rng.choice([0, 0, 2, -2]))  # by how far the foot is longer than the ridge
        y = float(rng.choice([0, 0, width, 2]))
        corners = [(sign * (end + over), side, -6) for sign, end in zip((-1, 1), ends, strict=True) for side in (-width, width)]
        return np.array([*corners, (-ends[0], y, 0), (ends[1], y, 0)], dtype=float)

    lower = [roof() + np.array([0, rng.choice([0, 0, 10, 5]), 0])]
    if rng.random() < 0.5:
        return Stack([lower, [plate(rng, half)]])
    return Stack([lower, turned([roof() * [1, 1, -1]], float(rng.choice([0, 1, 0.5, 0.1])))])


def tips(rng) -> Stack:
    """Draw pyramids whose tips meet corners, edges and facets of a plate, or tips."""
    places = rng.choice(GRID, (rng.integers(1, 4), 2))
    if rng.random() < 0.3:
        places = places + rng.normal(size=places.shape) * 0.1
    base = float(rng.choice([2, 4]))
    pyramids = [np.array([*box((x - base, y - base, -7), (x + base, y + base, -6)), (x, y, 0)]) for x, y in places]
    lower = [box((-14, -14, -10), (14, 14, -6)), *pyramids]
    if rng.random() < 0.3:
        upper = [box((-14, -14, 6), (14, 14, 10)), *(points * [1, 1, -1] for points in pyramids)]
    else:
        upper = [plate(rng, 10.0)] if rng.random() < 0.7 else [lattice_hull(rng, 0, 8)]
    return Stack([lower, upper])


def mirrored(rng) -> Stack:
    """Draw a body and its mirror image, which share a face, an edge or a corner."""
    points = lattice_hull(rng, -10, 0) if rng.random() < 0.6 else rng.normal(size=(9, 3)) * 6
    points = points - [0, 0, points[:, 2].max()]
    signs = rng.choice([-1, 1], 2) if rng.random() < 0.5 else (1, 1)
    return Stack([[points], [points * [*signs, -1]]])


def wedges(rng) -> Stack:
    """Draw wedges on wedges with the same slope, on two or three bodies."""
    rise = float(rng.choice([0.5, 2, 5, 10]))
    wedge = np.array(
        [
            (-10, -10, -10),
            (10, -10, -10),
            (-10, 10, -10),
            (10, 10, -10),
            (-10, -10, -rise),
            (-10, 10, -rise),
            (10, -10, 0),
            (10, 10, 0),
        ],
        dtype=float,
    )
    upper = np.array([(-10, -10, -rise), (-10, 10, -rise), (10, -10, 0), (10, 10, 0), (-10, -10, 6), (-10, 10, 6)], dtype=float)
    if rng.random() < 0.5:
        upper = np.concatenate([upper, [(10, -10, 6), (10, 10, 6)]])
    upper = upper * [1, float(rng.choice([1, 1, 0.5, 1.2])), 1] + rng.choice([0, 0, 0, 2.5]) * np.array([0, 1, 0])
    if rng.random() < 0.3:
        return Stack([[wedge], [upper], [box((-10, -10, 6), (10, 10, 10))]], three_pairs(rng))
    return Stack([[wedge], [upper]])


LOOSE: dict[str, Callable[..., Stack]] = {
    "lattice": lattice,
    "lattice of three": lattice_of_three,
    "lattice unions": lattice_unions,
    "boxes": boxes,
    "crossed bars": crossed_bars,
    "ridges": ridges,
    "tips": tips,
    "mirrored": mirrored,
    "wedges": wedges,
}
