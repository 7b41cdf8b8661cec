"""The summary of a run as text."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from rich.console import Group
from rich.padding import Padding
from rich.text import Text
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.report.contact_text import CORRECTED, RAW, contact_lines, offset_table, pair_table
from tolcontact.report.results_table import full_name, overview_table, verdict_lines, verdict_of
from tolcontact.report.table import NO_INTERVAL, Table, by_measure, grouped, limits_text, number, percent, share
from tolcontact.statistics.capability import CONSTANT, FAILS, MEETS, MIN_TAIL, MIN_TAILS, UNDECIDED
from tolcontact.statistics.few_parts import MIN_ROWS
from tolcontact.statistics.intervals import CONFIDENCE, MAX_KURTOSIS, MIN_SHAPE, MIN_VARIANCE
from tolcontact.statistics.sample import MIN_APART

MOST_DETAILED, MOST_LISTED = 3, 6  # measurements with all their figures; measurements, parts or pairs in a table
EVERYTHING = "the page has all, and so has tolcontact summary --all"
NO_NUMBER = "not a number"
URGENCY = {NO_NUMBER: 3.0, FAILS: 2.0, UNDECIDED: 1.0, "": 0.0, CONSTANT: -1.0, MEETS: -1.0}
MOST_IN_LINE = 2  # parts or pairs, in a line of a long summary
CHANGES_NOTE = "Changes are from the same draws.\n"
CHANGE_OF_STATISTIC = {"mean": terms.SHIFT, "6 sigma": terms.SPREAD_RATIO, "variance": terms.VARIANCE_RATIO}
SHORT_LABELS = {"standard deviation": "std. dev.", terms.BELOW: "below the lower limit", terms.ABOVE: "above the upper limit",
                terms.OUTSIDE: terms.OUT_OF_SPECIFICATION}  # fmt: skip
PERCENTILE_COUNTERPART = {terms.PP_NORMAL: terms.PP, terms.PPK_NORMAL: terms.PPK}
APART = (
    "* differs from the index by percentiles by more than chance explains: the measurement is not normally distributed\n"
    "(95 % confidence for all measurements of this run together)"
)
NEEDS = {  # realizations, of statistics that have no interval
    terms.VARIANCE: f"std. dev., 6 sigma and variance need {MIN_VARIANCE} realizations",
    terms.SKEWNESS: f"skewness and kurtosis need {MIN_SHAPE} realizations, and a kurtosis below {MAX_KURTOSIS:g}",
    terms.PPK: f"Pp and Ppk need {grouped(MIN_TAIL)} realizations, {grouped(MIN_TAILS)} with two limits",
}


def summary_text(summary: xr.Dataset, *, is_whole: bool = False) -> Group:
    """Return a summary (see summarize) for rich to print: of many measurements, parts or pairs those that fall short.

    A summary that `is_whole` has all of them, with all figures.
    """
    return Group(*_sections(summary, is_whole=is_whole))


def _sections(summary: xr.Dataset, *, is_whole: bool) -> Iterator[Text | Table | Padding]:
    count = summary.attrs["realizations"]
    yield Text(f"{summary.attrs['title']}: {count} realizations", style="bold")
    if summary.attrs["samples"] > count:
        yield Text(f"{grouped(count)} of {grouped(summary.attrs['samples'])} realizations are done; continue with --resume")
    is_long = not is_whole and max(summary.sizes["part"], summary.sizes["pair"]) > MOST_LISTED
    yield Text(f"{terms.ESTIMATES_NOTE}.\n{'' if is_long else CHANGES_NOTE}")
    brief, remark = (summary, "") if is_whole else _brief_measures(summary)
    yield overview_table(brief, is_long=is_long)
    has_details = is_whole or (summary.sizes["measure"] <= MOST_DETAILED and not is_long)
    yield from map(Text, verdict_lines(brief, states_once=not has_details))
    if has_details:
        yield from (measure_table(measure, summary.sizes["measure"]) for measure in by_measure(summary))
    elif remark or not is_long:
        yield Text(remark or f"percentiles and capability of each: {EVERYTHING}")
    if not summary.sizes["part"]:
        yield from map(Text, summary.attrs["correlations"].splitlines())
        return
    if not is_long:
        magnitudes = int(summary["magnitude_realizations"])
        yield Text("\n6 sigma of the displacement magnitude over the surface of each part (mm)", style="bold")
        if magnitudes < count:
            yield Text(f"of at least the first {grouped(magnitudes)} realizations" if magnitudes else "not summed up")
        if magnitudes:
            yield _field_table(summary)
    yield Text("\ncontact", style="bold")
    for line in contact_lines(summary, count, is_long=is_long):
        yield Padding(Text(line), (0, 0, 0, 2), expand=False)
    if is_long:
        yield from map(Text, _long_lines(summary))
        return
    for table in (pair_table(summary), offset_table(summary)):
        if table is not None:
            yield Text()
            yield table


def _brief_measures(summary: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the summary of the measurements that fall short of their limits, and a remark about all others.

    All measurements are kept if there are few. Those that are not a number in some realizations come first. If none falls
    short, the first ones are kept.
    """
    count = summary.sizes[terms.MEASURE]
    if count <= MOST_LISTED:
        return summary, ""
    measures = by_measure(summary)
    opinions = [verdict_of(measure, summary.attrs["realizations"]) for measure in measures]
    verdicts = [
        NO_NUMBER if int(measure[terms.NOT_A_NUMBER].values) else "" if opinion is None else opinion.word
        for measure, opinion in zip(measures, opinions, strict=True)
    ]
    shares = [float(m["statistic_value"].sel(state=CORRECTED, statistic=terms.OUTSIDE)[0]) for m in measures]
    urgencies = [URGENCY[verdict] + float(np.nan_to_num(share)) / 2 for verdict, share in zip(verdicts, shares, strict=True)]
    largest = np.argsort(-np.array(urgencies), kind="stable")[:MOST_LISTED]
    failing = [index for index in sorted(largest.tolist()) if verdicts[index] in (NO_NUMBER, FAILS, UNDECIDED)]
    selection = failing or list(range(MOST_LISTED))
    remainder = [verdict for index, verdict in enumerate(verdicts) if index not in selection]
    phrases = {
        "not a number in some realizations": (NO_NUMBER,),
        "fall short, too": (FAILS,),
        "undecided": (UNDECIDED,),
        "without limits": ("",),
        "meet their limits": (MEETS, CONSTANT),
    }
    counts = {phrase: sum(verdict in group for verdict in remainder) for phrase, group in phrases.items()}
    remark = ", ".join(f"{number} more {phrase}" for phrase, number in counts.items() if number)
    return summary.isel(measure=selection), f"{remark}; {EVERYTHING}"


