"""Do intervals of rare events cover? Events of known probability, by scores in closed form and by models on the engine.

Beside the coverage stand the misses without a warning, the precision (upper bound over estimate, median), the realizations that
were simulated, and those that plain Monte Carlo would need for this precision. A cell is an event with a number of
realizations. Its coverage is below the target beyond its scatter if its own exact 95 % interval is.
"""

import argparse
import itertools
import math
import time

import casadi as ca
import numpy as np
from scipy import integrate, stats
from scipy.special import ndtr, stdtrit

import tolcontact as tc
from tolcontact.statistics.intervals import proportion_of
from tolcontact.statistics.rare import sufficient_tail

Q, PHI = stats.norm.sf, stats.norm.pdf
SLOPES = np.geomspace(0.1, 1.0, 20)
CENTRE, RADIUS = np.array([2.0, -1.5, 1.0]), 0.05
PULL = 190.0
SIZES = (30_000, 40_000, 50_000, 60_000, 80_000, 100_000, 120_000)  # realizations of a search, from the least number on
TARGET = 92.0


def over_normal(f, *points):
    spans = itertools.pairwise([-12, *points, 12])
    return sum(integrate.quad(f, *span, epsabs=0, epsrel=1e-9, limit=500)[0] for span in spans)


def four_branches(u, base=4.5, k=9.2):
    a, b = (u[:, 0] + u[:, 1]) / np.sqrt(2), (u[:, 0] - u[:, 1]) / np.sqrt(2)
    return -np.minimum(base + 0.2 * b**2 - np.abs(a), k / np.sqrt(2) - np.sqrt(2) * np.abs(b))


def heavy_probability():
    t = stats.t(3)
    spans = (-np.inf, 0), (0, PULL / 2)
    inner = [integrate.quad(lambda x: t.pdf(x) * t.sf(PULL - x), *span, epsrel=1e-10)[0] for span in spans]
    return 2 * sum(inner) + t.sf(PULL / 2) ** 2


def stuck(u):
    return (np.abs(u[:, :3].sum(axis=1)) / np.sqrt(3) > 4.9) | (u[:, 3:].sum(axis=1) / np.sqrt(3) > 4.6)


def two_ways_of_many(u):
    a, b = u[:, :10].sum(axis=1) / np.sqrt(10), u[:, 10:].sum(axis=1) / np.sqrt(10)
    return np.maximum(0.1 * a, b - 4.0) - 0.5


# name: score, number of contributors, probability, whether the score leads
SCORES = {
    "two ways": (lambda u: np.maximum(0.1 * u[:, 0], u[:, 1] - 3.5) - 0.5, 2, 1 - ndtr(5) * ndtr(4), True),
    "two ways, 20-D": (two_ways_of_many, 20, Q(5) + Q(4.5) - Q(5) * Q(4.5), True),
    "four branches": (
        four_branches, 2,
        1 - integrate.quad(lambda b: PHI(b) * (1 - 2 * Q(4.5 + 0.2 * b * b)), -4.6, 4.6, epsabs=1e-14)[0], True,
    ),
    "20 regions, 10-D": (
        lambda u: (SLOPES * (np.concatenate([u, -u], axis=1) - 4.5)).max(axis=1), 10, 1 - (1 - 2 * Q(4.5)) ** 10, True,
    ),
    "needle": (
        lambda u: RADIUS - np.sqrt(((u - CENTRE) ** 2).sum(axis=1)), 3,
        float(stats.ncx2.cdf(RADIUS**2, 3, (CENTRE**2).sum())), True,
    ),
    "linear, 40-D": (lambda u: u.sum(axis=1) / np.sqrt(40) - 5.5, 40, Q(5.5), True),
    "parabola": (
        lambda u: u[:, 1] + 0.5 * (u[:, 0] - 0.1) ** 2 - 9, 2,
        over_normal(lambda x: PHI(x) * Q(9 - 0.5 * (x - 0.1) ** 2), -4, 0, 4), True,
    ),
    "waves": (
        lambda u: u[:, 0] + 0.8 * np.sin(4 * u[:, 1]) - 5.2, 2,
        over_normal(lambda x: PHI(x) * Q(5.2 - 0.8 * np.sin(4 * x)), -4, -2, 0, 2, 4), True,
    ),
    "heavy tails": (lambda u: stdtrit(3, ndtr(u[:, 0])) + stdtrit(3, ndtr(u[:, 1])) - PULL, 2, heavy_probability(), True),
    "shell, 10-D": (lambda u: np.sqrt((u**2).sum(axis=1)) - 6.5, 10, float(stats.chi2.sf(6.5**2, 10)), True),
    "six ways, 30-D": (lambda u: np.where(u[:, :6].max(axis=1) > 4.2, 1.0, -1.0), 30, 1 - ndtr(4.2) ** 6, False),
    "yes or no": (lambda u: np.where(stuck(u), 1.0, -1.0), 6, 1 - (1 - 2 * Q(4.9)) * (1 - Q(4.6)), False),
}  # fmt: skip


