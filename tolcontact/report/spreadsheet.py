"""The tables of a report as a spreadsheet: one sheet per table, numbers as numbers, units in the headings."""

import importlib
import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import TitleBlock
from tolcontact.declaration.title_block import title_block_of
from tolcontact.errors import ArchiveError, OptionError
from tolcontact.replacing import replacing
from tolcontact.report.contributor_shares import contributor_shares
from tolcontact.report.model_tables import archived_settings, model_tables
from tolcontact.report.results_table import STATISTICS, result_rows
from tolcontact.report.table import Table, by_measure
from tolcontact.statistics.capability import VERDICT_RULE
from tolcontact.texts import sheet_cell
from tolcontact.vocabulary import units_of

MAX_WIDTH = 48  # characters of a column
INTERVAL = ("", ", lower end of its 95 % interval", ", upper end of its 95 % interval")


def write_spreadsheet(results: xr.DataTree, summary: xr.Dataset, path: Path, title_block: TitleBlock | None = None) -> None:
    """Write the tables of a run with this summary as .xlsx; the default `title_block` comes from the archive.

    Raises OptionError if openpyxl is not installed, and ArchiveError if the file cannot be written.
    """
    try:
        openpyxl = importlib.import_module("openpyxl")
    except ModuleNotFoundError as error:
        raise OptionError("--xlsx needs openpyxl, which is not installed; install it: pip install '.[xlsx]'") from error
    book = openpyxl.Workbook()
    book.remove(book.active)
    bold = openpyxl.styles.Font(bold=True)
    for sheet in sheets_of(results, summary, title_block or title_block_of(results.attrs)):
        page = book.create_sheet(sheet.title)
        page.append(list(map(sheet_cell, sheet.columns)))
        for row in sheet.rows:
            page.append([_plain(cell) for cell in row])
        for cells in page.iter_rows():
            for cell in cells:
                if isinstance(cell.value, str):
                    cell.data_type = "s"  # neither a formula nor an error value, whatever it says
        for cell in page[1]:
            cell.font = bold
            texts = [sheet.columns[cell.column - 1], *(str(row[cell.column - 1]) for row in sheet.rows)]
            page.column_dimensions[cell.column_letter].width = min(max(map(len, texts)) + 2, MAX_WIDTH)
        page.freeze_panes = "B2"
    content = io.BytesIO()
    book.save(content)
    try:
        with replacing(path) as part:
            part.write_bytes(content.getvalue())
    except OSError as error:
        raise ArchiveError(f'spreadsheet "{path}" cannot be written: {error.strerror}') from error


def sheets_of(results: xr.DataTree, summary: xr.Dataset, titles: TitleBlock) -> Iterator[Table]:
    """Yield the tables of a report in the order of its page."""
    yield _document(results, summary, titles)
    yield _results(summary)
    yield _statistics(summary)
    yield _contributors(results, summary)
    if summary.sizes["pair"]:
        yield _contact(summary)
    yield from model_tables(results)


def _document(results: xr.DataTree, summary: xr.Dataset, titles: TitleBlock) -> Table:
    rows = [[name.replace("_", " "), entry] for name, entry in titles.entries.items() if entry]
    rows += [
        ["simulation", summary.attrs["title"]],
        ["realizations", summary.attrs["realizations"]],
        ["verdict", VERDICT_RULE],
        *map(list, archived_settings(results).items()),
    ]
    return Table("Document", ["entry", "value"], rows)


def _results(summary: xr.Dataset) -> Table:
    heads = [f"{name}{end}" for name in (*STATISTICS[:3], "share below limit", "share above limit") for end in INTERVAL]
    rows = [
        [*row[:4], row.nominal, row.lower, row.upper, state.state, *state.values.ravel()]
        for row in result_rows(summary)
        for state in row.states
    ]
    labels = [terms.MEASUREMENT, "units", "quantity", "verdict", "nominal", "lower limit", "upper limit", "contact"]
    return Table("Results", [*labels, *heads], rows)


def _statistics(summary: xr.Dataset) -> Table:
    rows = []
    for measure in by_measure(summary):
        name, units = str(measure["measure"].values), str(measure["measure_units"].values)
        for state in terms.STATES:
            for statistic in summary["statistic"].values:
                values = measure["statistic_value"].sel(state=state, statistic=statistic).values
                if np.isfinite(values[0]):
                    rows.append([name, terms.WORD_OF_STATE[state], str(statistic), units_of(statistic, units), *values])
    return Table("Statistics", [terms.MEASUREMENT, "contact", "statistic", "units", *terms.ESTIMATE], rows)


def _contributors(results: xr.DataTree, summary: xr.Dataset) -> Table:
    rows: list[list[Any]] = []
    for name, shares in zip(summary["measure"].values, contributor_shares(results, summary.attrs["realizations"]), strict=True):
        rows += [[str(name), group, *(100 * values)] for group, values in zip(shares.groups, shares.shares, strict=True)] or [
            [str(name), shares.note, None, None, None]
        ]
    heads = [f"share of variance{end}, %" for end in INTERVAL]
    return Table(terms.CONTRIBUTORS, [terms.MEASUREMENT, "contributor", *heads], rows)


def _contact(summary: xr.Dataset) -> Table:
    reaction = terms.reaction_words(summary["reaction"].attrs["units"]).heading
    heads = [f"{heading}{end}".replace("\n", " ") for heading in (terms.IN_CONTACT, reaction) for end in INTERVAL]
    rows = []
    for pair in summary["pair"].values:
        of_pair = summary.sel(pair=pair)
        rows.append([str(pair), *of_pair["carried"].values, *of_pair["reaction"].sel(of_reaction=terms.MEAN).values])
    return Table("Contact", ["contact pair", *heads], rows)


def _plain(value: Any) -> Any:
    """Return a cell for openpyxl, without numbers that a spreadsheet cannot contain."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else sheet_cell(value)
