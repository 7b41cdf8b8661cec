"""Tables of measured parts: from a CSV file, or a table in memory, to the deviations of a population."""

import importlib  # pandas takes longer to import than all the rest: only if it is needed
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.population import Population
from tolcontact.declaration.values import is_length
from tolcontact.tables import number, read_table
from tolcontact.texts import shown

Gaps = Literal["refused", "left out"]  # rows with empty cells
Expected = Callable[[str], str]  # the units of a contributor's column
MAX_LISTED = 3  # cells in a message
_HEADING = re.compile(r"(.*\S)\s*[\[(]\s*([^\])]*?)\s*[\])]")  # a name, and its unit in brackets
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


class Measured(NamedTuple):
    """A table of measured parts.

    title   of the file or the kind of table
    labels  of the contributors, which are the columns
    values  (row, column) in the units of the columns; NaN for an entry that is no number
    gaps    (row, column): whether an entry is empty
    lots    the lot of each row; empty without lots
    """

    title: str
    labels: list[str]
    values: np.ndarray
    gaps: np.ndarray
    lots: list[str]


def population(
    source: Any, columns: Mapping[str, str] | None, declared_at: str, *, variables: Mapping[str, str],
    units: str | None = None, sizes: Mapping[str, float] | None = None, gauge: float | Mapping[str, float] = 0.0,
    lots: str | None = None, gaps: Gaps = "refused",
) -> Population:  # fmt: skip
    """Return the Population of a CSV file, a DataFrame, an xarray Dataset of one dimension, or a mapping of columns.

    `variables` are the units of variables by name; other contributors are in mm. `sizes` are the nominal sizes [mm] by label,
    if columns of sizes hold absolute values; Assembly.population explains the others. Entries of a table in memory that are
    not numbers become NaN, and a fault of the population. Raises ValueError for an unreadable table, a cell of a file that is
    no number, a missing column, or one in other units.
    """
    stated_units = "mm" if units is None else units
    for option, value, choices in (("units", stated_units, tuple(UNITS)), ("gaps", gaps, get_args(Gaps))):
        if value not in choices:
            raise ValueError(f"population: {option} is {value!r}; expected one of: {', '.join(choices)}")

    def own(label: str) -> str:
        return variables.get(label, "mm")

    def expected(label: str) -> str:
        return own(label) if units is None or own(label) not in UNITS else units

    is_file = isinstance(source, str | Path)
    measured = _of_file(source, columns, expected, lots, gaps) if is_file else _of_memory(source, columns, expected, lots)
    title, labels = measured.title, measured.labels
    kept = np.asarray(~measured.gaps.any(axis=1) | (gaps == "refused"))
    if not kept.any() and len(kept):
        raise ValueError(f'population "{title}": each of its {len(kept)} rows has a gap; leave out the column that is empty')
    factors = np.array([UNITS.get(expected(label), 1.0) / UNITS.get(own(label), 1.0) for label in labels])
    values, row_lots = factors * measured.values[kept], np.array(measured.lots)[kept[: len(measured.lots)]]
    if sizes is not None:
        nominal = [sizes.get(label, 0.0) for label in labels]
        if not any(nominal):
            raise ValueError(
                f'population "{title}": absolute=True is for sizes ("part.feature.size") of features that are declared before, '
                "and it has no such column; subtract the nominal values"
            )
        values = values - nominal
    if isinstance(gauge, Mapping) and (unknown := [label for label in gauge if label not in labels]):
        raise ValueError(f'population "{title}": gauge has "{unknown[0]}"; its contributors are: {", ".join(labels)}')
    stated_gauge = gauge.values() if isinstance(gauge, Mapping) else [gauge]
    if wrong := [u for u in stated_gauge if not is_length(u)]:
        raise ValueError(f'population "{title}": gauge is {wrong[0]!r}; expected a standard uncertainty, or one for each label')
    uncertainties = [gauge.get(label, 0.0) for label in labels] if isinstance(gauge, Mapping) else [gauge] * len(labels)
    stated = tuple(float(f * u) for f, u in zip(factors, uncertainties, strict=True)) if any(uncertainties) else ()
    left_out = int((~kept).sum())
    return Population(tuple(labels), values, title, declared_at, stated, tuple(map(str, row_lots)), left_out)


def _of_memory(source: Any, columns: Mapping[str, str] | None, expected: Expected, lots: str | None) -> Measured:
    """Return a table in memory."""
    pd = importlib.import_module("pandas")
    try:
        table = source.to_dataframe() if hasattr(source, "to_dataframe") else pd.DataFrame(source)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"a population is a {type(source).__name__} that is no table ({error}); expected a CSV file, a DataFrame, a "
            "Dataset, or columns of equal length by name"
        ) from error
    title = f"of {len(table)} rows"
    labels, indices, lot_index = _columns(title, list(map(str, table.columns)), columns, expected, lots)
    entries = [table.iloc[:, index].astype(object) for index in indices]
    is_gap = [
        (column.isna() | column.map(lambda cell: isinstance(cell, str) and not cell.strip())).to_numpy(dtype=bool)
        for column in entries
    ]
    entries = [column.mask(column.map(type).isin([bool, np.bool_])) for column in entries]
    numbers = [pd.to_numeric(column, errors="coerce").to_numpy(dtype=float) for column in entries]
    nothing = np.empty((len(table), 0))
    cells = [] if lot_index is None else ["" if pd.isna(cell) else str(cell) for cell in table.iloc[:, lot_index]]
    values = np.column_stack(numbers) if numbers else nothing
    gaps = np.column_stack(is_gap) if is_gap else nothing.astype(bool)
    return Measured(title, labels, values, gaps, _lots(title, cells, range(1, len(table) + 1), "row"))


