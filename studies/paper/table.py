"""Table 1 of the paper and the claims of its section 3.2, compared with ours: rows of tables."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

import tolcontact as tc
from studies.paper.published import PAPER, SENSITIVE, STATES
from studies.tables import with_interval
from tolcontact.statistics import intervals

SEEDS = range(1, 21)
FIGURES = {
    "mean": intervals.mean,
    "6 sigma": lambda x: intervals.standard_deviation(x, times=6),
    "variance": intervals.variance,
}
NAMES = {"raw": "contactless", "corrected": "contact"}
# RA1's A locators (x, y), the corners of the contact area, and the measured corner, in the assembly frame.
BASE, TOP = [(5, 5), (95, 5), (50, 45)], [(55, 32.5), (95, 32.5), (75, 17.5)]
CORNERS, MEASURED = [(50, 12.5), (100, 12.5), (50, 37.5), (100, 37.5)], (100, 12.5)


def heights(run: xr.DataTree) -> np.ndarray:
    """Return the deviation of the first measure from nominal, (realization, state) [mm]."""
    return run.measured.isel(measure=0).values - run.measure_nominal.values[0]


def table_1(name: str, runs: list[xr.DataTree], large: dict[str, np.ndarray]) -> Iterator[tuple[str, ...]]:
    """Yield the paper's figures of an assembly, ours of one seed and of all seeds, and figures of large runs by each method."""
    yield name, "paper", "seed 1", f"{len(runs)} seeds, least to largest", *large
    samples = [heights(run) for run in runs]
    for k, state in enumerate(STATES):
        for (figure, estimate), paper in zip(FIGURES.items(), PAPER[name].figures[state], strict=True):
            scatter = [estimate(sample[:, k])[0] for sample in samples]
            yield (
                f"{NAMES[state]} {figure}",
                f"{paper:.4f}",
                with_interval(*estimate(samples[0][:, k])),
                f"{min(scatter):.3f} to {max(scatter):.3f}",
                *(with_interval(*estimate(x[:, k])) for x in large.values()),
            )


def claims(runs: dict[str, list[xr.DataTree]], large: dict[str, xr.DataTree]) -> Iterator[tuple[str, ...]]:
    """Yield the rows for the statements that the paper makes in words."""
    yield "claim", "paper", "20 seeds, N = 1000", "large run"
    for name, run in large.items():
        for claim, *cells in (*measure_claims(name, runs[name], run), *field_claims(name, runs[name], run)):
            yield f"{name}: {claim}", *cells


def measure_claims(name: str, runs: list[xr.DataTree], large: xr.DataTree) -> Iterator[tuple[str, ...]]:
    """Reduced spread and shifted mean of the measure."""
    paper, x, samples = PAPER[name].figures, heights(large), [heights(run) for run in runs]
    for column, figure in ((1, "6 sigma"), (2, "variance")):
        power = column / 2
        theirs = 1 - paper["corrected"][column] / paper["raw"][column]
        each = [1 - (sample[:, 1].var() / sample[:, 0].var()) ** power for sample in samples]
        ours = reduction(intervals.variance_ratio(x[:, 1], x[:, 0]), power)
        yield f"{figure} reduced by", f"{theirs:.1%}", least_to_largest(each, percent=True), ours
    theirs = paper["corrected"][0] - paper["raw"][0]
    shift = [float((sample[:, 1] - sample[:, 0]).mean()) for sample in samples]
    yield "mean shifted by [mm]", f"{theirs:+.4f}", least_to_largest(shift), with_interval(*intervals.mean(x[:, 1] - x[:, 0]))


