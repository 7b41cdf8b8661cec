"""Comparison of runs: the statistics of their common measures, and the changes from the first run."""

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.realizations import assembled, declaration_of, is_assembled, pieces, statuses
from tolcontact.statistics import intervals
from tolcontact.statistics.few_parts import Worlds, has_few_parts, worlds_of
from tolcontact.statistics.few_parts_of_runs import MeasureOfRun, widened_changes
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sample import Sample, measured_sample
from tolcontact.statistics.summary import summarize

DRAW_ATTRIBUTES = ("seed", "sampler")  # attributes that determine the random numbers of a realization


def compare_runs(runs: Mapping[str, xr.DataTree]) -> xr.Dataset:
    """Return the statistics of two or more named runs, and their changes from the first run, each with its 95 % interval.

        value        (run, state, measure, statistic, interval)   mean, 6 sigma, Ppk and the share outside its own limits
        change       (run, state, measure, change_of, interval)   shift of the mean, ratio of 6 sigma, shift of the share;
                                                                  NaN for the first run itself
        furthest     (run, state, measure)     largest difference in a realization; NaN if the draws are not the same
        by_status    (run, status_meaning)     number of realizations
        penetration  (run, state)              largest true penetration of any contact point [mm]
        draws        (run)                     "same", "same seed" or "other", compared with the first run
        few_parts    (run)                     "included" or "left out": what few measured parts leave open; "none" without any

    Runs with the same seed are compared realization by realization, up to the length of the shorter one; others as independent
    runs. Intervals include what few measured parts leave open if the deviations are archived. Equal populations, and equal
    distributions and numbers of parts of a contributor, are known from the same parts; other parts are independent. Raises
    OptionError if the runs share no measurement of the same name, units and quantity, and ArchiveError for a run with too few
    finished realizations.
    """
    (reference_name, reference), *_ = runs.items()
    summaries = {name: summarize(run) for name, run in runs.items()}
    shared = _shared_measures(summaries)
    if not shared:
        raise OptionError(
            f"{', '.join(runs)} share no measurement of the same name, units and quantity; there is nothing to compare"
        )
    rows = [_changes(run, reference, (summaries[name], summaries[reference_name]), shared) for name, run in runs.items()]
    draws, changes, furthest = zip(*rows, strict=True)
    selection = {terms.MEASURE: shared, terms.STATISTIC: list(terms.COMPARED_STATISTICS)}
    estimates = [summary[terms.STATISTIC_VALUE.name].sel(selection) for summary in summaries.values()]
    values = {
        "value": [estimate.transpose(terms.STATE, terms.MEASURE, ...).values for estimate in estimates],
        "change": [np.full_like(changes[0], np.nan), *changes[1:]],
        "furthest": furthest,
        terms.BY_STATUS.name: [summary[terms.BY_STATUS.name].values for summary in summaries.values()],
        terms.PENETRATION.name: [summary[terms.PENETRATION.name].values for summary in summaries.values()],
        "draws": draws,
    }
    return xr.Dataset(
        {variable.name: variable.entry(np.array(values[variable.name])) for variable in terms.COMPARED_RUNS},
        coords=_coordinates(runs, summaries, shared),
        attrs={
            "title": f"comparison of {len(runs)} runs",
            "reference_run": reference_name,
            "left_out": _left_out(summaries, shared),
        },
    )


def _shared_measures(summaries: Mapping[str, xr.Dataset]) -> list[str]:
    """Return the measures that all runs have with the same units and quantity, in the order of the first run."""
    columns = (terms.MEASURE, terms.MEASURE_UNITS.name, terms.QUANTITY.name)
    tables = [list(zip(*(summary[column].values for column in columns), strict=True)) for summary in summaries.values()]
    return [str(row[0]) for row in tables[0] if all(row in table for table in tables)]


