"""Runs side by side: what each shows of the measures that they share, and how they differ from the first one."""

import json
from collections.abc import Mapping

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.realizations import pieces
from tolcontact.statistics import intervals, two_samples
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sample import Sample, measured_sample
from tolcontact.statistics.summary import summarize

DRAWS = ("seed", "sampler")  # attributes: what the numbers of a realization follow from


def compare_runs(runs: Mapping[str, xr.DataTree]) -> xr.Dataset:
    """Statistics of two runs or more, by their names, and how they differ from the first one, each with its 95 % interval.

        value        (run, state, measure, statistic, interval)   mean, 6 sigma, Ppk and the share outside its own limits
        change       (run, state, measure, change_of, interval)   shift of the mean, ratio of 6 sigma, shift of the share;
                                                                  NaN of the first run itself
        furthest     (run, state, measure)     largest difference of a realization; NaN if the draws are not the same
        by_status    (run, status_meaning)     number of realizations
        penetration  (run, state)              largest true penetration of any contact point [mm]
        draws        (run)                     "same", "same seed" or "other": than the first one's

    Runs of the same seed are compared realization by realization, as far as both go; others as independent ones.
    Raises OptionError if they share no measure of the same name, units and quantity, ArchiveError for a run that is not
    finished far enough.
    """
    (first, reference), *_ = runs.items()
    summaries = {name: summarize(run) for name, run in runs.items()}
    shared = _shared(summaries)
    if not shared:
        raise OptionError(
            f"{', '.join(runs)} share no measure of the same name, units and quantity; there is nothing to compare"
        )
    counts = {name: summaries[name].attrs["realizations"] for name in runs}
    draws = {name: _draws(run, reference, min(counts[name], counts[first])) for name, run in runs.items()}
    values = {name: of["statistic_value"].sel(statistic=list(terms.COMPARED_STATISTICS)) for name, of in summaries.items()}
    changes = {name: _Change(run, reference, summaries[name], summaries[first], draws[name]) for name, run in runs.items()}
    nothing = np.full((len(terms.STATES), len(shared), len(terms.CHANGES_OF_RUNS), len(terms.ESTIMATE)), np.nan)
    of_runs = {
        "value": [of.sel(measure=shared).transpose(terms.STATE, terms.MEASURE, ...).values for of in values.values()],
        "change": [of.everywhere(shared) if name != first else nothing for name, of in changes.items()],
        "furthest": [of.furthest(shared) for of in changes.values()],
        "by_status": [of["by_status"].values for of in summaries.values()],
        "penetration": [of["penetration"].values for of in summaries.values()],
        "draws": list(draws.values()),
    }
    one, own = summaries[first].sel(measure=shared), list(summaries.values())
    return xr.Dataset(
        {of.name: (of.dims, np.array(of_runs[of.name]), of.all_attributes) for of in terms.COMPARED_RUNS},
        coords={
            terms.RUN: list(runs),
            terms.STATE: list(terms.STATES),
            terms.MEASURE: shared,
            terms.STATISTIC: list(terms.COMPARED_STATISTICS),
            terms.CHANGE_OF: list(terms.CHANGES_OF_RUNS),
            terms.INTERVAL: list(terms.ESTIMATE),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
            "measure_units": (terms.MEASURE, one["measure_units"].values.astype(str)),
            **{
                f"measure_{side}": (
                    (terms.RUN, terms.MEASURE),
                    np.array([of[f"measure_{side}"].sel(measure=shared) for of in own]),
                )
                for side in terms.BOUNDS
            },
            "realizations": (terms.RUN, list(counts.values())),
            "title": (terms.RUN, [of.attrs["title"] for of in summaries.values()]),
        },
        attrs={"title": f"comparison of {len(runs)} runs", "reference_run": first, "left_out": _left_out(summaries, shared)},
    )


def _shared(summaries: Mapping[str, xr.Dataset]) -> list[str]:
    """Measures that all runs have, in the order of the first one."""
    said = [
        {
            str(name): (units, quantity)
            for name, units, quantity in zip(
                of["measure"].values, of["measure_units"].values, of["measure_quantity"].values, strict=True
            )
        }
        for of in summaries.values()
    ]

    def is_alike(name: str) -> bool:
        of_all = [own.get(name) for own in said]
        units, quantities = ({own[k] for own in of_all if own is not None} for k in (0, 1))
        return None not in of_all and len(units) == 1 and len(quantities - {""}) <= 1  # old archives do not say the quantity

    return [name for name in said[0] if is_alike(name)]


