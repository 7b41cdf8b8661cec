"""The table of results: figures and a verdict for each measurement, the same for terminal, page and spreadsheet."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.contact_text import unexplained_offsets
from tolcontact.report.table import (
    Table,
    by_measure,
    grouped,
    limits_text,
    nominal_and_limits,
    not_a_number,
    number,
    percent,
)
from tolcontact.statistics.capability import CONSTANT, FAILS, KEPT, UNDECIDED, Verdict, verdict

PPM_BELOW = 0.01  # if all shares are smaller, the table states them in ppm
DIGITS_OF_COUNTS = 2  # significant digits of the number of realizations that would decide
STATISTICS = (terms.MEAN, terms.STANDARD_DEVIATION, terms.PPK, terms.BELOW, terms.ABOVE)


COLUMNS = (
    terms.MEASUREMENT, "verdict", "nominal", "lower limit", "upper limit", "contact", "mean", "sigma", terms.PPK,
)  # fmt: skip
SIDES = ("below", "above")


class StateFigures(NamedTuple):
    """The figures of a measurement in one state, as (estimate, lower, upper) of `STATISTICS`, and as texts."""

    state: str
    values: np.ndarray
    cells: list[str]


class ResultRow(NamedTuple):
    """The rows of the table for a measurement.

    verdict   "" without limits
    states    with contact first
    """

    name: str
    units: str
    quantity: str
    verdict: str
    is_good: bool | None
    nominal: float
    lower: float
    upper: float
    limits: tuple[str, str, str]
    states: list[StateFigures]


def share_units(summary: xr.Dataset) -> str:
    """Return the units of all shares out of specification in a table, "%" or "ppm"."""
    shares = summary["statistic_value"].sel(statistic=terms.OUTSIDE, interval="estimate").values
    return "%" if np.nan_to_num(shares).max(initial=0.0) >= PPM_BELOW else "ppm"


def share_in(values: np.ndarray, units: str) -> str:
    """Return a share (estimate, lower, upper) in "%" or "ppm", with its interval and without the units."""
    if not math.isfinite(values[0]):
        return "-"
    if units == "ppm":
        estimate, lower, upper = (grouped(round(1e6 * float(value))) for value in values)
        return f"{estimate} [{lower}, {upper}]"
    return number(100 * np.asarray(values), max_decimals=2)


def share_heading(summary: xr.Dataset) -> str:
    """Return the heading above the last two columns of the table, `SIDES`."""
    return f"{terms.OUT_OF_SPECIFICATION}, {share_units(summary)}"


def result_rows(summary: xr.Dataset) -> list[ResultRow]:
    """Return the rows of the table for each measurement."""
    doubts, is_reserved, rows = doubts_of_all(summary), bool(reservation(summary)), []
    for measure in by_measure(summary):
        opinion, kept = verdict_of(measure, summary.attrs["realizations"]), _kept(measure)
        is_open = opinion is None or opinion.word in (UNDECIDED, CONSTANT) or bool(kept) or is_reserved
        labels = (terms.MEASURE_NOMINAL.name, *terms.MEASURE_LIMITS[:2])
        nominal, lower, upper = (float(measure[label].values) for label in labels)
        rows.append(
            ResultRow(
                full_name(measure),
                str(measure["measure_units"].values),
                str(measure["measure_quantity"].values),
                f"{verdict_text(opinion)}{kept}{doubts}" if opinion else _lack(measure, summary.attrs["realizations"]),
                None if is_open or opinion is None else opinion.word != FAILS,
                nominal,
                lower,
                upper,
                nominal_and_limits(nominal, lower, upper),
                [_state_figures(measure.sel(state=state), share_units(summary)) for state in reversed(terms.STATES)],
            )
        )
    return rows


def _state_figures(of_state: xr.Dataset, units: str) -> StateFigures:
    values = of_state["statistic_value"].sel(statistic=list(STATISTICS)).transpose("statistic", "interval").values
    cells = [*map(number, values[:3]), *(share_in(share, units) for share in values[3:])]
    return StateFigures(terms.WORD_OF_STATE[str(of_state["state"].values)], values, cells)


def verdict_of(measure: xr.Dataset, realizations: int) -> Verdict | None:
    """Return the verdict on one measure of a summary; None without limits."""
    statistics = measure["statistic_value"]
    spreads = statistics.sel(statistic=terms.STANDARD_DEVIATION, interval="estimate").values  # raw and corrected
    varies = bool((spreads > float(measure[terms.MEASURE_LIMITS[2]].values)).any())
    share, open_by_parts = statistics.sel(state=terms.STATES[1], statistic=terms.OUTSIDE), bool(measure[terms.OPEN_BY_PARTS])
    return verdict(share.values, realizations, varies=varies, open_by_parts=open_by_parts)


def verdict_text(opinion: Verdict | None) -> str:
    """Return a verdict in words; "" without one."""
    if opinion is None:
        return ""
    if opinion.word != UNDECIDED:
        return opinion.word
    if math.isinf(opinion.more):
        return f"{UNDECIDED}: it is known from few parts, so measure more parts; more realizations decide nothing"
    digits = DIGITS_OF_COUNTS - len(str(int(opinion.more)))
    return f"{UNDECIDED}: about {grouped(int(round(opinion.more, min(digits, 0))))} more realizations"


def _lack(measure: xr.Dataset, realizations: int) -> str:
    """Return why a measurement with limits has no verdict; "" for one without limits."""
    count = int(measure[terms.NOT_A_NUMBER].values)
    return not_a_number(count, realizations) if count and limits_text(measure) else ""


def reservation(summary: xr.Dataset) -> str:
    """Return the text after each verdict that holds only for realizations that are as they should be; otherwise ""."""
    share, texts = summary["clash_share"].values, []
    if share[0] > 0:
        texts.append(f"; but parts lie in each other in {percent(share)} of realizations")
    if parts := unexplained_offsets(summary):
        texts.append(f"; but contact moved parts far off their locators: {', '.join(parts)} of realizations")
    if summary.attrs[terms.PARTS_LEFT_OUT]:
        texts.append('; but without what few parts leave open: archive the deviations, keep="all"')
    return "".join(texts)


def doubts_of_all(summary: xr.Dataset) -> str:
    """Return the text after each verdict: what cannot be assembled, and the reservation."""
    share = summary["not_assemblable"].values
    failures = f" (out of specification: {percent(share)} that cannot be assembled)" if share[0] > 0 else ""
    return f"{failures}{reservation(summary)}"


def _kept(measure: xr.Dataset) -> str:
    """Return which share of values contact keeps at a limit that is a stop; "" if none would be beyond it without contact."""
    raw, kept = measure["statistic_value"].sel(state=terms.STATES[terms.RAW]), []
    for side, bound, statistic in zip(SIDES, terms.BOUNDS, terms.SHARES[:2], strict=True):
        share = raw.sel(statistic=statistic).values
        if bound in str(measure[terms.MEASURE_STOPS].values) and share[0] > 0:
            kept.append(f"{percent(share)} {side}")
    return f", {KEPT}: without contact {' and '.join(kept)}" if kept else ""


def full_name(measure: xr.Dataset) -> str:
    """Return the name of one measure of a summary, with its station if the assembly has stations."""
    name, station = str(measure[terms.MEASURE].values), terms.MEASURE_STATION.name
    return f"{name}, station {measure[station].values}" if station in measure.coords else name


def verdict_lines(summary: xr.Dataset, *, states_once: bool = False) -> Iterator[str]:
    """Yield the verdict on each measurement that has limits, and why a measurement has none of its figures.

    What makes all verdicts doubtful follows each of them, or is stated once, in the last line.
    """
    doubts = doubts_of_all(summary)
    for measure in by_measure(summary):
        if count := int(measure[terms.NOT_A_NUMBER].values):
            lacking = "verdict" if limits_text(measure) else "statistics"
            yield f"{full_name(measure)}: {not_a_number(count, summary.attrs['realizations'])}, so it has no {lacking}"
        if text := verdict_text(verdict_of(measure, summary.attrs["realizations"])):
            is_about_limits = not text.startswith((UNDECIDED, CONSTANT))
            remarks = f"{_kept(measure)}{'' if states_once else doubts}"
            yield f"{full_name(measure)}: {text}{' its limits' * is_about_limits}{remarks}"
    if states_once and doubts:
        yield f"all verdicts{doubts.replace('; ', ': ', 1) if doubts.startswith('; ') else doubts}"


def has_no_verdict(summary: xr.Dataset) -> bool:
    """Return whether a measurement with limits is not a number in some realizations."""
    has_limits = np.isfinite([summary[name].values for name in terms.MEASURE_LIMITS[:2]]).any(axis=0)
    return bool((has_limits & (summary[terms.NOT_A_NUMBER].values > 0)).any())


def overview_table(summary: xr.Dataset, *, is_long: bool = False) -> Table:
    """Return the short table of a terminal: mean, 6 sigma, Ppk and share out of specification by measure and state.

    In a long summary it only has figures with contact.
    """
    rows, units = [], share_units(summary)
    for measure in by_measure(summary):
        if not is_long:
            rows.append([full_name(measure), "", "", "", ""])
        values = measure["statistic_value"].sel(statistic=[terms.MEAN, terms.SIX_SIGMA, terms.PPK, terms.OUTSIDE])
        for state in terms.STATES[-1:] if is_long else terms.STATES:
            mean, spread, ppk, outside = values.sel(state=state).values
            figures = [number(mean), number(spread), number(ppk), share_in(outside, units).replace(" [", f" {units} [")]
            rows.append([full_name(measure) if is_long else f"  {terms.WORD_OF_STATE[state]}", *figures])
    heading = terms.WITH_CONTACT if is_long else ""
    return Table("", [heading, "mean", "6 sigma", terms.PPK, terms.OUT_OF_SPECIFICATION_COLUMN], rows)
