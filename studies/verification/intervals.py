"""How often 95 % intervals cover the truth: every statistic of a measure, 13 distributions, samples of 20 to 5000.

Distributions have closed quantiles, and moments by quadrature. Limits lie at 1.2 times the distance of the outer percentiles.
With `--write` the tables of the README and the sentences of the guide are replaced, and the picture is drawn. A coverage is
below the target beyond its scatter if its own exact 95 % interval is.
"""

import argparse
import itertools
import zlib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy import special, stats

from studies.tables import markdown, replace, tables
from tolcontact.limits import Limits
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.sample import Sample
from tolcontact.statistics.variance_shares import linear_shares, required_realizations, sobol_indices
from tolcontact.variation.plans import planned_numbers
from tolcontact.vocabulary import LATIN_HYPERCUBE, REPLICATE, SOBOL

README = Path(__file__).with_name("README.md")
CHAPTER = Path(__file__).parents[2] / "tolcontact" / "guide" / "statistics.md"
PICTURE = "coverage.png"
SIZES = (20, 100, 300, 5000)
REPLICATES = 20  # of a run with a sampling plan
TARGET = 92.5
STATED = 0.1  # of the samples: if fewer have an interval, it counts as none
PERCENTS = (0.135, 5.0, 50.0, 95.0, 99.865)
STOP, LATER_STOP = float(special.ndtri(0.93)), float(special.ndtri(0.99))
LOW_STOP, HIGH_STOP = -0.5, 1.0
CLASSES = 5
MODES = 2.5
CHANGED = 0.02  # share of realizations that differ between two paired runs
SLOPES, PRODUCT = np.array([1.0, 0.5]), 0.3  # of a sum of two contributors and of their product


def two_modes(p):
    grid = np.linspace(-9, 9, 200_001)
    return np.interp(p, (special.ndtr(grid - MODES) + special.ndtr(grid + MODES)) / 2, grid)


QUANTILES = {
    "normal": stats.norm.ppf,
    "lognormal": stats.lognorm(0.5).ppf,
    "t5": stats.t(5).ppf,
    "uniform": stats.uniform.ppf,
    "beta": stats.beta(2, 5).ppf,
    "half at a stop": lambda p: np.maximum(0.0, special.ndtri(p)),
    "93 % at a stop": lambda p: np.maximum(0.0, special.ndtri(p) - STOP),
    "two modes": two_modes,
    "exponential": stats.expon.ppf,
    "Pareto": stats.pareto(3.5).ppf,
    "99 % at a stop": lambda p: np.maximum(0.0, special.ndtri(p) - LATER_STOP),
    "two stops": lambda p: np.clip(special.ndtri(p), LOW_STOP, HIGH_STOP),
    "discrete": lambda p: np.floor(CLASSES * p),
}
MOMENTS = {"t5": stats.t(5), "Pareto": stats.pareto(3.5)}  # whose tails reach beyond the quadrature
KINKS = [STOP, LATER_STOP, LOW_STOP, HIGH_STOP, *special.ndtri(np.arange(1, CLASSES) / CLASSES)]


class Truth:
    """What the statistics of a distribution really are."""

    def __init__(self, name):
        quantile = QUANTILES[name]
        # Gauss' rule in normal scores, split where quantiles have kinks and jumps.
        nodes, weights = np.polynomial.legendre.leggauss(200)
        edges = list(itertools.pairwise(np.sort(np.append(np.linspace(-8, 8, 65), KINKS))))
        z = np.concatenate([(b - a) / 2 * nodes + (a + b) / 2 for a, b in edges])
        w = np.concatenate([(b - a) / 2 * weights for a, b in edges]) * stats.norm.pdf(z)
        x = quantile(special.ndtr(z))
        self.mean = float((w * x).sum())
        moments = [float((w * (x - self.mean) ** k).sum()) for k in (2, 3, 4)]
        self.variance, self.skewness = moments[0], moments[1] / moments[0] ** 1.5
        self.kurtosis = moments[2] / moments[0] ** 2
        if name in MOMENTS:
            self.mean, self.variance, self.skewness, excess = map(float, MOMENTS[name].stats("mvsk"))
            self.kurtosis = 3 + excess
        self.percentiles = quantile(np.array(PERCENTS) / 100)
        low, middle, high = self.percentiles[[0, 2, 4]]
        self.limits = Limits(middle - 1.2 * (middle - low) if low < middle else -np.inf, middle + 1.2 * (high - middle))
        # Standardized contributors: the share of a slope in the variance of a sum with a product, and that of both slopes.
        self.linear = np.array([SLOPES[0] ** 2, SLOPES @ SLOPES]) / (SLOPES @ SLOPES + PRODUCT**2)
        clipped = np.maximum(x, self.mean)
        self.clipped = float((w * clipped**2).sum() - (w * clipped).sum() ** 2) / self.variance
        p = special.ndtr(np.linspace(-8, 8, 200_001))
        self.outside = float(np.interp(self.limits.lower, quantile(p), p)) if np.isfinite(self.limits.lower) else 0.0
        self.outside += 1 - float(np.interp(self.limits.upper, quantile(p), p))


