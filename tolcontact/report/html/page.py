"""Pages from templates; each contains its styles, scripts, libraries and data."""

import base64
import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jinja2
import markupsafe
import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import Assembly, Chain, TitleBlock
from tolcontact.declaration.title_block import title_block_of
from tolcontact.discretization import Nominal, discretize
from tolcontact.errors import ArchiveError, ModelError
from tolcontact.realizations import archived_analysis, declaration_of, finished
from tolcontact.replacing import replacing
from tolcontact.report.analysis_tables import analysis_report
from tolcontact.report.comparison_text import change_table, contributor_table, model_changes, runs_lines, value_table
from tolcontact.report.contact_text import contact_lines, offset_table, pair_table
from tolcontact.report.contributor_shares import ContributorShares, contributor_shares, shares_or_first_order
from tolcontact.report.elastic_tables import RigidMeasured, elastic_tables
from tolcontact.report.html.charts import bars_of, charts_of, compared_charts, loops_of, relations_of
from tolcontact.report.html.scene import gap_rows, scene_of, view_of
from tolcontact.report.model_tables import archived_settings, chains_of, dimensions_of, model_tables
from tolcontact.report.results_table import COLUMNS, SIDES, result_rows, share_heading
from tolcontact.report.summary_text import measure_table
from tolcontact.report.table import Table, by_measure, grouped, limits_text
from tolcontact.statistics.capability import VERDICT_RULE

HERE = Path(__file__).parent
GENERATOR = '<meta name="generator" content="tolcontact">'
SCRIPTS = {
    "report": (
        "vendor/three.min.js", "vendor/plotly-basic.min.js", "data.js", "labels.js", "viewer.js", "reactions.js", "stations.js",
        "charts.js", "report.js",
    ),
    "view": ("vendor/three.min.js", "data.js", "labels.js", "viewer.js", "stations.js", "features.js", "view.js"),
    "compare": ("vendor/plotly-basic.min.js", "data.js", "charts.js", "compare.js"),
}  # fmt: skip
TITLE_ENTRIES = {"part_number": "part number", "revision": "revision", "author": "author", "date": "date"}
MAX_ROWS = 15  # of the table of an analysis, above a fold
WORDS = {
    "states": terms.STATE_WORDS, "rule": VERDICT_RULE, "glossary": terms.GLOSSARY, "estimates_note": terms.ESTIMATES_NOTE,
    "contributors_heading": terms.CONTRIBUTORS, "settings_heading": terms.SIMULATION_SETTINGS,
}  # fmt: skip
MAX_BARS = 15  # of a chart
MAX_CHANGES = 30  # of a model, that a comparison lists
CASES_NOTE = "Those with contact are the first of the single realizations above."


def write_page(
    results: xr.DataTree, summary: xr.Dataset, path: Path, title_block: TitleBlock | None = None,
    variances: Callable[[], np.ndarray] | None = None, rigid: Callable[[], RigidMeasured | None] | None = None,
) -> None:  # fmt: skip
    """Write the report of a run (see page_of). Raises ArchiveError if the file cannot be written."""
    _write(page_of(results, summary, title_block, variances, rigid), path)


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


