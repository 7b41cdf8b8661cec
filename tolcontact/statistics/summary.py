"""The summary of a run: estimates of measures, parts and contact, read from its archive piece by piece."""

from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import UNITS
from tolcontact.errors import ArchiveError
from tolcontact.readable import Pictured
from tolcontact.realizations import finished, pieces, statuses
from tolcontact.statistics import contact, intervals
from tolcontact.statistics.few_parts import has_few_parts, with_few_parts, worlds_of
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.measure_statistics import STATISTICS, MeasuredValues, limits, measure_estimates
from tolcontact.vocabulary import ArchiveVariable

MIN_REALIZATIONS = 2
TEXTS = (
    terms.NOT_WATCHED,
    terms.STANDARD,
    terms.STORED_COORDINATES,
    terms.ELASTIC_PARTS,
    terms.CORRELATIONS,
)  # attributes of runs


class Summary(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset that a notebook shows as tables."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return Pictured.picture(self)


def summarize(results: xr.DataTree) -> Summary:
    """Return the statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, interval) in the measure's units; shares are of 1. In the corrected state,
                                  realizations that cannot be assembled count as outside the limits, and are left out otherwise
    change          (measure, change_of, interval)         from raw to corrected, over the same realizations
    touched         (interval)                           share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    not_assemblable (interval)                           share of realizations without a pose free of penetration
    conflicts       (pair)                               number of these with the pair in conflict
    penetration     (state)                              largest true penetration in a pair that is not compliant [mm]
    watched                                              number of realizations whose bodies were tested for interference
    clash_share     (interval)                           share of these with penetration between parts without contact
    clash_count, clash_largest_depth (clash)             number of realizations with two parts as the deepest pair, depth [mm]
    clash_declared  (clash)                              1: their contact is declared, and these realizations are doubtful
    surface_penetration, beside   largest values in the realizations that were checked against the surfaces [mm]: the depth of a
                                  face in the other body, and the distance of touching contact points outside the face
    surfaces_checked              number of these realizations
    penetrating_share, false_contact_share   (interval)  shares of realizations whose surfaces penetrate each other, or were
                                  apart in the raw state where contact was resolved, by more than 1 % of the smallest range;
                                  from the realizations that were checked at random
    contacts, contacts_ended      in the checked realizations: number of contact points that touch, and number of these that
                                  touch a plane beyond the end of its face; NaN where unknown
    false_contact   (pair)                               in the checked realizations: depth of contact points in the raw state
                                                         where the surfaces were apart [mm]; NaN where unknown
    carried         (pair, interval)                     share of realizations with a pair under load
    reaction        (pair, of_reaction, interval)        mean and percentiles of its reaction, in the objective's units
    together        (combination, interval)              share of realizations with exactly these pairs under load
    locator_offset  (part, of_offset, interval)          how far contact moved a part off its two-sided locators [mm]
    offset_beyond   (part, interval)                     share of realizations with more than these locators vary,
    offset_unexplained (part, interval)                  and certified with more than that and the largest raw penetration
    change_by_objective (by_objective, measure, change_of, interval)   change if another objective decided, from
    compared_by_objective (by_objective)                 that number of the same realizations
    iterations      (of_iterations)                      median and largest number of linear steps of touched realizations
    field_extreme   (part, state, extreme, interval)     least and largest 6 sigma of the displacement magnitude [mm]
    field_realizations                                   number of realizations in the displacement fields,
    magnitude_realizations                               and in their magnitudes

    The attribute `realizations` is the number of finished realizations, `samples` the number that the run was started with.
    Raises ArchiveError if fewer than MIN_REALIZATIONS realizations are finished.
    """
    dataset = _estimates(results)
    return Summary(dataset.data_vars, dataset.coords, dataset.attrs)


def _estimates(results: xr.DataTree) -> xr.Dataset:
    """Return the dataset of `summarize`."""
    count = finished(results)
    if count < MIN_REALIZATIONS:
        raise ArchiveError(
            f"{count} realizations are in the archive, too few for statistics; those in the journal of a run that was killed "
            "are not counted: continue with --resume, which keeps them"
        )
    rows = results.to_dataset().isel({terms.REALIZATION: slice(count)})
    combinations, smallest = contact.combinations(rows), _smallest_range(results, rows)
    statistics, changes, notes = measure_estimates(rows)
    by_realizations = statistics
    worlds, texts = worlds_of(results, count), {name: str(results.attrs.get(name, "")) for name in TEXTS}
    if is_left_out := worlds is None and has_few_parts(results):
        texts[terms.CORRELATIONS] = texts[terms.CORRELATIONS].replace(terms.KNOWN_FROM_FEW, terms.FEW_LEFT_OUT)
    if worlds:
        statistics, changes = with_few_parts(rows, worlds, statistics, changes)
    notes[terms.OPEN_BY_PARTS] = _are_open_by_parts(by_realizations, statistics)
    notes[terms.FEW_ROWS] = _have_few_rows(statistics)
    rigid, (clashes, clash_names) = _is_rigid(results), contact.clashes(rows)
    values = {
        terms.STATISTIC_VALUE: statistics,
        terms.CHANGE: changes,
        **_status_values(rows, rigid),
        terms.CARRIED: contact.loaded(rows),
        terms.PAIR_REACTION: contact.reactions(rows),
        terms.CARRIED_TOGETHER: contact.shares([times for _, times in combinations], count),
        **contact.offset_values(rows),
        **contact.changes_by_objective(results),
        terms.STEPS: _steps(rows),
        terms.PENETRATION: _penetration(rows, rigid),
        **clashes,
        **contact.surface_values(results, terms.NOTICED_SHARE * smallest),
        **_field_values(results),
    }
    units = {terms.PAIR_REACTION: {"units": rows[terms.REACTION.name].attrs["units"]}}
    return xr.Dataset(
        {variable.name: variable.entry(array, **units.get(variable, {})) for variable, array in values.items()},
        _coordinates(rows, combinations)
        | {name: (terms.MEASURE, values) for name, values in notes.items()}
        | {terms.CLASH: clash_names, terms.BY_OBJECTIVE: contact.other_objectives(results)},
        {
            "title": results.attrs["title"],
            "realizations": count,
            # With rows that were selected from an archive, there are no others.
            "samples": int(results.attrs["samples"]) if count == int(results.attrs["realizations"]) else count,
            **{name: results.attrs[name] for name in terms.METHOD_ATTRIBUTES},
            "search": results.attrs["search"],
            "datum_shifts": ", ".join(_datum_shifts(results)),
            "smallest_range": smallest,
            terms.INTERFERENCE_DEPTH: float(results.attrs.get(terms.INTERFERENCE_DEPTH, np.nan)),
            terms.PARTS_LEFT_OUT: int(is_left_out),
            **texts,
        },
    )


def estimate_of(results: xr.DataTree, measure: str, statistic: str) -> Estimate:
    """Return one of `STATISTICS` of a corrected measure."""
    rows = results.to_dataset().isel({terms.REALIZATION: slice(finished(results))})
    number = rows[terms.MEASURE].values.tolist().index(measure)
    return MeasuredValues(rows, number, terms.STATES[terms.CORRECTED], limits(rows)[number]).estimate(statistic)


def in_conflict(rows: xr.Dataset, rigid: np.ndarray) -> np.ndarray:
    """Return the pairs that contradict each other where no pose is free of penetration, (realization, pair) bool.

    These are the `rigid` pairs (pair,) that still penetrate at the pose of least penetration.
    """
    gap = rows[terms.GAP_MIN.name].sel({terms.STATE: "corrected"}).transpose(terms.REALIZATION, terms.PAIR).values
    stuck = rows[terms.STATUS.name].values == terms.Status.NOT_ASSEMBLABLE
    return stuck[:, None] & (gap < -rows.attrs["solver_accuracy"]) & rigid


def _are_open_by_parts(by_realizations: np.ndarray, statistics: np.ndarray) -> np.ndarray:
    """Return whether few parts make the interval of a share outside limits (measure,) more than twice as wide."""
    before, after = (
        np.ptp(values[:, terms.CORRECTED, list(STATISTICS).index(terms.OUTSIDE), 1:], axis=1)
        for values in (by_realizations, statistics)
    )
    return (after > 2 * before).astype(np.int64)


def _have_few_rows(statistics: np.ndarray) -> np.ndarray:
    """Return whether the median of a measure (measure,) has no bounds in either state: few realizations leave infinite ones."""
    medians = statistics[:, :, list(STATISTICS).index("50 %")]
    return (np.isfinite(medians[..., 0]) & np.isnan(medians[..., 1])).any(axis=1).astype(np.int64)


def _coordinates(rows: xr.Dataset, combinations: list[tuple[tuple[str, ...], int]]) -> dict[str, Any]:
    """Return the labels of all dimensions, and the descriptions of measures."""
    return {
        terms.MEASURE: rows[terms.MEASURE].values,
        terms.STATE: list(terms.STATES),
        terms.STATISTIC: list(STATISTICS),
        terms.INTERVAL: list(terms.ESTIMATE),
        terms.CHANGE_OF: list(terms.CHANGES),
        terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        terms.PART: rows[terms.PART].values,
        terms.PAIR: rows[terms.PAIR].values,
        terms.OF_REACTION: list(terms.REACTION_STATISTICS),
        terms.COMBINATION: [" + ".join(pairs) or "none" for pairs, _ in combinations],
        terms.OF_OFFSET: list(terms.OFFSET_PERCENTILES),
        terms.OF_ITERATIONS: list(terms.MIDDLES),
        terms.EXTREME: list(terms.EXTREMES),
        terms.MEASURE_UNITS.name: (terms.MEASURE, rows[terms.MEASURE_UNITS.name].values),
        terms.MEASURE_NOMINAL.name: (terms.MEASURE, rows[terms.MEASURE_NOMINAL.name].values),
        **{
            name: (terms.MEASURE, np.array(values))
            for name, values in zip(terms.MEASURE_LIMITS, zip(*limits(rows), strict=True), strict=True)
        },
        terms.QUANTITY.name: (terms.MEASURE, rows[terms.QUANTITY.name].values),
        **{label.name: (label.dims, rows[label.name].values) for label in terms.OF_STATIONS if label.name in rows},
    }


def _status_values(rows: xr.Dataset, rigid: np.ndarray) -> dict[ArchiveVariable, Any]:
    """Return the number of realizations of each status, and the resulting shares and conflicts of `rigid` pairs."""
    by_status = np.bincount(statuses(rows), minlength=len(terms.STATUS_MEANINGS))
    total, not_assemblable = int(by_status.sum()), by_status[terms.Status.NOT_ASSEMBLABLE]
    return {
        terms.TOUCHED: np.array(intervals.proportion_of(total - by_status[terms.Status.UNTOUCHED], total)),
        terms.BY_STATUS: by_status,
        terms.NOT_ASSEMBLABLE_SHARE: np.array(intervals.proportion_of(not_assemblable, total)),
        terms.CONFLICTS: np.sum([in_conflict(piece, rigid).sum(axis=0) for piece in pieces(rows)], axis=0),
    }


def _field_values(results: xr.DataTree) -> dict[ArchiveVariable, Any]:
    """Return the extremes of the displacement fields, and the number of realizations that all of them cover.

    The extremes (part, state, extreme, interval) are 6 sigma of |u|, and its interval, where a field is least and largest.
    """
    parts = [str(part) for part in results.to_dataset()[terms.PART].values]
    fields = [results["field"].children[terms.group_of(part)].to_dataset() for part in parts]
    summed = [int(field[terms.FIELD_REALIZATIONS.name]) for field in fields]
    magnitudes = [int(field[terms.MAGNITUDE_REALIZATIONS.name]) for field in fields]
    extremes = np.full((len(parts), len(terms.STATES), len(terms.EXTREMES), len(terms.ESTIMATE)), np.nan)
    for field, count, extremes_of_part in zip(fields, summed, extremes, strict=True):
        six_sigma = field[terms.FIELD_SIX_SIGMA.name].sel({terms.COMPONENT: "magnitude"}).values
        for state, values in enumerate(six_sigma):
            if count and np.isfinite(values).all():
                vertices = [values.argmin(), values.argmax()]
                extremes_of_part[state, :, 0] = values[vertices]
                extremes_of_part[state, :, 1:] = field[terms.FIELD_INTERVAL.name].values[state, vertices]
    return {
        terms.FIELD_EXTREME: extremes,
        terms.REALIZATIONS_IN_FIELDS: min(summed, default=0),
        terms.REALIZATIONS_IN_MAGNITUDES: min([*magnitudes, *summed], default=0),
    }


def _is_rigid(results: xr.DataTree) -> np.ndarray:
    """Return whether no point of a pair is compliant, (pair,)."""
    rigid = np.ones(results.to_dataset().sizes[terms.PAIR], dtype=bool)
    if terms.POINT_STIFFNESS.name in (contact := results["contact"].to_dataset()):
        gives = np.isfinite(contact[terms.POINT_STIFFNESS.name].values)
        rigid[contact[terms.PAIR_OF_POINT.name].values[gives]] = False
    return rigid


def _penetration(rows: xr.Dataset, rigid: np.ndarray) -> np.ndarray:
    """Return the largest penetration of any contact point of the `rigid` pairs (pair,) in each state [mm]."""
    if not (rows[terms.GAP_MIN.name].size and rigid.any()):
        return np.zeros(len(terms.STATES))
    gaps = (piece[terms.GAP_MIN.name].transpose(terms.STATE, ..., terms.PAIR).values for piece in pieces(rows))
    return np.maximum(-np.min([np.fmin.reduce(gap[..., rigid], axis=(1, 2)) for gap in gaps], axis=0), 0)


def _steps(rows: xr.Dataset) -> list[float]:
    """Return the median and the largest number of linear steps, over the realizations with at least one."""
    steps = rows[terms.ITERATIONS.name].values
    positive = steps[steps > 0]
    return [float(np.median(positive)), float(positive.max())] if positive.size else [0.0, 0.0]


def _smallest_range(results: xr.DataTree, rows: xr.Dataset) -> float:
    """Return the smallest tolerance range above 0 of any contributor or measure [mm]; infinite if there is none."""
    sample = results["sample"].to_dataset()
    contributors = sample[terms.TOLERANCE_RANGE.name].values[sample[terms.CONTRIBUTOR_UNITS.name].values == "mm"]
    sizes = np.array([UNITS.get(str(unit), np.nan) for unit in rows[terms.MEASURE_UNITS.name].values])
    measures = rows[terms.MEASURE_TOLERANCE.name].values * sizes
    ranges = np.concatenate([contributors, measures[np.isfinite(measures)]])
    return float(np.min(ranges, where=ranges > 0, initial=np.inf))


def _datum_shifts(results: xr.DataTree) -> list[str]:
    """Return the features with a datum at maximum or least material condition, as part.feature."""
    sample = results["sample"].to_dataset()
    labels = zip(sample[terms.CONTRIBUTOR].values, sample[terms.DISTRIBUTION.name].values, strict=True)
    shifted = [str(label).rpartition(".")[0] for label, text in labels if "(M)" in str(text) or "(L)" in str(text)]
    return list(dict.fromkeys(shifted))