def figures(draws, truth):
    """Return estimates and their true values by name, of the first of four independent samples (4, n)."""
    x, other, x_anew, other_anew = draws
    sample, limits = Sample.of(x), truth.limits
    low, _, high = truth.percentiles[[0, 2, 4]]
    both = np.isfinite(limits.lower)
    sigma = np.sqrt(truth.variance)
    pp, ppk = capability.by_percentiles(sample, limits)
    pp_normal, ppk_normal = capability.as_normal(sample, limits)
    upper_side = (limits.upper - truth.mean) / (3 * sigma)
    clipped = Sample.of(np.maximum(x, truth.mean))
    first, total = (f[0] for f in sobol_indices(np.column_stack([x + other, x_anew + other_anew, x_anew + other])))
    table = {
        "mean": (intervals.mean(sample), truth.mean),
        "6 sigma": (intervals.standard_deviation(sample, times=6), 6 * sigma),
        "skewness": (intervals.skewness(sample), truth.skewness),
        "kurtosis": (intervals.kurtosis(sample), truth.kurtosis),
        "outside": (capability.share_outside(sample, limits), truth.outside),
        "Pp": (pp, (limits.upper - limits.lower) / (high - low) if both else np.nan),
        "Ppk": (ppk, 1.2),
        "Pp as normal": (pp_normal, (limits.upper - limits.lower) / (6 * sigma) if both else np.nan),
        "Ppk as normal": (ppk_normal, min(upper_side, (truth.mean - limits.lower) / (3 * sigma))),
        "ratio of variance": (intervals.variance_ratio(clipped, sample), truth.clipped),
        "first order": (first, 0.5),
        "total": (total, 0.5),
    }
    values = intervals.percentiles(sample, PERCENTS)
    table |= {f"{p:g} %": (value, true) for p, value, true in zip(PERCENTS, values, truth.percentiles, strict=True)}
    return table | paired_figures(x, other, truth)


def paired_figures(x, other, truth):
    """Return the change of a share where few realizations change, and linear shares, with their true values."""
    rng = np.random.default_rng(zlib.crc32(x.tobytes()))
    hits = [rng.random(len(x)) < 0.05]
    hits.append(np.where(rng.random(len(x)) < CHANGED, rng.random(len(x)) < 0.05, hits[0]))
    shift = intervals.share_shift(*map(Sample.of, hits), paired=True)
    table = {"shift of a share": (shift, 0.0)}
    if len(x) >= required_realizations(2) and np.ptp(x) * np.ptp(other) > 0:
        z = (np.column_stack([x, other]) - truth.mean) / np.sqrt(truth.variance)
        (shares,) = linear_shares(z, (z @ SLOPES + PRODUCT * z.prod(axis=1))[:, None], [np.array([0]), np.array([1])])
        assert shares is not None
        of_line = (intervals.Estimate(*values) for values in (shares.shares[0], shares.r2))
        table |= dict(zip(("linear share", "R2"), zip(of_line, truth.linear, strict=True), strict=True))
    return table


def counted(draw, repeats, figures_of, truth):
    """Return by statistic the coverage [%] of intervals, with its own interval; NaN if few samples have an interval."""
    covered: dict[str, list[bool]] = {}
    for repeat in range(repeats):
        draws = draw(repeat)
        for statistic, (estimate, true) in figures_of(draws, truth).items():
            rows = covered.setdefault(statistic, [])
            if not (np.isnan(true) or np.isnan(estimate.lower)):
                rows.append(bool(estimate.lower <= true <= estimate.upper))
    return {
        statistic: 100 * np.array(intervals.proportion_of(sum(rows), len(rows)))
        if len(rows) >= STATED * repeats
        else np.full(3, np.nan)
        for statistic, rows in covered.items()
    }


def coverage(name, size, repeats):
    """Return the coverage of all figures of independent realizations of a distribution."""
    rng = np.random.default_rng([size, zlib.crc32(name.encode())])
    return counted(lambda _: QUANTILES[name](rng.random((4, size))), repeats, figures, Truth(name))


