"""Analyses for the terminal."""

from collections.abc import Iterator

import xarray as xr
from rich.console import Group
from rich.text import Text

from tolcontact.report.analysis_tables import analysis_report
from tolcontact.report.text.table import FigureTable
from tolcontact.vocabulary import AnalysisRecord


def analysis_text(record: AnalysisRecord, dataset: xr.Dataset) -> Group:
    """Return the dataset of an analysis as something that rich prints."""
    return Group(*_sections(record, dataset))


def _sections(record: AnalysisRecord, dataset: xr.Dataset) -> Iterator[Text | FigureTable]:
    report = analysis_report(record, dataset)
    yield Text(f"{dataset.attrs['title']}: {report.count}", style="bold")
    yield from map(Text, report.notes)
    for table in report.tables:
        if table.title:
            yield Text(f"\n{table.title}", style="bold")
        yield FigureTable(table.columns, table.rows)
        yield from map(Text, table.remarks)