def _coordinates(runs: Mapping[str, xr.DataTree], summaries: Mapping[str, xr.Dataset], shared: list[str]) -> dict[str, Any]:
    """Return the labels of all dimensions, and what describes the runs and the `shared` measures."""
    reference = next(iter(summaries.values()))
    units = reference.sel(measure=shared)[terms.MEASURE_UNITS.name].values.astype(str)
    bounds = {
        name: np.array([summary[name].sel(measure=shared) for summary in summaries.values()]) for name in terms.MEASURE_LIMITS
    }
    return {
        terms.RUN: list(runs),
        terms.STATE: list(terms.STATES),
        terms.MEASURE: shared,
        terms.STATISTIC: list(terms.COMPARED_STATISTICS),
        terms.CHANGE_OF: list(terms.CHANGES_OF_RUNS),
        terms.INTERVAL: list(terms.ESTIMATE),
        terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        terms.MEASURE_UNITS.name: (terms.MEASURE, units),
        **{name: ((terms.RUN, terms.MEASURE), limits) for name, limits in bounds.items()},
        "realizations": (terms.RUN, [summary.attrs["realizations"] for summary in summaries.values()]),
        terms.FEW_PARTS: (terms.RUN, [_few_parts(runs[name], summary) for name, summary in summaries.items()]),
        "title": (terms.RUN, [summary.attrs["title"] for summary in summaries.values()]),
    }


def _left_out(summaries: Mapping[str, xr.Dataset], shared: list[str]) -> str:
    """Return the names of the measures that are not compared."""
    names = dict.fromkeys(str(name) for summary in summaries.values() for name in summary[terms.MEASURE].values)
    return ", ".join(name for name in names if name not in shared)


def _few_parts(run: xr.DataTree, summary: xr.Dataset) -> str:
    """Return whether a run has contributors that are known from few parts, and intervals include or leave out what is open."""
    if not has_few_parts(run):
        return terms.NO_FEW_PARTS
    return terms.OPEN_LEFT_OUT if summary.attrs[terms.PARTS_LEFT_OUT] else terms.OPEN_INCLUDED


def _draws(run: xr.DataTree, reference: xr.DataTree, count: int) -> str:
    """Return whether `count` realizations of a run have the draws of the reference, only its seed, or neither."""
    if any(run.attrs[name] != reference.attrs[name] for name in DRAW_ATTRIBUTES):
        return terms.OTHER_DRAWS
    samples, deviation = [tree["sample"].to_dataset() for tree in (run, reference)], terms.DEVIATION.name
    if all(deviation in sample for sample in samples):
        a, b = (sample[deviation] for sample in samples)
        rows = {terms.REALIZATION: slice(count)}
        pairs = zip(pieces(a.isel(rows).to_dataset()), pieces(b.isel(rows).to_dataset()), strict=True)
        has_same_labels = a[a.dims[-1]].values.tolist() == b[b.dims[-1]].values.tolist()
        is_same = has_same_labels and all(np.array_equal(x[deviation].values, y[deviation].values) for x, y in pairs)
    else:
        is_same = _drawn_declaration(run) == _drawn_declaration(reference)
    return terms.SAME_DRAWS if is_same else terms.SAME_SEED


def _drawn_declaration(run: xr.DataTree) -> dict[str, Any]:
    """Return the declaration without the method, which does not affect the draws."""
    return {key: value for key, value in declaration_of(run).items() if key != "method"}