def seat(name, cause, limits):
    """Return a block over a table, lifted by a cause; contact keeps its height at 0 or more."""
    a = tc.Assembly(name)
    table, block = a.part("table", tc.Box(100, 50, 10), fixed=True), a.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0)
    a.variable("lift", cause, drives={f"block.A{k}": 1.0 for k in (1, 2, 3)})
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12)
    a.measure("height", block.point(25, 12.5, 10), along="z", limits=limits)
    return a


def two_causes():
    """Return a block of height max(v, s - 3.5): v lifts the block, s the table; sd 0.1 and 1."""
    a = tc.Assembly("two causes")
    table, block = a.part("table", tc.Box(100, 50, 10), at=(0, 0, -3.5)), a.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    for part, cause in ((table, stats.norm(0, 1.0)), (block, stats.norm(0, 0.1))):
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5), tolerance=0)
        lift = {f"{part.name}.A{k}": 1.0 for k in (1, 2, 3)}
        a.variable(f"lift of {part.name}", tc.Tolerance(distribution=cause), drives=lift)
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12, within=10)
    a.measure("height", block.point(25, 12.5, 10), along="z", limits=(None, 0.5))
    return a


def four_blocks():
    """Return four blocks, each with a deviation of its own unit, of which the highest counts."""
    a = tc.Assembly("four blocks")
    a.part("ground", tc.Box(1, 1, 1), fixed=True, at=(0, 0, -50))
    blocks = []
    for k, sd in enumerate((0.05, 0.1, 0.3, 1.0)):
        block = a.part(f"block {k}", tc.Box(10, 10, 10), at=(20.0 * k, 0, 0))
        a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2), tolerance=0)
        cause = tc.Tolerance(distribution=stats.norm(-(4.2 + 0.1 * k) * sd, sd))
        a.variable(f"lift {k}", cause, drives={f"block {k}.A{i}": 1.0 for i in (1, 2, 3)})
        blocks.append(block)

    def highest(poses):
        heights = [poses.translation(block)[2] for block in blocks]
        return ca.fmax(ca.fmax(heights[0], heights[1]), ca.fmax(heights[2], heights[3]))

    a.measure("highest", highest, limits=(None, 0.0))
    return a


def tight():
    """Return a block between two walls 0.45 mm wider, of which one moves by N(0, 0.1): it does not fit beyond 4.5 sd."""
    a = tc.Assembly("tight")
    left = a.part("left wall", tc.Box(10, 40, 20), fixed=True)
    right = a.part("right wall", tc.Box(10, 40, 20), at=(40.45, 0, 0))
    block = a.part("block", tc.Box(30, 20, 10), at=(10.225, 10, 5))
    a.locate(right, tc.three_two_one(right.face("-z"), right.face("-y"), right.face("-x"), inset=2), tolerance=0)
    a.variable("width", tc.Tolerance(distribution=stats.norm(0, 0.1)), drives={"right wall.C1": 1.0})
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2), tolerance=0)
    a.measure("place", block.point(15, 10, 5), along="x")
    a.contact("left", moving=block.face("-x"), reference=left.face("+x"), within=2)
    a.contact("right", moving=block.face("+x"), reference=right.face("-x"), within=2)
    return a


