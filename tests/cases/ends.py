"""Bodies that end within reach of contact: chamfers, tips, needles, ribs, roofs; with their convex pieces, for a judge."""

import numpy as np
import trimesh

import tolcontact as tc
from studies.certificates.ends import METHOD

TIPS = ((-15.0, -12.0), (15.0, -12.0), (0.0, 14.0))
PLATE = np.array([(x, y, z) for x in (-30.0, 30.0) for y in (-25.0, 25.0) for z in (0.0, 3.0)])


def chamfered_block():
    """A block of 40 x 30 mm whose top has chamfers of 1 mm."""
    corners = ((20, 15, -10), (20, 15, -1), (19, 14, 0))
    return np.array([(s * x, u * y, z) for x, y, z in corners for s in (-1, 1) for u in (-1, 1)], dtype=float)


def tapered(x, y, top, bottom=3.0, depth=8.0):
    """A square needle or pad: `top` and `bottom` are half widths [mm]."""
    ends = ((bottom, -depth), (top, 0.0))
    return np.array([(x + a, y + b, z) for half, z in ends for a in (-half, half) for b in (-half, half)])


def cone(radius, height):
    """A cone of 24 facets whose tip is at height 0, beside the origin."""
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(24, -height)])
    return np.vstack([rim, np.zeros(3)]) + np.array([0.7, -0.4, 0])


def roof(along, up, length=40.0, width=10.0, height=6.0):
    """A roof whose ridge runs along x or y at height 0, above it or below."""
    sections = [(-width, -height), (width, -height), (0, 0)]
    points = np.array([(e, w, z if up else -z) for e in (-length / 2, length / 2) for w, z in sections])
    return points if along == "x" else points[:, [1, 0, 2]]


RIB = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-15.0, 15.0) for z in (-5.0, 0.0)])
# by name: pieces of the moving and of the reference body, clearance, ranges of heights and of sideways shifts [mm]
CASES = {
    "chamfer": ([PLATE], [chamfered_block()], 0.05, 0.0, 0.6),
    "chamfer without clearance": ([PLATE], [chamfered_block()], 0.0, 0.0, 0.6),
    "needles": ([PLATE], [tapered(*tip, 0.2) for tip in TIPS], 0.3, 0.0, 3.0),
    "needles, tilted": ([PLATE], [tapered(*tip, 0.2) for tip in TIPS], 0.0, 1.0, 1.0),
    "chamfered pads": ([PLATE], [tapered(*tip, 3.0, 4.0, 1.0) for tip in TIPS], 0.0, 1.0, 1.0),
    "cone": ([PLATE], [cone(8, 6)], 0.0, 1.0, 1.0),
    "steep cone": ([PLATE], [cone(3, 12)], 0.0, 1.0, 1.0),
    "cone above": ([cone(8, 6) * [1, 1, -1]], [PLATE * [1, 1, -1]], 0.0, 1.0, 1.0),
    "rib": ([PLATE], [RIB], 0.0, 1.0, 1.0),
    "roof": ([PLATE], [roof("x", True)], 0.0, 1.0, 1.0),
    "crossing roofs": ([roof("y", False)], [roof("x", True)], 0.0, 1.0, 1.0),
    "ridge over an edge": ([roof("x", False, 80.0)], [chamfered_block()[:, [1, 0, 2]] - [12, 0, 0]], 0.0, 1.0, 1.0),
}


def case(name, method=METHOD, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), **contact):
    """Return the assembly of a case, and the pieces of its moving and its reference body."""
    moving, reference, clearance, height, sideways = CASES[name]
    moving = [points + np.array([0, 0, clearance]) for points in moving]
    a = tc.Assembly(name, method=method)
    r, m = (
        a.part(part, tc.Mesh(trimesh.util.concatenate([trimesh.convex.convex_hull(points) for points in pieces])),
               at=shift, rotation=turn, fixed=part == "reference" or None)
        for part, pieces in (("reference", reference), ("moving", moving))
    )  # fmt: skip
    feet = ((-18, -18, 0), (18, -18, 0), (0, 18, 0))
    rows = [*((p, "z") for p in feet), ((-10, 0, 0), "y"), ((10, 0, 0), "y"), ((0, 0, 0), "x")]
    a.locate(m, [tc.Locator(f"L{k}", p, along, height if along == "z" else sideways) for k, (p, along) in enumerate(rows)])
    down, up = m.face(lambda c, n: n[:, 2] < -0.05), r.face(lambda c, n: n[:, 2] > 0.05)
    a.contact("contact", moving=down, reference=up, **contact)
    for along in "xyz":
        a.measure(along, m.point(20, 20, 0), along=along, tolerance=1)
    return a, [reference, moving]


