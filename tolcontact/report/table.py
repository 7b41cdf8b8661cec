"""Figures for readers, rounded to what their intervals support, and tables: for the terminal, the page and the spreadsheet."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import rich.table
import xarray as xr
from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from tolcontact import vocabulary as terms
from tolcontact.limits import GAP_ACCURACY

Cell = str | float | None  # None is an empty cell
NAME_WIDTH = 12  # longer names and labels may be wrapped
FILE_WIDTH = 80  # of tables in files and pipes
BETWEEN = 2  # characters between columns
MAX_DECIMALS = 6
MAX_DECIMALS_PERCENT = 2
NO_INTERVAL = "[-]"
PERCENT_FROM = 10_000  # ppm; smaller shares are in ppm
NOISE = 1e-5  # of the scale of a declared value: smaller differences from a shorter text are rounding


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
            if self._width(rows) > width:
                rows = [[*row[:k], row[k].replace(", ", ",\n ") if "\n[" in row[k] else row[k], *row[k + 1 :]] for row in rows]
        return rows

    def _widths(self, rows: Sequence[Sequence[str]]) -> list[int]:
        """Return the width of each column, for cells of several lines."""
        columns = zip(self.columns, *rows, strict=True)
        return [max(cell_len(line) for cell in cells for line in cell.split("\n")) for cells in columns]

    def _width(self, rows: Sequence[Sequence[str]]) -> int:
        return sum(self._widths(rows)) + BETWEEN * (len(self.columns) - 1)


@dataclass(frozen=True)
class AnalysisReport:
    """The report of an analysis for readers.

    name     prefix of the titles of its tables on a page
    count    the simulated realizations, in words
    notes    lines that explain the tables
    main     the most important column of the tables
    """

    name: str
    count: str
    notes: Sequence[str]
    tables: Sequence[Table]
    main: int = 1


def by_measure(dataset: xr.Dataset) -> list[xr.Dataset]:
    """Return the part of a dataset for each measure."""
    return [dataset.sel(measure=name) for name in dataset["measure"].values]


def lost_realizations(count: int) -> list[str]:
    """Return a remark on realizations that were not resolved; none without any."""
    return [f"{grouped(count)} realizations were not resolved; their last poses are included"] if count else []


def not_a_number(count: int, realizations: int) -> str:
    """Return in which share of the realizations a measurement is not a number: two digits, never rounded to 0 or to all."""
    share = count / realizations
    rounded = f"{100 * share:.2g} %" if share < 0.995 else "100 %" if share == 1 else "more than 99 %"
    return f"not a number in {rounded} of the realizations"


def unresolved(dataset: xr.Dataset) -> int:
    """Return the number of realizations that were not resolved."""
    return int(dataset["by_status"].values[list(terms.UNRESOLVED)].sum())


def grouped(count: int) -> str:
    """Return a count with grouped thousands: 57 344."""
    return f"{count:,}".replace(",", " ")


def plain(value: float, scale: float | None = None) -> str:
    """Return a declared value with the fewest decimals within `NOISE` of its scale; "" without a value.

    The scale is the width of the limits, or by default the size of the value.
    """
    if not math.isfinite(value):
        return ""
    allowed = NOISE * (scale or abs(value))
    decimals = next((d for d in range(MAX_DECIMALS + 1) if abs(round(value, d) - value) <= allowed), None)
    return f"{value:.6g}" if decimals is None else f"{_rounded(value, decimals):.{decimals}f}"


def nominal_and_limits(nominal: float, lower: float, upper: float) -> tuple[str, str, str]:
    """Return a nominal value and its limits, which may be infinite, with decimals that suit the width of the limits."""
    known = [abs(value) for value in (nominal, lower, upper) if math.isfinite(value)]
    scale = upper - lower if math.isfinite(upper - lower) else max(known, default=None)
    return plain(nominal, scale), plain(lower, scale), plain(upper, scale)


def settled(penetration: float) -> float:
    """Return a penetration [mm], or 0 where it is rounding."""
    return penetration if penetration > GAP_ACCURACY else 0.0


def limits_text(measure: xr.Dataset) -> str:
    """Return the limits of a measure in words, and which of them are stops; empty without limits."""
    lower, upper = float(measure["measure_lower"].values), float(measure["measure_upper"].values)
    stops = str(measure["measure_stops"].values) if "measure_stops" in measure.coords else ""
    note = f" ({stops} limit: a stop)" if stops else ""
    if math.isfinite(upper - lower):
        return f"limits {plain(lower, upper - lower)} to {plain(upper, upper - lower)}{note}"
    sides = (("at least", lower), ("at most", upper))
    return next((f"{words} {plain(limit)}{note}" for words, limit in sides if math.isfinite(limit)), "")


def number(values: object, *, sign: bool = False, max_decimals: int = MAX_DECIMALS) -> str:
    """Return `estimate [lower, upper]` with the decimals that its width supports; "-" without an estimate.

    An estimate without an interval has two significant digits, and says so.
    """
    estimate, lower, upper = (float(v) for v in values)  # type: ignore[attr-defined]
    plus = "+" if sign else ""
    if not math.isfinite(estimate):
        return "-"
    if math.isnan(lower) and math.isnan(upper):
        decimals = 1 - math.floor(math.log10(abs(estimate))) if estimate else 0
        return f"{_rounded(estimate, decimals):{plus}.{max(decimals, 0)}f} {NO_INTERVAL}"
    width = max((abs(bound - estimate) for bound in (lower, upper) if math.isfinite(bound)), default=0.0)
    if width > 0:
        exponent = math.floor(math.log10(width))
        # A half width that begins with 1 or 2 has one more digit: rounding stays below a fifth of it.
        decimals = min(max((1 if width / 10**exponent < 3 else 0) - exponent, 0), max_decimals)
    else:
        decimals = 0 if estimate == 0 else min(4, max_decimals)
    ends = (f"{_rounded(x, decimals):.{decimals}f}" if math.isfinite(x) else "-inf" if x < 0 else "inf" for x in (lower, upper))
    return f"{_rounded(estimate, decimals):{plus}.{decimals}f} [{', '.join(ends)}]"


def percent(values: object, *, sign: bool = False) -> str:
    """Return `number` of a share, in percent."""
    shares = [100 * float(v) for v in values]  # type: ignore[attr-defined]
    return number(shares, sign=sign, max_decimals=MAX_DECIMALS_PERCENT).replace(" [", " % [")


def share(values: object) -> str:
    """Return `number` of a share, in percent, or in ppm if it is small."""
    estimate, lower, upper = (1e6 * float(v) for v in values)  # type: ignore[attr-defined]
    if not math.isfinite(estimate) or estimate >= PERCENT_FROM:
        return percent(values)
    return f"{grouped(round(estimate))} ppm [{grouped(round(lower))}, {grouped(round(upper))}]"


def _rounded(value: float, decimals: int) -> float:
    """Return a rounded value; it is never -0."""
    return round(value, decimals) + 0.0
