"""Tables of measured parts: from a CSV file, or a table in memory, to the deviations of a population."""

import csv
import importlib  # pandas takes longer to import than all the rest: only if it is needed
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tolcontact.declaration.dependence import Population
from tolcontact.declaration.geometry import UNITS
from tolcontact.input_files import check_inputs
from tolcontact.texts import shown

SEPARATORS = ";\t,"  # of columns, in the order in which they are looked for
MAX_LISTED = 3  # cells in a message
_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_HEADING = re.compile(r"(.*\S)\s*[\[(]\s*([^\])]*?)\s*[\])]")  # a name, and its unit in brackets
_COMMENT = re.compile(r"\s*#(?:\s|$)")  # "#DIV/0!" is none
_SIGNS = str.maketrans({"\N{MINUS SIGN}": "-", "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


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
        check_inputs([Path(source)])
        (_, heading), *rows = _rows(_text(Path(source).read_bytes(), title), columns)
    except (OSError, ValueError, csv.Error) as error:
        raise ValueError(f'population "{title}" cannot be read as CSV: {error}') from error
    labels, indices = _columns(title, heading, columns, units)
    faults, values = list[str](), np.full((len(rows), len(indices)), np.nan)
    for row, (line, cells) in enumerate(rows):
        if len(cells) != len(heading) and any(cells):
            faults.append(f"line {line} has {len(cells)} entries, and the heading {len(heading)}; expected one for each column")
            continue
        for column, index in enumerate(indices):
            cell = cells[index] if index < len(cells) else ""
            if _NUMBER.fullmatch(cell):
                values[row, column] = float(cell)
            else:
                text = f'"{shown(cell[:40])}"' if cell else "empty"
                faults.append(f'line {line}, column "{shown(heading[index])}" is {text}, and no number{_advice(cell)}')
    if faults:
        others = f"; and {len(faults) - MAX_LISTED} more" if len(faults) > MAX_LISTED else ""
        raise ValueError(
            f'population "{title}": {"; ".join(faults[:MAX_LISTED])}{others}; mend the table, or leave out the rows'
        )
    return title, labels, values


def _advice(cell: str) -> str:
    return ": write a decimal point" if re.fullmatch(r"[+-]?[\d.]*,\d+", cell) else ""


def _text(content: bytes, title: str) -> str:
    """Return the text of a table in UTF-8, in UTF-16 with its mark, or in the Western encoding of spreadsheets."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    if content[:2] == b"PK":
        raise ValueError(f'it is a workbook; read it with pandas: population(pandas.read_excel("{title}"))')
    if b"\0" in content:
        raise ValueError("it holds zero bytes; save it as CSV in UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _rows(text: str, columns: Mapping[str, str] | None) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of the heading and of each row, without comments and blank lines.

    Columns are separated as a first line "sep=;" states, or by semicolons, tabs or commas. Decimal commas go with semicolons
    and tabs. In a table of one column a blank line between rows is a row without an entry.
    """
    lines = text.splitlines()
    used = [number for number, line in enumerate(lines) if line.strip() and not _COMMENT.match(line)]
    stated = re.fullmatch(r'"?sep=(.)"?', lines[used[0]].rstrip("\r\n")) if used else None
    first = used[1 if stated else 0] if len(used) > bool(stated) else None
    if first is None:
        raise ValueError("it has no rows; expected a heading with the names of columns, and a row for each part")
    names = set(columns.values()) if columns is not None else set()
    heading = lines[first]
    marks = [mark for mark in SEPARATORS if mark in heading] if heading.strip() not in names else []
    separator = stated[1] if stated else next(iter(marks), ",")
    for number in range(first, used[-1] + 1):
        line = lines[number].translate(_SIGNS) if number > first else heading
        if _COMMENT.match(line) and number not in used:
            continue
        cells = [cell.strip() for cell in next(csv.reader(io.StringIO(line), delimiter=separator, skipinitialspace=True), [])]
        if number not in used and len(next(csv.reader([heading], delimiter=separator, skipinitialspace=True))) > 1:
            continue
        is_decimal = separator != "," and number > first
        yield number + 1, [_decimal(cell) for cell in cells] if is_decimal else cells


def _decimal(cell: str) -> str:
    """Return a cell with a point for a decimal comma; a comma that may separate thousands stays."""
    return cell.replace(",", ".") if re.fullmatch(r"[+-]?(?:0?,\d+|\d+,(?:\d{1,2}|\d{4,}))(?:[eE][+-]?\d+)?", cell) else cell


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
        unit = stated[matching[0]][1].translate(_SIGNS)
        if unit in UNITS and unit != units:
            raise ValueError(f'population "{title}": column "{heading[matching[0]]}" is in {unit}; give units="{unit}"')
        indices.append(matching[0])
    return labels, indices