def _changes(
    run: xr.DataTree, reference: xr.DataTree, summaries: tuple[xr.Dataset, xr.Dataset], measures: list[str]
) -> tuple[str, np.ndarray, np.ndarray]:
    """Return how the draws of a run compare with a reference run, and the changes of measures from it.

    Changes are (state, measure, change_of, interval), and largest differences in a realization (state, measure).
    """
    counts = [summary.attrs["realizations"] for summary in summaries]
    draws = _draws(run, reference, min(counts))
    if draws != terms.OTHER_DRAWS:
        counts = [min(counts)] * 2
    rows = [
        tree.to_dataset()[[terms.MEASURED.name, terms.STATUS.name, terms.MEASURE_ACCURACY.name]].isel(
            {terms.REALIZATION: slice(count)}
        )
        for tree, count in zip((run, reference), counts, strict=True)
    ]
    worlds = [worlds_of(tree, count, by_source=True) for tree, count in zip((run, reference), counts, strict=True)]
    is_paired, changes, furthest = draws != terms.OTHER_DRAWS, [], []
    nothing = [UNDEFINED] * len(terms.CHANGES_OF_RUNS)
    existing = assembled(*rows) if is_paired else [*itertools.chain(*map(assembled, rows))]
    for state, measure in itertools.product(terms.STATES, measures):
        is_raw = state == terms.STATES[terms.RAW]
        numbers = [run_rows[terms.MEASURE].values.tolist().index(measure) for run_rows in rows]
        sample, baseline = itertools.starmap(
            measured_sample, zip(rows if is_raw else existing, numbers, itertools.repeat(state), strict=False)
        )
        selections = [summary.sel(measure=measure) for summary in summaries]
        limits = [Limits(*(float(selection[name]) for name in terms.MEASURE_LIMITS)) for selection in selections]
        hits = [_hits(*arguments, state) for arguments in zip(rows, numbers, limits, strict=True)]
        has_values = min(sample.count, baseline.count) > 1
        estimates = _estimates(sample, baseline, hits, paired=is_paired) if has_values else nothing
        both = itertools.starmap(_measure_of_run, zip(worlds, rows, numbers, limits, selections, [state] * 2, strict=True))
        changes.append(widened_changes(estimates, *both) if any(worlds) else estimates)
        is_compared = draws == terms.SAME_DRAWS and sample.count
        furthest.append(float(np.abs(sample.values - baseline.values).max()) if is_compared else np.nan)
    shape = (len(terms.STATES), len(measures))
    return draws, np.array(changes).reshape(*shape, *np.shape(changes[0])), np.array(furthest).reshape(shape)


def _hits(rows: xr.Dataset, measure: int, limits: Limits, state: str) -> Sample | None:
    """Return which realizations are out of specification; None without limits. With contact, they can also be not assembled."""
    values = measured_sample(rows, measure, state)
    if limits.are_open or state == terms.STATES[terms.RAW]:
        return None if limits.are_open else values.map(limits.outside)
    exists = is_assembled(statuses(rows))
    return values.map(lambda x: limits.outside(x) | ~exists)


def _measure_of_run(
    worlds: Worlds | None, rows: xr.Dataset, measure: int, limits: Limits, summary: xr.Dataset, state: str
) -> MeasureOfRun:
    """Return a measurement, given by its index in the rows and its summary, in a state."""
    values = measured_sample(rows, measure, state).values
    exists = is_assembled(statuses(rows)) | (state == terms.STATES[terms.RAW])
    outside = summary[terms.STATISTIC_VALUE.name].sel({terms.STATE: state, terms.STATISTIC: terms.OUTSIDE}).values
    return MeasureOfRun(worlds, np.where(exists, values, np.nan), limits, Estimate(*map(float, outside)))


def _estimates(sample: Sample, baseline: Sample, hits: list[Sample | None], *, paired: bool) -> list[Estimate]:
    """Return the changes from a baseline to a sample, with those out of specification in both."""
    if not (np.isfinite(sample.mean) and np.isfinite(baseline.mean)):
        return [UNDEFINED] * len(terms.CHANGES_OF_RUNS)
    limited = [x for x in hits if x is not None]
    estimates = {
        terms.SHIFT: intervals.shift(sample, baseline, paired=paired),
        terms.SPREAD_RATIO: intervals.root(intervals.variance_ratio(sample, baseline, paired=paired)),
        terms.SHARE_SHIFT: intervals.share_shift(*limited, paired=paired) if len(limited) == len(hits) else UNDEFINED,
    }
    return [estimates[name] for name in terms.CHANGES_OF_RUNS]
