"""Problems with known answers, restated, and what tolcontact computes for each.

A figure of a Monte-Carlo run agrees if what is expected lies in its interval, which covers 99.9 % of runs: of some thirty
figures none should be outside. A figure without an interval agrees within the tolerance that stands beside it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

import tolcontact as tc
from tests import cases
from tests.cases.fasteners import fasteners
from tests.cases.pocket import pocket
from tests.helpers import EXACT, PAPER, SEATED, simulate
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, RAW, Status

Z = float(stats.norm.ppf(0.9995))
SEED = 1


@dataclass(frozen=True)
class Figure:
    """What is expected, where that comes from, and what was computed: an interval, or a value and a tolerance."""

    quantity: str
    expected: float
    source: str
    computed: float
    lower: float
    upper: float

    @property
    def agrees(self) -> bool:
        """Whether what is expected lies within the bounds; nothing need be expected."""
        return np.isnan(self.expected) or self.lower <= self.expected <= self.upper

    @property
    def verdict(self) -> str:
        """In a word."""
        if np.isnan(self.expected):
            return "-"
        return "agrees" if self.agrees else "DIFFERS"


@dataclass(frozen=True)
class Problem:
    """A problem: its number and name, its text, and what computes its figures."""

    number: str
    name: str
    text: str
    figures: Callable[[], Iterator[Figure]]


def mean(quantity: str, expected: float, source: str, x: np.ndarray) -> Figure:
    """Of a sample."""
    half = Z * x.std(ddof=1) / np.sqrt(len(x))
    return Figure(quantity, expected, source, x.mean(), x.mean() - half, x.mean() + half)


def variance(quantity: str, expected: float, source: str, x: np.ndarray) -> Figure:
    """Of a sample; its interval from the fourth moment."""
    v = x.var(ddof=1)
    half = Z * np.sqrt((((x - x.mean()) ** 2 - v) ** 2).mean() / len(x))
    return Figure(quantity, expected, source, v, v - half, v + half)


def deviation(quantity: str, expected: float, source: str, x: np.ndarray) -> Figure:
    """Return the standard deviation of a sample."""
    of = variance(quantity, expected, source, x)
    return Figure(quantity, expected, source, *np.sqrt([of.computed, of.lower, of.upper]))


def share(quantity: str, expected: float, source: str, hits: np.ndarray) -> Figure:
    """Share of True, with the exact interval."""
    found = stats.binomtest(int(hits.sum()), len(hits)).proportion_ci(0.999)
    return Figure(quantity, expected, source, hits.mean(), found.low, found.high)


def within(quantity: str, expected: float, source: str, computed: float, tolerance: float) -> Figure:
    """Return a figure that is no estimate."""
    return Figure(quantity, expected, source, computed, computed - tolerance, computed + tolerance)


def gap_of_one_dimension() -> Iterator[Figure]:
    """Yield closed forms of max(0, g) and of the larger of two."""
    for base, tail in ((0, "below a fixed face"), (6, "both vary")):
        _, run = simulate(cases.one_dimensional(base), samples=40_000, seed=SEED, solver="daqp", block=4096)
        height = run["measured"][:, CORRECTED, 0]
        yield mean(f"mean, {tail} [s]", 0.398942 if base == 0 else 0.564190, "closed form", height)
        yield variance(f"variance, {tail} [s2]", 0.340845 if base == 0 else 1 - 1 / np.pi, "closed form", height)
    yield share("share in contact", 0.5, "closed form", run["status"] != Status.UNTOUCHED)


def flush_planes() -> Iterator[Figure]:
    """Gaps of the faces after contact."""
    program, run = simulate(cases.ra1(), samples=1000, seed=SEED, method=PAPER)
    (pair,) = program.nominal.pairs
    poses = run["poses"].reshape(1000, 2, 2, 12)
    R, t = poses[..., :9].reshape(1000, 2, 2, 3, 3), poses[..., 9:]
    P = pair.P_m
    gaps = []
    for k in np.flatnonzero(run["status"] == Status.RESOLVED):
        n = R[k, CORRECTED, 0] @ [0, 0, 1]
        raw = (P @ R[k, RAW, 1].T + t[k, RAW, 1] - t[k, RAW, 0]) @ (R[k, RAW, 0] @ [0, 0, 1]) - 10
        active = P[raw < 0]
        if len(active) >= 3 and np.linalg.svd(active - active.mean(axis=0))[1][1] > 5:
            gaps.append(np.abs((P @ R[k, CORRECTED, 1].T + t[k, CORRECTED, 1] - t[k, CORRECTED, 0]) @ n - 10).max())
    yield within("largest gap left between the faces [mm]", 0.0, "proof", max(gaps), 1e-3)


def papers_assemblies() -> Iterator[Figure]:
    """Where one more run of N = 1000 lies, from ten; the paper's run is one."""
    printed = {"ra1": (0.0632, 7.2158, 0.2734, 2.6799), "ra2": (-0.0014, 4.3534, -0.0664, 0.9521)}
    for name, paper in printed.items():
        program = tc.build(cases.model(name), solver="daqp")
        found = []
        for seed in range(1, 11):
            blocks = [block.measured[..., 0] for block in tc.simulate_blocks(program, samples=1000, seed=seed)]
            x = np.concatenate(blocks)
            found.append([x[:, RAW].mean(), x[:, RAW].var(ddof=1), x[:, CORRECTED].mean(), x[:, CORRECTED].var(ddof=1)])
        runs = np.array(found)
        reach = stats.t.ppf(0.9995, len(runs) - 1) * np.sqrt(1 + 1 / len(runs)) * runs.std(axis=0, ddof=1)
        for k, word in enumerate(("mean, raw", "variance, raw", "mean, contact", "variance, contact")):
            middle = runs[:, k].mean()
            yield Figure(f"{name.upper()}: {word}", paper[k], "paper, N = 1000", middle, middle - reach[k], middle + reach[k])


