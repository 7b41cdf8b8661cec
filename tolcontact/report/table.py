"""A table: the same for the terminal, where it fits into the width, for the page and for the spreadsheet."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
BETWEEN = 2  # characters between columns


@dataclass(frozen=True)
class Table:
    """A table with its title, and remarks below it; numbers stay numbers. A detail is left out of the page.

    Columns are as wide as their cells. If they do not fit, each interval is printed below its estimate, in a terminal on two
    lines where even that is too wide.
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
    def names(self) -> list[str]:
        """The first cell of each row."""
        return [row[0] for row in self.texts]

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
        yield self._figures(options.max_width if console.is_terminal else FILE_WIDTH, is_cut=console.is_terminal)
        yield from map(Text, self.remarks)

    def _figures(self, width: int, *, is_cut: bool) -> rich.table.Table:
        rows, headings = self.texts, [column.split("\n") for column in self.columns]
        if self._width(rows) > width:
            rows = [[cell.replace(" [", "\n[") for cell in row] for row in rows]
        if is_cut:
            rows = self._split(rows, width)
        fits, height = self._width(rows) <= width, max(map(len, headings), default=0)
        table = rich.table.Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), collapse_padding=fits, show_edge=False)
        for k, lines in enumerate(headings):
            heading = "\n".join([""] * (height - len(lines)) + lines)  # aligned to the last line
            min_width = None if k or fits else min(self._widths(rows)[0], NAME_WIDTH)
            table.add_column(heading, justify="right" if k else "left", no_wrap=fits or k > 0, min_width=min_width)
        for row in rows:
            table.add_row(*row)
        return table

    def _split(self, rows: list[list[str]], width: int) -> list[list[str]]:
        """Return rows with intervals split at their comma, from the widest column on, until they fit: no column may be cut."""
        widths = self._widths(rows)
        for k in sorted(range(1, len(widths)), key=lambda k: -widths[k]):
            if self._width(rows) <= width:
                break
            rows = [
                [cell.replace(", ", ",\n ") if j == k and "\n[" in cell else cell for j, cell in enumerate(row)] for row in rows
            ]
        return rows

    def _widths(self, rows: Sequence[Sequence[str]]) -> list[int]:
        """Return the width of each column, for cells of several lines."""
        return [
            max(cell_len(line) for cell in cells for line in cell.split("\n"))
            for cells in zip(self.columns, *rows, strict=True)
        ]

    def _width(self, rows: Sequence[Sequence[str]]) -> int:
        return sum(self._widths(rows)) + BETWEEN * (len(self.columns) - 1)
