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
from tolcontact.report.brief import EVERYTHING, MOST_DETAILED, MOST_LISTED, brief_measures
from tolcontact.report.convention_text import convention_lines, offset_lines, offset_table
from tolcontact.report.figures import NO_INTERVAL, grouped, limits_text, number, percent, settled, share
from tolcontact.report.results_table import full_name, overview_table, verdict_lines
from tolcontact.report.table import Table
from tolcontact.statistics.capability import MIN_TAIL, MIN_TAILS
from tolcontact.statistics.intervals import CONFIDENCE, MAX_KURTOSIS, MIN_SHAPE, MIN_VARIANCE
from tolcontact.statistics.sample import MIN_APART

RAW, CORRECTED = terms.STATES
MOST_IN_LINE = 2  # parts or pairs, in a line of a long summary
MOST_CLASHES = 2  # pairs of parts that lie in each other, in a long summary
CHANGES_NOTE = "Changes are from the same draws.\n"
DEEPEST = "largest penetration between surfaces"
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
    brief, remark = (summary, "") if is_whole else brief_measures(summary)
    yield overview_table(brief, is_long=is_long)
    has_details = is_whole or (summary.sizes["measure"] <= MOST_DETAILED and not is_long)
    yield from map(Text, verdict_lines(brief, states_once=not has_details))
    if has_details:
        yield from (measure_table(summary.sel(measure=name), summary.sizes["measure"]) for name in summary["measure"].values)
    elif remark or not is_long:
        yield Text(remark or f"percentiles and capability of each: {EVERYTHING}")
    if not summary.sizes["part"]:
        return
    magnitudes = int(summary["magnitude_realizations"])
    if not is_long:
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
    pairs, offsets = pair_table(summary) if summary.sizes["pair"] else None, offset_table(summary)
    for table in filter(None, (pairs, offsets)):
        yield Text()
        yield table


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
    return Group(
        Text(f"{summary.attrs['title']}: {summary.attrs['realizations']} realizations", style="bold"), *_limits(summary)
    )


def _limits(summary: xr.Dataset) -> Iterator[Text | Table]:
    for name in summary["measure"].values:
        measure = summary.sel(measure=name)
        title = f"{name} ({measure['measure_units'].values}): {limits_text(measure) or 'no limits'}"
        if not limits_text(measure):
            yield Text(f"\n{title}", style="bold")
            continue
        table = measure_table(measure.sel(statistic=[*terms.SHARES, *terms.CAPABILITY]), summary.sizes["measure"])
        yield replace(table, title=title, columns=table.columns[:-1], rows=[row[:-1] for row in table.rows])


def measure_table(measure: xr.Dataset, measures: int) -> Table:
    """Return all estimates of one of `measures` measurements in both states, with their changes and the meaning of marks."""
    units, quantity = str(measure["measure_units"].values), str(measure["measure_quantity"].values)
    subtitle = ", ".join(text for text in (quantity, limits_text(measure)) if text)
    title, rows = f"{full_name(measure)} ({units}){': ' if subtitle else ''}{subtitle}", _measure_rows(measure, measures)
    cells = [cell for row in rows for cell in row]
    notes = [APART] if any(cell.startswith("*") for cell in cells) else []
    return Table(title, ["", *terms.STATE_WORDS, "change"], rows, [*notes, *_needs(measure)])


def _needs(measure: xr.Dataset) -> Iterator[str]:
    """Yield from how many realizations on the statistics of a measurement that have no interval would have one."""
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
    """Return the table of the displacement fields of the parts that move."""
    rows = []
    is_moving = (summary["field_extreme"].values != 0).any(axis=(1, 2, 3))
    for part in summary["part"].values[is_moving]:
        for state in (RAW, CORRECTED):
            field = summary["field_extreme"].sel(part=part, state=state)
            extremes = [number(field.sel(extreme=extreme).values) for extreme in ("least", "largest")]
            rows.append([str(part), terms.WORD_OF_STATE[state], *extremes])
    return Table("", ["part", "", "smallest", "largest"], rows)


def pair_table(summary: xr.Dataset) -> Table:
    """Return the share of realizations with contact, and the reaction, of each pair."""
    rows = []
    for pair in summary["pair"].values:
        mean, *_, high = summary["reaction"].sel(pair=pair).values
        rows.append([str(pair), percent(summary["carried"].sel(pair=pair).values), number(mean), number(high)])
    heading = terms.reaction_words(summary["reaction"].attrs["units"]).heading
    return Table("", ["contact pair", terms.IN_CONTACT, heading, "95th\npercentile"], rows)