def extremes_of_fasteners() -> Iterator[Figure]:
    """All features at the ends of their zones."""
    for is_fixed, pull, *expected in ((True, -3, 47, 48.5), (True, 3, 53, 51.5), (False, -3, 46, 48), (False, 3, 54, 52)):
        program = tc.build(fasteners(is_fixed, pull), solver="daqp")
        plate, reach, sign = ("thread", 0.25, np.sign(pull)) if is_fixed else ("hole", 0.5, np.sign(pull))
        at = {f"plate.left {plate}.shift x": -sign * reach, f"plate.right {plate}.shift x": sign * reach}
        at |= {"left.hole.shift x": sign / 2, "right.hole.shift x": -sign / 2}
        block = simulate_block(program, np.array([[at.get(label, 0.0) for label in program.nominal.contributors]]))
        kind = f"{'fixed' if is_fixed else 'floating'}, {'largest' if pull > 0 else 'least'}"
        for word, truth, computed in zip(("float", "no float"), expected, block.measured[0, 1], strict=True):
            yield within(f"{kind}, {word} [mm]", truth, "documented", computed, 1e-6)


def pocket_of_four_freedoms() -> Iterator[Figure]:
    """Yield figures of the smaller of two gaps."""
    gaps = tc.run(pocket(), samples=400_000, seed=SEED, surfaces=0, fields="none", keep="measures")
    least = gaps.measured.sel(state="raw").values.min(axis=1)
    yield share("P(gap < 0)", 0.0522305, "quadrature", least < 0)
    yield mean("mean [mm]", 0.14170, "quadrature", least)
    yield deviation("standard deviation [mm]", 0.08532, "quadrature", least)


def pins_in_slots() -> Iterator[Figure]:
    """Yield the share of realizations that the solver calls not assemblable."""
    _, run = simulate(cases.square_pins(), samples=20_000, seed=SEED, method=SEATED)
    yield share("share that cannot be assembled", 0.049133, "2e7 draws", run["status"] == Status.NOT_ASSEMBLABLE)


def clutch() -> Iterator[Figure]:
    """Yield figures of the angle that contact and a spring determine."""
    program, run = simulate(cases.model("clutch"), samples=2000, seed=SEED, solver="daqp", method=cases.model("clutch").method)
    of = dict(zip(program.nominal.contributors, run["deviations"].T, strict=True))
    a = 27.645 + of["hub.flat.offset"]
    c, e = 11.43 + of["roller.barrel.size"] / 2, 50.8 + of["ring.bore.size"] / 2
    angle = run["measured"][:, CORRECTED, 0]
    off = np.abs(angle - np.degrees(np.arccos((a + c) / (e - c)))).max()
    yield within("largest difference from the formula [deg]", 0.0, "closed form", off, 1e-5)
    yield mean("mean [deg]", 7.01477, "8e6 draws", angle)
    yield deviation("standard deviation [deg]", 0.21971, "8e6 draws", angle)


