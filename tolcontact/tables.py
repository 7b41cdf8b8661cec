"""Tables and numbers in the text files of users: how they are encoded and separated, and what counts as a number."""

import csv
import itertools
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from tolcontact.input_files import MAX_BYTES, check_inputs
from tolcontact.texts import clipped

MAX_NUMBER = 1e15  # of a length [mm], a force, a stiffness: nothing overflows
MAX_HEADING_LINES = 20
EMPTY = "it is empty"
SEPARATORS = ";\t,"  # of columns, in the order in which they are looked for
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?(?:0?,[0-9]+|[0-9]+,(?:[0-9]{1,2}|[0-9]{4,}))(?:[eE][+-]?[0-9]+)?")  # others: thousands
_AMBIGUOUS = re.compile(r"[+-]?[1-9][0-9]{0,2}[,.][0-9]{3}")  # decimals or thousands
_COMMENT = re.compile(r"\s*#(?:\s|$)")  # "#DIV/0!" is none


class Table(NamedTuple):
    """A heading, and rows with the numbers of their lines; a blank line is a row without cells.

    decimal_marks   "." and ",", or one of them: "," if other cells have decimal commas, so that a point may separate thousands
    """

    heading: list[str]
    rows: list[tuple[int, list[str]]]
    decimal_marks: str


def number(cell: str, *, decimal_marks: str = ".") -> float:
    """Return the number of a cell. Raises ValueError for any other text, in words that follow the name of the cell."""
    text = cell.replace("\N{MINUS SIGN}", "-")
    is_ambiguous = _AMBIGUOUS.fullmatch(text) and ("," in text or decimal_marks == ",")
    if "," in decimal_marks and _DECIMAL_COMMA.fullmatch(text):
        text = text.replace(",", ".")
    if _NUMBER.fullmatch(text) and abs(value := float(text)) <= MAX_NUMBER and not is_ambiguous:
        return value
    advice = "; write a decimal point" if re.fullmatch(r"[+-]?[0-9.]*,[0-9]+", text) else ""
    if is_ambiguous:
        name, mark, other = ("comma", ",", ".") if "," in text else ("point", ".", ",")
        either = f"{text.replace(mark, other)} or {text.replace(mark, '')}"
        advice = f"; its {name} may separate decimals or thousands: write {either}"
    expected = f"a number up to {MAX_NUMBER:g}" if _NUMBER.fullmatch(text) and not is_ambiguous else "a number"
    actual = f'"{clipped(cell, 40)}"' if cell else "empty"
    raise ValueError(f"is {actual}; expected {expected}{advice}")


def text_of(path: Path, max_bytes: int = MAX_BYTES) -> str:
    """Return the text of a file in UTF-8, in UTF-16 with its mark, or in the Western encoding of spreadsheets.

    Lines end in "\\n". Raises OSError or ValueError for a file that cannot be read, is too large, or is no text.
    """
    check_inputs([path], max_bytes)
    content = path.read_bytes()
    if content[:2] == b"PK":
        raise ValueError("it is a workbook; save it as CSV, or read it with pandas.read_excel")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = content.decode("utf-16")
    elif b"\0" in content:
        raise ValueError("it holds zero bytes; save it as CSV in UTF-8")
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_table(path: Path, names: Collection[str] = (), max_bytes: int = MAX_BYTES) -> Table:
    """Return the table of a CSV file, without comments, and without blank lines at its end.

    Columns are separated as a first line "sep=;" states, or by semicolons, tabs or commas. Decimal commas go with semicolons
    and tabs. A heading that is one of `names` is that of a single column. Raises OSError or ValueError if there is no table.
    """
    lines = text_of(path, max_bytes).split("\n")
    used = (k for k, line in enumerate(lines) if line.strip() and not _COMMENT.match(line))
    heading_index = next(used, None)
    stated = re.fullmatch(r'"?sep=([^\w"])"?', lines[heading_index]) if heading_index is not None else None
    heading_index = next(used, None) if stated else heading_index
    if heading_index is None:
        raise ValueError(f"{EMPTY}; expected a heading with the names of columns, and rows below it")
    head = "\n".join(lines[heading_index : heading_index + MAX_HEADING_LINES])
    unquoted = re.sub(r'"[^"]*(?:"|$)', "", head).partition("\n")[0]
    marks = (mark for mark in SEPARATORS if mark in unquoted and lines[heading_index].strip() not in names)
    separator = stated[1] if stated else next(marks, ",")
    try:
        (_, heading), *rows = _records(lines, heading_index, separator)
    except csv.Error as error:
        raise ValueError(str(error)) from error
    while rows and not rows[-1][1]:
        rows.pop()
    has_commas = separator != "," and any(_DECIMAL_COMMA.fullmatch(cell) for _, cells in rows for cell in cells)
    return Table(heading, rows, "," if has_commas else ".")


def _records(lines: list[str], heading_index: int, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number, from 1, and the cells of each record from the line with the index `heading_index`."""
    numbered = enumerate(itertools.islice(lines, heading_index, None), start=heading_index + 1)
    for line_number, line in numbered:
        if _COMMENT.match(line):
            continue
        # The reader takes further lines only for a cell in quotation marks that has line breaks.
        record = (f"{text}\n" for text in itertools.chain([line], (text for _, text in numbered), _unclosed(line_number)))
        cells = next(csv.reader(record, delimiter=separator, skipinitialspace=True)) if line.strip() else []
        yield line_number, [cell.strip() for cell in cells]


def _unclosed(line_number: int) -> Iterator[str]:
    raise ValueError(f"line {line_number} has a quotation mark that is not closed")
    yield ""
