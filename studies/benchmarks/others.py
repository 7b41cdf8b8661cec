"""Other open tools on the problems that are functions of independent deviations: python -m studies.benchmarks.others [NAMES].

OpenTURNS computes moments, shares (Monte Carlo) and rare events (FORM, subset sampling), SALib computes Sobol' indices. Neither
has parts or contact: contact stands here in closed form, as in max(0, g). otaf solves a linear program for each realization of
an assembly; the pins in slots are among its own examples. An environment of its own suffices, with NumPy, SciPy, rich and the
three packages (otaf from https://github.com/Kramer84/otaf). Figures without an interval are compared with a tolerance of 1 %.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import openturns as ot
from otaf.example_models.models_2_D import _model_2D_16_dof as pins
from otaf.uncertainty import compute_gap_optimizations_on_sample_batch
from rich.console import Console
from rich.table import Table
from SALib.analyze import sobol as sobol_analysis
from SALib.sample import sobol as sobol_sample
from scipy import stats

from studies.benchmarks.problem import Problem, read

Z = float(stats.norm.ppf(0.9995))
SAMPLES, PROGRAMS = 200_000, 20_000
NO_VALUE = (np.nan, np.nan, np.nan)
COLUMNS = ("problem", "quantity", "method", "expected", "computed", "interval", "verdict", "calls", "CPU s")


class Model(NamedTuple):
    """Distributions of the deviations, the measure as a function of samples (n, deviation), and its lower and upper limit."""

    deviations: list[Any]
    measure: Callable[[np.ndarray], np.ndarray]
    lower: float | None = None
    upper: float | None = None


def normal(*widths: float) -> list[Any]:
    return [ot.Normal(0.0, width / 6) for width in widths]


def models(name: str, n: Any) -> Model:
    """Return the model of a problem with its numbers."""

    def total(x: np.ndarray) -> np.ndarray:
        return np.asarray(x.sum(axis=1))

    return {
        "linear_stack": lambda: Model(
            normal(n.ta, n.tb, n.tc, n.th), lambda x: n.h - n.a - n.b - n.c + x @ [-1, -1, -1, 1], lower=n.limit
        ),
        "uniform_stack": lambda: Model([ot.Uniform(-n.half, n.half)] * 6, total, upper=n.limit),
        "skewed_stack": lambda: Model([ot.Gamma(n.shape, 1 / n.scale)] * 3, total, upper=n.limit),
        "clutch_by_formula": lambda: Model(
            normal(2 * n.da, 2 * n.dc, 2 * n.de),
            lambda x: np.degrees(np.arccos((n.a + x[:, 0] + n.c + x[:, 1]) / (n.e + x[:, 2] - n.c - x[:, 1]))),
            lower=n.limit,
        ),
        "block_on_plane": lambda: Model([ot.Normal(0, n.s)], lambda x: np.maximum(0, x[:, 0])),
        "two_causes": lambda: Model(
            [ot.Normal(0, n.sv), ot.Normal(0, n.su)], lambda x: np.maximum(x[:, 0], x[:, 1] - n.low), upper=n.limit
        ),
        "limit_above_a_stop": lambda: Model([ot.Normal(0, n.s)], lambda x: np.maximum(0, x[:, 0]), upper=n.limit),
        "highest_of_four": lambda: Model(
            [ot.Normal(-b * s, s) for b, s in zip(n.below, n.sd, strict=True)], lambda x: x.max(axis=1), upper=0.0
        ),
        "twelve_uniform_parts": lambda: Model([ot.Uniform(-n.half, n.half)] * 12, total, upper=n.limit),
        "forty_parts": lambda: Model([ot.Normal(0, n.s)] * 40, total, upper=n.limit),
        "heavy_tails": lambda: Model([ot.Student(3, 0, n.scale)] * 2, total, upper=n.limit),
        "ishigami": lambda: Model(
            [ot.Uniform(-np.pi, np.pi)] * 3,
            lambda x: np.sin(x[:, 0]) + n.a * np.sin(x[:, 1]) ** 2 + n.b * x[:, 2] ** 4 * np.sin(x[:, 0]),
        ),
        "contributions_through_contact": lambda: Model(
            [ot.Normal(0, n.sa), ot.Normal(0, n.sb)], lambda x: np.maximum(0, x.sum(axis=1))
        ),
    }[name]()


MOMENTS = ("linear_stack", "uniform_stack", "skewed_stack", "clutch_by_formula", "block_on_plane")
RARE = ("two_causes", "limit_above_a_stop", "highest_of_four", "twelve_uniform_parts", "forty_parts", "heavy_tails")
ASSEMBLIES = ("square_pins_in_slots",)
INDICES = ("ishigami", "contributions_through_contact")


def moments(problem: Problem, model: Model) -> Iterator[tuple]:
    """Yield quantities, method, values with bounds, and the number of calls, by Monte Carlo of OpenTURNS."""
    sample = np.asarray(ot.JointDistribution(model.deviations).getSample(SAMPLES))
    y = ot.Sample(model.measure(sample)[:, None])
    values = np.asarray(y)[:, 0]
    n, mean, deviation = len(values), y.computeMean()[0], y.computeStandardDeviation()[0]
    spread = Z * np.sqrt(((((values - mean) ** 2 - deviation**2) ** 2).mean()) / n)
    for quantity in problem.quantities:
        if "mean" in quantity.name:
            half, value = Z * deviation / np.sqrt(n), mean
        elif "variance" in quantity.name:
            value, half = deviation**2, spread
        elif "deviation" in quantity.name:
            value, half = deviation, spread / (2 * deviation)
        elif "skewness" in quantity.name:
            value = y.computeSkewness()[0]
            z = (values - mean) / deviation
            half = Z * (z**3 - 3 * z - 1.5 * value * (z**2 - 1)).std() / np.sqrt(n)
        else:
            hits = values < model.lower if model.lower is not None else values > (model.upper or 0.0)
            value = hits.mean()
            half = Z * np.sqrt(value * (1 - value) / n)
        yield quantity, "OpenTURNS, Monte Carlo", (value, value - half, value + half), n


def rare(problem: Problem, model: Model) -> Iterator[tuple]:
    """Yield the probability by FORM and by subset sampling of OpenTURNS."""
    (quantity,) = problem.quantities
    distribution = ot.JointDistribution(model.deviations)
    calls = 0

    def counted(sample: Any) -> np.ndarray:
        nonlocal calls
        calls += len(sample)
        return model.measure(np.asarray(sample))[:, None]

    function = ot.PythonFunction(len(model.deviations), 1, func_sample=counted)
    event = ot.ThresholdEvent(ot.CompositeRandomVector(function, ot.RandomVector(distribution)), ot.Greater(), model.upper)
    optimizer = ot.AbdoRackwitz()
    optimizer.setMaximumIterationNumber(200)
    optimizer.setStartingPoint(distribution.getMean())
    try:
        form = ot.FORM(optimizer, event)
        form.run()
        value = form.getResult().getEventProbability()
        bounded_value = value, 0.99 * value, 1.01 * value
    except (RuntimeError, TypeError):  # it does not converge where the measure does not change
        bounded_value = NO_VALUE
    yield quantity, "OpenTURNS, FORM", bounded_value, calls
    calls = 0
    subset = ot.SubsetSampling(event)
    subset.setMaximumOuterSampling(10_000)
    subset.setBlockSize(1)
    subset.run()
    value, log_spread = subset.getResult().getProbabilityEstimate(), subset.getResult().getCoefficientOfVariation()
    bounds = value * np.exp(-Z * log_spread), value * np.exp(Z * log_spread)
    yield quantity, "OpenTURNS, subset sampling", (value, *bounds), calls


def indices(problem: Problem, model: Model) -> Iterator[tuple]:
    """Yield Sobol' indices of SALib."""
    count = len(model.deviations)
    setting = {"num_vars": count, "names": [f"x{k + 1}" for k in range(count)], "bounds": [[0.0, 1.0]] * count}
    u = sobol_sample.sample(setting, 16_384, calc_second_order=False, seed=1)
    clipped = u.clip(1e-12, 1 - 1e-12)
    x = np.column_stack(
        [[d.computeQuantile(p)[0] for p in column] for d, column in zip(model.deviations, clipped.T, strict=True)]
    )
    sobol_indices = sobol_analysis.analyze(setting, model.measure(x), calc_second_order=False, conf_level=0.999, seed=1)
    for quantity in problem.quantities:
        kind = "S1" if quantity.name.startswith("first") else "ST" if quantity.name.startswith("total") else None
        if kind:
            place = int(quantity.name[-1]) - 1 if quantity.name[-1].isdigit() else 0
            value, half = sobol_indices[kind][place], sobol_indices[f"{kind}_conf"][place]
            yield quantity, "SALib, Sobol'", (value, value - half, value + half), len(x)


