"""Pages from templates; each holds its styles, scripts, libraries and data."""

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import markupsafe
import xarray as xr

from tolcontact.declaration import Assembly
from tolcontact.discretization import Nominal, discretize
from tolcontact.errors import ArchiveError, ModelError
from tolcontact.replacing import replacing
from tolcontact.report.figures import grouped
from tolcontact.report.html.analyses import contributions_of, tables_of
from tolcontact.report.html.charts import charts_of, compared_charts, relations_of
from tolcontact.report.html.scene import gap_rows, scene_of, view_of
from tolcontact.report.results_table import result_columns, result_rows
from tolcontact.report.text.runs import CHANGES, VALUES, change_rows, runs_lines, value_rows
from tolcontact.report.text.summary import contact_lines, measure_rows, notes, pair_columns, pair_rows
from tolcontact.vocabulary import STATE_WORDS

HERE = Path(__file__).parent
GENERATOR = '<meta name="generator" content="tolcontact">'
SCRIPTS = {
    "report": ("vendor/three.min.js", "vendor/plotly-basic.min.js", "data.js", "viewer.js", "charts.js", "report.js"),
    "view": ("vendor/three.min.js", "data.js", "viewer.js", "features.js", "view.js"),
    "compare": ("vendor/plotly-basic.min.js", "data.js", "charts.js", "compare.js"),
}
RUN = ("solver", "resolution", "objective", "regularization", "eta", "active_set", "search", "method_from", "sampler", "seed",
       "samples", "kept", "fields", "versions", "history", "format")  # fmt: skip


def write_page(results: xr.DataTree, summary: xr.Dataset, path: Path) -> None:
    """Write the report of a run with this summary. Raises ArchiveError if the file cannot be written."""
    _write(page_of(results, summary), path)


def write_view(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str], path: Path) -> None:
    """Write the view of a model before a run (see view_page). Raises ArchiveError if the file cannot be written."""
    _write(view_page(assembly, nominal, faults), path)


def write_comparison(runs: Mapping[str, xr.DataTree], comparison: xr.Dataset, path: Path) -> None:
    """Write the comparison of runs (see compare_runs). Raises ArchiveError if the file cannot be written."""
    _write(comparison_page(runs, comparison), path)


