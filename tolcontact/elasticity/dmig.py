"""Stiffness matrices in the text of Nastran: DMIG entries of a bulk data or punch file, in small, large or free fields."""

import re
from collections.abc import Iterator

import numpy as np

SYMMETRIC, SQUARE = "6", "1"
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?")


def dmig_matrix(text: str, max_freedoms: int) -> tuple[np.ndarray, np.ndarray]:
    """Return freedoms (row, 2) and the stiffness matrix (row, row) of the only DMIG matrix whose name begins with K.

    Names that begin with K4 are structural damping.
    Raises ValueError if there is none, or if it is complex, rectangular or damaged.
    """
    headers, columns = dict[str, list[str]](), list[list[str]]()
    for fields in _entries(text):
        if fields[1] == "0":
            headers[fields[0]] = fields
        else:
            columns.append(fields)
    names = [name for name in headers if len(headers) == 1 or (name.startswith("K") and not name.startswith("K4"))]
    if len(names) != 1:
        raise ValueError(f"it has the DMIG matrices {', '.join(headers) or 'none'}; expected one whose name begins with K")
    form, kind = headers[names[0]][2:4]
    if form not in (SYMMETRIC, SQUARE) or kind not in ("1", "2"):
        raise ValueError(f"DMIG {names[0]} is of form {form} and type {kind}; expected 6 or 1, and real numbers (1 or 2)")
    entries = dict[tuple[tuple[int, int], tuple[int, int]], float]()
    for fields in columns:
        if fields[0] == names[0]:
            column = int(fields[1]), int(fields[2])
            for k in range(4, len(fields), 4):
                if fields[k]:
                    row = int(fields[k]), int(fields[k + 1])
                    entries[row, column] = _real(fields[k + 2])
    freedoms = sorted({freedom for pair in entries for freedom in pair})
    if len(freedoms) > max_freedoms:
        raise ValueError(f"DMIG {names[0]} has {len(freedoms)} freedoms, at most {max_freedoms} are supported: condense it")
    index = {freedom: k for k, freedom in enumerate(freedoms)}
    matrix = np.zeros((len(freedoms), len(freedoms)))
    for (row, column), value in entries.items():
        matrix[index[row], index[column]] = value
        if form == SYMMETRIC:
            matrix[index[column], index[row]] = value
    return np.array(freedoms), matrix


def _entries(text: str) -> Iterator[list[str]]:
    """Yield the fields of each DMIG entry after its keyword; the lines that continue an entry are joined to it."""
    entry = list[str]()
    for line in text.split("\n"):
        content = line.split("$")[0].rstrip()
        if not content:
            continue
        is_new = content[:1].isalpha()
        fields = _fields(content)
        if is_new:
            if entry:
                yield entry
            entry = fields[1:] if fields[0].rstrip("*").upper() == "DMIG" else []
        elif entry:
            entry += fields[1:]
    if entry:
        yield entry


def _fields(line: str) -> list[str]:
    """Return the fields of a line: its keyword or mark, and 4 large or 8 small ones."""
    if "," in line:
        fields = [field.strip() for field in line.split(",")]
        return [*fields, *[""] * (9 - len(fields))][:9]
    width = 16 if "*" in line[:8] else 8
    return [line[:8].strip(), *(line[start : start + width].strip() for start in range(8, 72, width))]


def _real(field: str) -> float:
    """Return a real number of Nastran, such as 1.5, 1.5D+3 or 1.5+3."""
    match = _REAL.fullmatch(field)
    if match is None:
        raise ValueError(f'DMIG has "{field}" in place of a real number')
    return float(f"{match[1]}e{match[2] or match[3] or 0}")