def _long_lines(summary: xr.Dataset) -> Iterator[str]:
    """Yield the largest displacements, contacts and offsets of many parts and pairs, a line each, and what is left out."""

    def line(heading: str, names: np.ndarray, values: xr.DataArray, text: Callable[[np.ndarray], str]) -> str:
        estimates = values.transpose(..., "interval").values
        order = [k for k in np.argsort(-estimates[:, 0], kind="stable")[:MOST_IN_LINE] if estimates[k, 0] > 0]
        items = ", ".join(f"{names[k]} {text(estimates[k])}" for k in order)
        return f"{heading}: {items or 'none'}" + (f"; {len(names) - len(order)} more" if order else "")

    parts, pairs = summary["part"].values, summary["pair"].values
    if int(summary["magnitude_realizations"]):
        fields = summary["field_extreme"].sel(state=CORRECTED, extreme="largest")
        yield line("move most (6 sigma, mm)", parts, fields, number)
    yield line("in contact most", pairs, summary["carried"], percent)
    yield line("furthest off their locators (99 %, mm)", parts, summary["locator_offset"].isel(of_offset=-1), number)
    yield f"results without contact, percentiles, all parts and pairs, other checks: {EVERYTHING}"


def capability_text(summary: xr.Dataset) -> Group:
    """Return shares out of specification and capability of each measurement of a summary."""
    sections: list[Text | Table] = [
        Text(f"{summary.attrs['title']}: {summary.attrs['realizations']} realizations", style="bold")
    ]
    for measure in by_measure(summary):
        title = f"{measure['measure'].values} ({measure['measure_units'].values}): {limits_text(measure) or 'no limits'}"
        if limits_text(measure):
            table = measure_table(measure.sel(statistic=[*terms.SHARES, *terms.CAPABILITY]), summary.sizes["measure"])
            sections.append(replace(table, title=title, columns=table.columns[:-1], rows=[row[:-1] for row in table.rows]))
        else:
            sections.append(Text(f"\n{title}", style="bold"))
    return Group(*sections)


