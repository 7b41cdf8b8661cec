"""The statistics of a measure: one table of names and functions."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.limits import GAP_ACCURACY, Limits
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sample import Sample, measured_sample


class MeasuredValues:
    """The values of a measure in one state, with its limits; intermediate results of several statistics are computed once."""

    def __init__(self, rows: xr.Dataset, measure: int, state: str) -> None:
        self.sample: Sample = measured_sample(rows, measure, state)
        self.limits = limits(rows)[measure]

    @cached_property
    def variance(self) -> Estimate:
        return intervals.variance(self.sample)

    @cached_property
    def percentiles(self) -> dict[float, Estimate]:
        return dict(zip(terms.PERCENTILES, intervals.percentiles(self.sample, terms.PERCENTILES), strict=True))

    @cached_property
    def capability(self) -> tuple[Estimate, Estimate]:
        """Pp and Ppk by percentiles."""
        return capability.by_percentiles(self.sample, self.limits)

    @cached_property
    def capability_as_normal(self) -> tuple[Estimate, Estimate]:
        """Pp and Ppk as of a normal distribution."""
        return capability.as_normal(self.sample, self.limits)

    def share(self, share: Callable[[Sample, Limits], Estimate]) -> Estimate:
        """Return a share of values beyond limits; undefined if a value is not a number."""
        return share(self.sample, self.limits) if np.isfinite(self.sample.mean) else UNDEFINED


STATISTICS: dict[str, Callable[[MeasuredValues], Estimate]] = {
    terms.MEAN: lambda x: intervals.mean(x.sample),
    terms.STANDARD_DEVIATION: lambda x: intervals.root(x.variance),
    terms.SIX_SIGMA: lambda x: intervals.root(x.variance, times=6),
    terms.VARIANCE: lambda x: x.variance,
    **{f"{percent:g} %": lambda x, percent=percent: x.percentiles[percent] for percent in terms.PERCENTILES},  # type: ignore[misc]
    terms.SKEWNESS: lambda x: intervals.skewness(x.sample),
    terms.KURTOSIS: lambda x: intervals.kurtosis(x.sample),
    terms.BELOW: lambda x: x.share(capability.share_below),
    terms.ABOVE: lambda x: x.share(capability.share_above),
    terms.OUTSIDE: lambda x: x.share(capability.share_outside),
    terms.PP: lambda x: x.capability[0],
    terms.PPK: lambda x: x.capability[1],
    terms.PP_NORMAL: lambda x: x.capability_as_normal[0],
    terms.PPK_NORMAL: lambda x: x.capability_as_normal[1],
}


def all_statistics(rows: xr.Dataset) -> np.ndarray:
    """Return the estimates of all `STATISTICS`, (measure, state, statistic, interval)."""
    values = [[MeasuredValues(rows, k, state) for state in terms.STATES] for k in range(rows.sizes[terms.MEASURE])]
    return np.array([[[statistic(x) for statistic in STATISTICS.values()] for x in states] for states in values])


def stops(rows: xr.Dataset) -> list[str]:
    """Return the sides, "lower" or "upper" or both, at which the corrected values of each measure stop (see without_stops)."""
    sides = []
    for number, limits_of_measure in enumerate(limits(rows)):
        sample = measured_sample(rows, number, terms.STATES[terms.CORRECTED])
        kept = capability.without_stops(sample, limits_of_measure) if np.isfinite(sample.mean) else limits_of_measure
        named = zip(terms.BOUNDS, limits_of_measure, kept, strict=False)
        sides.append(" and ".join(side for side, limit, left in named if np.isfinite(limit) and not np.isfinite(left)))
    return sides


def changes(rows: xr.Dataset) -> np.ndarray:
    """Return the changes from raw to corrected measures, (measure, change_of, interval)."""
    rows_of_changes = []
    for measure in range(rows.sizes[terms.MEASURE]):
        raw, corrected = (measured_sample(rows, measure, state) for state in terms.STATES)
        ratio = intervals.variance_ratio(corrected, raw)
        estimates = {
            terms.SHIFT: intervals.mean(corrected - raw),
            terms.SPREAD_RATIO: intervals.root(ratio),
            terms.VARIANCE_RATIO: ratio,
        }
        rows_of_changes.append([estimates[name] for name in terms.CHANGES])
    return np.array(rows_of_changes)


def limits(rows: xr.Dataset) -> list[Limits]:
    """Return the limits of each measure; not a number where a side is open."""
    if terms.LOWER_LIMIT.name in rows:
        lower, upper = rows[terms.LOWER_LIMIT.name].values, rows[terms.UPPER_LIMIT.name].values
    else:
        nominal, half = rows[terms.MEASURE_NOMINAL.name].values, rows[terms.MEASURE_TOLERANCE.name].values / 2
        lower, upper = nominal - half, nominal + half
    is_stated = terms.MEASURE_ACCURACY.name in rows  # archives of former versions do not state it
    accuracies = rows[terms.MEASURE_ACCURACY.name].values if is_stated else np.full(len(lower), GAP_ACCURACY)
    return [Limits(*map(float, values)) for values in zip(lower, upper, accuracies, strict=True)]