def contact_lines(summary: xr.Dataset, count: int, *, is_long: bool = False) -> Iterator[str]:
    """Yield lines about the contact of a run of `count` realizations; only what failed, if it is part of a long summary."""
    if not is_long:
        yield f"realizations touched by contact: {percent(summary['touched'].values)}"
    by_status = _by_status(summary)
    yield "status: " + ", ".join(f"{n} {meaning}" for meaning, n in by_status.items() if n)
    conflicts = [f"{pair} ({int(n)})" for pair, n in zip(summary["pair"].values, summary["conflicts"].values, strict=True) if n]
    if conflicts and is_long:
        yield f"not assemblable, so out of specification, and left out of other statistics: {', '.join(conflicts)}"
    elif conflicts:
        share = percent(summary["not_assemblable"].values)
        yield f"not assemblable: {share}; these count as out of specification, and other statistics with contact leave them out"
        yield f"pairs in conflict there: {', '.join(conflicts)}"
    if unconverged := by_status["not_converged"]:
        yield f"not converged: {unconverged} of {count}; the statistics include their last poses"
    if doubtful := by_status["doubtful"]:
        yield from _doubts(summary, int(doubtful), count)
    yield from _clashes(summary, count, is_long=is_long)
    raw, corrected = (settled(float(summary["penetration"].sel(state=state))) for state in (RAW, CORRECTED))
    median, largest = summary["iterations"].values
    steps = (
        f", {median:g} steps (median), {largest:g} at most" if summary.attrs["resolution"] == "exact" and not is_long else ""
    )
    yield f"resolution: {summary.attrs['resolution']}{steps}; objective: {summary.attrs['objective']}"
    if is_long:
        yield from (line for line in (*_between(summary, count), *_advice(summary, corrected)) if not line.startswith(DEEPEST))
        yield from offset_lines(summary)
        if len(lines := [*convention_lines(summary)]) > 3:  # results depend on it
            yield from lines
        return
    yield from convention_lines(summary)
    yield from offset_lines(summary)
    if shifted := summary.attrs["datum_shifts"]:
        yield f"datum shift of {shifted}: not drawn; contact of the datum features determines it"
    if elastic := summary.attrs["elastic_parts"]:
        yield f"elastic parts: {elastic}; certificates hold at their contact points, bent"
    if stored := summary.attrs["stored_coordinates"]:
        yield stored
    yield from summary.attrs["correlations"].splitlines()
    yield f"largest penetration at contact points: {raw:.3g} mm without, {corrected:.3g} mm with contact"
    yield from _between(summary, count)
    yield from _advice(summary, corrected)


def _doubts(summary: xr.Dataset, doubtful: int, count: int) -> Iterator[str]:
    """Yield lines about answers that are not certified."""
    in_bodies = min(int(summary["clash_count"].values[summary["clash_declared"].values == 1].sum()), doubtful)
    number_far = f"{doubtful - in_bodies} of {count}"
    if in_bodies < doubtful and summary["clash_share"].values[0] > 0:  # whose pairs are named instead of declared ones
        yield (
            f"doubtful: {number_far}: parts of a contact pair lie in each other beyond its faces, or too far from their poses "
            "without contact; tolcontact check names these faces"
        )
    elif in_bodies < doubtful:
        yield f"doubtful: {number_far} answers lie too far from the pose without contact to be certified"
    if in_bodies:
        parts = ", ".join(_clashes_of(summary, is_declared=True))
        yield f"doubtful: in {in_bodies} of {count} answers bodies with declared contact still lie in each other: {parts}"
        yield "advice: they probably meet beyond the chosen faces; tolcontact check names these, and writes the lines to add"