def assembled(problem: Problem) -> Iterator[tuple]:
    """Yield the share of plates that otaf cannot assemble: the largest slack of all gaps is negative."""
    n = SimpleNamespace(**problem.numbers)
    constraints = pins.get_system_of_constraints_assembly_model(n.pin, n.pin, n.x1, n.x2 - n.x1, n.x1, n.pin, n.slot)
    law, *_ = pins.get_distribution_params(n.t, 1.0, n.pin, n.pin)
    slack = compute_gap_optimizations_on_sample_batch(constraints, np.asarray(law.getSample(PROGRAMS)), batch_size=PROGRAMS)[
        :, -1
    ]
    interval = stats.binomtest(int((slack < 0).sum()), PROGRAMS).proportion_ci(0.999)
    yield problem.quantities[0], "otaf, Monte Carlo", ((slack < 0).mean(), interval.low, interval.high), PROGRAMS


def rows(name: str) -> Iterator[tuple]:
    """Yield what another tool answers to a problem."""
    problem = read(name)
    if name in ASSEMBLIES:
        yield from assembled(problem)
    else:
        solve = moments if name in MOMENTS else rare if name in RARE else indices
        yield from solve(problem, models(name, SimpleNamespace(**problem.numbers)))


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("names", nargs="*", default=[*MOMENTS, *RARE, *INDICES, *ASSEMBLIES])
    ot.RandomGenerator.SetSeed(1)
    table = Table(*COLUMNS)
    for name in parser.parse_args().names:
        start = time.process_time()
        for quantity, method, (value, lower, upper), calls in rows(name):
            seconds, start = time.process_time() - start, time.process_time()
            agrees = lower - quantity.tolerance <= quantity.expected <= upper + quantity.tolerance
            verdict = "no answer" if np.isnan(value) else "agrees" if agrees else "DIFFERS"
            interval = f"{lower:.4g} to {upper:.4g}"
            cells = [f"{quantity.expected:.6g}", f"{value:.6g}", interval, verdict, str(calls), f"{seconds:.1f}"]
            table.add_row(name, quantity.name, method, *cells)
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