def field_claims(name: str, runs: list[xr.DataTree], large: xr.DataTree) -> Iterator[tuple[str, ...]]:
    """Range of the varying part's field without contact, and its reduced maximum, which the paper states for RA1 alone."""
    fields, most = [field_range(run, name) for run in runs], field_range(large, name)
    scale = "{:g} to {:g} (scale)".format(*PAPER[name].scale)
    for k, extreme in enumerate(("least", "largest")):
        claim = f"{extreme} 6 sigma magnitude of {PAPER[name].part} without contact [mm]"
        yield claim, scale, least_to_largest([field[0, k] for field in fields]), f"{most[0, k]:.3f}"
    if name == "RA1":
        each = [1 - field[1, 1] / field[0, 1] for field in fields]
        reduced = f"{1 - most[1, 1] / most[0, 1]:.1%}"
        yield "largest reduced by, anywhere", f"{SENSITIVE:.1%}", least_to_largest(each, percent=True), reduced
        each = [at_the_spot(run, name) for run in runs]
        reduced = f"{at_the_spot(large, name):.1%}"
        yield "largest reduced by, at its spot", f"{SENSITIVE:.1%}", least_to_largest(each, percent=True), reduced


def at_the_spot(run: xr.DataTree, name: str) -> float:
    """By how much contact reduces the field where it is largest without contact."""
    raw, corrected = run[f"field/{PAPER[name].part}"].six_sigma.sel(component="magnitude").values
    return 1 - corrected[raw.argmax()] / raw.max()


def field_range(run: xr.DataTree, name: str) -> np.ndarray:
    """Least and largest 6 sigma of the displacement magnitude on the varying part, (state, 2) [mm]."""
    field = run[f"field/{PAPER[name].part}"].six_sigma.sel(component="magnitude")
    return np.stack([field.min("vertex").values, field.max("vertex").values], axis=1)


def first_order(run: xr.DataTree) -> Iterator[tuple[str, ...]]:
    """RA1 linear in the deviations: the base's plane where both faces cut each other in the contact area, else the top."""
    d = run["sample"].deviation.sel(contributor=[f"{part}.A{k}" for part in ("base", "top") for k in (1, 2, 3)]).values

    def height(deviations, triangle, x):
        return deviations @ np.linalg.solve(np.vstack([np.transpose(triangle), np.ones(3)]), [*x, 1.0])

    base, top = d[:, :3], d[:, 3:]
    gap = np.min([height(top, TOP, x) - height(base, BASE, x) for x in CORNERS], axis=0)
    raw = height(top, TOP, MEASURED)
    linear, x = np.stack([raw, np.where(gap < 0, height(base, BASE, MEASURED), raw)], axis=1), heights(run)
    yield "RA1, linear in the deviations", "mean", "variance", "second order adds to the mean", "variance / first order"
    for k, state in enumerate(STATES):
        estimates = [
            intervals.mean(linear[:, k]),
            intervals.variance(linear[:, k]),
            intervals.mean(x[:, k] - linear[:, k]),
            intervals.variance_ratio(x[:, k], linear[:, k]),
        ]
        yield NAMES[state], *(with_interval(*estimate) for estimate in estimates)


def simulate(model: tc.Assembly, samples: int, seed: int, solver: str, **method: Any) -> xr.DataTree:
    return tc.run(model, samples=samples, seed=seed, solver=solver, method=tc.Method(**method))


def reduction(ratio: tuple[float, float, float], power: float) -> str:
    value, upper, lower = (100 * (1 - r**power) for r in ratio)
    return f"{with_interval(value, lower, upper)} %"


def least_to_largest(values: list[float], *, percent: bool = False) -> str:
    form = "{:.1%}" if percent else "{:.3f}"
    return f"{form.format(min(values))} to {form.format(max(values))}"


def penetration_left(run: xr.DataTree) -> tuple[str, str]:
    """Return the largest penetration that a method leaves [mm], and the share of realizations with more than 1 um."""
    depth = -run.gap_min.sel(state="corrected").min("pair").values
    share = with_interval(*(100 * value for value in intervals.proportion(depth > 1e-3)))
    return f"{depth.max():.2g}", f"{share} %"
