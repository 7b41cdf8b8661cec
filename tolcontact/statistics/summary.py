"""What a run says about each measure, each part and the contact, read from its archive alone."""

import functools
from collections.abc import Callable

import numpy as np
import xarray as xr

from tolcontact import vocabulary as words
from tolcontact.statistics import intervals
from tolcontact.statistics.fields import displacement
from tolcontact.statistics.intervals import Estimate

ESTIMATE = ("estimate", "lower", "upper")
PERCENTILES = (0.135, 5, 50, 95, 99.865)
STATISTICS: dict[str, Callable[[np.ndarray], Estimate]] = {
    "mean": intervals.mean,
    "standard deviation": intervals.standard_deviation,
    "6 sigma": lambda x: intervals.standard_deviation(x, times=6),
    "variance": intervals.variance,
    **{f"{percent:g} %": functools.partial(intervals.percentile, percent=percent) for percent in PERCENTILES},
}
OUTSIDE = "outside tolerance"
NOT_ASSEMBLABLE = words.STATUS_MEANINGS.index("not_assemblable")
SHIFT, SPREAD_RATIO, VARIANCE_RATIO = "shift of the mean", "ratio of 6 sigma", "ratio of variance"


def summarize(results: xr.DataTree) -> xr.Dataset:
    """Statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, bound)   in the measure's units; "outside tolerance" is a share
    change          (measure, change_of, bound)          corrected against raw, from the same realizations
    touched         (bound)                              share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    not_assemblable (bound)                              share of realizations without a pose free of penetration
    conflicts       (pair)                               in how many of these a pair is among those in conflict
    penetration     (state)                              largest true penetration of any contact point [mm]
    iterations      (of_iterations)                      median and largest number of linear steps of those touched
    field_extreme   (part, state, extreme, bound)        least and largest 6 sigma of the displacement magnitude [mm]
    """
    rows = results.to_dataset().isel({words.REALIZATION: finished(results)})
    x = rows[words.MEASURED.name].transpose(words.MEASURE, words.STATE, words.REALIZATION).values
    values = np.array([[_of_sample(sample, rows, k) for sample in both] for k, both in enumerate(x)])
    changes = np.array([_change(raw, corrected) for raw, corrected in x])
    status = rows[words.STATUS.name].values
    gap_min = rows[words.GAP_MIN.name]
    deepest = -gap_min.min([words.REALIZATION, words.PAIR]).values if gap_min.size else np.zeros(2)
    parts = rows[words.PART].values
    return xr.Dataset(
        {
            "statistic_value": ((words.MEASURE, words.STATE, "statistic", "bound"), values),
            "change": ((words.MEASURE, "change_of", "bound"), changes),
            "touched": (("bound",), np.array(intervals.share(status != 0))),
            "by_status": (("status_meaning",), np.bincount(status.astype(int), minlength=len(words.STATUS_MEANINGS))),
            "not_assemblable": (("bound",), np.array(intervals.share(status == NOT_ASSEMBLABLE))),
            "conflicts": ((words.PAIR,), in_conflict(rows).sum(axis=0)),
            "iterations": (("of_iterations",), _iterations(rows, status)),
            "penetration": ((words.STATE,), np.maximum(deepest, 0), {"units": "mm"}),
            "field_extreme": (
                (words.PART, words.STATE, "extreme", "bound"),
                np.array([_field_extremes(results, rows, str(part)) for part in parts]),
                {"units": "mm"},
            ),
        },
        coords={
            words.MEASURE: rows[words.MEASURE].values,
            words.STATE: list(words.STATES),
            "statistic": [*STATISTICS, OUTSIDE],
            "bound": list(ESTIMATE),
            "change_of": [SHIFT, SPREAD_RATIO, VARIANCE_RATIO],
            "status_meaning": list(words.STATUS_MEANINGS),
            words.PART: parts,
            words.PAIR: rows[words.PAIR].values,
            "of_iterations": ["median", "largest"],
            "extreme": ["least", "largest"],
            "measure_units": (words.MEASURE, rows[words.MEASURE_UNITS.name].values),
            "measure_tolerance": (words.MEASURE, rows[words.MEASURE_TOLERANCE.name].values),
        },
        attrs={
            "title": results.attrs.get("title", ""),
            "realizations": len(status),
            **{word: results.attrs[word] for word in ("resolution", "objective", "active_set")},
            "smallest_range": _smallest_range(results, rows),
        },
    )