def _clashes(summary: xr.Dataset, count: int, *, is_long: bool = False) -> Iterator[str]:
    """Yield lines about bodies without contact that penetrate each other, and about the test of all bodies."""
    watched, share = int(summary["watched"]), summary["clash_share"].values
    if not watched:
        is_linear = summary.attrs["resolution"] == "linearized"
        reason = "by a linearized resolution" if is_linear else "in this archive"
        yield f"bodies were not tested for interference {reason}: certificates hold for contact points"
        return
    if share[0] > 0:
        clashes = _clashes_of(summary, is_declared=False)
        if is_long:  # the verdicts state the share
            rest = [f"{len(clashes) - MOST_CLASHES} more"] if len(clashes) > MOST_CLASHES else []
            yield f"parts without declared contact lie in each other: {', '.join(clashes[:MOST_CLASHES] + rest)}"
        else:
            text = f"{percent(share)} of realizations; verdicts do not hold there"
            yield f"parts without declared contact lie in each other: {text}"
            yield f"these parts, where they lie deepest: {', '.join(clashes)}"
        yield "advice: declare their contact, or that it is meant: assembly.may_overlap(...); tolcontact check writes the lines"
    if is_long:
        return
    extent = f"all {grouped(watched)}" if watched == count else f"{grouped(watched)} of {grouped(count)}"
    depth = summary.attrs["interference_depth"]
    found = "see above" if share[0] > 0 else "none where certified"
    yield f"interference of bodies from {depth:.2g} mm: {found} ({extent} tested)"
    if summary.attrs["not_watched"]:
        yield f"not tested for interference: {summary.attrs['not_watched']}"


def _clashes_of(summary: xr.Dataset, *, is_declared: bool) -> list[str]:
    """Return the pairs of parts that penetrate each other, with the number of realizations and the largest depth."""
    columns = [summary[name].values for name in ("clash", "clash_count", "clash_largest_depth", "clash_declared")]
    texts = []
    for name, count, depth, declared in zip(*columns, strict=True):
        if bool(declared) == is_declared:
            texts.append(f"{name} ({grouped(int(count))}{f', up to {depth:.2g} mm' if math.isfinite(depth) else ''})")
    return texts


def _between(summary: xr.Dataset, count: int) -> Iterator[str]:
    """Yield lines about penetration between contact points, and about contact beyond the ends of faces."""
    checked, depth, overhang = (float(summary[name]) for name in ("surfaces_checked", "surface_penetration", "beside"))
    limit = terms.NOTICED_SHARE * summary.attrs["smallest_range"]
    if math.isfinite(depth):
        yield f"{DEEPEST}: {settled(depth):.3g} mm ({checked:.0f} of {count} checked)"
        if depth > limit:
            share = percent(summary["penetrating_share"].values)
            least = f"{terms.NOTICED_SHARE:.0%} of the smallest tolerance"
            yield f"penetration between surfaces above {least}: {share} of realizations"
        if depth > limit and depth > 2 * float(summary["penetration"].sel(state=CORRECTED)):
            yield f"advice: {_way_out(summary)}"
        if overhang > limit:
            yield f"touching contact points lie up to {overhang:.3g} mm outside their reference face"
    contacts, ended = (float(summary[name]) for name in ("contacts", "contacts_ended"))
    if ended > 0:
        yield f"contact beyond the end of a face: {ended:.0f} of {contacts:.0f} touching contact points, where checked"
    for pair, depth in zip(summary["pair"].values, summary["false_contact"].values, strict=True):
        if depth > limit:
            share = percent(summary["false_contact_share"].values)
            yield f'contact pair "{pair}": points lie up to {depth:.3g} mm inside where its surfaces are apart ({share})'
            yield f"advice: its faces end within reach of contact; {_way_out(summary)}"


def _way_out(summary: xr.Dataset) -> str:
    """Return advice for surfaces that penetrate each other, or were resolved although they were apart."""
    if summary.attrs["resolution"] == "linearized":
        return "use --resolution exact"
    if summary.attrs["search"] == "bounded":
        return "use finer meshes, or where faces have form a smaller spacing"
    return f'leave out search="{summary.attrs["search"]}"'


def _advice(summary: xr.Dataset, penetration: float) -> Iterator[str]:
    """Yield advice on penetration that remains after a linear step, or with the paper's set of active points."""
    limit = terms.NOTICED_SHARE * summary.attrs["smallest_range"]
    if penetration > limit and summary.attrs["active_set"] == "initial":
        yield 'advice: points outside the initial set penetrate; use Method(active_set="closed")'
    elif summary.attrs["resolution"] == "linearized" and penetration > limit:
        yield f"advice: penetration exceeds {terms.NOTICED_SHARE:.0%} of the smallest tolerance; use --resolution exact"
    elif summary.attrs["resolution"] == "linearized" and _by_status(summary)["not_converged"]:
        yield "advice: some realizations did not converge; use --resolution exact"


def _by_status(summary: xr.Dataset) -> dict[str, int]:
    return {str(m): int(n) for m, n in zip(summary["status_meaning"].values, summary["by_status"].values, strict=True)}