def ring(inner, outer, sections, low, high, turn=0.0):
    """A ring of flat sections: its mesh, and its convex pieces."""
    angles = np.linspace(0, 2 * np.pi, sections, endpoint=False) + turn
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    corners = np.concatenate([np.column_stack([r * circle, np.full(sections, z)]) for z in (low, high) for r in (inner, outer)])
    here, there = np.arange(sections), np.roll(np.arange(sections), -1)
    inner_low, outer_low, inner_high, outer_high = (k * sections + np.stack([here, there]) for k in range(4))
    sides = ((outer_low, outer_high), (outer_high, inner_high), (inner_high, inner_low), (inner_low, outer_low))
    faces = [np.stack([a[0], a[1], b[1]], axis=1) for a, b in sides] + [np.stack([a[0], b[1], b[0]], axis=1) for a, b in sides]
    pieces = [corners[np.concatenate([of[:, k] for of in (inner_low, outer_low, inner_high, outer_high)])] for k in here]
    return trimesh.Trimesh(corners, np.concatenate(faces), process=False), pieces


def prism(outline, low, high):
    """A prism along y over an outline (corner, 2) in x and z: its points."""
    return np.array([(x, y, z) for x, z in outline for y in (low, high)], dtype=float)


def nut_over_washer():
    """A hexagonal nut with a hexagonal hole, whose corners hang over the rim of a washer."""
    return ring(3.0, 9.0, 6, 0.0, 6.0, 0.1), ring(4.0, 8.4, 24, -2.0, 0.0), 0.0, (0.8, 1.5)


def dovetail():
    """A key in a dovetail groove, 0.1 mm clear, whose flanks end before those of the key."""
    key = prism([(-5, 0.1), (5, 0.1), (8, 4), (-8, 4)], -12, 12) * [1, 1, -1] + [0, 0, 4]
    groove = [
        prism([(-20, -2), (20, -2), (20, 0), (-20, 0)], -8, 8) - [0, 0, 0.1],
        prism([(-20, -0.1), (-8.2, -0.1), (-5.2, 3.8), (-20, 3.8)], -8, 8),
        prism([(20, -0.1), (8.2, -0.1), (5.2, 3.8), (20, 3.8)], -8, 8),
    ]
    body = trimesh.boolean.union([trimesh.convex.convex_hull(points) for points in groove], engine="manifold")
    return (trimesh.convex.convex_hull(key), [key]), (body, groove), 0.0, (0.3, 0.5)


def pin_at_a_rim():
    """A pin of twelve sides whose end stands 0.2 mm in a hole of twelve sides: it leaves the hole, and touches its rim."""
    _, pieces = ring(0.0, 4.0, 12, -0.2, 8.0)
    points = np.unique(np.concatenate(pieces), axis=0)
    return (trimesh.convex.convex_hull(points), [points]), ring(4.15, 10.0, 12, -6.0, 0.0), 0.0, (0.8, 0.8)


WHOLE = {"nut over a washer": nut_over_washer, "dovetail": dovetail, "pin at a rim": pin_at_a_rim}


def whole_case(name, method=METHOD):
    """Return the assembly of a case whose whole surfaces may touch, and the pieces of its moving and its reference body."""
    (moving, moving_pieces), (reference, reference_pieces), _, (height, sideways) = WHOLE[name]()
    a = tc.Assembly(name, method=method)
    r, m = a.part("reference", tc.Mesh(reference), fixed=True), a.part("moving", tc.Mesh(moving))
    feet = ((-8, -8, 0), (8, -8, 0), (0, 8, 0))
    rows = [*((p, "z") for p in feet), ((-8, 0, 0), "y"), ((8, 0, 0), "y"), ((0, 0, 0), "x")]
    a.locate(m, [tc.Locator(f"L{k}", p, along, height if along == "z" else sideways) for k, (p, along) in enumerate(rows)])
    a.contact("contact", moving=m.face(), reference=r.face(), within=2)
    for along in "xyz":
        a.measure(along, m.point(8, 8, 0), along=along, tolerance=1)
    return a, [reference_pieces, moving_pieces]