def opposed_faces() -> Iterator[Figure]:
    """Compare the paper's QP, as linear rows that share no code with ours, with the exact answers of the engine."""
    program, run = simulate(cases.model("channel"), samples=2000, seed=SEED, solver="daqp", method=EXACT)
    stuck = []
    for raw in run["poses"][:500, RAW]:
        rows, gaps = [], []
        for pair in program.nominal.pairs:
            R, t = (raw[:, :9].reshape(-1, 3, 3), raw[:, 9:])
            n, P = pair.n_r @ R[pair.reference].T, pair.P_m @ R[pair.moving].T + t[pair.moving]
            gaps.append(((P - pair.P_r @ R[pair.reference].T - t[pair.reference]) * n).sum(axis=1))
            rows.append(np.column_stack([n, np.cross(P, n)]))
        J, g = np.concatenate(rows), np.concatenate(gaps)
        J, g = J[g < 0], g[g < 0]  # the paper has rows of the points that penetrate
        # The least common penetration s that a linear step can leave: g + J x + s >= 0.
        found = optimize.linprog(
            [0] * 6 + [1], -np.column_stack([J, np.ones(len(g))]), g, bounds=[(None, None)] * 6 + [(0, None)]
        )
        stuck.append(found.fun > 1e-9)
    yield share("share of linear QPs without a feasible point", np.nan, "depends on the layout", np.array(stuck))
    yield share("share that exact resolution does not resolve", 0.0, "proof", run["status"] != Status.RESOLVED)


def invariances() -> Iterator[Figure]:
    """Frames, lengths, orders."""
    _, still = simulate(cases.stack(), seed=SEED, method=EXACT)
    frame = cases.Frame(turn=(2, 1, -1), shift=(-900, 300, 800))
    others = {"moved and turned": (cases.stack(frame), 1), "doubled": (cases.stack(cases.Frame(scale=2.0)), 2)}
    others["in another order"] = (cases.stack(reverse=True), 1)
    for word, (model, times) in others.items():
        _, run = simulate(model, seed=SEED, method=EXACT)
        off = np.abs(run["measured"] - times * still["measured"]).max()
        yield within(f"{word}: largest difference of a measure [mm]", 0.0, "proof", off, 1e-8)


PROBLEMS = (
    Problem(
        "C1", "a gap of one dimension",
        "A block moves up and down with g ~ N(0, s) above a face that stands still, or that moves with N(0, s) too. "
        "Contact keeps it above: max(0, g), or the larger of both heights.",
        gap_of_one_dimension,
    ),
    Problem(
        "C2", "planar contact is flush",
        "Where three points that are not on one line are active on one plane, the paper's QP makes the moving face flush "
        "with the reference plane: every gap becomes 0, to the order of eta.",
        flush_planes,
    ),
    Problem(
        "C3", "the paper's two assemblies",
        "RA1 is a block on a block, RA2 a U in a U (Table 1, N = 1000). The paper prints neither locators nor dimensions "
        "of RA2; ours were chosen. Bounds are those of one more run of N = 1000.",
        papers_assemblies,
    ),
    Problem(
        "C4", "fixed and floating fasteners",
        "Two supports are bolted to a plate; bolt 10, holes of the plate 105 apart, 27.5 from a support's hole to its "
        "face. Fixed: threads with position 0.5, holes 11.5 at least material with position 1.0. Floating: holes 11 in "
        "both, position 1.0. How far are the supports apart, at the worst?",
        extremes_of_fasteners,
    ),
    Problem(
        "C5", "a rectangular pocket",
        "A male part of 99.8 in a pocket of 100, depth 10, t = 0.31: either face is off by N(0, t/6) and askew by N(0, "
        "t/30); the gap is the lesser one of those at both ends.",
        pocket_of_four_freedoms,
    ),
    Problem(
        "C6", "two square pins in two slots",
        "Pins of 10 x 10 at x = 30 and 100, slots of 10.2, t = 0.16: faces are off by N(0, t/6) and askew by N(0, t/30), "
        "one translation is free. Which share cannot be assembled? (Rarer events of this problem need more draws than "
        "this page.)",
        pins_in_slots,
    ),
    Problem(
        "C7", "a one-way clutch",
        "cos(phi) = (a + c) / (e - c) with a = 27.645 +- 0.05, c = 11.43 +- 0.01, e = 50.8 +- 0.0125, each three standard "
        "deviations. Here phi is where a roller comes to rest between hub and ring.",
        clutch,
    ),
    Problem(
        "C8", "opposed faces without clearance",
        "A U in a U with vertical flanges on both sides, sigma = 5/6: many of the paper's linearized QPs, with a row for "
        "each point that penetrates, have no feasible point; the exact problem always has one, the nominal pose.",
        opposed_faces,
    ),
    Problem(
        "C9", "invariances",
        "Moving and turning an assembly, and the order of its parts and pairs, change no measure; doubling every length "
        "doubles them.",
        invariances,
    ),
)  # fmt: skip