def in_conflict(rows: xr.Dataset) -> np.ndarray:
    """Which pairs contradict each other where no pose is free of penetration, (realization, pair) bool.

    These are the pairs that the pose of least penetration leaves inside each other.
    """
    gap = rows[words.GAP_MIN.name].sel({words.STATE: "corrected"}).transpose(words.REALIZATION, words.PAIR).values
    stuck = rows[words.STATUS.name].values == NOT_ASSEMBLABLE
    return np.asarray(stuck[:, None] & (gap < -rows.attrs["solver_accuracy"]))


def _iterations(rows: xr.Dataset, status: np.ndarray) -> list[float]:
    taken = rows[words.ITERATIONS.name].values[status != 0]
    return [float(np.median(taken)), float(taken.max())] if taken.size else [0.0, 0.0]


def _smallest_range(results: xr.DataTree, rows: xr.Dataset) -> float:
    """The smallest tolerance range above 0 of any locator or measure [mm]; infinite where there is none."""
    locators = results["sample"].to_dataset()[words.TOLERANCE_RANGE.name].values
    ranges = np.concatenate(
        [locators, rows[words.MEASURE_TOLERANCE.name].values[rows[words.MEASURE_UNITS.name].values == "mm"]]
    )
    return float(np.min(ranges, where=ranges > 0, initial=np.inf))


def finished(results: xr.DataTree) -> np.ndarray:
    """Numbers of the rows that were written completely, (row,)."""
    status = results.to_dataset()[words.STATUS.name].values
    return np.flatnonzero(status != words.UNFINISHED)


def _of_sample(x: np.ndarray, rows: xr.Dataset, measure: int) -> list[Estimate]:
    tolerance = float(rows[words.MEASURE_TOLERANCE.name][measure])
    nominal = float(rows[words.MEASURE_NOMINAL.name][measure])
    known = np.isfinite(tolerance) and np.isfinite(x).all()
    outside = intervals.share(np.abs(x - nominal) > tolerance / 2) if known else (np.nan,) * 3
    return [*(statistic(x) for statistic in STATISTICS.values()), outside]


def _change(raw: np.ndarray, corrected: np.ndarray) -> list[Estimate]:
    ratio = intervals.variance_ratio(corrected, raw)
    root = (float(np.sqrt(ratio[0])), float(np.sqrt(ratio[1])), float(np.sqrt(ratio[2])))
    return [intervals.mean(corrected - raw), root, ratio]


def _field_extremes(results: xr.DataTree, rows: xr.Dataset, part: str) -> list[list[Estimate]]:
    """Interval of 6 sigma of |u| at the points where the archived field is least and largest, per state."""
    field = results["field"].children[part].to_dataset()
    extremes = []
    for state in words.STATES:
        chosen = {words.STATE: state, words.PART: part}
        R = rows[words.ROTATION.name].sel(chosen).values
        t = rows[words.TRANSLATION.name].sel(chosen).values
        six_sigma = field[words.FIELD_SIX_SIGMA.name].sel({words.STATE: state, words.COMPONENT: "magnitude"}).values
        if not np.isfinite(six_sigma).all():
            extremes.append([(np.nan,) * 3] * 2)
            continue
        points = field[words.FIELD_VERTICES.name].values[[six_sigma.argmin(), six_sigma.argmax()]]
        sizes = [np.linalg.norm(displacement(R, t, point), axis=1) for point in points]
        extremes.append([intervals.standard_deviation(size, times=6) for size in sizes])
    return extremes  # type: ignore[return-value]