def is_page(path: Path) -> bool:
    """Return whether a file is a page that tolcontact wrote."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(1000)


def page_of(results: xr.DataTree, summary: xr.Dataset) -> str:
    """Return the report of a run with this summary."""
    scene = scene_of(results, summary)
    values = {
        "title": summary.attrs["title"],
        "realizations": grouped(summary.attrs["realizations"]),
        "begun": grouped(summary.attrs["samples"]) if summary.attrs["samples"] > summary.attrs["realizations"] else "",
        "results": _results(summary),
        "details": _details(summary),
        "contact": list(contact_lines(summary, summary.attrs["realizations"])),
        "pairs": {"columns": pair_columns(summary), "rows": pair_rows(summary)} if summary.sizes["pair"] else None,
        "tables": list(tables_of(results)),
        "contributions": (shares := contributions_of(results)),
        "run": {name: str(results.attrs[name]) for name in RUN if name in results.attrs},
        "missing": _missing(scene),
    }
    data = {
        "scene": scene,
        "charts": charts_of(results, summary),
        "relations": relations_of(results, summary),
        "contributions": shares,
    }
    return _page("report", values, data)


def view_page(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> str:
    """Return the view of a model before a run; `nominal` is None for a model with faults other than omissions."""
    omissions = [fault for fault in assembly.omissions() if fault in faults]
    others = [fault for fault in faults if fault not in omissions]
    values = {
        "title": assembly.name,
        "faults": others,
        "omissions": omissions,
        "has_features": any(part.toleranced for part in assembly.parts),
        "pairs": gap_rows(nominal),
        "file": _file(assembly, nominal, faults),
    }
    return _page("view", values, {"scene": view_of(assembly, nominal, others), "charts": []})


def nominal_and_faults(assembly: Assembly) -> tuple[Nominal | None, tuple[str, ...]]:
    """Return what the view of a model shows: its nominal model if its only faults are omissions, and its faults."""
    try:
        return discretize(assembly, incomplete=True), tuple(assembly.omissions())
    except ModelError as error:
        return None, tuple(dict.fromkeys([*assembly.omissions(), *error.faults]))


def _file(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> str:
    """Return the name of the file of the parts, if nothing else is declared yet."""
    return "" if nominal or faults or not assembly.parts else Path(str(getattr(assembly.parts[0].geometry, "source", ""))).name


def comparison_page(runs: Mapping[str, xr.DataTree], comparison: xr.Dataset) -> str:
    """Return the comparison of runs as a page."""
    measures = []
    for name in comparison["measure"].values:
        measure = comparison.sel(measure=name)
        tables = [{"columns": VALUES, "rows": value_rows(measure)}, {"columns": CHANGES, "rows": change_rows(measure)}]
        measures.append({"name": str(name), "units": str(measure["measure_units"].values), "tables": tables})
    values = {
        "title": comparison.attrs["title"],
        "reference": comparison.attrs["reference_run"],
        "lines": list(runs_lines(comparison)),
        "measures": measures,
    }
    return _page("compare", values, {"charts": compared_charts(runs, comparison)})


def summary_table(summary: xr.Dataset) -> str:
    """Return the overview of a summary as a table outside of a page."""
    return _template("overview").render(results=_results(summary))


def _page(kind: str, values: dict[str, Any], data: dict[str, Any]) -> str:
    """Return a page of a kind, which selects its template and scripts."""
    scripts = [_as_is(file) for file in SCRIPTS[kind]]
    data |= {"states": STATE_WORDS}
    return _template(kind).render(
        states=STATE_WORDS,
        data=jinja2.utils.htmlsafe_json_dumps(data, dumps=_plain_json),
        style=_as_is("page.css"),
        generator=markupsafe.Markup(GENERATOR),
        scripts=scripts,
        allowed=" ".join(map(_hash, scripts)),  # no other script runs, whatever the data are
        **values,
    )


def _template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(HERE), autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.get_template(f"{name}.html.j2")


def _write(page: str, path: Path) -> None:
    try:
        with replacing(path) as part:
            part.write_text(page, encoding="utf-8")
    except OSError as error:
        raise ArchiveError(f'page "{path}" cannot be written: {error.strerror}') from error


def _as_is(file: str) -> markupsafe.Markup:
    return markupsafe.Markup((HERE / file).read_text(encoding="utf-8").replace("</script", "<\\/script"))


def _hash(script: markupsafe.Markup) -> str:
    """Return the hash of a script as a content security policy states it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


def _plain_json(data: Any, **_: Any) -> str:
    return json.dumps(data, allow_nan=False, separators=(",", ":"))


def _results(summary: xr.Dataset) -> dict[str, Any]:
    return {"columns": result_columns(summary), "rows": result_rows(summary)}


def _details(summary: xr.Dataset) -> list[dict[str, Any]]:
    """Return all estimates of each measure as rows of texts."""
    details = []
    for measure in summary["measure"].values:
        rows = measure_rows(summary.sel(measure=measure))
        details.append({"name": str(measure), "rows": rows, "note": "; ".join(notes(rows))})
    return details


def _missing(scene: dict[str, Any]) -> list[str]:
    """Return sentences about data that the archive does not have, or that the page simplifies."""
    remarks = []
    if not any("mean" in part for part in scene["parts"]):
        remarks.append("The archive has no displacement fields.")
    if "motions" not in scene["realizations"]:
        remarks.append("The archive has no poses: single realizations have figures only.")
    remarks += [
        f"Part {part['name']} is drawn with {grouped(part['faces']['shape'][0])} of its {grouped(part['triangles'])} triangles."
        for part in scene["parts"]
        if part["faces"]["shape"][0] < part["triangles"]
    ]
    return remarks
