"""Tables of analyses, the same for the terminal and the page; one function per analysis makes them from its dataset."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.limits import GAP_ACCURACY
from tolcontact.report.figures import grouped, number, percent, share
from tolcontact.report.stack_tables import stack_up_report
from tolcontact.report.sweep_tables import sweep_report
from tolcontact.report.table import Table

SMALL_SHARE = 0.005  # groups with smaller total shares, in both states, are only counted
SMALL_SLOPE = 1e-3  # of the largest derivative of a measure: smaller ones are only counted
AT_END = 1.001  # times the smallest factor of a tolerance: below this, it is as small as permitted
MAX_HOLDERS = 3  # of a part, in a table
FEW_NAMES = 3  # of features in a note
FEW_SEARCHES = 0.25  # of all: if no more than this share end at a value, a remark states that there may be worse ones


@dataclass(frozen=True)
class AnalysisReport:
    """The report of an analysis for readers.

    name     prefix of the titles of its tables on a page
    count    the simulated realizations, in words
    notes    lines that explain the tables
    """

    name: str
    count: str
    notes: Sequence[str]
    tables: Sequence[Table]


def analysis_report(record: terms.AnalysisRecord, dataset: xr.Dataset) -> AnalysisReport:
    """Return the report of the dataset of an analysis."""
    return _REPORTS[record.name](dataset)


def analysis_text(record: terms.AnalysisRecord, dataset: xr.Dataset) -> Group:
    """Return the dataset of an analysis as something that rich prints."""
    report = analysis_report(record, dataset)
    title = Text(f"{dataset.attrs['title']}: {report.count}", style="bold")
    return Group(title, *map(Text, report.notes), *report.tables)


def _lost(count: int) -> list[str]:
    return [f"{grouped(count)} realizations were not resolved; their last poses are included"] if count else []


def _unresolved(dataset: xr.Dataset) -> int:
    return int(dataset["by_status"].values[list(terms.UNRESOLVED)].sum())


def _ppm(values: np.ndarray, *, sign: bool = False) -> str:
    return number(1e6 * np.asarray(values), sign=sign, max_decimals=0).replace(" [", " ppm [")


def _contributions(dataset: xr.Dataset) -> AnalysisReport:
    notes = ["Shares of variance: alone, and in total, together with others; 95 % intervals.", *_lost(_unresolved(dataset))]
    tables = [table for measure in dataset["measure"].values for table in _shares(dataset.sel(measure=measure))]
    return AnalysisReport("Contributions", f"{grouped(dataset.attrs['realizations'])} realizations", notes, tables)


def _shares(dataset: xr.Dataset) -> Iterator[Table]:
    """Yield shares of groups, the largest total share first; and Shapley effects, if there are any."""
    measure = str(dataset["measure"].values)
    raw, corrected = (percent(dataset["missed"].sel(state=state).values) for state in terms.STATES)
    missed = [f"missed by linear sensitivities:\n  {terms.WITHOUT_CONTACT} {raw}, {terms.WITH_CONTACT} {corrected}"]
    largest = dataset["total"].sel(interval="estimate").max("state", skipna=True)
    rows = []
    for group in _by_size(dataset["total"]):
        if float(largest[group]) < SMALL_SHARE:
            continue
        shares = dataset.isel(group=group)
        # Without contact, measures are nearly additive: first-order and total shares hardly differ.
        cells = [
            _share(shares["total"].isel(state=terms.RAW)),
            _share(shares["first"].isel(state=terms.CORRECTED)),
            _share(shares["total"].isel(state=terms.CORRECTED)),
        ]
        linear = float(shares["linear"])
        rows.append([str(shares["group"].values), *cells, f"{100 * linear:.1f} %" if math.isfinite(linear) else "-"])
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
    effects = dataset["shapley"].sel(interval="estimate")
    rows = [
        [str(dataset["unit"].values[k]), *(_share(dataset["shapley"].sel(state=s).isel(unit=k)) for s in terms.STATES)]
        for k in _by_size(dataset["shapley"])
        if not abs(float(effects.isel(unit=k).max())) < SMALL_SHARE
    ]
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
        *_lost(_unresolved(dataset)),
    ]
    tables = [_slopes(dataset.sel(measure=measure)) for measure in dataset["measure"].values]
    leverage = dataset["leverage"].values
    order = [k for k in np.argsort(-leverage, kind="stable") if np.isfinite(leverage[k])]
    if order:
        rows = [[str(dataset["contributor"].values[k]), f"{leverage[k]:.3g}"] for k in order]
        title = "Leverage of locators: the largest displacement of a point of their part for 1 mm"
        tables.append(Table(title, ["", "leverage"], rows))
    return AnalysisReport("Sensitivities", f"{grouped(dataset.attrs['realizations'])} realizations", notes, tables)


def _slopes(dataset: xr.Dataset) -> Table:
    """Return the derivatives of a measure, starting with the contributors that have the largest effect."""
    mean = np.abs(dataset["sensitivity"].sel(interval="estimate").values).max(axis=0)
    size = np.fmax(mean, dataset["spread"].max("state").values)
    rows = []
    for k in np.argsort(-size * dataset["step"].values, kind="stable"):
        if not size[k] > SMALL_SLOPE * np.nanmax(size):
            continue
        slopes = dataset.isel(contributor=int(k))
        by_contact = [number(slopes["by_contact"].sel(contact=contact).values) for contact in terms.CONTACT_STATES]
        corrected = number(slopes["sensitivity"].isel(state=terms.CORRECTED).values)
        spread, slope = f"{float(slopes['spread'][terms.CORRECTED]):.2g}", float(slopes["nominal"])
        nominal = f"{slope:.3g}" if math.isfinite(slope) else "kink"
        kinks = percent(slopes["changing"].values)
        rows.append([str(slopes["contributor"].values), nominal, *by_contact, corrected, spread, kinks])
    small = dataset.sizes["contributor"] - len(rows)
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
    tables = [table for measure in dataset["measure"].values for table in _extremes(dataset.sel(measure=measure))]
    return AnalysisReport("Worst cases", f"{grouped(int(counts.sum()))} combinations", notes, tables)


def _extremes(dataset: xr.Dataset) -> Iterator[Table]:
    """Yield both ends of a measure in both states, and the combinations that cause the corrected ends."""
    rows, searches = [], int(dataset.attrs["searches"])
    for state in terms.STATES:
        for end, word in terms.WORD_OF_END.items():
            extreme = dataset.sel(state=state, end=end)
            found, linear = float(extreme["worst"]), float(extreme["bound"])
            cells = [f"{found:.6g}", f"{linear:.6g}" if math.isfinite(linear) else "no limit"]
            cells.append(f"{int(extreme['agreeing'])} of {searches}")
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


def _allocation(dataset: xr.Dataset) -> AnalysisReport:
    requirements = []
    for name, values in zip(dataset["requirement"].values, dataset["kept"].values, strict=True):
        requirements.append([str(name), *map(share if f": {terms.PPM}" in str(name) else number, values)])
    ranges = []
    for group in dataset["group"].values:
        row = dataset.sel(group=group)
        widths = [f"{width:.4g}" if math.isfinite(width) else "several" for width in row["range"].values]
        ranges.append([str(group), *widths, f"{float(row['factor']):.3g}", _remark_on(row, dataset.attrs)])
    before, after = dataset["cost"].sum("group").values
    tables = [
        Table("", ["required", *terms.STAGES], requirements),
        Table(f"Cost {before:.4g} before, {after:.4g} after", ["tolerance", *terms.STAGES, "factor", ""], ranges),
        *(_effects(dataset["effect"].sel(measure=measure)) for measure in dataset["measure"].values),
    ]
    notes = [f"Requirements in fresh runs of {grouped(dataset.attrs['fresh'])} realizations; 95 % intervals."]
    least, most = (f"{dataset.attrs[name]:g} times" for name in ("floor", "ceiling"))
    notes.append(f"Tolerances may be {least} (smallest allowed) to {most} (largest allowed) those before.\n")
    if choices := dataset.attrs.get("choices"):
        notes.append(f"Choices: {choices}.\n")
    if dataset["idle"].values.any():
        count = dataset.attrs["idle_tried"]
        notes.append(
            f"No influence: with all of these tolerances together at {least} or {most} those before, none of {grouped(count)} "
            f"resolved realizations changed. So at most {3 / count:.2g} of them do, with 95 % confidence.\n"
        )
    for (name, _, after), is_met in zip(requirements, dataset["met"].values, strict=True):
        if not is_met:
            notes.append(f'"{name}": no tolerances were found whose 95 % interval keeps it; the best: {after}.\n')
    return AnalysisReport("Allocation", f"{grouped(dataset.attrs['samples'])} realizations", notes, tables)


def _remark_on(row: xr.Dataset, attributes: dict) -> str:
    """Return why a tolerance did not change further, if there is a reason."""
    if int(row["idle"]):
        return "no influence"
    factor = float(row["factor"])
    at_floor, at_ceiling = factor <= attributes["floor"] * AT_END, factor * AT_END >= attributes["ceiling"]
    return "smallest allowed" if at_floor else "largest allowed" if at_ceiling else ""


def _effects(effect: xr.DataArray) -> Table:
    """Return the effects (of_effect, group, interval) on a measure, starting with the largest one."""
    rows = []
    for k in np.argsort(effect.values[0, :, 0], kind="stable"):
        spread, outside = effect.values[:, k]
        rows.append([str(effect["group"].values[k]), number(spread, sign=True), _ppm(outside, sign=True)])
    title = f"{effect['measure'].values} [{effect['measure_units'].values}]: changes if zones were a tenth narrower than before"
    return Table(title, ["", *terms.EFFECTS], rows)


def _relocation(dataset: xr.Dataset) -> AnalysisReport:
    statistic = dataset.attrs["least"]
    is_share = statistic.endswith(terms.PPM)
    text = share if is_share else number
    rows = []
    for stage, point, reached in zip(terms.STAGES, dataset["point"].values, dataset["reached"].values, strict=True):
        rows.append([f"{stage}: ({', '.join(f'{c:.4g}' for c in point)})", text(reached)])
    change = dataset["change"].values
    rows.append(["after minus before", _ppm(change, sign=True)] if is_share else ["after / before", number(change)])
    columns = [dataset.attrs["locator"], statistic if is_share else f"{statistic} [{dataset['measure_units'].values}]"]
    samples, fresh = (grouped(dataset.attrs[word]) for word in ("samples", "fresh"))
    notes = [
        f"{samples} realizations for each trial position;",
        f"{fresh} fresh ones for the figures below, with 95 % intervals.\n",
    ]
    before, after = dataset["point"].values
    stays = ["No position between the corners is better: the locator stays where it is.\n"] * bool((before == after).all())
    table = Table("", columns, rows, _lost(int(dataset["unresolved"].max())))
    return AnalysisReport("Position of a locator", f"{grouped(dataset.sizes['trial'])} trial positions", notes + stays, [table])


def _seating(dataset: xr.Dataset) -> AnalysisReport:
    notes = [
        "Least coefficient of friction, the same at all other contacts, that can hold",
        "a part short of a seat: 0 if they hold it without friction, inf if they cannot",
        "with any; and the contacts that then hold it, with shares of normal forces.",
        f"Parts stand {dataset.attrs['place']}.",
    ]
    if dataset.attrs["open_pairs"]:
        notes.append(f"They do not touch there, so they hold nothing: {dataset.attrs['open_pairs']}.")
    rows = [_seat(dataset.isel(seat=k)) for k in range(dataset.sizes["seat"])]
    columns = ["", "critical", "reserve", "held by"]
    return AnalysisReport("Seating", f"{len(rows)} seats", notes, [Table("", columns, rows)])


def _seat(dataset: xr.Dataset) -> list[str]:
    """Return the row of a seat, starting with the contacts that have the largest shares."""
    critical, reserve, shares = (dataset[name].values for name in ("critical", "reserve", "share"))
    holders = [k for k in np.argsort(-shares, kind="stable") if shares[k] >= SMALL_SHARE and critical > 0]
    names = [f"{dataset['holder'].values[k]} {100 * shares[k]:.0f} %" for k in holders[:MAX_HOLDERS]]
    names += [f"and {len(holders) - MAX_HOLDERS} more"] if len(holders) > MAX_HOLDERS else []
    warning = ", may stop short" if 0 < critical and reserve <= 1 else ""
    factor = "-" if np.isnan(reserve) else f"{float(reserve):.3g}{warning}"
    return [str(dataset["seat"].values), f"{float(critical):.4g}", factor, ",\n".join(names)]


_REPORTS: dict[str, Callable[[xr.Dataset], AnalysisReport]] = {
    terms.STACK_UP.name: lambda dataset: AnalysisReport(*stack_up_report(dataset, _lost(_unresolved(dataset)))),
    terms.CONTRIBUTIONS.name: _contributions,
    terms.SENSITIVITIES.name: _sensitivities,
    terms.WORST_CASE.name: _worst_case,
    terms.TAILS.name: _tails,
    terms.ALLOCATION.name: _allocation,
    terms.RELOCATION.name: _relocation,
    terms.SEATING.name: _seating,
    terms.SWEEP.name: lambda dataset: AnalysisReport(*sweep_report(dataset, _lost(_unresolved(dataset.sum("position"))))),
}
