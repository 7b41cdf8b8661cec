"""Two channels without clearance: the model is models/channel.py."""

import importlib

import numpy as np

from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return 0.0, 0.0


def check():
    # Any motion X of the outer channel: the inner one moved by X too keeps every gap n . (p - q) at 0.
    rng = np.random.default_rng(1)
    inner = np.array([(x, y, z) for x in (-N.width / 2, N.width / 2) for y in (0, N.depth) for z in (0, N.height)], dtype=float)
    normals = np.where(inner[:, :1] < 0, 1.0, -1.0) * [1, 0, 0]
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.normal(size=3)
    gaps = ((inner @ turn.T + shift - (inner @ turn.T + shift)) * (normals @ turn.T)).sum(axis=1)
    return float((gaps < 0).mean()), float(-gaps.min())


def assembly():
    return importlib.import_module("models.channel").assembly()


def answers():
    results = an.simulated(assembly(), 1000)
    penetration = max(0.0, -float(results.gap_min.sel(state="corrected").min()))
    return an.Answers([an.within(an.not_assembled(results).mean(), 0), an.within(penetration, 1e-8)], 1000)