def _left_out(summaries: Mapping[str, xr.Dataset], shared: list[str]) -> str:
    every = dict.fromkeys(str(name) for of in summaries.values() for name in of["measure"].values)
    return ", ".join(name for name in every if name not in shared)


def _draws(run: xr.DataTree, first: xr.DataTree, count: int) -> str:
    """Whether a run has the draws of the first one, in so many realizations."""
    if any(run.attrs[word] != first.attrs[word] for word in DRAWS):
        return terms.OTHER_DRAWS
    own, theirs = (each["sample"].to_dataset() for each in (run, first))
    if terms.DEVIATION.name in own and terms.DEVIATION.name in theirs:
        a, b = (each[terms.DEVIATION.name] for each in (own, theirs))
        labels = [each[each.dims[-1]].values.tolist() for each in (a, b)]
        some = {terms.REALIZATION: slice(count)}
        both = zip(pieces(a.isel(some).to_dataset()), pieces(b.isel(some).to_dataset()), strict=True)
        same = labels[0] == labels[1] and all(np.array_equal(x[a.name].values, y[b.name].values) for x, y in both)
    else:
        same = _drawn_from(run) == _drawn_from(first)
    return terms.SAME_DRAWS if same else terms.SAME_SEED


def _drawn_from(run: xr.DataTree) -> dict:
    """The declaration but the method, which draws nothing."""
    return {
        word: value for word, value in json.loads(str(run["model"][terms.DECLARATION.name].values)).items() if word != "method"
    }


class _Change:
    """How a run differs from the first one, measure by measure."""

    def __init__(self, run: xr.DataTree, first: xr.DataTree, summary: xr.Dataset, of_first: xr.Dataset, draws: str) -> None:
        self.same, self.paired = draws == terms.SAME_DRAWS, draws != terms.OTHER_DRAWS
        counts = [of.attrs["realizations"] for of in (summary, of_first)]
        counts = [min(counts)] * 2 if self.paired else counts
        self.summaries = summary, of_first
        self.rows = [
            each.to_dataset()[[terms.MEASURED.name]].isel({terms.REALIZATION: slice(count)})
            for each, count in zip((run, first), counts, strict=True)
        ]

    def everywhere(self, measures: list[str]) -> np.ndarray:
        return np.array([[self._of(measure, state) for measure in measures] for state in terms.STATES])

    def furthest(self, measures: list[str]) -> np.ndarray:
        return np.array([[self._furthest(measure, state) for measure in measures] for state in terms.STATES])

    def _samples(self, measure: str, state: str) -> list[Sample]:
        return [measured_sample(rows, rows[terms.MEASURE].values.tolist().index(measure), state) for rows in self.rows]

    def _of(self, measure: str, state: str) -> list[Estimate]:
        after, before = self._samples(measure, state)
        if not (np.isfinite(after.mean) and np.isfinite(before.mean)):
            return [UNDEFINED] * len(terms.CHANGES_OF_RUNS)
        hits = [_outside(x, of.sel(measure=measure)) for x, of in zip((after, before), self.summaries, strict=True)]
        return [
            two_samples.shift(after, before, paired=self.paired),
            intervals.root(two_samples.variance_ratio(after, before, paired=self.paired)),
            UNDEFINED if hits[0] is None or hits[1] is None else two_samples.share_shift(hits[0], hits[1], paired=self.paired),
        ]

    def _furthest(self, measure: str, state: str) -> float:
        if not self.same:
            return np.nan
        after, before = self._samples(measure, state)
        return float(max(np.abs(a - b).max() for a, b in zip(after.pieces(), before.pieces(), strict=True)))


def _outside(x: Sample, of: xr.Dataset) -> Sample | None:
    """Which values are beyond a run's own limits; nothing without limits."""
    lower, upper = float(of["measure_lower"]), float(of["measure_upper"])
    if not (np.isfinite(lower) or np.isfinite(upper)):
        return None
    return x.map(lambda piece: (piece < lower) | (piece > upper))