def _of_file(
    source: str | Path, columns: Mapping[str, str] | None, expected: Expected, lots: str | None, gaps: Gaps
) -> Measured:
    """Return the table of a CSV file."""
    title = shown(Path(source).name)
    try:
        table = read_table(Path(source), (columns or {}).values())
    except (OSError, ValueError) as error:
        raise ValueError(f'population "{title}" cannot be read as CSV: {error}') from error
    labels, indices, lot_index = _columns(title, table.heading, columns, expected, lots)
    # In a table of one column a blank line is a row without an entry.
    rows = [(line, cells or [""]) for line, cells in table.rows if cells or len(table.heading) == 1]
    faults, values = list[str](), np.full((len(rows), len(indices)), np.nan)
    is_gap = np.zeros(values.shape, dtype=bool)
    for row, (line, cells) in enumerate(rows):
        if len(cells) != len(table.heading):
            faults.append(f"line {line} has {len(cells)} entries, and the heading {len(table.heading)}; expected as many")
            continue
        for column, index in enumerate(indices):
            is_gap[row, column] = not cells[index]
            if gaps != "refused" and is_gap[row, column]:
                continue
            try:
                values[row, column] = number(cells[index], decimal_marks=table.decimal_marks)
            except ValueError as fault:
                faults.append(f'line {line}, column "{shown(table.heading[index])}" {fault}')
    if faults:
        others = f"; and {len(faults) - MAX_LISTED} more" if len(faults) > MAX_LISTED else ""
        remedy = '; gaps="left out" leaves out the rows with empty cells' if gaps == "refused" and is_gap.any() else ""
        if columns is None and len(table.heading) > 1:
            remedy += "; columns={label: column} reads these columns alone"
        raise ValueError(
            f'population "{title}": {"; ".join(faults[:MAX_LISTED])}{others}; mend the table, or leave out the rows{remedy}'
        )
    cells_of_lots = [] if lot_index is None else [cells[lot_index] for _, cells in rows]
    return Measured(title, labels, values, is_gap, _lots(title, cells_of_lots, [line for line, _ in rows], "line"))


def _lots(title: str, cells: list[str], numbers: Sequence[int], kind: str) -> list[str]:
    """Return the lots of rows. Raises ValueError, with the number of a row or line, for a row without one."""
    lots = [cell.strip() for cell in cells]
    if "" in lots:
        raise ValueError(f'population "{title}": {kind} {numbers[lots.index("")]} has no lot; name it, or leave out the row')
    return lots


def _columns(
    title: str, heading: Sequence[str], columns: Mapping[str, str] | None, expected: Expected, lots: str | None
) -> tuple[list[str], list[int], int | None]:
    """Return labels and the indices of their columns, and the index of the column of lots, if there is one.

    A heading may state its unit in brackets, which has to be the expected one.
    """
    stated = [match.groups() if (match := _HEADING.fullmatch(name)) else (name, "") for name in heading]
    labels = (
        list(columns)
        if columns is not None
        else [name for (name, _), cell in zip(stated, heading, strict=True) if lots not in (name, cell)]
    )
    names = list(map(str, labels if columns is None else columns.values()))
    indices = list[int]()
    for name in [*names, *([] if lots is None else [lots])]:
        matching = [k for k, (short, _) in enumerate(stated) if heading[k] == name or short == name]
        if not matching or not name.strip():
            listed = ", ".join(map(shown, heading))
            fault = (
                f"has no column {name!r}; its columns are: {listed}"
                if name
                else "has a column without a name; name it, or choose columns={label: column}"
            )
            raise ValueError(f'population "{title}" {fault}')
        if len(matching) > 1:
            places = " and ".join(str(k + 1) for k in matching)
            raise ValueError(f'population "{title}": columns {places} are both named "{name}"; rename one of them')
        indices.append(matching[0])
    for label, index in zip(labels, indices, strict=False):  # lots have no units
        unit, needed = stated[index][1].translate(_MICRO), expected(label)
        if unit and unit != needed and heading[index] != label:
            remedy = (
                f'give units="{unit}"' if {unit, needed} <= UNITS.keys()
                else f"expected numbers in {needed}, as {label} is, and [{needed}] or nothing in brackets; convert the column, "
                "or rename it"
            )  # fmt: skip
            raise ValueError(f'population "{title}": column "{shown(heading[index])}" is in {shown(unit)}; {remedy}')
    return labels, indices[: len(names)], None if lots is None else indices[-1]