def coverage_of_plan(plan, name, repeats):
    """Return the coverage of the figures of a run with a sampling plan: a function of the sum of three contributors."""

    def draw(seed):
        numbers = planned_numbers(plan, ["a", "b", "c"], seed, 0, REPLICATES * REPLICATE)
        score = sum(special.ndtri(numbers(label)) for label in "abc") / np.sqrt(3)
        return QUANTILES[name](special.ndtr(score))[None]

    def planned_figures(draws, truth):
        x, limits = Sample(lambda: draws[0], REPLICATE), Limits(-np.inf, truth.percentiles[3])
        five, ninety_five = intervals.percentiles(x, [5, 95])
        beyond = 0.05 if truth.percentiles[3] < truth.percentiles[4] else 0.0
        return {
            "mean": (intervals.mean(x), truth.mean),
            "6 sigma": (intervals.standard_deviation(x, times=6), 6 * np.sqrt(truth.variance)),
            "outside": (capability.share_outside(x, limits), beyond),
            "5 %": (five, truth.percentiles[1]),
            "95 %": (ninety_five, truth.percentiles[3]),
            "Ppk": (capability.by_percentiles(x, truth.limits)[1], 1.2),
        }

    return counted(draw, repeats, planned_figures, Truth(name))


PLANNED = ("normal", "lognormal", "half at a stop", "uniform")


def below(rows):
    """Return the cells whose coverage is below the target: row, statistic, coverage, and whether its interval is below, too."""
    return [
        (f"{name}, {size}", statistic, float(percent), bool(upper < TARGET))
        for (name, size), column in rows.items()
        for statistic, (percent, _, upper) in column.items()
        if percent < TARGET
    ]


def table_of(rows):
    """Return a table: for each row, the number of figures with an interval, the least coverage, and those below the target."""
    table = [["", "realizations", "figures with an interval", "least coverage %", "of", f"below {TARGET:g} %"]]
    for (name, size), column in rows.items():
        stated = {statistic: float(cell[0]) for statistic, cell in column.items() if not np.isnan(cell[0])}
        worst = min(stated, key=lambda statistic: stated[statistic])
        weak = [f"{statistic} {percent:.1f}" for _, statistic, percent, _ in below({(name, size): column})]
        table.append([name, str(size), str(len(stated)), f"{stated[worst]:.1f}", worst, ", ".join(weak) or "none"])
    return markdown(table)


def sentences_of(rows, repeats):
    """Return what the table of all rows shows: how many intervals cover less often than the target, and which."""
    count, weak = sum(not np.isnan(cell[0]) for column in rows.values() for cell in column.values()), below(rows)
    sure = [cell for cell in weak if cell[3]]
    clean, fair = (len(rows) - len({cell[0] for cell in cells}) for cells in (weak, sure))
    text = (
        f"Of {count} intervals in {len(rows)} rows, each of {repeats} samples, {len(weak)} cover the truth in less than "
        f"{TARGET:g} %,\n{len(sure)} of them beyond the scatter of their coverage; {clean} rows have none below, "
        f"and {fair} none beyond the scatter.\n"
    )
    listed = [f"- {row}: {name} {percent:.1f} %{', beyond the scatter' * is_sure}" for row, name, percent, is_sure in weak]
    return text + "".join(f"{line}\n" for line in ["", *listed] if listed)


def draw_picture(rows, path):
    """Draw the coverage of each figure (column) by distribution and number of realizations (row)."""
    figures_of_all = list(dict.fromkeys(figure for column in rows.values() for figure in column))
    values = np.array([[column.get(figure, [np.nan])[0] for figure in figures_of_all] for column in rows.values()])
    figure, axes = plt.subplots(figsize=(9, 12), layout="constrained")
    colours = plt.get_cmap("RdYlBu").copy()
    colours.set_bad("0.9")
    image = axes.imshow(values, cmap=colours, vmin=90, vmax=100, aspect="auto")
    axes.set_xticks(range(len(figures_of_all)), figures_of_all, rotation=90)
    axes.set_yticks(range(len(rows)), [f"{name}, {size}" for name, size in rows], fontsize=7)
    figure.colorbar(image, label="coverage of 95 % intervals, % (grey: no interval)", extend="min")
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=1000)
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    parser.add_argument("--write", action="store_true", help="replace the tables of the README, and draw the picture")
    options = parser.parse_args()
    rows = {(name, size): coverage(name, size, options.repeats) for name in QUANTILES for size in options.sizes}
    planned = {
        (f"{name}, {plan}", REPLICATES * REPLICATE): coverage_of_plan(plan, name, options.repeats)
        for plan in (LATIN_HYPERCUBE, SOBOL)
        for name in PLANNED
    }
    texts = {
        "rows": sentences_of(rows, options.repeats),
        "coverage": table_of(rows),
        "plan rows": sentences_of(planned, options.repeats),
        "plans": table_of(planned),
    }
    print("\n".join(texts.values()))
    if options.write:
        marked = {f"{Path(__file__).name}: {name}": text for name, text in texts.items()}
        replace(README, marked)
        replace(CHAPTER, {name: text for name, text in marked.items() if name in tables(CHAPTER)})
        draw_picture(rows, README.with_name(PICTURE))


if __name__ == "__main__":
    main()