def page_of(
    results: xr.DataTree, summary: xr.Dataset, title_block: TitleBlock | None = None,
    variances: Callable[[], np.ndarray] | None = None, rigid: Callable[[], RigidMeasured | None] | None = None,
) -> str:  # fmt: skip
    """Return the report of a run with this summary; the default `title_block` comes from the archive.

    Where shares of contributors cannot be estimated, `variances` is called for first-order ones (see shares_or_first_order).
    With elastic parts, `rigid` is called for values with rigid ones (see variance_table).
    """
    scene, titles = scene_of(results, summary), title_block or title_block_of(results.attrs)
    shares, document = shares_or_first_order(results, summary.attrs["realizations"], variances), declaration_of(results)
    values = {
        "title": summary.attrs["title"],
        "titles": titles,
        "block": _block(results, titles),
        "realizations": grouped(summary.attrs["realizations"]),
        "begun": grouped(summary.attrs["samples"]) if summary.attrs["samples"] > summary.attrs["realizations"] else "",
        "results": _results(summary),
        "details": _details(summary, shares),
        "model": model_tables(results),
        "loops": loops_of(chains_of(document), dimensions_of(document)),
        "has_parts": summary.sizes["part"] > 0,
        "contact": list(contact_lines(summary, summary.attrs["realizations"])),
        "pairs": pair_table(summary),
        "offsets": offset_table(summary),
        "elastic": list(elastic_tables(results, rigid)),
        "reactions": terms.reaction_words(summary["reaction"].attrs["units"]).explanation,
        "tables": list(tables_of(results)),
        "contributions": (indices := contributions_of(results)),
        "max_rows": MAX_ROWS,
        "run": {name: str(value) for name, value in archived_settings(results).items()},
        "missing": _missing(scene) if scene["parts"] else [],
        "stations": scene["stations"],
    }
    data = {
        "scene": scene,
        "charts": [
            {**chart, "contributors": bars_of(of_measure), "contributorsTitle": of_measure.title}
            for chart, of_measure in zip(charts_of(results, summary), shares, strict=True)
        ],
        "relations": relations_of(results, summary),
        "contributions": indices,
    }
    return _page("report", values, data)


