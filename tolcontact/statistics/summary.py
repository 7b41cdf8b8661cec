"""What a run shows about each measure, each part and the contact, read from its archive alone, piece by piece."""

from collections import Counter

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import ArchiveError
from tolcontact.readable import FORMATTERS, HTML
from tolcontact.realizations import finished, pieces, statuses
from tolcontact.statistics import capability, contact, intervals
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.sample import Sample, measured_sample

LEAST = 2


class Summary(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset that a notebook shows as tables."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return FORMATTERS[HTML](self)


def summarize(results: xr.DataTree) -> Summary:
    """Statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, interval) in the measure's units; shares are of 1
    change          (measure, change_of, interval)         corrected against raw, from the same realizations
    touched         (interval)                           share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    not_assemblable (interval)                           share of realizations without a pose free of penetration
    conflicts       (pair)                               in how many of these a pair is among those in conflict
    penetration     (state)                              largest true penetration of any contact point [mm]
    surface_penetration, beside   largest of the realizations that were checked against the surfaces [mm]: how deep a face lies
                                  in the other body, and how far contact points that touch stand beside the face
    surfaces_checked              number of these realizations
    carried         (pair, interval)                     share of realizations in which a pair carries
    reaction        (pair, of_reaction, interval)        mean and percentiles of its reaction, in the objective's units
    together        (combination, interval)              share of realizations in which just these pairs carry
    iterations      (of_iterations)                      median and largest number of linear steps of those touched
    field_extreme   (part, state, extreme, interval)     least and largest 6 sigma of the displacement magnitude [mm]
    field_realizations                                   number of realizations in the displacement fields,
    magnitude_realizations                               and in their magnitudes

    The attribute `realizations` is the number of those that are finished, `samples` of those that the run was begun for.
    Raises ArchiveError if fewer than LEAST realizations are finished.
    """
    done = finished(results)
    if done < LEAST:
        raise ArchiveError(f"{done} realizations are finished, too few for statistics; continue with --resume")
    rows = results.to_dataset().isel({terms.REALIZATION: slice(done)})
    measures = range(rows.sizes[terms.MEASURE])
    samples = [[measured_sample(rows, measure, state) for state in terms.STATES] for measure in measures]
    values = np.array([[_of_sample(sample, rows, k) for sample in both] for k, both in enumerate(samples)])
    changes = np.array([_change(raw, corrected) for raw, corrected in samples])
    by_status = np.sum([np.bincount(piece, minlength=len(terms.STATUS_MEANINGS)) for piece in statuses(rows)], axis=0)
    total = int(by_status.sum())
    parts, together = rows[terms.PART].values, contact.combinations(rows)
    return Summary(
        {
            "statistic_value": ((terms.MEASURE, terms.STATE, terms.STATISTIC, terms.INTERVAL), values),
            "change": ((terms.MEASURE, terms.CHANGE_OF, terms.INTERVAL), changes),
            "touched": ((terms.INTERVAL,), np.array(intervals.proportion_of(total - by_status[terms.Status.UNTOUCHED], total))),
            "by_status": ((terms.STATUS_MEANING,), by_status),
            "not_assemblable": (
                (terms.INTERVAL,),
                np.array(intervals.proportion_of(by_status[terms.Status.NOT_ASSEMBLABLE], total)),
            ),
            "conflicts": ((terms.PAIR,), np.sum([in_conflict(piece).sum(axis=0) for piece in pieces(rows)], axis=0)),
            "carried": ((terms.PAIR, terms.INTERVAL), contact.carried(rows)),
            "reaction": (
                (terms.PAIR, terms.OF_REACTION, terms.INTERVAL),
                contact.reactions(rows),
                {"units": rows[terms.REACTION.name].attrs.get("units", "1")},
            ),
            "together": (
                (terms.COMBINATION, terms.INTERVAL),
                np.array([intervals.proportion_of(n, total) for _, n in together]).reshape(-1, len(terms.ESTIMATE)),
            ),
            "iterations": ((terms.OF_ITERATIONS,), _iterations(rows)),
            "penetration": ((terms.STATE,), _penetration(rows), {"units": "mm"}),
            **_checked(results),
            "field_extreme": (
                (terms.PART, terms.STATE, terms.EXTREME, terms.INTERVAL),
                np.array([_field_extremes(results, str(part)) for part in parts]),
                {"units": "mm"},
            ),
            "field_realizations": ((), min(_summed(results, str(part)) for part in parts), {"units": "1"}),
            "magnitude_realizations": ((), min(_magnitudes(results, str(part)) for part in parts), {"units": "1"}),
        },
        coords={
            terms.MEASURE: rows[terms.MEASURE].values,
            terms.STATE: list(terms.STATES),
            terms.STATISTIC: list(terms.EVERY_STATISTIC),
            terms.INTERVAL: list(terms.ESTIMATE),
            terms.CHANGE_OF: list(terms.CHANGES),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
            terms.PART: parts,
            terms.PAIR: rows[terms.PAIR].values,
            terms.OF_REACTION: list(terms.REACTION_STATISTICS),
            terms.COMBINATION: [" + ".join(pairs) or "none" for pairs, _ in together],
            terms.OF_ITERATIONS: list(terms.MIDDLES),
            terms.EXTREME: list(terms.EXTREMES),
            "measure_units": (terms.MEASURE, rows[terms.MEASURE_UNITS.name].values),
            **{
                f"measure_{side}": (terms.MEASURE, of_side)
                for side, of_side in zip(("lower", "upper"), limits(rows).T, strict=True)
            },
            "measure_quantity": (terms.MEASURE, _quantities(rows)),
        },
        attrs={
            "title": results.attrs.get("title", ""),
            "realizations": total,
            "samples": _begun_for(results, total),
            **{word: results.attrs[word] for word in ("resolution", "objective", "active_set")},
            "datum_shifts": ", ".join(_datum_shifts(results)),
            "smallest_range": _smallest_range(results, rows),
        },
    )


def estimate_of(results: xr.DataTree, measure: str, statistic: str) -> Estimate:
    """One of the statistics of `summarize`, of a corrected measure."""
    rows = results.to_dataset().isel({terms.REALIZATION: slice(finished(results))})
    number = rows[terms.MEASURE].values.tolist().index(measure)
    x = measured_sample(rows, number, terms.STATES[terms.CORRECTED])
    return _of_sample(x, rows, number)[terms.EVERY_STATISTIC.index(statistic)]


def in_conflict(rows: xr.Dataset) -> np.ndarray:
    """Which pairs contradict each other if no pose is free of penetration, (realization, pair) bool.

    These are the pairs that the pose of least penetration leaves inside each other.
    """
    gap = rows[terms.GAP_MIN.name].sel({terms.STATE: "corrected"}).transpose(terms.REALIZATION, terms.PAIR).values
    stuck = rows[terms.STATUS.name].values == terms.Status.NOT_ASSEMBLABLE
    return np.asarray(stuck[:, None] & (gap < -rows.attrs["solver_accuracy"]))


def _penetration(rows: xr.Dataset) -> np.ndarray:
    if not rows[terms.GAP_MIN.name].size:
        return np.zeros(len(terms.STATES))
    least = [piece[terms.GAP_MIN.name].min([terms.REALIZATION, terms.PAIR]).values for piece in pieces(rows)]
    return np.asarray(np.maximum(-np.min(least, axis=0), 0))


def _checked(results: xr.DataTree) -> dict[str, tuple[tuple[()], float, dict[str, str]]]:
    largest, count = [np.nan, np.nan], 0
    if "surface" in results.children:  # archives of before have none
        of = results["surface"].to_dataset()
        known = [of[v.name].values[~np.isnan(of[v.name].values)] for v in (terms.SURFACE_PENETRATION, terms.BESIDE)]
        largest = [float(values.max()) if values.size else np.nan for values in known]
        count = int((of[terms.CHECKED_REALIZATION.name] != terms.UNFINISHED).sum())
    return {
        "surface_penetration": ((), largest[0], {"units": "mm"}),
        "beside": ((), largest[1], {"units": "mm"}),
        "surfaces_checked": ((), count, {"units": "1"}),
    }


def _iterations(rows: xr.Dataset) -> list[float]:
    """Median and largest number of linear steps of the realizations that contact touched: those that took any."""
    counts: Counter[int] = Counter()
    for piece in pieces(rows[[terms.ITERATIONS.name]]):
        steps, times = np.unique(piece[terms.ITERATIONS.name].values, return_counts=True)
        counts.update(dict(zip(steps.tolist(), times.tolist(), strict=True)))
    taken = sorted(steps for steps in counts if steps > 0)
    if not taken:
        return [0.0, 0.0]
    below = np.cumsum([counts[steps] for steps in taken])
    middle = np.searchsorted(below, [(below[-1] - 1) // 2, below[-1] // 2], side="right")
    return [float(np.mean([taken[k] for k in middle])), float(taken[-1])]


def _smallest_range(results: xr.DataTree, rows: xr.Dataset) -> float:
    """The smallest tolerance range above 0 of any contributor or measure [mm]; infinite if there is none."""
    sample = results["sample"].to_dataset()
    contributors = sample[terms.TOLERANCE_RANGE.name].values
    if terms.CONTRIBUTOR_UNITS.name in sample:  # archives up to format 3 have locators alone
        contributors = contributors[sample[terms.CONTRIBUTOR_UNITS.name].values == "mm"]
    ranges = np.concatenate(
        [contributors, rows[terms.MEASURE_TOLERANCE.name].values[rows[terms.MEASURE_UNITS.name].values == "mm"]]
    )
    return float(np.min(ranges, where=ranges > 0, initial=np.inf))


def _datum_shifts(results: xr.DataTree) -> list[str]:
    """Features with a datum at maximum or least material, as part.feature."""
    sample = results["sample"].to_dataset()
    if terms.DISTRIBUTION.name not in sample or terms.CONTRIBUTOR not in sample[terms.DISTRIBUTION.name].dims:
        return []
    labels = zip(sample[terms.CONTRIBUTOR].values, sample[terms.DISTRIBUTION.name].values, strict=True)
    shifted = [str(label).rpartition(".")[0] for label, said in labels if "(M)" in str(said) or "(L)" in str(said)]
    return list(dict.fromkeys(shifted))


def _begun_for(results: xr.DataTree, done: int) -> int:
    """How many realizations the run was begun for; those that are there, if they were taken from an archive."""
    samples, size = int(results.attrs["samples"]), results.to_dataset().sizes[terms.REALIZATION]
    unfinished = size > done or size == terms.FIRST_ROWS
    return max(samples, done) if unfinished else done


def _of_sample(x: Sample, rows: xr.Dataset, measure: int) -> list[Estimate]:
    variance = intervals.variance(x)
    spreads = [intervals.root(variance), intervals.root(variance, times=6), variance]
    shape = [intervals.skewness(x), intervals.kurtosis(x)]
    return [
        intervals.mean(x),
        *spreads,
        *intervals.percentiles(x, terms.PERCENTILES),
        *shape,
        *_within(x, *limits(rows)[measure]),
    ]


def _within(x: Sample, lower: float, upper: float) -> list[Estimate]:
    """How a sample stays within limits; nothing if it is not of numbers."""
    if not np.isfinite(x.mean):
        return [intervals.UNDEFINED] * len((*terms.SHARES, *terms.CAPABILITY))
    shares = [capability.share_below(x, lower), capability.share_above(x, upper), capability.share_outside(x, lower, upper)]
    return [*shares, *capability.by_percentiles(x, lower, upper), *capability.as_normal(x, lower, upper)]


def limits(rows: xr.Dataset) -> np.ndarray:
    """Lower and upper limit of each measure (measure, 2); NaN where a side is open."""
    if terms.LOWER_LIMIT.name in rows:
        return np.column_stack([rows[terms.LOWER_LIMIT.name].values, rows[terms.UPPER_LIMIT.name].values])
    nominal, half = rows[terms.MEASURE_NOMINAL.name].values, rows[terms.MEASURE_TOLERANCE.name].values / 2
    return np.column_stack([nominal - half, nominal + half])


def _quantities(rows: xr.Dataset) -> np.ndarray:
    """What each measure is a value of; archives before format 4 do not say it."""
    known = terms.QUANTITY.name in rows
    return np.asarray(rows[terms.QUANTITY.name].values if known else [""] * rows.sizes[terms.MEASURE], dtype=object)


def _change(raw: Sample, corrected: Sample) -> list[Estimate]:
    ratio = intervals.variance_ratio(corrected, raw)
    return [intervals.mean(corrected - raw), intervals.root(ratio), ratio]


def _field_extremes(results: xr.DataTree, part: str) -> np.ndarray:
    """6 sigma of |u|, and its interval, where the archived field is least and largest; (state, extreme, bound)."""
    found = np.full((len(terms.STATES), 2, len(terms.ESTIMATE)), np.nan)
    if not _summed(results, part):
        return found
    field = _field(results, part)
    six_sigma = field[terms.FIELD_SIX_SIGMA.name].sel({terms.COMPONENT: "magnitude"}).values
    for state, values in enumerate(six_sigma):
        if np.isfinite(values).all():
            where = [values.argmin(), values.argmax()]
            found[state, :, 0] = values[where]
            found[state, :, 1:] = field[terms.FIELD_INTERVAL.name].values[state, where]
    return found


def _summed(results: xr.DataTree, part: str) -> int:
    """How many realizations are in the field of a part; 0 if it is being written."""
    field = _field(results, part)
    if terms.FIELD_REALIZATIONS.name not in field:  # archives of format 1 have fields of all their rows, or none
        return results.to_dataset().sizes[terms.REALIZATION]
    whole = int(field[terms.GROUP_CHECKSUM.name]) != terms.UNFINISHED
    return int(field[terms.FIELD_REALIZATIONS.name]) if whole else 0


def _magnitudes(results: xr.DataTree, part: str) -> int:
    """How many realizations are in the magnitude of a part's field: before format 3 all of the field's."""
    field, summed = _field(results, part), _summed(results, part)
    known = terms.MAGNITUDE_REALIZATIONS.name in field
    return min(int(field[terms.MAGNITUDE_REALIZATIONS.name]), summed) if known else summed


def _field(results: xr.DataTree, part: str) -> xr.Dataset:
    return results["field"].children[terms.group_of(part)].to_dataset()
