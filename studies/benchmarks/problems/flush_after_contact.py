"""A block that penetrates a plane lands flush on it by the paper's quadratic program."""

import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
FLAT = 5.0  # mm: points whose second singular value is below this are nearly on one line


def solution():
    return (0.0,)


def check():
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(20):
        points = np.column_stack([np.ones(12), rng.uniform([0, 0], [N.length, N.width], (12, 2)) / N.length])
        gaps = points @ rng.normal([-1, 0, 0], 0.3)
        active = gaps < 0
        penetrating = points[active]
        outside = {"type": "ineq", "fun": lambda q, g=gaps, p=points: g + p @ q}
        start = np.array([2.0, 0, 0])
        step = optimize.minimize(
            lambda q, penetrating=penetrating: np.sum((penetrating @ q) ** 2),
            start,
            method="SLSQP",
            constraints=outside,
            options={"ftol": 1e-14},
        ).x
        if active.sum() >= 3:
            worst = max(worst, np.abs(gaps + points @ step).max())
    return (worst,)


def assembly():
    model = tc.Assembly("flush", method=tc.Method(resolution="linearized"))
    base = model.part("base", tc.Box(2 * N.length, 2 * N.width, 10))
    top = model.part("top", tc.Box(N.length, N.width, 10), at=(N.length, N.width / 2, 10))
    for part, side in ((base, "-y"), (top, "+y")):
        scheme = tc.three_two_one(part.face("-z"), part.face(side), part.face("-x"), inset=5)
        model.locate(part, scheme, tolerance=N.t)
    model.contact("interface", moving=top.face("-z"), reference=base.face("+z"), points=200)
    model.measure("corner", top.point(N.length, 0, 10), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 1000, keep="poses", solver="qpoases")
    contact, R, t = results["contact"], results.rotation.values, results.translation.values
    points, feet, normals = (contact[name].values for name in ("moving_point", "reference_point", "reference_normal"))

    def gaps(state):
        moving, reference = (
            place @ R[:, state, part].swapaxes(1, 2) + t[:, state, part, None] for place, part in ((points, 1), (feet, 0))
        )
        return ((moving - reference) * (normals @ R[:, state, 0].swapaxes(1, 2))).sum(axis=2)

    raw, corrected = gaps(0), gaps(1)
    largest = 0.0
    for before, after in zip(raw, corrected, strict=True):
        active = points[before < 0]
        if len(active) >= 3 and np.linalg.svd(active - active.mean(axis=0))[1][1] > FLAT:
            largest = max(largest, np.abs(after).max())
    return an.Answers([an.within(largest, 1e-3)], len(raw))