def measure_table(measure: xr.Dataset, measures: int) -> Table:
    """Return all estimates of one of `measures` measurements in both states, with their changes and the meaning of marks."""
    units, quantity = str(measure["measure_units"].values), str(measure["measure_quantity"].values)
    subtitle = ", ".join(text for text in (quantity, limits_text(measure)) if text)
    title, rows = f"{full_name(measure)} ({units}){': ' if subtitle else ''}{subtitle}", _measure_rows(measure, measures)
    cells = [cell for row in rows for cell in row]
    notes = [APART] if any(cell.startswith("*") for cell in cells) else []
    return Table(title, ["", *terms.STATE_WORDS, "change"], rows, [*notes, *_needs(measure)])


def _needs(measure: xr.Dataset) -> Iterator[str]:
    """Yield from how many realizations or measured rows on the statistics of a measurement without an interval have one."""
    if measure[terms.FEW_ROWS]:
        yield f"{NO_INTERVAL} of fewer than {MIN_ROWS} measured rows the mean and shares alone have an interval: measure more"
        return
    if required := int(measure[terms.REQUIRED].values):
        yield f"{NO_INTERVAL} at a stop, moments need {MIN_APART} values off it: about {grouped(required)} realizations"
    for statistic in measure["statistic"].values:
        estimates = measure["statistic_value"].sel(statistic=statistic).transpose("interval", ...).values
        is_told = statistic not in NEEDS or (required and statistic == terms.VARIANCE)
        if not is_told and (np.isfinite(estimates[0]) & np.isnan(estimates[1:]).all(axis=0)).any():
            yield f"{NO_INTERVAL} {NEEDS[statistic]}"


def _is_apart(estimate: Sequence[float], other: Sequence[float], tests: int) -> bool:
    """Return whether two estimates differ by more than chance explains, in all of `tests` comparisons together (Bonferroni).

    Both intervals are stretched from the level of a single figure to the joint one, as for a normal distribution.
    """
    stretch = special.ndtri(1 - (1 - CONFIDENCE) / (2 * tests)) / special.ndtri((1 + CONFIDENCE) / 2)
    (low, low_lower, low_upper), (high, high_lower, _) = sorted((tuple(estimate), tuple(other)))
    return bool(math.isfinite(low_lower) and high - low > stretch * (low_upper - low + high - high_lower))


def _measure_rows(measure: xr.Dataset, measures: int) -> list[list[str]]:
    """Return rows of label, both states and change of a measurement; * marks an index that differs from the percentile one."""
    rows, tests = [], measures * len(terms.STATES) * len(PERCENTILE_COUNTERPART)
    estimates = dict(
        zip(measure["statistic"].values, measure["statistic_value"].transpose("statistic", ...).values, strict=True)
    )
    changes = dict(zip(measure["change_of"].values, measure["change"].values, strict=True))
    for statistic, values in estimates.items():
        if statistic in (*terms.SHARES, *terms.CAPABILITY) and not any(math.isfinite(value[0]) for value in values):
            continue
        if statistic in terms.SHARES:
            rows.append([SHORT_LABELS[statistic], *map(share, values), ""])
            continue
        label, figures = SHORT_LABELS.get(statistic, statistic), [number(value) for value in values]
        if statistic in PERCENTILE_COUNTERPART:
            counterpart = estimates[PERCENTILE_COUNTERPART[statistic]]
            for k, pair in enumerate(zip(values, counterpart, strict=True)):
                if _is_apart(*pair, tests):
                    figures[k] = f"* {figures[k]}"
        change = ""
        if statistic in CHANGE_OF_STATISTIC:
            ratio = changes[CHANGE_OF_STATISTIC[statistic]]
            change = number(ratio, sign=True) if statistic == "mean" else percent(ratio - 1, sign=True)
        rows.append([str(label), *figures, change])
    return rows


def _field_table(summary: xr.Dataset) -> Table:
    rows = []
    is_moving = (summary["field_extreme"].values != 0).any(axis=(1, 2, 3))
    for part in summary["part"].values[is_moving]:
        for state in (RAW, CORRECTED):
            field = summary["field_extreme"].sel(part=part, state=state)
            extremes = [number(field.sel(extreme=extreme).values) for extreme in ("least", "largest")]
            rows.append([str(part), terms.WORD_OF_STATE[state], *extremes])
    return Table("", ["part", "", "smallest", "largest"], rows)