def view_page(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> str:
    """Return the view of a model before a run; `nominal` is None for a model with faults other than omissions."""
    omissions = [fault for fault in assembly.omissions() if fault in faults]
    remaining_faults = [fault for fault in faults if fault not in omissions]
    scene, file = view_of(assembly, nominal, remaining_faults), ""
    if assembly.parts and not nominal and not faults:  # nothing else is declared yet
        file = Path(str(getattr(assembly.parts[0].geometry, "source", ""))).name
    values = {
        "title": assembly.name,
        "faults": remaining_faults,
        "omissions": omissions,
        "loops": loops_of({m.name: vars(m.of) for m in assembly.measures if isinstance(m.of, Chain)}, assembly.variables),
        "has_parts": bool(assembly.parts),
        "has_features": any(part.toleranced for part in assembly.parts),
        "pairs": gap_rows(nominal),
        "file": file,
        "stations": scene["stations"],
    }
    return _page("view", values, {"scene": scene, "charts": []})


def nominal_and_faults(assembly: Assembly) -> tuple[Nominal | None, tuple[str, ...]]:
    """Return the nominal model for the view of a model, if its only faults are omissions, and its faults."""
    try:
        return discretize(assembly, incomplete=True), tuple(assembly.omissions())
    except ModelError as error:
        return None, tuple(dict.fromkeys([*assembly.omissions(), *error.faults]))


def comparison_page(runs: Mapping[str, xr.DataTree], comparison: xr.Dataset) -> str:
    """Return the comparison of runs as a page."""
    measures, (reference, *others) = [], runs
    documents = {name: declaration_of(results) for name, results in runs.items()}
    positions = {name: results.to_dataset()[terms.MEASURE].values.tolist() for name, results in runs.items()}
    shares = {name: contributor_shares(results, finished(results)) for name, results in runs.items()}
    for measure in by_measure(comparison):
        name = str(measure["measure"].values)
        contributors = contributor_table({run: shares[run][names.index(name)] for run, names in positions.items()})
        tables = [value_table(measure), change_table(measure), *([contributors] if contributors.rows else [])]
        measures.append({"name": name, "units": str(measure["measure_units"].values), "tables": tables})
    values = {
        "title": comparison.attrs["title"],
        "reference": comparison.attrs["reference_run"],
        "lines": list(runs_lines(comparison)),
        "blocks": {name: _block(results, title_block_of(results.attrs)) for name, results in runs.items()},
        "changes": {name: list(model_changes(documents[reference], documents[name])) for name in others},
        "max_changes": MAX_CHANGES,
        "measures": measures,
    }
    return _page("compare", values, {"charts": compared_charts(runs, comparison)})


def _block(results: xr.DataTree, titles: TitleBlock) -> dict[str, str]:
    """Return what identifies a run: entries of a title block, the standard of the drawings, and the seed."""
    entries = {word: titles.entries[name] for name, word in TITLE_ENTRIES.items()}
    entries |= {"standard": str(results.attrs.get(terms.STANDARD, "")), "seed": str(results.attrs["seed"])}
    return {word: entry for word, entry in entries.items() if entry}


def summary_table(summary: xr.Dataset) -> str:
    """Return the overview of a summary as a table outside of a page."""
    return _template("overview").render(results=_results(summary))


def _page(kind: str, values: dict[str, Any], data: dict[str, Any]) -> str:
    scripts = [_as_is(file) for file in SCRIPTS[kind]]
    data |= {"states": terms.STATE_WORDS}
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    return _template(kind).render(
        **WORDS,
        data=jinja2.utils.htmlsafe_json_dumps(data, dumps=json.dumps, allow_nan=False, separators=(",", ":")),
        style=_as_is("page.css"),
        generator=markupsafe.Markup(GENERATOR),
        scripts=scripts,
        allowed=" ".join(f"'sha256-{digest}'" for digest in hashes),  # no other script runs, even if data contain one
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


def _results(summary: xr.Dataset) -> dict[str, Any]:
    return {"columns": COLUMNS, "shares": share_heading(summary), "sides": SIDES, "rows": result_rows(summary)}


def _details(summary: xr.Dataset, shares: Sequence[ContributorShares]) -> list[dict[str, Any]]:
    """Return the details of each measurement: limits, contributors, and all estimates as rows of texts."""
    details = []
    for measure, contributors in zip(by_measure(summary), shares, strict=True):
        name, units = (str(measure[label].values) for label in ("measure", "measure_units"))
        table = measure_table(measure, summary.sizes["measure"])
        figures = {"limits": limits_text(measure), "rows": table.rows, "note": "; ".join(table.remarks)}
        details.append({"name": name, "units": units, "contributors": contributors, **figures})
    return details


def _missing(scene: dict[str, Any]) -> list[str]:
    """Return sentences about data that the archive does not have, or that the page simplifies."""
    counts = {part["name"]: (part["faces"]["shape"][0], part["triangles"]) for part in scene["parts"]}
    coarse = [f"{name} {grouped(drawn)} of {grouped(count)}" for name, (drawn, count) in counts.items() if drawn < count]
    remarks = {
        "The archive has no displacement fields.": not any("mean" in part for part in scene["parts"]),
        "The archive has no poses: single realizations have figures only.": "motions" not in scene["realizations"],
        f"Parts are drawn with fewer triangles than they have: {', '.join(coarse)}.": bool(coarse),
    }
    return [remark for remark, is_true in remarks.items() if is_true]


def contributions_of(results: xr.DataTree) -> list[dict[str, Any]]:
    """Return total and first-order shares of each measure's groups, in both states, the largest total share first."""
    dataset = archived_analysis(results, terms.CONTRIBUTIONS)
    return [] if dataset is None else list(map(_shares, by_measure(dataset)))


def tables_of(results: xr.DataTree) -> Iterator[Table]:
    """Yield the tables of all other analyses, with titles, and notes as remarks below the first one."""
    for record in terms.ANALYSES.values():
        dataset = archived_analysis(results, record)
        if dataset is None:
            continue
        report = analysis_report(record, dataset)
        notes = [f"{report.count}. {' '.join(report.notes)}", *([CASES_NOTE] if record is terms.WORST_CASE else [])]
        for table in report.tables:
            if not table.is_detail:
                title = f"{report.name}: {table.title}" if table.title else report.name
                yield replace(table, title=title, remarks=[*table.remarks, *notes])
                notes = []


def _shares(dataset: xr.Dataset) -> dict[str, Any]:
    total = dataset["total"].sel(interval="estimate")
    order = np.argsort(-np.nan_to_num(total.max("state").values), kind="stable")[:MAX_BARS]
    return {
        "measure": str(dataset["measure"].values),
        "groups": [str(group) for group in dataset["group"].values[order]],
        "states": [
            {word: [_percents(shares) for shares in dataset[word].values[state, order]] for word in ("first", "total")}
            for state in range(len(terms.STATES))
        ],
        "linear": _percents(dataset["linear"].values[order]),
    }


def _percents(shares: np.ndarray) -> list[float | None]:
    return [100 * float(share) if np.isfinite(share) else None for share in shares]
