"""Texts of models and files on their way into other formats, whose readers must not take them for anything else."""

import json
import re
from typing import Any

# Characters that XML, and with it a spreadsheet, cannot hold.
NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")  # a cell of a CSV file that begins with one may be run as a formula


def sheet_cell(value: Any) -> Any:
    """Return a value as a spreadsheet can hold it: characters that XML lacks become escapes; numbers stay."""
    return NOT_IN_XML.sub(lambda match: match[0].encode("unicode_escape").decode(), value) if isinstance(value, str) else value


def csv_cell(value: Any) -> Any:
    """Return a value as a cell of a CSV file; an apostrophe stands before a text that a spreadsheet would take as a formula."""
    value = sheet_cell(value)
    return f"'{value}" if isinstance(value, str) and value.lstrip(" ").startswith(FORMULA_SIGNS) else value


def literal(value: Any) -> str:
    """Return a text, a number or None as Python reads it, texts in double quotes.

    Python reads what JSON escapes. Surrogates, which no encoding can write, are escaped as well.
    """
    if value is None:
        return "None"
    written = json.dumps(value, ensure_ascii=False)
    return re.sub("[\ud800-\udfff\u2028\u2029\x7f-\x9f]", lambda match: f"\\u{ord(match[0]):04x}", written)
