"""Wedges around an axis."""

import numpy as np
import trimesh
from scipy.stats import norm

import tolcontact as tc
from tests.cases.frames import Frame
from tests.cases.locators import parked


def ring(wedges: int = 8) -> tc.Assembly:
    """Free wedges side by side around an axis: the loop of contacts closes."""
    a = tc.Assembly("ring")
    half = np.pi / wedges
    corners = [(r * np.cos(s * half), r * np.sin(s * half), z) for r in (20, 40) for s in (-1, 1) for z in (0, 10)]
    wedge = trimesh.Trimesh(corners).convex_hull
    out, along = np.array([np.cos(half), np.sin(half), 0]), np.array([-np.sin(half), np.cos(half), 0])
    x = 20 * np.cos(half)
    locators = [
        tc.Locator("A1", (x + 1, 0, 0), "z"),
        tc.Locator("A2", (35, -5, 0), "z"),
        tc.Locator("A3", (35, 5, 0), "z"),
        tc.Locator("B1", (x, -5, 5), "x"),
        tc.Locator("B2", (x, 5, 5), "x"),
        tc.Locator("C", tuple(30 * out * [1, -1, 1] + [0, 0, 5]), "y"),
    ]
    parts = []
    for k in range(wedges):
        part = a.part(f"wedge {k}", tc.Mesh(wedge), rotation=(0, 0, 2 * half * k), fixed=False)
        a.locate(part, locators, tolerance=0.5)
        parts.append(part)

    def towards(direction):
        return lambda c, n: n @ direction > 0.99

    ahead, behind = towards(along), towards(along * [1, -1, 1])
    for k, part in enumerate(parts):
        a.contact(f"joint {k}", moving=part.face(ahead), reference=parts[(k + 1) % wedges].face(behind), points=20)
    a.measure("width", parts[0].point(x, 0, 5), to=parts[wedges // 2].point(x, 0, 5), along="x", tolerance=1)
    return a


def hinged_ring(wedges: int, sigma: float = 0.05) -> tc.Assembly:
    """Wedges hinged on one axis, one of them fixed, each face of each askew by its own angle; pushed together.

    They close where the sum of the angles leaves room: see `excess_of_hinged_ring`. A face is a plate of its own, which turns
    about the axis by its locator at 30 mm.
    """
    a = tc.Assembly("hinged ring")
    half, open_ = np.pi / wedges, ring_opening(wedges, sigma) / 30 / (2 * wedges)
    faces = []
    for k in range(wedges):
        c, s = np.cos(2 * half * k), np.sin(2 * half * k)
        hub = a.part(f"hub {k}", tc.Box(20, 2, 10), at=(20 * c, 20 * s, 0), rotation=(0, 0, 2 * half * k), fixed=k == 0)
        feet = [tc.Locator(f"Z{i}", p, "z", 0) for i, p in enumerate([(0, 0, 0), (20, 0, 0), (10, 2, 0)])]
        axis = [tc.Locator("X", (-20, 0, 0), "x", 0), tc.Locator("Y", (-20, 0, 0), "y", 0)]
        last = [tc.Locator("T", (10, 0, 0), "y", 0)] if k == 0 else parked("T:10,0,0:y", away=20)
        a.locate(hub, [*feet, *axis, *last])
        if k:
            a.force(f"push {k}", at=hub.point(10, 0, 0), vector=(-0.1 * s, 0.1 * c, 0))
        both = {}
        for side, sign, y in (("ahead", 1, 1.0), ("behind", -1, 0.0)):
            angle = 2 * half * k + sign * (half - open_)
            frame = Frame(turn=(0, 0, angle))
            plate = a.part(f"{side} {k}", tc.Box(20, 1, 10), **frame.place(20, -y, 0), fixed=True)
            rest = [tc.Locator(f"Z{i}", p, "z", 0) for i, p in enumerate([(0, 0, 0), (20, 0, 0), (10, 1, 0)])]
            about = [tc.Locator("X", (-20, y, 0), "x", 0), tc.Locator("Y", (-20, y, 0), "y", 0)]
            a.locate(plate, [*rest, *about, tc.Locator("T", (10, y, 0), "y", norm(0, sigma))], on=hub)
            both[side] = plate
        faces.append(both)
    for k in range(wedges):
        moving, reference = faces[(k + 1) % wedges]["behind"].face("-y"), faces[k]["ahead"].face("+y")
        a.contact(f"joint {k}", moving=moving, reference=reference, points=9, within=5)
    a.measure("x", faces[0]["ahead"].point(0, 0, 0), along="x", tolerance=1)
    return a


def ring_opening(wedges: int, sigma: float = 0.05) -> float:
    """What the hinged ring is open nominally, at 30 mm from the axis [mm]: some 19 % of the draws exceed it."""
    return 0.87 * sigma * np.sqrt(2 * wedges)


def excess_of_hinged_ring(nominal, deviations: np.ndarray, sigma: float = 0.05) -> np.ndarray:
    """By how much (realization,) the wedges are wider than the full turn, at 30 mm from the axis [mm]."""
    labels = nominal.locators.labels
    wide = sum(
        (1.0 if label.startswith("ahead") else -1.0) * deviations[:, column]
        for column, label in enumerate(labels)
        if label.endswith(".T") and not label.startswith("hub")
    )
    return wide - ring_opening(sum(label.startswith("ahead") for label in labels) // 6, sigma)
