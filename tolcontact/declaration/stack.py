"""Stacks in one dimension: links with limits, and the gaps that they close, by a script or from a table."""

import importlib  # pandas takes longer to import than all the rest: only if it is needed
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import scipy

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.dependence import Variable
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measurement import Chain
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import is_length
from tolcontact.declaration.written_tolerance import TextFault, written
from tolcontact.errors import Faults, ModelError, nearest_name
from tolcontact.input_files import check_inputs
from tolcontact.tables import EMPTY, Table, number, read_table
from tolcontact.texts import shown

GAP = "gap "  # heading of a column with the sensitivities of a gap
MEASURED = "mean", "sd", "parts"  # of a dimension, and the number of parts that they are from
NUMBERS = "nominal", "upper", "lower", "sensitivity", "cp", "cpk", *MEASURED  # columns of numbers
COLUMNS = (
    "name", "nominal", "tolerance", "upper", "lower", "sensitivity", "distribution", "cp", "cpk", *MEASURED, "description",
)  # fmt: skip
MAX_BYTES = 1 << 24  # of a table


class Stack(Assembly):
    """A stack in one dimension: an assembly without parts, of links and of the gaps that these close.

        play = tc.Stack("play")
        play.link("housing", 100.4, "±0.15")
        play.link("spacer", 40, "+0/-0.1", sensitivity=-1)
        play.gap("gap", limits=(0, None))

    `tc.Stack("play", units="in")` has the `name` "play". All numbers are in its `units`, by default mm, which are labels:
    nothing is converted. The `title_block` heads its reports.
    """

    def __init__(self, name: str, *, units: str = "mm", title_block: TitleBlock | None = None) -> None:
        super().__init__(name, title_block=title_block, units=units)
        self._sensitivities: dict[str, float] = {}

    def link(self, name: str, nominal: float, tolerance: Any, *, sensitivity: float = 1.0) -> Variable:
        """Declare a link, a dimension of a drawing.

        name         of the link
        nominal      its nominal value, as drawn; 0 for a float
        tolerance    full width of its zone, limit deviations ("±0.1", "+0.1/-0.05", a class such as "H7"), or a tc.Tolerance
        sensitivity  change of a gap for a unit of the link, by default 1: -1 if the gap shrinks as the link grows

        `stack.link("spacer", 40, "+0/-0.1", sensitivity=-1)`
        """
        if isinstance(tolerance, str) and is_length(nominal):
            try:
                tolerance = written(tolerance, units=self.units, nominal=nominal)
            except TextFault as fault:
                raise ValueError(f'link "{name}": tolerance is {tolerance!r}; {fault}') from fault
        variable = self.variable(name, tolerance, units=self.units, nominal=nominal)
        self._sensitivities[name] = sensitivity
        return variable

    def gap(
        self, name: str, sensitivities: Mapping[str, float] | None = None, *, tolerance: Any = None,
        limits: Sequence[float | None] | None = None,
    ) -> Measure:  # fmt: skip
        """Declare a gap: the sum of its links times their sensitivities.

        name           of the gap
        sensitivities  of its links by their names; by default all links declared before, with their own
        tolerance      width of its limits about the nominal value, or "+0.2/-0.1"
        limits         (lower, upper) values in place of a tolerance; None for an open side

        `stack.gap("left", {"housing": 1, "shaft": -0.5}, limits=(0.1, None))`
        """
        chosen = self._sensitivities if sensitivities is None else sensitivities
        return self.measure(name, Chain(dict(chosen), units=self.units), tolerance=tolerance, limits=limits)

    def read(self, path: str | Path) -> tuple[Variable, ...]:
        """Declare the links of a table, the CSV file or .xlsx workbook at a `path`, as in `stack.read("links.csv")`.

        Its columns are name, nominal, and tolerance, or upper and lower; others may be left out: sensitivity, distribution, cp,
        cpk, description. A row with mean and sd, of the measured dimension, needs no tolerance, and may state the number of
        parts that they are from. A column "gap NAME" has the sensitivities of a gap, which is declared without limits. Raises
        ModelError with all faults of the table.
        """
        heading, rows, decimal_marks = _table(Path(path), self.name)
        faults, title = Faults(), shown(Path(path).name)
        faults.extend(f'table "{title}": {fault}' for fault in _heading_faults(heading))
        faults.refuse(self.name)
        gaps: dict[str, dict[str, float]] = {name.removeprefix(GAP): {} for name in heading if name.startswith(GAP)}
        links = []
        for line, cells in rows:
            if not any(cells):
                continue
            row = dict.fromkeys(heading, "") | dict(zip(heading, cells, strict=False))
            try:
                if len(cells) > len(heading):
                    raise ValueError(f"it has {len(cells)} cells for {len(heading)} columns; write decimals with a point")
                numbers = _numbers(row, decimal_marks)
                links.append(self.link(row["name"], *_zone(row, numbers), sensitivity=numbers.get("sensitivity", 1.0)))
                for name, factors in gaps.items():
                    if (factor := numbers.get(GAP + name)) is not None:
                        factors[row["name"]] = factor
            except ValueError as fault:
                faults.append(f'table "{title}", row {line}: {fault}')
        if not (links or faults):
            faults.append(f'table "{title}": it has no rows below its heading; expected a row for each link')
        faults.refuse(self.name)
        for name, factors in gaps.items():
            self.gap(name, factors)
        return tuple(links)


