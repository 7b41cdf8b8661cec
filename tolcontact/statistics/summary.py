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
SHIFT, SPREAD_RATIO, VARIANCE_RATIO = "shift of the mean", "ratio of 6 sigma", "ratio of variance"


def summarize(results: xr.DataTree) -> xr.Dataset:
    """Statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, bound)   in the measure's units; "outside tolerance" is a share
    change          (measure, change_of, bound)          corrected against raw, from the same realizations
    touched         (bound)                              share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    penetration     (state)                              largest true penetration of any contact point [mm]
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
            "extreme": ["least", "largest"],
            "measure_units": (words.MEASURE, rows[words.MEASURE_UNITS.name].values),
            "measure_tolerance": (words.MEASURE, rows[words.MEASURE_TOLERANCE.name].values),
        },
        attrs={"title": results.attrs.get("title", ""), "realizations": len(status)},
    )


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
