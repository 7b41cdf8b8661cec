"""Families of stacks that fit into each other, as unions of convex pieces: each from a random generator."""

import itertools
from collections.abc import Callable

import numpy as np

from studies.certificates.stacks import Stack, bar, box, clearance, prism


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
    key = [(side * max(y - gap, 0.0), z + drop) for side in (-1, 1) for y, z in ((floor, -depth), (mouth, 0))]
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
    return Stack([lower, upper])


def corners(rng) -> Stack:
    """Draw a block in a corner of one or two walls: of one body, or of two bodies that stand beside each other."""
    gap = clearance(rng)
    floor, wall = box((-10, -10, -6), (10, 10, 0)), box((-14, -10, -6), (-10, 10, 6))
    second = box((-14, 10, -6), (10, 14, 6))
    block = [box((-10 + gap, float(rng.choice([-10, -5])), 0), (float(rng.choice([10, 5])), 10 - gap * rng.integers(2), 6))]
    if rng.random() < 0.5:
        return Stack([[floor, wall, *([second] if rng.random() < 0.5 else [])], block])
    return Stack([[floor], [wall], block], ((2, 0), (2, 1), (1, 0)) if rng.random() < 0.5 else ((2, 0), (2, 1)))


MATING: dict[str, Callable[..., Stack]] = {
    "terraces": terraces,
    "keys": keys,
    "combs": combs,
    "pegs": pegs,
    "corners": corners,
}