# name: model, event, probability, method
MODELS = {
    "atom at a limit": (seat("atom", tc.Tolerance(0.6), (0, 0.4)), "height outside limits", Q(4), "linearized"),
    "two causes": (two_causes(), "height outside limits", 1 - ndtr(5) * ndtr(4), "linearized"),
    "four blocks": (
        four_blocks(),
        "highest outside limits",
        1 - np.prod([ndtr(4.2 + 0.1 * k) for k in range(4)]),
        "linearized",
    ),
    "rarer": (seat("rarer", tc.Tolerance(0.6), (None, 0.55)), "height outside limits", Q(5.5), "linearized"),
    "does not fit": (tight(), "not assemblable", Q(4.5), "exact"),
}


def found_by_score(name, samples, seed):
    score, dimensions, _, leads = SCORES[name]
    rng = np.random.default_rng([seed, len(name), samples])
    used = 0

    def counted(u):
        nonlocal used
        used += len(u)
        return score(u)

    tail = sufficient_tail(counted, dimensions, samples=samples, rng=rng, leads=leads)
    return (*tail.probability, tail.disagreement, used)


def found_by_model(program, event, samples, seed):
    tails = tc.analyses.tails(program, samples=samples, seed=seed).sel(event=event)
    return (*tails.probability.values, float(tails.disagreement), int(tails.simulated))


def row(name, samples, truth, found, seconds):
    """Print the row of a cell, and return whether its coverage is below the target, and whether beyond its scatter."""
    estimate, lower, upper, disagreement, used = np.array(found, dtype=float).T
    covered, warned = (lower <= truth) & (truth <= upper), disagreement > 1
    precision = float(np.median(upper / np.maximum(estimate, 1e-300)))
    plain = (1 - truth) / truth * (1.96 / math.log(precision)) ** 2 if precision > 1 else np.inf
    cells = [
        name, samples, f"{truth:.2g}", *(f"{100 * hits.mean():.0f}" for hits in (covered, ~covered & ~warned, warned)),
        f"{np.median(estimate) / truth:.2f}", f"{precision:.2f}", f"{used.mean():.0f}", f"{plain:.1g}", f"{seconds:.2f}",
    ]  # fmt: skip
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)
    share, _, upper = (100 * end for end in proportion_of(int(covered.sum()), len(covered)))
    return share < TARGET, upper < TARGET


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--samples", type=int, nargs="*", default=SIZES)
    parser.add_argument("--only", nargs="*", default=[*SCORES, *MODELS])
    options = parser.parse_args()
    print("| event | samples | p | covered % | missed unwarned % | warned % | median / p ", end="")
    print("| upper / estimate | realizations | plain | s |\n" + "|---" * 11 + "|")
    cells = []
    for name, samples in itertools.product(options.only, options.samples):
        start = time.perf_counter()
        if name in SCORES:
            truth, found = SCORES[name][2], [found_by_score(name, samples, seed) for seed in range(options.seeds)]
        else:
            model, event, truth, resolution = MODELS[name]
            method = tc.Method(resolution=resolution, objective="all points")
            program = tc.build(model, solver="daqp", method=method)
            found = [found_by_model(program, event, samples, seed + 1) for seed in range(options.seeds)]
        cells.append(row(name, samples, truth, found, (time.perf_counter() - start) / options.seeds))
    below, surely = np.sum(cells, axis=0)
    print(f"\n{len(cells)} cells, {below} covered in less than {TARGET:g} %, {surely} of them beyond the scatter")


if __name__ == "__main__":
    main()
