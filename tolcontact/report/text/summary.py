"""The summary as text for a terminal."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr
from rich.console import Group
from rich.padding import Padding
from rich.text import Text

from tolcontact.report.figures import grouped, limits_text, number, percent, share
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import (
    ABOVE,
    BELOW,
    CAPABILITY,
    OUTSIDE,
    PP,
    PP_NORMAL,
    PPK,
    PPK_NORMAL,
    SHARES,
    SHIFT,
    SPREAD_RATIO,
    STATES,
    VARIANCE_RATIO,
)

RAW, CORRECTED = STATES
_CHANGE_BESIDE = {"mean": SHIFT, "6 sigma": SPREAD_RATIO, "variance": VARIANCE_RATIO}
_SHORT = {"standard deviation": "std. dev.", BELOW: "below", ABOVE: "above", OUTSIDE: "outside"}
_BY_PERCENTILES = {PP_NORMAL: PP, PPK_NORMAL: PPK}
ADVISED = 0.01  # share of the smallest tolerance range: more penetration than that deserves an exact resolution
APART = "* apart from that by percentiles: as of a normal distribution it is wrong"


def summary_text(summary: xr.Dataset) -> Group:
    """A summary (see summarize) as something that rich prints."""
    return Group(*_sections(summary))


def _sections(summary: xr.Dataset) -> Iterator[Text | FigureTable | Padding]:
    count = summary.attrs["realizations"]
    yield Text(f"{summary.attrs['title']}: {count} realizations", style="bold")
    if summary.attrs["samples"] > count:
        yield Text(f"{grouped(count)} of {grouped(summary.attrs['samples'])} realizations are done; continue with --resume")
    yield Text("Estimates with their 95 % confidence intervals; changes are from the same draws.\n")
    yield _overview(summary)
    for measure in summary["measure"].values:
        yield from _measure_section(summary.sel(measure=measure), str(measure))
    magnitudes = int(summary["magnitude_realizations"])
    yield Text("\n6 sigma of the displacement magnitude over the surface of each part (mm)", style="bold")
    if magnitudes < count:
        yield Text(f"of at least the first {grouped(magnitudes)} realizations" if magnitudes else "not summed up")
    if magnitudes:
        yield _field_table(summary)
    yield Text("\ncontact", style="bold")
    for line in contact_lines(summary, count):
        yield Padding(Text(line), (0, 0, 0, 2), expand=False)
    if summary.sizes["pair"]:
        yield Text()
        yield FigureTable(pair_columns(summary), pair_rows(summary))


def capability_text(summary: xr.Dataset) -> Group:
    """How each measure of a summary keeps within its limits, and no more."""
    return Group(
        Text(f"{summary.attrs['title']}: {summary.attrs['realizations']} realizations", style="bold"), *_limits(summary)
    )


def _limits(summary: xr.Dataset) -> Iterator[Text | FigureTable]:
    for measure in summary["measure"].values:
        of = summary.sel(measure=measure)
        yield Text(f"\n{measure} ({of['measure_units'].values}): {limits_text(of) or 'no limits'}", style="bold")
        if limits_text(of):
            rows, marked = measure_rows(of.sel(statistic=[*SHARES, *CAPABILITY]))
            yield FigureTable(["", RAW, CORRECTED], [row[:-1] for row in rows])
            if marked:
                yield Text(APART)


def _overview(summary: xr.Dataset) -> FigureTable:
    """Of each measure what a decision is made by."""
    rows = []
    for measure in summary["measure"].values:
        rows.append([str(measure), "", "", "", ""])
        for state in (RAW, CORRECTED):
            rows.append([f"  {state}", *overview_cells(summary["statistic_value"].sel(measure=measure, state=state))])
    return FigureTable(["", "mean", "6 sigma", PPK, "outside"], rows)


def overview_cells(of: xr.DataArray) -> list[str]:
    """Mean, 6 sigma, Ppk and share outside of a measure in one state."""
    mean, spread, ppk, outside = (of.sel(statistic=word).values for word in ("mean", "6 sigma", PPK, OUTSIDE))
    return [number(mean), number(spread), number(ppk), share(outside)]


def _measure_section(of: xr.Dataset, name: str) -> Iterator[Text | FigureTable]:
    units, quantity = str(of["measure_units"].values), str(of["measure_quantity"].values)
    said = ", ".join(each for each in (quantity, limits_text(of)) if each)
    yield Text(f"\n{name} ({units}){': ' if said else ''}{said}", style="bold")
    rows, marked = measure_rows(of)
    yield FigureTable(["", RAW, CORRECTED, "change"], rows)
    if marked:
        yield Text(APART)


def measure_rows(of: xr.Dataset) -> tuple[list[list[str]], bool]:
    """All estimates of a measure: rows of label, raw, corrected and change; and whether one is marked by * (see APART)."""
    rows, marked = [], False
    for statistic in of["statistic"].values:
        values = [of["statistic_value"].sel(statistic=statistic, state=state).values for state in (RAW, CORRECTED)]
        if statistic in (*SHARES, *CAPABILITY) and not any(math.isfinite(value[0]) for value in values):
            continue
        if statistic in SHARES:
            rows.append([_SHORT[statistic], *map(share, values), ""])
            continue
        label, figures = _SHORT.get(statistic, statistic), [number(value) for value in values]
        if statistic in _BY_PERCENTILES:
            beside = of["statistic_value"].sel(statistic=_BY_PERCENTILES[statistic])
            for k, state in enumerate((RAW, CORRECTED)):
                if _are_apart(values[k], beside.sel(state=state).values):
                    figures[k], marked = f"* {figures[k]}", True
        change = ""
        if statistic in _CHANGE_BESIDE:
            changed = of["change"].sel(change_of=_CHANGE_BESIDE[statistic]).values
            change = number(changed, sign=True) if statistic == "mean" else percent(changed - 1, sign=True)
        rows.append([label, *figures, change])
    return rows, marked


def _are_apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two intervals have nothing in common."""
    return bool(one[1] > other[2] or other[1] > one[2])


