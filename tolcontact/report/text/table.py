"""A table of figures that fits into the width of the terminal."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table

NAME_WIDTH = 12  # longer names and labels may be wrapped
WIDTH = 80  # of files and pipes


@dataclass(frozen=True)
class FigureTable:
    """Columns as wide as their cells. If they do not fit, each interval stands below its estimate."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width if console.is_terminal else WIDTH
        widths = [max(len(row[k]) for row in [self.columns, *self.rows]) for k in range(len(self.columns))]
        rows = self.rows
        if sum(widths) + 3 * (len(widths) - 1) > width:  # three spaces between columns
            rows = [[cell.replace(" [", "\n[") for cell in row] for row in rows]
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
        for k, column in enumerate(self.columns):
            min_width = min(widths[0], NAME_WIDTH) if k == 0 else None
            table.add_column(column, justify="left" if k == 0 else "right", no_wrap=k > 0, min_width=min_width)
        for row in rows:
            table.add_row(*row)
        yield table
