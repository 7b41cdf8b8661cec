"""Texts of models and files on their way out: each format has one rule, so that no reader takes a text for anything else.

terminal, CSV, spreadsheet   shown, shown_name, csv_cell, sheet_cell
Python source                literal
JSON                         the escapes of its library
page                         the escapes of its templates
archive                      names with control characters are refused when they are declared
"""

import json
import re
from typing import Any

# Control characters but tab and line feed, separators of lines and paragraphs, overrides of the writing direction, halves of
# surrogate pairs (bytes of a file name that are not text): they steer a terminal, or cannot be written to it.
CONTROL_CHARACTERS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_NOT_SHOWN = re.compile(f"{CONTROL_CHARACTERS.pattern}|[\ufffe\uffff]")  # XML, and with it a spreadsheet, lacks the last two
_FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")  # a cell of a CSV file that begins with one may be run as a formula


def shown(text: str) -> str:
    """Return a text as it may be printed: characters that would steer a terminal become escapes."""
    return _NOT_SHOWN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def shown_name(name: str) -> str:
    """Return a name as it may be printed on one line: tabs and line breaks become escapes, too."""
    return shown(name).replace("\t", "\\t").replace("\n", "\\n")


def clipped(text: str, max_length: int = 400) -> str:
    """Return the text of a file as a message may quote it: on one line, printable and short."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())
    return line if len(line) <= max_length else f"{line[:max_length]}..."


def sheet_cell(value: Any) -> Any:
    """Return a value as a cell of a spreadsheet; numbers are unchanged."""
    return shown(value) if isinstance(value, str) else value


def csv_cell(value: Any) -> Any:
    """Return a value as a cell of a CSV file; an apostrophe precedes a text that a spreadsheet would take as a formula."""
    value = sheet_cell(value)
    return f"'{value}" if isinstance(value, str) and value.lstrip(" ").startswith(_FORMULA_SIGNS) else value


def literal(value: Any) -> str:
    """Return a text, a number, a truth value or None as Python reads it, texts in double quotes.

    Python reads what JSON escapes. Surrogates, which no encoding can write, are escaped as well.
    """
    if value is None or isinstance(value, bool):
        return str(value)
    written = json.dumps(value, ensure_ascii=False)
    return re.sub("[\ud800-\udfff\u2028\u2029\x7f-\x9f]", lambda match: f"\\u{ord(match[0]):04x}", written)


def duration(seconds: float) -> str:
    """Return a time in words."""
    for size, unit in ((86_400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
