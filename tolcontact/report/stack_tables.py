"""Tables of a stack-up: worst case, RSS, inflated RSS and Monte Carlo range of each measurement."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.figures import grouped, number
from tolcontact.report.table import Table
from tolcontact.statistics.capability import MIN_TAIL

WIDENING = 3.29 / 1.96  # from 95 % intervals to 99.9 % intervals, beyond which RSS misses the range
NOTES = (
    "worst case, RSS: zones times sensitivities at the nominal assembly, about the centred value.",
    "MRSS: RSS times the factor of Drake (ch. 9). 1.5 RSS: Bender.",
    "99.73 %: between the percentiles 0.135 % and 99.865 % of the realizations; 95 % intervals.",
    "Distributions, capabilities and correlations count in the realizations alone; RSS is off where",
    "it lies beyond the 99.9 % interval of an end.",
)


def stack_up_report(dataset: xr.Dataset, remarks: Sequence[str]) -> tuple[str, str, list[str], list[Table]]:
    """Return name, number of realizations, notes and tables of a stack-up, with remarks on its realizations."""
    count = f"{grouped(dataset.attrs['realizations'])} realizations"
    return "Stack-up", count, [*NOTES, *remarks], [_table(dataset.sel(measure=name)) for name in dataset["measure"].values]


def _table(dataset: xr.Dataset) -> Table:
    drawn, centred = float(dataset["drawn"]), float(dataset["centred"])
    halves = dict(zip(terms.APPROACHES, map(float, dataset["half_width"].values), strict=True))
    rows = []
    for name, half in halves.items():
        factor = f", factor {half / halves['RSS']:.3g}" if name == "MRSS" and half > 0 else ""
        figures = [f"{centred + sign * half:.5g}" for sign in terms.SENSES] + [f"{half:.4g}"]
        rows.append([name + factor, *(figures if math.isfinite(half) else ["-"] * 3)])
    for state, word in terms.WORD_OF_STATE.items():
        ends = dataset["simulated"].sel(state=state).values
        rows.append([f"99.73 %, {word}", *map(number, ends), f"{(ends[1, 0] - ends[0, 0]) / 2:.4g}"])
    if _is_without_contact(dataset):
        rows[-2:] = [["99.73 %", *rows[-1][1:]]]
    title = f"{dataset['measure'].values} [{dataset['measure_units'].values}]: {drawn:.6g} as drawn"
    title += f", {centred:.6g} centred" if math.isfinite(centred) else ""
    return Table(title, ["", *terms.EXTREME_WORDS, "±"], rows, list(_remarks(dataset, centred, halves["RSS"])))


def _remarks(dataset: xr.Dataset, centred: float, rss: float) -> Iterator[str]:
    """Yield by how much RSS misses the simulated range, and what has no figure."""
    if not math.isfinite(centred):
        yield "No linear figures: it has a kink in the assembly as drawn, or no slope there."
        return
    if int(dataset["forms"]):
        yield f"RSS has {int(dataset['forms'])} forms of faces with 3 sigma; worst case and MRSS have no figure for them."
    if lots := float(dataset.get("lots", 0.0)):  # archives of earlier versions have none
        yield f"Lots with their means on either side shift the mean by up to ±{lots:.4g}, if all are on the worse one."
    states = dict(terms.WORD_OF_STATE)
    if _is_without_contact(dataset):
        states.pop(terms.STATES[0])
    for state, word in states.items():
        where = f", {word}" if len(states) > 1 else ""
        if not np.isfinite(dataset["simulated"].sel(state=state)).all():
            yield f"RSS{where} is not judged: {MIN_TAIL} realizations bound the range, give --samples {MIN_TAIL} or more."
            continue
        misses = []
        for end, sense, extreme in zip(terms.ENDS, terms.SENSES, terms.EXTREME_WORDS, strict=True):
            estimate, lower, upper = map(float, dataset["simulated"].sel(state=state, end=end).values)
            miss = centred + sense * rss - estimate
            if not WIDENING * (lower - estimate) <= miss <= WIDENING * (upper - estimate):
                misses.append(f"{miss:+.2g} at the {extreme}")
        verdict = f"is off by {' and '.join(misses)}" if misses else "agrees with the realizations"
        yield f"RSS{where} {verdict}."


def _is_without_contact(dataset: xr.Dataset) -> bool:
    """Return whether contact changes nothing in the range of a measure."""
    raw, corrected = dataset["simulated"].values
    return np.array_equal(raw, corrected, equal_nan=True)
