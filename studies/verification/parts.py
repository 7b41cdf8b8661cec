"""Do intervals cover if contributors are known from few parts? A linear stack, whose truth is known in closed form.

Each repetition draws the parts of each contributor, states their mean and standard deviation, or all of them as a population,
simulates the stack, and asks whether the intervals contain the truth: those of the realizations alone, and those that include
what so few parts leave open.
"""

import argparse

import numpy as np
from scipy import stats

from studies import tables
from tolcontact.limits import Limits
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.few_parts import NAMES, Worlds, widened
from tolcontact.statistics.measured_rows import MeasuredRows
from tolcontact.statistics.sample import Sample

FIGURES = "mean", "6 sigma", "outside limits", "Ppk as normal"
NORMAL, SKEWED = stats.norm(), stats.gamma(4, -2, 0.5)
ROWS = [  # contributors, parts of each, share outside, whether the parts are a population, distribution of parts
    (1, 30, 1e-3, False, NORMAL), (3, 30, 1e-3, False, NORMAL), (8, 30, 1e-3, False, NORMAL), (3, 10, 1e-3, False, NORMAL),
    (1, 10, 2e-2, True, NORMAL), (1, 30, 2e-2, True, NORMAL), (3, 30, 1e-3, True, NORMAL), (3, 30, 1e-3, True, SKEWED),
]  # fmt: skip
COEFFICIENTS = np.array([1.0, -0.5, 0.7, 1.0, -1.0, 0.3, 0.8, -0.6])
MIXED = 2_000_000  # realizations that state the truth of a sum that has no closed form


def limit_of(coefficients: np.ndarray, share: float, distribution: stats.rv_continuous) -> tuple[float, float]:
    """Return the upper limit with this share beyond it, and the standard deviation of the stack."""
    sigma = float(np.linalg.norm(coefficients) * distribution.std())
    if distribution.dist.name == "norm":
        return float(stats.norm.isf(share)) * sigma, sigma
    rng = np.random.default_rng(99)
    return float(np.quantile(sum(a * distribution.rvs(MIXED, random_state=rng) for a in coefficients), 1 - share)), sigma


def hits(row: tuple, repetitions: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return in how many repetitions each of FIGURES is covered, today and with parts, and the median widths relative."""
    count, parts, share, is_population, distribution = row
    a, rng = COEFFICIENTS[:count], np.random.default_rng(7)
    upper, sigma = limit_of(a, share, distribution)
    truths, limits = (0.0, 6 * sigma, share, upper / (3 * sigma)), Limits(-np.inf, upper)
    covered, widths = np.zeros((2, len(FIGURES))), []
    for _ in range(repetitions):
        measured = distribution.rvs((parts, count), random_state=rng)
        if is_population:
            chosen = rng.integers(0, parts, (samples, count))
            x, few = np.take_along_axis(measured, chosen, axis=0), np.zeros(count, int)
            rows = [MeasuredRows(np.array([k]), chosen[:, k], np.ones(parts, int)) for k in range(count)]
        else:
            x = measured.mean(axis=0) + measured.std(axis=0, ddof=1) * rng.standard_normal((samples, count))
            few, rows = np.full(count, parts), []
        y = x @ a
        today = np.full((len(NAMES), 3), np.nan)
        values = intervals.mean(y), intervals.standard_deviation(y, times=6), intervals.proportion(y > upper)
        today[[NAMES.index(name) for name in FIGURES]] = *values, capability.as_normal(Sample.of(y), limits)[1]
        worlds = Worlds(x, few, rows)
        estimates, _ = widened(worlds, worlds.index(y), y, limits, limits, today)
        chosen_rows = [NAMES.index(name) for name in FIGURES]
        for k, of in enumerate((today[chosen_rows], estimates[chosen_rows])):
            covered[k] += (of[:, 1] <= truths) & (truths <= of[:, 2])
        widths.append(estimates[chosen_rows][:, 2] - estimates[chosen_rows][:, 1])
    return covered / repetitions, np.median(widths, axis=0)


def main() -> None:
    """Print the table of coverage, and write it into the README."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repetitions", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    table: list[list[object]] = [["contributors", "parts", "as", "share outside", *FIGURES, "median width of the share"]]
    for row in ROWS:
        covered, widths = hits(row, options.repetitions, options.samples)
        count, parts, share, is_population, distribution = row
        kind = ("a population" if is_population else "mean and sd") + ("" if distribution.dist.name == "norm" else ", skewed")
        cells = [f"{100 * before:.1f} → {100 * after:.1f}" for before, after in covered.T]
        table.append([count, parts, kind, f"{1e6 * share:,.0f} ppm".replace(",", " "), *cells, f"{widths[2]:.2g}"])
        print(table[-1], flush=True)
    if options.write:
        tables.write(__file__, {"parts": table})


if __name__ == "__main__":
    main()
