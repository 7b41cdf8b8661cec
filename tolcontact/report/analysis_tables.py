"""Tables of analyses, the same for the terminal and the page; one function per analysis makes them from its dataset."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.limits import GAP_ACCURACY
from tolcontact.report import allocation_tables, stack_tables
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

BRIEF_TABLES, BRIEF_ROWS = 10, 4  # of a coarse answer in brief: the first tables, and the rows of each that a line has
SMALL_SHARE = 0.005  # groups with smaller total shares, in both states, are only counted
SMALL_EFFECT = 1e-3  # of the largest effect on a measure, a derivative times a step: smaller ones are only counted
MAX_HOLDERS = 3  # of a part, in a table
FEW_NAMES = 3  # of features in a note
FEW_SEARCHES = 0.25  # of all: if no more than this share end at a value, a remark states that there may be worse ones


def analysis_report(record: terms.AnalysisRecord, dataset: xr.Dataset) -> AnalysisReport:
    """Return the report of the dataset of an analysis."""
    report = _REPORTS[record.name](dataset)
    if coarse := dataset.attrs.get(terms.COARSE):
        notes = [f"COARSE, {coarse}. More time or realizations give the complete answer.", *report.notes]
        report = replace(report, notes=notes)
    return report


def analysis_text(record: terms.AnalysisRecord, dataset: xr.Dataset) -> Group:
    """Return the dataset of an analysis as something that rich prints."""
    report = analysis_report(record, dataset)
    title = Text(f"{dataset.attrs['title']}: {report.count}", style="bold")
    return Group(title, *map(Text, report.notes), *report.tables)


def brief_lines(record: terms.AnalysisRecord, dataset: xr.Dataset) -> Iterator[str]:
    """Yield a coarse answer in brief: what it rests on, and the first rows of its first tables."""
    report = analysis_report(record, dataset)
    yield f"{report.name.lower()} {dataset.attrs[terms.COARSE]}"
    tables = [table for table in report.tables if len(table.columns) > report.main and (table.title or len(report.tables) == 1)]
    for table in tables[:BRIEF_TABLES]:
        rows = [[cell for cell in (row[0], row[report.main], *row[1:]) if cell != "-"][:2] for row in table.rows[:BRIEF_ROWS]]
        known = "; ".join(" ".join(row) for row in rows if len(row) > 1)
        yield f"  {table.title}: " * bool(table.title) + (known or "not known yet")


def _contributions(dataset: xr.Dataset) -> AnalysisReport:
    notes = [
        "Shares of variance: alone, and in total, together with others; 95 % intervals.",
        *lost_realizations(unresolved(dataset)),
    ]
    tables = [table for measure in by_measure(dataset) for table in _shares(measure)]
    return AnalysisReport("Contributions", f"{grouped(dataset.attrs['realizations'])} realizations", notes, tables, main=3)


def _shares(dataset: xr.Dataset) -> Iterator[Table]:
    """Yield shares of groups, the largest total share first; and Shapley effects, if there are any."""
    measure = str(dataset["measure"].values)
    raw, corrected = (percent(dataset["missed"].sel(state=state).values) for state in terms.STATES)
    missed = [f"missed by linear sensitivities:\n  {terms.WITHOUT_CONTACT} {raw}, {terms.WITH_CONTACT} {corrected}"]
    largest = dataset["total"].sel(interval="estimate").max("state", skipna=True)
    order, rows = _by_size(dataset["total"]), []
    if not dataset.attrs["base_realizations"]:  # only linear shares are known
        largest, order = dataset["linear"], np.argsort(-dataset["linear"].values, kind="stable")
    for group in order:
        if float(largest[group]) < SMALL_SHARE:
            continue
        shares = dataset.isel(group=group)
        # Without contact, measures are nearly additive: first-order and total shares hardly differ.
        cells = shares["total"][terms.RAW], shares["first"][terms.CORRECTED], shares["total"][terms.CORRECTED]
        linear = f"{100 * float(shares['linear']):.1f} %" if math.isfinite(shares["linear"]) else "-"
        rows.append([str(shares["group"].values), *map(_share, cells), linear])
    if not np.isfinite(dataset["linear"].values).any():
        missed.append("no linear shares: it has a kink in the assembly as drawn, or no slope there")
    small = dataset.sizes["group"] - len(rows)
    remarks = [f"and {small} of less than {100 * SMALL_SHARE:g} % each"] if small else []
    if dataset["minor"].any():
        together = percent(dataset["minor_total"].isel(state=terms.CORRECTED).values)
        remarks.append(f"{int(dataset['minor'].sum())} minor ones, estimated together: with contact {together} in total")
    columns = ["", "without\ncontact", "with contact,\nalone", "in total", "linear"]
    if not dataset.sizes["unit"]:
        yield Table(measure, columns, rows, [*remarks, *missed], is_detail=True)
        return
    yield Table(measure, columns, rows, remarks, is_detail=True)
    rows = []
    for k in _by_size(dataset["shapley"]):
        effects = dataset["shapley"].isel(unit=k)
        if not abs(float(effects.sel(interval="estimate").max())) < SMALL_SHARE:
            rows.append([str(dataset["unit"].values[k]), *map(_share, effects)])
    title = f"{measure}: Shapley effects, which divide what is correlated"
    yield Table(title, ["", *terms.STATE_WORDS], rows, missed, is_detail=True)


def _share(values: xr.DataArray) -> str:
    """Return a share of a variance (interval,) in percent, at most 100 %: estimates scatter beyond."""
    return percent(np.minimum(values.values, 1.0))


def _by_size(shares: xr.DataArray) -> np.ndarray:
    """Return positions of shares (state, group, interval), the largest estimate with contact first."""
    return shares.sel(interval="estimate").isel(state=terms.CORRECTED).argsort()[::-1].values


def _sensitivities(dataset: xr.Dataset) -> AnalysisReport:
    notes = [
        "Mean derivatives with 95 % intervals: over realizations without contact, and",
        "over realizations with contact, both without kinks and jumps;",
        '"all" includes kinks and jumps, and "kinks" is their share.',
        *lost_realizations(unresolved(dataset)),
        *_left_out(dataset),
    ]
    tables = [_slopes(measure) for measure in by_measure(dataset)]
    leverage = dataset["leverage"].values
    order = [k for k in np.argsort(-leverage, kind="stable") if np.isfinite(leverage[k])]
    if order:
        rows = [[str(dataset["contributor"].values[k]), f"{leverage[k]:.3g}"] for k in order]
        title = "Leverage of locators: the largest displacement of a point of their part for 1 mm"
        tables.append(Table(title, ["", "leverage"], rows))
    return AnalysisReport("Sensitivities", f"{grouped(dataset.attrs['realizations'])} realizations", notes, tables, main=4)


def _left_out(dataset: xr.Dataset) -> Iterator[str]:
    """Yield a remark on each measurement that is not a number in some realizations."""
    counts = dataset["not_a_number"].values.tolist() if "not_a_number" in dataset else []  # older archives have none
    for measure, count in zip(dataset["measure"].values, counts, strict=False):
        if count:
            share = not_a_number(count, dataset.attrs["realizations"])
            yield f"{measure}: {share}, or at a step from there; they are left out"


def _slopes(dataset: xr.Dataset) -> Table:
    """Return the derivatives of a measure, starting with the contributors that have the largest effect."""
    mean = np.abs(dataset["sensitivity"].sel(interval="estimate").values).max(axis=0)
    size = np.fmax(mean, dataset["spread"].max("state").values)
    if not dataset.attrs["realizations"]:  # only nominal derivatives are known
        size = np.abs(dataset["nominal"].values)
    effects, rows = size * dataset["step"].values, []
    for k in np.argsort(-effects, kind="stable"):
        if not effects[k] > SMALL_EFFECT * np.nanmax(effects, initial=0.0):
            continue
        slopes = dataset.isel(contributor=int(k))
        means = [slopes["by_contact"].sel(contact=contact).values for contact in terms.CONTACT_STATES]
        means.append(slopes["sensitivity"].isel(state=terms.CORRECTED).values)
        nominal = f"{float(slopes['nominal']):.3g}" if math.isfinite(slopes["nominal"]) else "kink"
        spread, kinks = f"{float(slopes['spread'][terms.CORRECTED]):.2g}", percent(slopes["changing"].values)
        rows.append([str(slopes["contributor"].values), nominal, *map(number, means), spread, kinks])
    small = int(np.isfinite(effects).sum()) - len(rows)
    title = f"{dataset['measure'].values} ({dataset['measure_units'].values} for a unit of each)"
    columns = ["", "nominal", "apart", "touching", "all", "spread", "kinks"]
    return Table(title, columns, rows, [f"and {small} with next to no effect"] if small else [])


def _worst_case(dataset: xr.Dataset) -> AnalysisReport:
    notes = [
        "Worst-case minimum and maximum over all combinations that the tolerances allow.",
        "Correlations are ignored.",
        "found: the worst combination that searches found; `searches` says how many of them met there.",
        "linear: tolerances times sensitivities at the nominal assembly, as in a stack-up; with contact,",
        "the farthest that parts can be without penetration, if contact or locators hold them.",
    ]
    if names := [name for name in dataset.attrs.get(terms.WITHOUT_FORM, "").split(", ") if name]:
        others = f" and {len(names) - FEW_NAMES} more" if len(names) > FEW_NAMES else ""
        notes.append(f"Without the form deviations of {', '.join(names[:FEW_NAMES])}{others}: these faces keep their shape.")
    counts = dataset["by_status"].values
    for status in terms.UNRESOLVED:
        if counts[status]:
            meaning = terms.STATUS_MEANINGS[status].replace("_", " ")
            notes.append(f"{grouped(int(counts[status]))} combinations are {meaning}; they do not count")
    if counts[terms.Status.NOT_ASSEMBLABLE]:
        notes.append("So the drawings allow parts that do not go together.")
    tables = [table for measure in by_measure(dataset) for table in _extremes(measure)]
    return AnalysisReport("Worst cases", f"{grouped(int(counts.sum()))} combinations", notes, tables)


def _extremes(dataset: xr.Dataset) -> Iterator[Table]:
    """Yield both ends of a measure in both states, and the combinations that cause the corrected ends."""
    rows, searches = [], int(dataset.attrs["searches"])
    for state in terms.STATES:
        for end, word in terms.WORD_OF_END.items():
            extreme = dataset.sel(state=state, end=end)
            linear = f"{float(extreme['bound']):.6g}" if math.isfinite(extreme["bound"]) else "no limit"
            cells = [f"{float(extreme['worst']):.6g}", linear, f"{int(extreme['agreeing'])} of {searches}"]
            rows.append([f"{word}, {terms.WORD_OF_STATE[state]}", *cells])
    remarks = []
    beyond = float((np.array(terms.SENSES) * (dataset["worst"] - dataset["bound"]).values).max())
    if beyond > GAP_ACCURACY:
        remarks.append(f"Found up to {beyond:.2g} beyond linear: sensitivities change when parts tilt that far.")
    if not np.isfinite(dataset["bound"].values).all():
        remarks.append("No limit: a kink in the nominal assembly, or contact alone would have to hold the part.")
    if int(dataset["agreeing"].min()) <= FEW_SEARCHES * searches:
        remarks.append("Where few searches met, there may be worse combinations; more --samples find more.")
    title = f"{dataset['measure'].values} [{dataset['measure_units'].values}]"
    yield Table(title, ["", "found", "linear", "searches"], rows, remarks)
    deviations = dataset["deviations"].isel(state=terms.CORRECTED).transpose("contributor", "end").values
    combination = [
        [str(label), *(f"{value:+.4g}" for value in values)]
        for label, values in zip(dataset["contributor"].values, deviations, strict=True)
        if np.abs(values).max() > 0
    ]
    yield Table("", ["deviations, with contact", *terms.EXTREME_WORDS], combination, is_detail=True)


def _tails(dataset: xr.Dataset) -> AnalysisReport:
    rows = []
    for event in dataset["event"].values:
        ppm = [1e6 * float(value) for value in dataset["probability"].sel(event=event).values]
        estimate, lower, upper = (grouped(round(value)) if value >= 1000 else f"{value:.3g}" for value in ppm)
        figures = f"{estimate} [{lower}, {upper}]" if ppm[0] else f"none found: at most {upper}"
        rows.append([str(event), "-" if math.isnan(ppm[0]) else figures])
    count = f"{grouped(int(dataset['simulated'].sum()))} realizations"
    notes = ["Probabilities in ppm, with contact, by searches and importance sampling; 95 % intervals."]
    for event, factor in zip(dataset["event"].values, dataset["disagreement"].values, strict=True):
        if factor > 1:
            differ = f"disagree by a factor of {factor:.2g}" if math.isfinite(factor) else "disagree: only one of them found it"
            notes.append(f"{event}: two searches {differ}; more realizations are needed.")
    for event in dataset["event"].values[dataset["stop"].values == 1]:
        notes.append(f"{event}: values stop at a limit; none was found beyond it.")
    for event in dataset["event"].values[np.isnan(dataset["probability"].values[:, 0])]:
        notes.append(f"{event}: the measurement is not a number in some realizations, so its probability is not defined.")
    return AnalysisReport("Rare events", count, notes, [Table("", ["", "ppm"], rows)])


def _seating(dataset: xr.Dataset) -> AnalysisReport:
    notes = [
        "Least coefficient of friction, the same at all other contacts, that can hold",
        "a part short of a seat: 0 if they hold it without friction, inf if they cannot",
        "with any; and the contacts that then hold it, with shares of normal forces.",
        f"Parts stand {dataset.attrs['place']}.",
    ]
    if dataset.attrs["open_pairs"]:
        notes.append(f"They do not touch there, so they hold nothing: {dataset.attrs['open_pairs']}.")
    rows = []
    for seat in range(dataset.sizes["seat"]):
        critical, reserve, shares = (dataset[name].values[seat] for name in ("critical", "reserve", "share"))
        holders = [k for k in np.argsort(-shares, kind="stable") if shares[k] >= SMALL_SHARE and critical > 0]
        names = [f"{dataset['holder'].values[k]} {100 * shares[k]:.0f} %" for k in holders[:MAX_HOLDERS]]
        names += [f"and {len(holders) - MAX_HOLDERS} more"] if len(holders) > MAX_HOLDERS else []
        warning = ", may stop short" if 0 < critical and reserve <= 1 else ""
        factor = "-" if np.isnan(reserve) else f"{float(reserve):.3g}{warning}"
        rows.append([str(dataset["seat"].values[seat]), f"{float(critical):.4g}", factor, ",\n".join(names)])
    columns = ["", "critical", "reserve", "held by"]
    return AnalysisReport("Seating", f"{len(rows)} seats", notes, [Table("", columns, rows)])


_REPORTS: dict[str, Callable[[xr.Dataset], AnalysisReport]] = {
    terms.STACK_UP.name: stack_tables.stack_up_report,
    terms.CONTRIBUTIONS.name: _contributions,
    terms.SENSITIVITIES.name: _sensitivities,
    terms.WORST_CASE.name: _worst_case,
    terms.TAILS.name: _tails,
    terms.ALLOCATION.name: allocation_tables.allocation_report,
    terms.RELOCATION.name: allocation_tables.relocation_report,
    terms.SEATING.name: _seating,
    terms.SWEEP.name: stack_tables.sweep_report,
}
