"""How often 95 % intervals cover the truth: every statistic of a measure, eight distributions, samples of 100 to 10 000.

Distributions have closed quantiles, and moments by quadrature. Limits lie at 1.2 times the distance of the outer percentiles.
"""

import argparse
import itertools
import zlib

import numpy as np
from scipy import special, stats

from tolcontact.limits import Limits
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.sample import Sample
from tolcontact.statistics.sobol_indices import sobol_indices

SIZES = (100, 300, 2000, 10_000)
TARGET = 92.5
PERCENTS = (0.135, 5.0, 50.0, 95.0, 99.865)
STOP = float(special.ndtri(0.93))
MODES = 2.5


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
}
MOMENTS = {"t5": stats.t(5)}  # whose tails reach beyond the quadrature


class Truth:
    """What the statistics of a distribution really are."""

    def __init__(self, name):
        quantile = QUANTILES[name]
        # Gauss' rule in normal scores, split where the stops are.
        nodes, weights = np.polynomial.legendre.leggauss(200)
        edges = list(itertools.pairwise(np.sort(np.append(np.linspace(-8, 8, 65), STOP))))
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
    return table


def coverage(name, size, repeats):
    """Return by statistic: coverage in percent of the intervals that there are, and the share of samples that have one."""
    truth, rng = Truth(name), np.random.default_rng([size, zlib.crc32(name.encode())])
    covered: dict[str, int] = {}
    stated: dict[str, int] = {}
    for _ in range(repeats):
        draws = QUANTILES[name](rng.random((4, size)))
        if np.ptp(draws[0]) == 0:
            continue
        for statistic, (estimate, true) in figures(draws, truth).items():
            if not (np.isnan(true) or np.isnan(estimate.lower)):
                covered[statistic] = covered.get(statistic, 0) + bool(estimate.lower <= true <= estimate.upper)
                stated[statistic] = stated.get(statistic, 0) + 1
    return {s: (100 * covered[s] / stated[s], stated[s] / repeats) for s in covered if stated[s] >= repeats / 10}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=1000)
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    options = parser.parse_args()
    below = []
    for size in options.sizes:
        table = {name: coverage(name, size, options.repeats) for name in QUANTILES}
        print(f"\n{size} realizations, coverage in % (* below {TARGET}; - no interval)\n\n| | " + " | ".join(table) + " |")
        print("|---" * (1 + len(table)) + "|")
        for statistic in figures(np.random.default_rng(0).random((4, 100)), Truth("normal")):
            cells = []
            for name, column in table.items():
                percent = column.get(statistic, (np.nan, 0))[0]
                cells.append("-" if np.isnan(percent) else f"{percent:.1f}" + "*" * (percent < TARGET))
                if percent < TARGET:
                    below.append(f"{statistic} of {name} at {size}: {percent:.1f}")
            print(f"| {statistic} | " + " | ".join(cells) + " |", flush=True)
    print(f"\nBelow {TARGET}: " + ("; ".join(below) or "none"))


if __name__ == "__main__":
    main()
