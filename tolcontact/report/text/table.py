"""A table of figures that fits into the width of the terminal."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

NAME_WIDTH = 12  # longer names and labels may be wrapped
FILE_WIDTH = 80  # of tables in files and pipes
BETWEEN = "  "  # separator of columns


@dataclass(frozen=True)
class FigureTable:
    """A table with columns as wide as their cells. If they do not fit, each interval is printed below its estimate."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width if console.is_terminal else FILE_WIDTH
        rows = [[cell.split("\n") for cell in row] for row in self.rows]
        if self._full_width(rows) > width:
            rows = [[cell.replace(" [", "\n[").split("\n") for cell in row] for row in self.rows]
        if self._full_width(rows) <= width:
            yield from self._lines(rows)
            return
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
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
        height = max(map(len, headings))
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
