"""Tables of measured parts: from a CSV file, or a table in memory, to the deviations of a population."""

import importlib  # pandas takes longer to import than all the rest: only if it is needed
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tolcontact.declaration.dependence import Population
from tolcontact.declaration.geometry import UNITS
from tolcontact.tables import number, read_table
from tolcontact.texts import shown

MAX_LISTED = 3  # cells in a message
_HEADING = re.compile(r"(.*\S)\s*[\[(]\s*([^\])]*?)\s*[\])]")  # a name, and its unit in brackets
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


def population(
    source: Any, columns: Mapping[str, str] | None, declared_at: str, *, units: str = "mm",
    sizes: Mapping[str, float] | None = None,
) -> Population:  # fmt: skip
    """Return the Population of a CSV file, a DataFrame, an xarray Dataset of one dimension, or a mapping of columns.

    `columns` maps the label of each contributor to the name of its column; by default the two are equal. `units` are the
    units of the numbers. `sizes` are the nominal sizes [mm] by label, if columns of sizes hold absolute values. Entries of a
    table in memory that are not numbers become NaN, and a fault of the population. Raises ValueError for an unreadable table, a
    cell of a file that is no number, or a missing column.
    """
    if units not in UNITS:
        raise ValueError(f"population: units is {units!r}; expected one of: {', '.join(UNITS)}")
    is_file = isinstance(source, str | Path)
    title, labels, values = (_of_file if is_file else _of_memory)(source, columns, units)
    if units != "mm":
        values = UNITS[units] * values
    if sizes is not None:
        nominal = [sizes.get(label, 0.0) for label in labels]
        if not any(nominal):
            raise ValueError(
                f'population "{title}": absolute=True is for sizes ("part.feature.size") of features that are declared before, '
                "and it has no such column; subtract the nominal values"
            )
        values = values - nominal
    return Population(tuple(labels), values, title, declared_at)


def _of_memory(source: Any, columns: Mapping[str, str] | None, units: str) -> tuple[str, list[str], np.ndarray]:
    """Return the title, the labels and the values (row, column) of a table in memory."""
    pd = importlib.import_module("pandas")
    try:
        table = source.to_dataframe() if hasattr(source, "to_dataframe") else pd.DataFrame(source)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"a population is a {type(source).__name__} that is no table ({error}); expected a CSV file, a DataFrame, a "
            "Dataset, or columns of equal length by name"
        ) from error
    title = f"of {len(table)} rows"
    labels, indices = _columns(title, list(map(str, table.columns)), columns, units)
    entries = [table.iloc[:, index].astype(object) for index in indices]
    entries = [column.mask(column.map(type).isin([bool, np.bool_])) for column in entries]
    numbers = [pd.to_numeric(column, errors="coerce").to_numpy(dtype=float) for column in entries]
    return title, labels, np.column_stack(numbers) if numbers else np.empty((len(table), 0))


def _of_file(source: str | Path, columns: Mapping[str, str] | None, units: str) -> tuple[str, list[str], np.ndarray]:
    """Return the title, the labels and the values (row, column) of a CSV file."""
    title = shown(Path(source).name)
    try:
        table = read_table(Path(source), (columns or {}).values())
    except (OSError, ValueError) as error:
        raise ValueError(f'population "{title}" cannot be read as CSV: {error}') from error
    labels, indices = _columns(title, table.heading, columns, units)
    # In a table of one column a blank line is a row without an entry.
    rows = [(line, cells or [""]) for line, cells in table.rows if cells or len(table.heading) == 1]
    faults, values = list[str](), np.full((len(rows), len(indices)), np.nan)
    for row, (line, cells) in enumerate(rows):
        if len(cells) != len(table.heading):
            faults.append(f"line {line} has {len(cells)} entries, and the heading {len(table.heading)}; expected as many")
            continue
        for column, index in enumerate(indices):
            try:
                values[row, column] = number(cells[index], has_decimal_commas=table.has_decimal_commas)
            except ValueError as fault:
                faults.append(f'line {line}, column "{shown(table.heading[index])}" {fault}')
    if faults:
        others = f"; and {len(faults) - MAX_LISTED} more" if len(faults) > MAX_LISTED else ""
        raise ValueError(
            f'population "{title}": {"; ".join(faults[:MAX_LISTED])}{others}; mend the table, or leave out the rows'
        )
    return title, labels, values


def _columns(title: str, heading: Sequence[str], columns: Mapping[str, str] | None, units: str) -> tuple[list[str], list[int]]:
    """Return labels and the indices of their columns. A heading may state its unit in brackets, which has to be `units`."""
    stated = [match.groups() if (match := _HEADING.fullmatch(name)) else (name, "") for name in heading]
    labels = list(columns) if columns is not None else [name for name, _ in stated]
    indices = list[int]()
    for name in map(str, labels if columns is None else columns.values()):
        matching = [k for k, (short, _) in enumerate(stated) if heading[k] == name or short == name]
        if not matching or not name.strip():
            listed = ", ".join(map(shown, heading))
            fault = f"has no column {name!r}; its columns are: {listed}" if name else "has a column without a name; name it"
            raise ValueError(f'population "{title}" {fault}')
        if len(matching) > 1:
            places = " and ".join(str(k + 1) for k in matching)
            raise ValueError(f'population "{title}": columns {places} are both named "{name}"; rename one of them')
        unit = stated[matching[0]][1].translate(_MICRO)
        if unit in UNITS and unit != units:
            raise ValueError(f'population "{title}": column "{heading[matching[0]]}" is in {unit}; give units="{unit}"')
        indices.append(matching[0])
    return labels, indices
