"""The statistics of a measure: one table of names and functions; and the texts of options that name one."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.realizations import assembled
from tolcontact.statistics import capability, intervals
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sample import Sample, measured_sample

NUMBER = r"(?P<value>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
MIN_VALUES = 2
NO_VALUE, VALUE, HALF_WIDTH = "", rf" *{NUMBER}", rf" *(?:\+-|±) *{NUMBER} *(?P<percent>%)?"  # may follow the statistic


@dataclass(frozen=True)
class StatisticRequest:
    """A statistic of a measure, with its required value above 0 if there is one.

    option      the name of the option, for messages
    is_percent  whether the value is followed by a percent sign
    """

    option: str
    measure: str
    statistic: str
    value: float
    is_percent: bool

    @classmethod
    def parse(
        cls, text: str, option: str, *, statistics: Sequence[str], form: str = NO_VALUE, examples: tuple[str, str]
    ) -> "StatisticRequest":
        """Return the request that a text states. Raises OptionError for other texts, and for statistics not in `statistics`."""
        match = re.fullmatch(rf"(?P<measure>.+): *(?P<statistic>.+?){form}", text.strip()) if isinstance(text, str) else None
        fields = match.groupdict() if match else {}
        value = float(fields.get("value", "nan"))
        if match is None or value == 0:
            expected = " or ".join(f'"{example}"' for example in examples)
            raise OptionError(f"{option} is {text!r}; expected a text such as {expected}")
        if fields["statistic"] not in statistics:
            raise OptionError(f'{option} has "{fields["statistic"]}"; expected one of: {", ".join(statistics)}')
        return cls(option, fields["measure"], fields["statistic"], value, fields.get("percent") is not None)

    def number_of(self, measures: Sequence[str]) -> int:
        """Return the index of the measure among the names of a model's measures. Raises OptionError if it is not there."""
        if self.measure not in measures:
            raise OptionError(f'{self.option} has the measurement "{self.measure}"; expected one of: {", ".join(measures)}')
        return list(measures).index(self.measure)


class MeasuredValues:
    """The values of a measure in one state, with its limits; intermediate results of several statistics are computed once.

    Corrected values of realizations that cannot be assembled do not exist. Statistics leave them out, and the share outside
    the limits counts them as outside; all shares are of all realizations.
    """

    def __init__(self, rows: xr.Dataset, measure: int, state: str, limits: Limits) -> None:
        (existing,) = (rows,) if state == terms.STATES[terms.RAW] else assembled(rows)
        self.sample: Sample = measured_sample(existing, measure, state)
        self.missing = rows.sizes[terms.REALIZATION] - self.sample.count
        self.limits = limits

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
        """Pp and Ppk for a normal distribution."""
        return capability.as_normal(self.sample, self.limits)

    def share(self, limits: Limits, *, counts_missing: bool = False) -> Estimate:
        """Return the share of values beyond limits; undefined if a value is not a number."""
        if not np.isfinite(self.sample.mean):
            return UNDEFINED
        return capability.share_outside(self.sample, limits, self.missing, counts_missing=counts_missing)

    def estimate(self, statistic: str) -> Estimate:
        """Return one of `STATISTICS`; undefined, except for the share outside, if fewer than two values exist."""
        if self.sample.count >= MIN_VALUES:
            return STATISTICS[statistic](self)
        return UNDEFINED if statistic != terms.OUTSIDE or self.limits.are_open else intervals.proportion_of(1, 1)


STATISTICS: dict[str, Callable[[MeasuredValues], Estimate]] = {
    terms.MEAN: lambda x: intervals.mean(x.sample),
    terms.STANDARD_DEVIATION: lambda x: intervals.root(x.variance),
    terms.SIX_SIGMA: lambda x: intervals.root(x.variance, times=6),
    terms.VARIANCE: lambda x: x.variance,
    **{f"{percent:g} %": lambda x, percent=percent: x.percentiles[percent] for percent in terms.PERCENTILES},  # type: ignore[misc]
    terms.SKEWNESS: lambda x: intervals.skewness(x.sample),
    terms.KURTOSIS: lambda x: intervals.kurtosis(x.sample),
    terms.BELOW: lambda x: x.share(x.limits._replace(upper=math.inf)),
    terms.ABOVE: lambda x: x.share(x.limits._replace(lower=-math.inf)),
    terms.OUTSIDE: lambda x: x.share(x.limits, counts_missing=True),
    terms.PP: lambda x: x.capability[0],
    terms.PPK: lambda x: x.capability[1],
    terms.PP_NORMAL: lambda x: x.capability_as_normal[0],
    terms.PPK_NORMAL: lambda x: x.capability_as_normal[1],
}


def measure_estimates(rows: xr.Dataset) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return statistics, changes and notes of all measures; the values of one measure are in memory at a time.

    statistics  (measure, state, statistic, interval)  all `STATISTICS`
    changes     (measure, change_of, interval)         from raw to corrected, over realizations that can be assembled
    notes       MEASURE_STOPS (measure,)               the sides, "lower" or "upper" or both, at which corrected values stop
                                                       (see without_stops)
                NOT_A_NUMBER (measure,)                number of corrected values that are not a number
                REQUIRED (measure,)                    number of realizations that moments need, where a stop leaves too few
    """
    statistics, changes, stops, undefined, required, (existing,) = [], [], [], [], [], assembled(rows)
    for number, limits_of_measure in enumerate(limits(rows)):
        raw, corrected = (MeasuredValues(rows, number, state, limits_of_measure) for state in terms.STATES)
        statistics.append([[x.estimate(statistic) for statistic in STATISTICS] for x in (raw, corrected)])
        before = raw.sample if existing is rows else measured_sample(existing, number, terms.STATES[terms.RAW])
        changes.append(changes_of(before, corrected.sample))
        stops.append(_stops(corrected))
        undefined.append(int((~np.isfinite(corrected.sample.values)).sum()))
        required.append(max(x.sample.required if x.sample.count else 0 for x in (raw, corrected)))
    counts = {terms.NOT_A_NUMBER: undefined, terms.REQUIRED: required}
    notes = {terms.MEASURE_STOPS: np.array(stops, dtype=object), **{k: np.array(v, dtype=np.int64) for k, v in counts.items()}}
    return np.array(statistics), np.array(changes), notes


def _stops(x: MeasuredValues) -> str:
    has_values = x.sample.count >= MIN_VALUES and np.isfinite(x.sample.mean)
    kept = capability.without_stops(x.sample, x.limits) if has_values else x.limits
    named = zip(terms.BOUNDS, x.limits, kept, strict=False)
    return " and ".join(side for side, limit, left in named if np.isfinite(limit) and not np.isfinite(left))


def changes_of(raw: Sample, corrected: Sample) -> list[Estimate]:
    """Return the `CHANGES` of a measure between two samples of the same realizations."""
    if corrected.count < MIN_VALUES:
        return [UNDEFINED] * len(terms.CHANGES)
    ratio = intervals.variance_ratio(corrected, raw)
    estimates = {
        terms.SHIFT: intervals.mean(corrected - raw),
        terms.SPREAD_RATIO: intervals.root(ratio),
        terms.VARIANCE_RATIO: ratio,
    }
    return [estimates[name] for name in terms.CHANGES]


def limits(rows: xr.Dataset) -> list[Limits]:
    """Return the limits of each measure; not a number where a side is open."""
    columns = (rows[variable.name].values for variable in (terms.LOWER_LIMIT, terms.UPPER_LIMIT, terms.MEASURE_ACCURACY))
    return [Limits(*map(float, values)) for values in zip(*columns, strict=True)]
