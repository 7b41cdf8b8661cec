"""Stacks of two or three bodies that coincide, or nearly: families of shapes, each from a random generator.

A body is a list of convex pieces, corners (point, 3) [mm]. The lowest body comes first; bodies meet near the height 0, and a
third one near the height 6. Nothing is located, turned or simulated here.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

GRID = np.array([-10.0, -5.0, 0.0, 5.0, 10.0])  # mm
HEIGHT = 6.0  # mm, of the second body of three
LEAST_VOLUME = 100.0  # mm^3, of a random hull
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


def terraces(rng) -> Stack:
    """Draw columns on a grid, and columns that fill the space above: unions that share faces, and fit without clearance."""
    count, gap, drop = int(rng.integers(2, 4)), clearance(rng), clearance(rng)
    lines = np.linspace(-9, 9, count + 1)
    heights = rng.choice([-4.0, -2.0, 0.0], (count, count))
    lower, upper = [box((-9, -9, -8), (9, 9, -4))], [box((-9, -9, 4), (9, 9, 8))]
    padded = np.pad(heights, 1, constant_values=-9.0)
    for i, j in itertools.product(range(count), repeat=2):
        height = heights[i, j]
        if height > -4:
            lower.append(box((lines[i], lines[j], -4), (lines[i + 1], lines[j + 1], height)))
        beside = np.array([[padded[i, j + 1], padded[i + 2, j + 1]], [padded[i + 1, j], padded[i + 1, j + 2]]])
        walls = gap * (beside > height)  # (axis, side)
        low, high = (lines[i] + walls[0, 0], lines[j] + walls[1, 0]), (lines[i + 1] - walls[0, 1], lines[j + 1] - walls[1, 1])
        upper.append(box((*low, height + drop), (*high, 4)))
    return Stack([lower, upper])


def keys(rng) -> Stack:
    """Draw a key on a block, in a keyway of the same profile: rectangle, wedge, trapezium or dovetail."""
    depth, narrow, wide = float(rng.choice([1, 3, 5])), *np.sort(rng.choice([0, 2, 4, 5], 2, replace=False))
    profile = str(rng.choice(["rectangle", "open", "dovetail"]))
    floor, mouth = {"rectangle": (wide, wide), "open": (narrow, wide), "dovetail": (wide, max(narrow, 1))}[profile]
    gap, drop = clearance(rng), clearance(rng)
    if profile == "dovetail":
        drop = min(drop, gap * depth / (floor - mouth)) if floor > mouth else drop
    ends = np.array([-10.0, 10.0])
    blind = rng.random() < 0.25
    lower = [box((-10, -10, -10), (10, 10, -depth))]
    for side in (-1, 1):
        lower.append(bar([(side * floor, -depth), (side * mouth, 0), (side * 10, 0), (side * 10, -depth)], *ends))
    if blind:
        lower.append(box((8, -10, -10), (10, 10, 0)))
    length = (-10.0 + float(rng.choice([0, 0, 2, -2])), 8.0 - clearance(rng) if blind else float(rng.choice([10, 10, 8, 12])))
    key = [(side * (y - gap), z + drop) for side in (-1, 1) for y, z in ((floor, -depth), (mouth, 0))]
    if narrow == gap == 0 and profile == "open":
        key = [(0, -depth + drop), (-mouth, drop), (mouth, drop)]
    upper = [bar(key, *length), box((length[0], -10, drop), (length[1], 10, 6))]
    return Stack([lower, upper], undercut=profile == "dovetail")


def combs(rng) -> Stack:
    """Draw two combs in each other, with straight or pointed teeth."""
    count, gap, drop = int(rng.integers(1, 5)), clearance(rng), clearance(rng)
    half = 10 / (2 * count + 1)
    top, bottom = (0.0, half) if rng.random() < 0.4 else (half, half)  # half widths of teeth; those of the lower comb
    lower, upper = [box((-10, -10, -10), (10, 10, -4))], [box((-10, -10, drop), (10, 10, 5))]
    if top == 0:
        gap, bottom = 0.0, 2 * half
    for k in range(2 * count + 1):
        y = -10 + (2 * k + 1) * half
        if k % 2 == 0:
            lower.append(bar([(y - half, -4), (y + half, -4), (y - top, 0), (y + top, 0)][: 4 if top else 3], -10, 10))
        else:
            foot = max(top - gap, 0.0)
            tooth = [(y - bottom + gap, drop), (y + bottom - gap, drop), (y - foot, drop - 4), (y + foot, drop - 4)]
            upper.append(bar(tooth[: 4 if top else 3], -10, 10))
    return Stack([lower, upper])


def pegs(rng) -> Stack:
    """Draw a peg with three to eight sides in a hole of the same outline."""
    sides, gap = int(rng.integers(3, 9)), clearance(rng)
    angles = 2 * np.pi * (np.arange(sides) + 0.5 * rng.integers(2)) / sides
    outline = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    inner, outer = outline * 5, outline * 10
    depth = float(rng.choice([2, 4]))
    lower = [prism([inner[k], inner[k - 1], outer[k - 1], outer[k]], -depth, 0) for k in range(sides)]
    if rng.random() < 0.5:
        lower.append(prism(outer, -8, -depth))
    apothem = 5 * np.cos(np.pi / sides)
    peg = inner * (1 - gap / apothem)
    head = float(rng.choice([5, 5 + 1e-3, 8, 10, 12]))
    upper = [prism(peg, -depth + clearance(rng), 0), prism(outline * head, clearance(rng), 5)]
    upper[0] = prism(peg, upper[0][:, 2].min(), upper[1][:, 2].min())
    return Stack([lower, turned(upper, 0.0)])


def corners(rng) -> Stack:
    """Draw a block in a corner of one or two walls: of one body, or of two bodies that stand beside each other."""
    gap = clearance(rng)
    floor, wall = box((-10, -10, -6), (10, 10, 0)), box((-14, -10, -6), (-10, 10, 6))
    second = box((-14, 10, -6), (10, 14, 6))
    block = [box((-10 + gap, float(rng.choice([-10, -5])), 0), (float(rng.choice([10, 5])), 10 - gap * rng.integers(2), 6))]
    if rng.random() < 0.5:
        return Stack([[floor, wall, *([second] if rng.random() < 0.5 else [])], block])
    return Stack([[floor], [wall], block], ((2, 0), (2, 1), (1, 0)) if rng.random() < 0.5 else ((2, 0), (2, 1)))


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


FAMILIES: dict[str, Callable[..., Stack]] = {
    "lattice": lattice,
    "lattice of three": lattice_of_three,
    "lattice unions": lattice_unions,
    "boxes": boxes,
    "crossed bars": crossed_bars,
    "ridges": ridges,
    "tips": tips,
    "mirrored": mirrored,
    "terraces": terraces,
    "keys": keys,
    "combs": combs,
    "pegs": pegs,
    "corners": corners,
    "wedges": wedges,
}
