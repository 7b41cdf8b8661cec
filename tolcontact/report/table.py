"""A table: the same for the terminal, where it fits into the width, for the page and for the spreadsheet."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

import rich.table
from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from tolcontact.report.figures import plain

Cell = str | float | None  # None is an empty cell
NAME_WIDTH = 12  # longer names and labels may be wrapped
FILE_WIDTH = 80  # of tables in files and pipes
BETWEEN = "  "  # separator of columns


@dataclass(frozen=True)
class Table:
    """A table with its title, and remarks below it; numbers stay numbers. A detail is left out of the page.

    In a terminal, columns are as wide as their cells. If they do not fit, each interval is printed below its estimate.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Any]]
    remarks: Sequence[str] = ()
    is_detail: bool = False

    @property
    def texts(self) -> list[list[str]]:
        """The rows as texts."""
        return [["" if cell is None else plain(cell) if isinstance(cell, float) else cell for cell in row] for row in self.rows]

    @property
    def is_number(self) -> list[bool]:
        """Whether each column has numbers."""
        return [any(isinstance(row[k], float) for row in self.rows) for k in range(len(self.columns))]

    def without_empty_columns(self) -> "Table":
        """Return the table without columns that are empty in all rows."""
        filled = [k for k in range(len(self.columns)) if any(row[k] not in (None, "") for row in self.rows)]
        return replace(self, columns=[self.columns[k] for k in filled], rows=[[row[k] for k in filled] for row in self.rows])

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        if self.title:
            yield Text(f"\n{self.title}", style="bold")
        yield from self._figures(options.max_width if console.is_terminal else FILE_WIDTH)
        yield from map(Text, self.remarks)

    def _figures(self, width: int) -> RenderResult:
        texts = self.texts
        rows = [[cell.split("\n") for cell in row] for row in texts]
        if self._full_width(rows) > width:
            rows = [[cell.replace(" [", "\n[").split("\n") for cell in row] for row in texts]
        if self._full_width(rows) <= width:
            yield from self._lines(rows)
            return
        table = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
        for k, (heading, least) in enumerate(zip(zip(*self._headings(), strict=True), self._widths(rows), strict=True)):
            min_width = min(least, NAME_WIDTH) if k == 0 else None
            table.add_column("\n".join(heading), justify="left" if k == 0 else "right", no_wrap=k > 0, min_width=min_width)
        for row in rows:
            table.add_row(*map("\n".join, row))
        yield table

    def _widths(self, rows: Sequence[Sequence[Sequence[str]]]) -> list[int]:
        """Return the width of each column, for cells of several lines."""
        cells: list[Sequence[Sequence[str]]] = [[column.split("\n") for column in self.columns], *rows]
        return [max(cell_len(line) for row in cells for line in row[k]) for k in range(len(self.columns))]

    def _full_width(self, rows: Sequence[Sequence[Sequence[str]]]) -> int:
        return sum(self._widths(rows)) + len(BETWEEN) * (len(self.columns) - 1)

    def _headings(self) -> list[tuple[str, ...]]:
        """Return the lines of the heading, with each column aligned to the last line."""
        headings = [column.split("\n") for column in self.columns]
        height = max(map(len, headings), default=0)
        return list(zip(*([""] * (height - len(lines)) + lines for lines in headings), strict=True))

    def _lines(self, rows: Sequence[Sequence[Sequence[str]]]) -> Iterator[Text]:
        """Yield the lines of the equivalent rich table, which takes a hundred times as long for cells without wrapping."""
        widths = self._widths(rows)
        for cells in self._headings():
            yield Text(_line(cells, widths), style="table.header", no_wrap=True)
        yield Text("─" * self._full_width(rows), no_wrap=True)
        if rows:
            lines = [_line(cells, widths) for row in rows for cells in zip_longest(*row, fillvalue="")]
            yield Text("\n".join(lines), no_wrap=True)


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (" " * (width - cell_len(cell)) for cell, width in zip(cells, widths, strict=True))
    return BETWEEN.join([cells[0] + first, *(space + cell for space, cell in zip(others, cells[1:], strict=True))])