def _table(path: Path, stack: str) -> Table:
    """Return a table of links, its heading in lower case. Raises ModelError if it cannot be read."""
    try:
        table = _workbook(path) if path.suffix.lower() == ".xlsx" else read_table(path, max_bytes=MAX_BYTES)
        heading = [cell if cell.casefold().startswith(GAP) else cell.casefold() for cell in table.heading]
        return table._replace(heading=heading)
    except (OSError, ValueError, ImportError) as error:
        remedy = '; install it: pip install "tolcontact[xlsx]"' if isinstance(error, ImportError) else ""
        fault = str(error).splitlines()[0] + (f"; its columns are some of: {', '.join(COLUMNS)}" if EMPTY in str(error) else "")
        raise ModelError(stack, [f'table "{shown(path.name)}" cannot be read: {fault}{remedy}']) from error


def _workbook(path: Path) -> Table:
    """Return the table in the first sheet of a workbook. Raises OSError, ValueError or ImportError."""
    check_inputs([path], MAX_BYTES)
    pandas = importlib.import_module("pandas")
    sheet = pandas.read_excel(path, header=None, dtype=object)
    rows = [["" if pandas.isna(cell) else str(cell).strip() for cell in row] for row in sheet.itertuples(index=False)]
    return Table(rows[0] if rows else [], list(enumerate(rows[1:], start=2)), decimal_marks=".,")


def _heading_faults(heading: Sequence[str]) -> Iterator[str]:
    unknown = [name for name in heading if name not in COLUMNS and not name.startswith(GAP)]
    for name in unknown:
        known = f'{", ".join(COLUMNS)}, or "gap NAME"'
        yield f'it has a column "{shown(name)}"{nearest_name(name, COLUMNS)}; expected some of: {known}'
    if unknown:  # other columns may only seem to be missing
        return
    for name in dict.fromkeys(name for name in heading if heading.count(name) > 1):
        yield f'it has {heading.count(name)} columns "{shown(name)}"; expected one'
    for name in ("name", "nominal"):
        if name not in heading:
            yield f'it has no column "{name}"; its columns are: {", ".join(map(shown, heading))}'
    limits = [name for name in ("tolerance", "upper", "lower") if name in heading]
    if limits not in (["tolerance"], ["upper", "lower"]) and (limits or not {"mean", "sd"} <= set(heading)):
        yield 'expected either a column "tolerance", or two, "upper" and "lower"; or "mean" and "sd" of measured links'


def _numbers(row: Mapping[str, str], decimal_marks: str) -> dict[str, float]:
    """Return the numbers of a row by their columns. Raises ValueError, which names the column, for a cell that is no number."""
    numbers = {}
    for column, text in row.items():
        if text and (column in NUMBERS or column.startswith(GAP)):
            try:
                numbers[column] = number(text, decimal_marks=decimal_marks)
            except ValueError as fault:
                raise ValueError(f"{column} {fault}") from None
    return numbers


def _measured(row: Mapping[str, str], numbers: Mapping[str, float]) -> Tolerance:
    """Return the normal distribution of a row with the mean and the standard deviation of measured parts."""
    if stated := [name for name in ("tolerance", "upper", "lower", "distribution", "cp", "cpk") if row.get(name)]:
        raise ValueError(f"it has mean and sd, and {stated[0]}, which they replace; leave one of the two out")
    if not numbers["sd"] > 0:
        raise ValueError(f"sd is {numbers['sd']:g}; expected a standard deviation above 0")
    parts = numbers.get("parts")
    whole = int(parts) if parts is not None and parts.is_integer() else parts
    measured = scipy.stats.norm(numbers["mean"] - numbers["nominal"], numbers["sd"])
    tolerance = Tolerance(distribution=measured, parts=whole)  # type: ignore[arg-type]
    if reason := next(tolerance.faults(), ""):
        raise ValueError(reason)
    return tolerance


def _zone(row: Mapping[str, str], numbers: Mapping[str, float]) -> tuple[float, Any]:
    """Return the nominal value and the tolerance of a row. Raises ValueError for a cell that is empty or states neither."""
    is_measured = any(name in numbers for name in MEASURED)
    limits: tuple[str, ...] = ("tolerance",) if "tolerance" in row else ("upper", "lower")
    if is_measured or not {"tolerance", "upper"} & set(row):
        limits = "mean", "sd"
    if empty := [name for name in ("name", "nominal", *limits) if not row.get(name)]:
        raise ValueError(f"{' and '.join(empty)} {'is' if len(empty) == 1 else 'are'} empty")
    nominal = numbers["nominal"]
    if is_measured:
        return nominal, _measured(row, numbers)
    if "tolerance" in row:
        try:
            zone = written(row["tolerance"], nominal=nominal)
        except TextFault as fault:
            raise ValueError(f'tolerance is "{shown(row["tolerance"])}"; {fault}') from fault
    else:
        zone = written((numbers["lower"], numbers["upper"]))
    options: dict[str, Any] = {name: numbers[name] for name in ("cp", "cpk") if name in numbers}
    tolerance = Tolerance(zone, row.get("distribution") or "normal", **options)
    if reason := next(tolerance.faults(), ""):
        raise ValueError(reason)
    return nominal, tolerance
