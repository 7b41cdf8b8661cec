"""Two supports on a plate with fixed or floating fasteners, at the worst."""

import numpy as np
import trimesh
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
NOMINAL = N.apart - 2 * N.arm


def solution():
    fixed = 2 * (N.thread / 2 + N.position / 2 + (N.fixed - N.bolt) / 2)
    floating = 2 * (N.position / 2 + N.position / 2 + 2 * (N.floating - N.bolt) / 2)
    return NOMINAL - fixed, NOMINAL + fixed, NOMINAL - floating, NOMINAL + floating


def check():
    ends = []
    for plate, play in ((N.thread, [(N.fixed - N.bolt) / 2]), (N.position, [(N.floating - N.bolt) / 2] * 2)):
        reach = [plate / 2, N.position / 2, *play] * 2
        shifts = [(-r, r) for r in reach]
        signs = np.concatenate([np.ones(len(reach) // 2), -np.ones(len(reach) // 2)])
        ends += [NOMINAL + sign * optimize.linprog(sign * signs, bounds=shifts).fun for sign in (1, -1)]
    return ends


def assembly(is_fixed=True, pull=3.0):
    """Return supports whose holes lie over threads or holes of the plate; forces pull them apart, or push them together."""
    model = tc.Assembly("bolted supports", method=tc.Method(resolution="exact", objective="seating"))
    for side, name in ((-1.0, "left"), (1.0, "right")):
        x = side * N.apart / 2
        hole = N.fixed if is_fixed else N.floating
        axis = parts.slider(model, f"{name} place", N.thread if is_fixed else N.position, along="x", at=(x, 60, 0))
        shape = trimesh.creation.cylinder(N.bolt / 2, 8) if is_fixed else trimesh.creation.annulus(hole / 2, 15, 8)
        anchor = model.part(f"{name} anchor", tc.Mesh(shape), at=(x, 0, -8 if not is_fixed else 0))
        model.locate(anchor, parts.sliding((10, 10, 10), "x", 0.0), on=axis)
        support = model.part(name, tc.Mesh(trimesh.creation.annulus(hole / 2, 15, 8)), at=(x, 0, 0))
        feet = [tc.Locator(f"Z{k}", (px, py, -4), "z", 0.0) for k, (px, py) in enumerate([(5, 0), (-5, 0), (0, 5)])]
        sides = [tc.Locator("Y", (0, 0, 0), "y", 0.0), tc.Locator("turn", (15, 0, 0), "y", 0.0)]
        model.locate(support, [*feet, *sides], floating=True)
        model.force(f"pull {name}", at=support.point(0, 0, 0), vector=(side * pull, 0, 0))
        pin = anchor.face(tc.select.Cylinder(radius=N.bolt / 2)) if is_fixed else None
        bore = support.face(tc.select.Cylinder(radius=hole / 2, inner=True))
        if pin is None:
            bolt = model.part(f"{name} bolt", tc.Mesh(trimesh.creation.cylinder(N.bolt / 2, 24)), at=(x, 0, -4))
            upright = [tc.Locator(f"Z{k}", (px, py, -12), "z", 0.0) for k, (px, py) in enumerate([(5, 0), (-5, 0), (0, 5)])]
            model.locate(
                bolt, [*upright, tc.Locator("Y", (0, 0, 0), "y", 0.0), tc.Locator("turn", (5, 0, 0), "y", 0.0)], floating=True
            )
            pin = bolt.face(tc.select.Cylinder())
            model.contact(
                f"{name} in plate", moving=pin, reference=anchor.face(tc.select.Cylinder(radius=hole / 2, inner=True))
            )
        model.contact(f"{name} fit", moving=bore, reference=pin)
        # The hole's own place in its support moves the face against the hole.
        model.variable(f"{name} hole", N.position, drives={f"{name} place.S": 1.0})
    left, right = (part for part in model.parts if part.name in ("left", "right"))
    model.measure("distance", left.point(N.arm, 0, 0), to=right.point(-N.arm, 0, 0), along="x")
    return model


def answers():
    estimates, count = [], 0
    for is_fixed in (True, False):
        for end, pull in ((0, -3.0), (1, 3.0)):
            extremes = tc.analyses.worst_case(assembly(is_fixed, pull), solver="daqp")
            estimates.append(an.within(extremes.worst.sel(measure="distance", state="corrected").values[end], 1e-6))
            count += int(extremes.by_status.sum())
    return an.Answers(estimates, count)
