"""Tables of what a search changed: the tolerances of an allocation, and the position of a locator."""

import math

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.table import AnalysisReport, Table, grouped, lost_realizations, number, share

AT_END = 1.001  # times the smallest factor of a tolerance: below this, it is as small as permitted


def allocation_report(dataset: xr.Dataset) -> AnalysisReport:
    """Return what is required, the tolerances before and after, and what narrower ones would change."""
    requirements = []
    for name, values in zip(dataset["requirement"].values, dataset["kept"].values, strict=True):
        requirements.append([str(name), *map(share if f": {terms.PPM}" in str(name) else number, values)])
    ranges = []
    for group in dataset["group"].values:
        row = dataset.sel(group=group)
        widths = [f"{width:.4g}" if math.isfinite(width) else "several" for width in row["range"].values]
        factor = float(row["factor"])
        if int(row["idle"]):
            remark = "no influence"
        elif factor <= dataset.attrs["floor"] * AT_END:
            remark = "smallest allowed"
        else:
            remark = "largest allowed" if factor * AT_END >= dataset.attrs["ceiling"] else ""
        ranges.append([str(group), *widths, f"{factor:.3g}", remark])
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


def _effects(effect: xr.DataArray) -> Table:
    """Return the effects (of_effect, group, interval) on a measure, starting with the largest one."""
    rows = []
    for k in np.argsort(effect.values[0, :, 0], kind="stable"):
        spread, outside = effect.values[:, k]
        rows.append([str(effect["group"].values[k]), number(spread, sign=True), _ppm(outside, sign=True)])
    title = f"{effect['measure'].values} [{effect['measure_units'].values}]: changes if zones were a tenth narrower than before"
    return Table(title, ["", *terms.EFFECTS], rows)


def relocation_report(dataset: xr.Dataset) -> AnalysisReport:
    """Return both positions of a locator, and what they reach."""
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
    table = Table("", columns, rows, lost_realizations(int(dataset["unresolved"].max())))
    return AnalysisReport("Position of a locator", f"{grouped(dataset.sizes['trial'])} trial positions", notes + stays, [table])


def _ppm(values: np.ndarray, *, sign: bool = False) -> str:
    return number(1e6 * np.asarray(values), sign=sign, max_decimals=0).replace(" [", " ppm [")
