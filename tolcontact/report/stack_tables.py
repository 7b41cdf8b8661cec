"""Tables of stack-ups, and of mechanisms."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.table import (
    AnalysisReport,
    Table,
    by_measure,
    grouped,
    lost_realizations,
    not_a_number,
    number,
    percent,
    unresolved,
)
from tolcontact.statistics.capability import MIN_TAIL

MAX_POSITIONS = 12  # rows of a table; of more, some evenly spaced ones are shown
WIDENING = 3.29 / 1.96  # from 95 % intervals to 99.9 % intervals, beyond which RSS misses the range
NOTES = (
    "worst case, RSS: zones times sensitivities at the nominal assembly, about the centred value.",
    "MRSS: RSS times the factor of Drake (ch. 9). 1.5 RSS: Bender.",
    "99.73 %: between the percentiles 0.135 % and 99.865 % of the realizations; 95 % intervals.",
    "Distributions, capabilities and correlations count in the realizations alone; RSS is off where",
    "it lies beyond the 99.9 % interval of an end.",
)


def stack_up_report(dataset: xr.Dataset) -> AnalysisReport:
    """Return worst case, RSS, inflated RSS and simulated range of each measurement."""
    count = f"{grouped(dataset.attrs['realizations'])} realizations"
    tables = [_table(measure) for measure in by_measure(dataset)]
    return AnalysisReport("Stack-up", count, [*NOTES, *lost_realizations(unresolved(dataset))], tables)


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
        spread = (ends[1, 0] - ends[0, 0]) / 2
        rows.append([f"99.73 %, {word}", *map(number, ends), f"{spread:.4g}" if math.isfinite(spread) else "-"])
    if _is_without_contact(dataset):
        rows[-2:] = [["99.73 %", *rows[-1][1:]]]
    value = f"{drawn:.6g}" if math.isfinite(drawn) else "not a number"
    title = f"{dataset['measure'].values} [{dataset['measure_units'].values}]: {value} as drawn"
    title += f", {centred:.6g} centred" if math.isfinite(centred) else ""
    return Table(title, ["", *terms.EXTREME_WORDS, "±"], rows, list(_remarks(dataset, centred, halves["RSS"])))


def _remarks(dataset: xr.Dataset, centred: float, rss: float) -> Iterator[str]:
    """Yield by how much RSS misses the simulated range, and what has no figure."""
    if not np.isfinite(dataset["drawn"]):
        yield "No linear figures: it is not a number in the assembly as drawn."
        return
    if not math.isfinite(centred):
        yield "No linear figures: it has a kink in the assembly as drawn, or no slope there."
        return
    if int(dataset["forms"]):
        yield f"RSS has {int(dataset['forms'])} forms of faces with 3 sigma; worst case and MRSS have no figure for them."
    if lots := float(dataset.get("lots", 0.0)):  # archives of earlier versions have none
        yield f"Lots with their means on either side shift the mean by up to ±{lots:.4g}, if all are on the worse one."
    is_without_contact = _is_without_contact(dataset)
    for state, word in terms.WORD_OF_STATE.items():
        if is_without_contact and state == terms.STATES[0]:
            continue
        where = "" if is_without_contact else f", {word}"
        if not np.isfinite(dataset["simulated"].sel(state=state)).all():
            if dataset.attrs["realizations"] >= MIN_TAIL:
                yield f"RSS{where} is not judged: the measurement is not a number in some realizations."
                continue
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


def sweep_report(dataset: xr.Dataset) -> AnalysisReport:
    """Return the envelope of a mechanism over all positions, and the means at each."""
    notes = [
        "The least and the largest value of each realization over all positions; 95 % intervals.",
        "What lies between two positions is not seen.",
        *lost_realizations(unresolved(dataset.sum("position"))),
    ]
    rows = [row for measure in by_measure(dataset) for row in _rows(measure)]
    heading = ["", "mean", "6 sigma", "outer\npercentile", "mostly at"]
    remarks = ["outer percentile: 0.135 % of the least values, 99.865 % of the largest"]
    remarks += [remark for measure in by_measure(dataset) for remark in _undefined(measure)]
    envelope = Table("", heading, rows, remarks)
    count = f"{grouped(dataset.attrs['realizations'])} realizations at {dataset.sizes['position']} positions"
    return AnalysisReport("Mechanism", count, notes, [envelope, _means(dataset)])


def _rows(measure: xr.Dataset) -> list[list[str]]:
    """Return the rows of a measure: its share outside, and both ends of its envelope in both states."""
    rows = [[f"{measure['measure'].values} ({measure['measure_units'].values})", "", "", "", ""]]
    has_limits = bool(np.isfinite(measure["outside"].values).any())
    for word, state in zip(terms.STATE_WORDS, terms.STATES, strict=True):
        in_state = measure.sel(state=state)
        rows.append([f"  {word}", "", "", "", ""])
        for end, extreme in terms.WORD_OF_END.items():
            figures = [number(values) for values in in_state["envelope"].sel(end=end).values]
            shares = in_state["extreme_share"].sel(end=end).values
            place = f"{_position(measure, int(shares.argmax()))} ({100 * shares.max():.0f} %)"  # of most realizations
            rows.append([f"    {extreme}", *figures, place if shares.any() else "-"])
        if has_limits:
            rows.append(["    beyond limits", percent(in_state["outside"].values), "", "", "at any position"])
    return rows


def _undefined(measure: xr.Dataset) -> Iterator[str]:
    """Yield a remark on a measure that is not a number in some realizations."""
    is_undefined = measure["swept"].isnull().any(["position", "state"])
    if count := int(is_undefined.sum()):
        share = not_a_number(count, is_undefined.size)
        yield f"{measure['measure'].values}: {share} at some position, so it has no envelope"


def _position(dataset: xr.Dataset, index: int) -> str:
    names, values = dataset["parameter_name"].values, dataset["parameter"].values
    moved = [k for k in range(len(names)) if np.ptp(values[k]) > 0] or [0]
    return ", ".join(f"{names[k]} {values[k, index]:.4g}" for k in moved)


def _means(dataset: xr.Dataset) -> Table:
    count = dataset.sizes["position"]
    chosen = np.unique(np.linspace(0, count - 1, min(count, MAX_POSITIONS)).round().astype(int))
    means = dataset["mean"].sel(state=terms.STATES[terms.CORRECTED])
    rows = [[_position(dataset, k), *(number(m.isel(position=k).values) for m in means)] for k in chosen]
    return Table(f"Mean {terms.WITH_CONTACT} at each position", ["", *map(str, dataset["measure"].values)], rows)
