"""A mechanism over its positions: the envelope of each measurement in each realization, from the same draws everywhere."""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Progress
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model, parameter_fault
from tolcontact.errors import OptionError
from tolcontact.input_files import is_archive
from tolcontact.limits import Limits
from tolcontact.method import Solver
from tolcontact.statistics import intervals
from tolcontact.statistics.capability import PERCENTS
from tolcontact.statistics.measure_statistics import MIN_VALUES
from tolcontact.statistics.sample import Sample
from tolcontact.workflow.models import Choice

OF_ALL_POSITIONS = "[limits]", "[effect]"  # kinds of doubts that a single position does not justify
Mechanism = Callable[..., Assembly] | str | Path  # a function of parameters that returns an assembly, or a script with one


def sweep(
    model: Mechanism, over: Mapping[str, Sequence[float]], *, samples: int = 1000, seed: int = 1,
    solver: Solver | None = None, method: Choice | None = None, client: Any = None, progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return the envelope of each measure over the positions of a mechanism, as an angle or a slide moves through them.

        envelope       (measure, state, end, of_envelope, interval)  mean, 6 sigma and outer percentile of the least and of the
                                                     largest value over all positions: 0.135 % of the least, 99.865 % of the
                                                     largest
        outside        (measure, state, interval)    share of realizations beyond a limit at any position; with contact also of
                                                     those that cannot be assembled there; NaN without limits,
                                                     or if the measure is not a number in any realization
        extreme_share  (measure, state, end, position)  share of realizations whose least or largest value is at a position
        mean           (measure, state, position, interval)  mean at each position
        swept          (position, realization, state, measure)  all values
        parameter      (parameter_name, position)    the parameters
        by_status      (position, status_meaning)    number of realizations

    model     function that declares the assembly from the parameters, as in `def assembly(angle=0.0)`, or a script with one
    over      values of each parameter, equally many, up to 1000: `tc.analyses.sweep(assembly, {"angle": [0, 0.5, 1]})`

    A realization has the same deviations at all positions: contributors must have the same labels there. Realizations that
    cannot be assembled at a position are left out of the envelope with contact, and count as outside. What lies between two
    positions is not seen: choose them close enough that the envelope does not change. `samples` (1000 by default), `seed`,
    `solver`, `method`, `client` and `progress` are as in all analyses (see tolcontact.analyses).
    """
    points = _points(over)
    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        analyses = [
            Analysis(terms.SWEEP, _at(model, point), samples=samples, seed=seed, solver=solver, method=method, client=client)
            for point in points
        ]
    for text, doubt in {str(doubt.message): doubt for doubt in doubts}.items():
        if not text.startswith(OF_ALL_POSITIONS):
            warnings.warn(text, doubt.category, stacklevel=2)
    _check_same(analyses, points)
    simulated = []
    for number, analysis in enumerate(analyses):
        if progress is not None:
            analysis.progress = partial(_shifted, progress, number * samples, len(points) * samples)
        analysis.expect(samples)
        simulated.append(analysis.simulate(samples))
    measured, statuses = zip(*simulated, strict=True)
    swept = np.array(measured)  # (position, realization, state, measure)
    fails = np.zeros(swept.shape[:3], dtype=bool)
    fails[:, :, terms.CORRECTED] = np.array(statuses) == terms.Status.NOT_ASSEMBLABLE
    values: dict[str, list[Any]] = {"envelope": [], "outside": [], "extreme_share": [], "mean": []}
    for k in range(swept.shape[3]):
        limits = [analysis.program.limits(k) for analysis in analyses]
        states = [_envelope(swept[:, :, state, k], fails[:, :, state], limits) for state in range(len(terms.STATES))]
        for name, of_states in zip(values, zip(*states, strict=True), strict=True):
            values[name].append(of_states)
    values |= {
        "swept": list(swept),
        "parameter": [[float(point[name]) for point in points] for name in over],
        "by_status": [analysis.statuses for analysis in analyses],
    }
    return analyses[0].dataset(values, {terms.PARAMETER_NAME: list(over)}, realizations=samples, positions=len(points))


def _points(over: Mapping[str, Sequence[float]]) -> list[dict[str, float]]:
    """Return the parameters of each position; whole numbers stay so. Raises OptionError unless there are as many of each."""
    try:
        values = {str(name): list(map(_number, of_name)) for name, of_name in over.items()}
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        raise OptionError(f'over is {over!r}; expected values of each parameter, such as {{"angle": [0, 0.5, 1]}}') from error
    counts = {name: len(of_name) for name, of_name in values.items()}
    if len(set(counts.values())) != 1 or not 2 <= min(counts.values()) <= terms.MAX_POSITIONS:
        listed = ", ".join(f"{count} of {name}" for name, count in counts.items()) or "none"
        raise OptionError(
            f"over has values: {listed}; expected two or more, up to {terms.MAX_POSITIONS}, and equally many of each parameter"
        )
    if not all(math.isfinite(value) for of_name in values.values() for value in of_name):
        raise OptionError("over has a value that is no finite number")
    return [dict(zip(values, point, strict=True)) for point in zip(*values.values(), strict=True)]


def _number(value: float) -> float:
    number = float(value)
    return int(value) if isinstance(value, Integral) else number


def _at(model: Mechanism, point: Mapping[str, float]) -> Callable[[], Assembly]:
    """Return the function that declares the assembly at a position. Raises OptionError for a model without parameters."""
    if isinstance(model, str | Path):
        if is_archive(model) or Path(model).suffix.lower() == ".json":
            raise OptionError(f'"{model}" holds the model at one position; name the script whose assembly(...) has parameters')
        return partial(load_model, Path(model), point)
    if isinstance(model, Assembly) or not callable(model):
        raise OptionError(
            f"the model is a {type(model).__name__}; expected a function of {', '.join(point)} that returns a tc.Assembly, "
            "or the path of a script with one"
        )
    if fault := parameter_fault(model, point):
        raise OptionError(f"over does not fit the model: {fault}")
    return partial(model, **point)


def _check_same(analyses: Sequence[Analysis], points: Sequence[Mapping[str, float]]) -> None:
    """Raise OptionError unless the contributors and the measures are the same at all positions."""
    names = {
        "contributors": [analysis.program.draws.labels for analysis in analyses],
        "measurements": [
            [f"{measure.name} [{measure.units}]" for measure in analysis.program.nominal.measures] for analysis in analyses
        ],
    }
    for kind, names_at in names.items():
        for point, actual in zip(points, names_at, strict=True):
            if actual != names_at[0]:
                different = sorted(set(actual) ^ set(names_at[0])) or actual
                where = ", ".join(f"{name}={value:g}" for name, value in point.items())
                raise OptionError(
                    f"at {where} the {kind} are others than at the first position, such as {different[0]}; declare the same "
                    "at all positions, so that a realization has the same parts there"
                )


def _shifted(progress: Progress, before: int, total: int, done: int, _: int) -> None:
    progress(before + done, total)


def _envelope(x: np.ndarray, fails: np.ndarray, limits: Sequence[Limits]) -> tuple[list[Any], Any, np.ndarray, list[Any]]:
    """Return the envelope, the share outside, the shares of extremes by position, and the mean at each position.

    x      (position, realization) values of a measure in one state
    fails  (position, realization) whether parts cannot be assembled
    """
    is_outside = (fails | np.array([limit.outside(row) for limit, row in zip(limits, x, strict=True)])).any(axis=0)
    is_defined = bool((np.isfinite(x) | fails).all())  # a value that is not a number is neither inside nor outside
    assembled = x[:, ~fails.any(axis=0)]
    defined = assembled[:, np.isfinite(assembled).all(axis=0)]
    ends, shares = [], []
    for extremes, places, percent in (
        (assembled.min(axis=0), defined.argmin(axis=0), PERCENTS[0]),
        (assembled.max(axis=0), defined.argmax(axis=0), PERCENTS[-1]),
    ):
        ends.append(_estimates(extremes, percent))
        shares.append(np.bincount(places, minlength=len(x)) / max(len(places), 1))
    means = [_estimates(row[~failed], PERCENTS[0])[0] for row, failed in zip(x, fails, strict=True)]
    has_share = is_defined and not all(limit.are_open for limit in limits)
    outside = intervals.proportion(is_outside) if has_share else intervals.UNDEFINED
    return ends, outside, np.array(shares), means


def _estimates(x: np.ndarray, percent: float) -> list[Any]:
    """Return mean, 6 sigma and a percentile of values (n,); undefined if there are too few, or one is not a number."""
    if len(x) < MIN_VALUES or not np.isfinite(x).all():
        return [intervals.UNDEFINED] * len(terms.ENVELOPE)
    sample = Sample.of(x)
    return [
        intervals.mean(sample), intervals.standard_deviation(sample, times=6), *intervals.percentiles(sample, [percent])
    ]  # fmt: skip