def _field_table(summary: xr.Dataset) -> FigureTable:
    rows = []
    for part in summary["part"].values:
        for state in (RAW, CORRECTED):
            of = summary["field_extreme"].sel(part=part, state=state)
            extremes = [number(of.sel(extreme=extreme).values) for extreme in ("least", "largest")]
            rows.append([str(part), state, *extremes])
    return FigureTable(["part", "state", "least", "largest"], rows)


def pair_columns(summary: xr.Dataset) -> list[str]:
    """The heading of `pair_rows`."""
    units = summary["reaction"].attrs["units"]
    return ["contact pair", "carries", f"mean reaction, {units}", "95th percentile"]


def pair_rows(summary: xr.Dataset) -> list[list[str]]:
    """How often each pair carries, and what."""
    rows = []
    for pair in summary["pair"].values:
        mean, *_, high = summary["reaction"].sel(pair=pair).values
        rows.append([str(pair), percent(summary["carried"].sel(pair=pair).values), number(mean), number(high)])
    return rows


def contact_lines(summary: xr.Dataset, count: int) -> Iterator[str]:
    """What a run of `count` realizations shows about contact, line by line."""
    yield f"realizations touched by contact: {percent(summary['touched'].values)}"
    by_status = _by_status(summary)
    yield "status: " + ", ".join(f"{n} {meaning}" for meaning, n in by_status.items() if n)
    stuck = [f"{pair} ({int(n)})" for pair, n in zip(summary["pair"].values, summary["conflicts"].values, strict=True) if n]
    if stuck:
        share = percent(summary["not_assemblable"].values)
        yield f"not assemblable: {share}; least-penetration poses are included"
        yield f"pairs in conflict there: {', '.join(stuck)}"
    if unsure := by_status["not_converged"]:
        yield f"not converged: {unsure} of {count}; their last poses are included above"
    if doubtful := by_status["doubtful"]:
        yield f"doubtful: {doubtful} of {count} answers lie too far from the raw pose to be certified"
    raw, corrected = (float(summary["penetration"].sel(state=state)) for state in (RAW, CORRECTED))
    median, largest = summary["iterations"].values
    steps = f", {median:g} steps (median), {largest:g} at most" if summary.attrs["resolution"] == "exact" else ""
    yield f"resolution: {summary.attrs['resolution']}{steps}; objective: {summary.attrs['objective']}"
    if shifted := summary.attrs["datum_shifts"]:
        yield f"datum shift of {shifted}: not drawn; the contact of the datum features decides it"
    yield f"largest penetration at contact points: raw {raw:.3g} mm, corrected {corrected:.3g} mm"
    yield from _between(summary, count)
    yield from _advice(summary, corrected)


def _between(summary: xr.Dataset, count: int) -> Iterator[str]:
    """What contact points do not see."""
    checked, depth, beside = (float(summary[name]) for name in ("surfaces_checked", "surface_penetration", "beside"))
    limit = ADVISED * summary.attrs["smallest_range"]
    if math.isfinite(depth):
        yield f"largest penetration between surfaces: {depth:.3g} mm ({checked:.0f} of {count} checked)"
        if depth > limit and depth > 2 * float(summary["penetration"].sel(state=CORRECTED)):
            yield f"advice: it exceeds {ADVISED:.0%} of the smallest tolerance range; use more contact points"
        if beside > limit:
            yield f"contact points that touch lie up to {beside:.3g} mm beside their reference face"


def _advice(summary: xr.Dataset, penetration: float) -> Iterator[str]:
    """What to do about penetration that a linear step, or the paper's set of active points, has left."""
    limit = ADVISED * summary.attrs["smallest_range"]
    if penetration > limit and summary.attrs["active_set"] == "initial":
        yield 'advice: points outside the initial set penetrate; use Method(active_set="closed")'
    elif summary.attrs["resolution"] == "linearized" and penetration > limit:
        yield f"advice: penetration exceeds {ADVISED:.0%} of the smallest range; use --resolution exact"
    elif summary.attrs["resolution"] == "linearized" and _by_status(summary)["not_converged"]:
        yield "advice: some realizations did not converge; use --resolution exact"


def _by_status(summary: xr.Dataset) -> dict[str, int]:
    return {str(m): int(n) for m, n in zip(summary["status_meaning"].values, summary["by_status"].values, strict=True)}
