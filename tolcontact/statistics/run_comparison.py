"""Comparison of runs: the statistics of their common measures, and the changes from the first run."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.realizations import pieces
from tolcontact.statistics import intervals, two_samples
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

    Runs with the same seed are compared realization by realization, up to the length of the shorter one; others as independent
    runs. Raises OptionError if they share no measurement of the same name, units and quantity, and ArchiveError for a run with
    too few finished realizations.
    """
    (reference_name, reference), *_ = runs.items()
    summaries = {name: summarize(run) for name, run in runs.items()}
    shared = _shared_measures(summaries)
    if not shared:
        raise OptionError(
            f"{', '.join(runs)} share no measurement of the same name, units and quantity; there is nothing to compare"
        )
    changes = {name: _Change(run, reference, summaries[name], summaries[reference_name]) for name, run in runs.items()}
    undefined = np.full((len(terms.STATES), len(shared), len(terms.CHANGES_OF_RUNS), len(terms.ESTIMATE)), np.nan)
    selection = {terms.MEASURE: shared, terms.STATISTIC: list(terms.COMPARED_STATISTICS)}
    estimates = [summary[terms.STATISTIC_VALUE.name].sel(selection) for summary in summaries.values()]
    values = {
        "value": [estimate.transpose(terms.STATE, terms.MEASURE, ...).values for estimate in estimates],
        "change": [undefined if name == reference_name else change.estimates(shared) for name, change in changes.items()],
        "furthest": [change.furthest(shared) for change in changes.values()],
        terms.BY_STATUS.name: [summary[terms.BY_STATUS.name].values for summary in summaries.values()],
        terms.PENETRATION.name: [summary[terms.PENETRATION.name].values for summary in summaries.values()],
        "draws": [change.draws for change in changes.values()],
    }
    units = summaries[reference_name].sel(measure=shared)[terms.MEASURE_UNITS.name].values.astype(str)
    bounds = {
        name: np.array([summary[name].sel(measure=shared) for summary in summaries.values()]) for name in terms.MEASURE_LIMITS
    }
    return xr.Dataset(
        {variable.name: variable.entry(np.array(values[variable.name])) for variable in terms.COMPARED_RUNS},
        coords={
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
            "title": (terms.RUN, [summary.attrs["title"] for summary in summaries.values()]),
        },
        attrs={
            "title": f"comparison of {len(runs)} runs",
            "reference_run": reference_name,
            "left_out": _left_out(summaries, shared),
        },
    )


def _shared_measures(summaries: Mapping[str, xr.Dataset]) -> list[str]:
    """Return the measures that all runs have with the same units and quantity, in the order of the first run."""
    columns = (terms.MEASURE, terms.MEASURE_UNITS.name, terms.QUANTITY.name)
    tables = [
        {str(name): (units, quantity) for name, units, quantity in zip(*(summary[c].values for c in columns), strict=True)}
        for summary in summaries.values()
    ]

    def is_shared(name: str) -> bool:
        entries = [table.get(name) for table in tables]
        units, quantities = ({entry[k] for entry in entries if entry is not None} for k in (0, 1))
        return None not in entries and len(units) == 1 and len(quantities) == 1

    return [name for name in tables[0] if is_shared(name)]


def _left_out(summaries: Mapping[str, xr.Dataset], shared: list[str]) -> str:
    """Return the names of the measures that are not compared."""
    names = dict.fromkeys(str(name) for summary in summaries.values() for name in summary[terms.MEASURE].values)
    return ", ".join(name for name in names if name not in shared)


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
    declaration = json.loads(str(run["model"][terms.DECLARATION.name].values))
    return {key: value for key, value in declaration.items() if key != "method"}


class _Change:
    """The change from the reference run to a run, measure by measure."""

    def __init__(self, run: xr.DataTree, reference: xr.DataTree, summary: xr.Dataset, reference_summary: xr.Dataset) -> None:
        self._summaries = summary, reference_summary
        counts = [summary.attrs["realizations"] for summary in self._summaries]
        self.draws = _draws(run, reference, min(counts))
        self._paired = self.draws != terms.OTHER_DRAWS
        if self._paired:
            counts = [min(counts)] * 2
        self._rows = [
            tree.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(count)})
            for tree, count in zip((run, reference), counts, strict=True)
        ]

    def estimates(self, measures: list[str]) -> np.ndarray:
        """Return all changes, (state, measure, change_of, interval)."""
        return np.array([[self._estimates(measure, state) for measure in measures] for state in terms.STATES])

    def furthest(self, measures: list[str]) -> np.ndarray:
        """Return the largest difference in a realization, (state, measure)."""
        return np.array([[self._furthest(measure, state) for measure in measures] for state in terms.STATES])

    def _samples(self, measure: str, state: str) -> list[Sample]:
        return [measured_sample(rows, rows[terms.MEASURE].values.tolist().index(measure), state) for rows in self._rows]

    def _estimates(self, measure: str, state: str) -> list[Estimate]:
        sample, baseline = self._samples(measure, state)
        if not (np.isfinite(sample.mean) and np.isfinite(baseline.mean)):
            return [UNDEFINED] * len(terms.CHANGES_OF_RUNS)
        hits = [
            _outside(x, summary.sel(measure=measure)) for x, summary in zip((sample, baseline), self._summaries, strict=True)
        ]
        shift = None if None in hits else two_samples.share_shift(*hits, paired=self._paired)  # type: ignore[arg-type]
        estimates = {
            terms.SHIFT: two_samples.shift(sample, baseline, paired=self._paired),
            terms.SPREAD_RATIO: intervals.root(two_samples.variance_ratio(sample, baseline, paired=self._paired)),
            terms.SHARE_SHIFT: shift or UNDEFINED,
        }
        return [estimates[name] for name in terms.CHANGES_OF_RUNS]

    def _furthest(self, measure: str, state: str) -> float:
        if self.draws != terms.SAME_DRAWS:
            return np.nan
        sample, baseline = self._samples(measure, state)
        return float(max(np.abs(a - b).max() for a, b in zip(sample.pieces(), baseline.pieces(), strict=True)))


def _outside(x: Sample, summary: xr.Dataset) -> Sample | None:
    """Return which values are beyond the limits of a summary's measure, as a sample of booleans; None without limits."""
    limits = Limits(*(float(summary[name]) for name in terms.MEASURE_LIMITS))
    return None if limits.are_open else x.map(limits.outside)
