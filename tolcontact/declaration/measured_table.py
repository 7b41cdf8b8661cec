"""Populations: measured parts of a table, whose rows are drawn as a whole, perhaps by lots, without the scatter of a gauge."""

import importlib  # pandas takes longer to import than all the rest: only if it is needed
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.values import is_length
from tolcontact.tables import MAX_NUMBER, number, read_table
from tolcontact.texts import shown

Gaps = Literal["refused", "left out"]  # rows with empty cells
Measured = tuple[str, list[str], np.ndarray, np.ndarray, list[str]]  # title, labels, values (row, column), gaps, lots of rows
MAX_LISTED = 3  # columns in words, cells in a message
ROUNDING = 1e-12  # of a variance: a smaller negative one is zero
_HEADING = re.compile(r"(.*\S)\s*[\[(]\s*([^\])]*?)\s*[\])]")  # a name, and its unit in brackets
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


@dataclass(frozen=True, eq=False, repr=False)
class Population(Declaration):
    """Measured parts: whole rows of deviations are drawn with replacement, which preserves their correlation.

    columns   labels of the contributors
    values    (row, column), as measured, in the units of the contributors
    source    the file or the kind of table
    gauge     (column,) standard uncertainty of measurement, in the same units: its variance is taken off the spread
    lots      (row,) the lot of each row: a realization draws a lot, then a part of it; without lots, any row
    left_out  number of rows with gaps that were left out
    """

    columns: tuple[str, ...]
    values: np.ndarray
    source: str = "given"
    declared_at: str = ""
    gauge: tuple[float, ...] = ()
    lots: tuple[str, ...] = ()
    left_out: int = 0
    noun: ClassVar[str] = "population"

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.source

    def faults(self) -> Iterator[str]:
        if not self.columns or len(set(self.columns)) < len(self.columns):
            yield 'it names no contributors, or one twice; give columns={"part.locator": "column of the table", ...}'
        elif self.values.ndim != 2 or self.values.shape[1] != len(self.columns):
            yield f"its values have the shape {self.values.shape}; expected a row for each part, a column for each contributor"
        elif len(self.values) < 2:
            yield f"it has {len(self.values)} row(s); a population needs two or more"
        elif fault := self._gap():
            yield fault
        elif self.lots and (len(self.lots) != len(self.values) or len(set(self.lots)) < 2):
            yield (
                f"it has {len(set(self.lots))} lot(s) for {len(self.values)} rows; expected two or more, and one for each row; "
                "leave lots out if all parts are of one"
            )
        elif self.gauge and not (len(self.gauge) == len(self.columns) and all(is_length(u) and u >= 0 for u in self.gauge)):
            yield f"gauge is {self.gauge!r}; expected a standard uncertainty of 0 or above for each column"
        else:
            yield from self._gauge_faults()

    def _gap(self) -> str:
        """Return a sentence on the first value that is no number; empty if there is none."""
        rows, columns = np.nonzero(~(np.abs(self.values) <= MAX_NUMBER))
        if not len(rows):
            return ""
        first = np.lexsort([rows, columns])[0]
        where = f"row {rows[first] + 1} of the column for {self.columns[columns[first]]}"
        remedy = 'mend it, or leave out the row; gaps="left out" leaves out rows with empty cells'
        return f"{where} is no number up to {MAX_NUMBER:g}; {remedy}"

    def _gauge_faults(self) -> Iterator[str]:
        """Yield a sentence if the scatter of the gauge is larger than the spread of the measured values."""
        if not any(self.gauge):
            return
        for label, u, s in zip(self.columns, self.gauge, self.within, strict=True):
            if u > s:
                yield (
                    f"gauge is {u:g}, and the measured values of {label} scatter by {s:.3g} (standard deviation"
                    f"{' within lots' if self.lots else ''}): no spread of the parts is left; check its units, measure with "
                    "a finer gauge, or leave gauge out"
                )
                return
        if self._true_variances.min() < -ROUNDING:
            yield (
                "gauge is larger than the spread of some combination of the columns, which correlate more than its scatter "
                "allows, as in tables with few rows; check its units, measure more parts, or leave gauge out"
            )

    @cached_property
    def members(self) -> list[np.ndarray]:
        """The rows (part,) of each lot; all rows without lots."""
        if not self.lots:
            return [np.arange(len(self.values))]
        _, numbers, counts = np.unique(self.lots, return_inverse=True, return_counts=True)
        return np.split(np.argsort(numbers, kind="stable"), np.cumsum(counts)[:-1])

    @property
    def centres(self) -> np.ndarray:
        """The mean (row, column) of the lot of each row."""
        centres = np.empty_like(self.values)
        for rows in self.members:
            centres[rows] = self.values[rows].mean(axis=0)
        return centres

    @property
    def within(self) -> np.ndarray:
        """The standard deviations (column,) of the measured values within their lots, all lots together."""
        freedom = max(len(self.values) - len(self.members), 1)
        return np.asarray(np.sqrt(((self.values - self.centres) ** 2).sum(axis=0) / freedom))

    @property
    def between(self) -> np.ndarray:
        """The standard deviations (column,) between lots: of their means, less what the spread within lots explains."""
        means = np.array([self.values[rows].mean(axis=0) for rows in self.members])
        explained = self.within**2 * np.mean([1 / len(rows) for rows in self.members])
        return np.asarray(np.sqrt(np.maximum(means.var(axis=0, ddof=1) - explained, 0.0)))

    @cached_property
    def drawn(self) -> np.ndarray:
        """The values (row, column) that realizations draw: measured ones, with the variance of the gauge taken off.

        Each row moves towards the mean of its lot. Means, and columns without uncertainty, stay; covariances between columns
        stay, too, since the errors of a gauge are independent. Rows move as little as this allows (optimal transport).
        """
        if not any(self.gauge):
            return self.values
        residuals, fitted, half, inverse, true = self._split
        root_of_true = _root(half @ true @ half)
        drawn = self.values.copy()
        columns = np.flatnonzero(self.gauge)
        drawn[:, columns] = self.centres[:, columns] + fitted + residuals @ (inverse @ root_of_true @ inverse)
        return drawn

    @property
    def _true_variances(self) -> np.ndarray:
        """The eigenvalues (k,) of the covariance without the gauge, as shares of measured variances; perhaps below 0."""
        scale = self.within[np.array(self.gauge) > 0]
        return np.linalg.eigvalsh(self._split[-1] / np.outer(scale, scale))

    @property
    def _split(self) -> tuple[np.ndarray, ...]:
        """The columns with uncertainty, split by those without it.

        Their residuals (row, k), and the values (row, k) that follow from the others; the root (k, k) of the covariance of the
        residuals, its inverse, and the covariance without the gauge.
        """
        deviations, is_uncertain = self.values - self.centres, np.array(self.gauge) > 0
        uncertain, certain = deviations[:, is_uncertain], deviations[:, ~is_uncertain]
        fitted = certain @ np.linalg.lstsq(certain, uncertain, rcond=None)[0]
        residuals = uncertain - fitted
        covariance = residuals.T @ residuals / max(len(self.values) - len(self.members), 1)
        true = covariance - np.diag(np.array(self.gauge)[is_uncertain] ** 2)
        half = _root(covariance)
        return residuals, fitted, half, np.linalg.pinv(half, hermitian=True), true

    @cached_property
    def row_ends(self) -> np.ndarray:
        """The upper ends (row,) of the numbers between 0 and 1 that draw each row: lots have equal shares."""
        shares = np.empty(len(self.values))
        for rows in self.members:
            shares[rows] = 1 / len(rows) / len(self.members)
        return np.cumsum(shares)

    def rows(self, u: np.ndarray) -> np.ndarray:
        """Return the rows (n,) for numbers u (n,) between 0 and 1."""
        if not self.lots:
            return np.asarray((u * len(self.values)).astype(int))
        return np.minimum(np.searchsorted(self.row_ends, u, side="right"), len(self.values) - 1)

    @property
    def in_words(self) -> str:
        """What was left out, whether the scatter of the gauge is taken off, and the spread between and within lots."""
        notes, listed = [], self.columns[:MAX_LISTED]
        if self.left_out:
            notes.append(f"{self.left_out} of {len(self.values) + self.left_out} rows had gaps and are left out")
        if any(self.gauge):
            spreads = [
                f"{label} {u:g}, so {np.sqrt(max(s**2 - u**2, 0.0)):.3g} after {s:.3g}"
                for label, u, s in zip(listed, self.gauge, self.within, strict=False)
                if u
            ]
            notes.append(f"the scatter of the gauge is taken off: {', '.join(spreads)}")
        else:
            notes.append("the scatter of the gauge is in their spread")
        if self.lots:
            spreads = [f"{label} {b:.3g} and {w:.3g}" for label, b, w in zip(listed, self.between, self.within, strict=False)]
            notes.append(f"{len(self.members)} lots, drawn with equal odds; spread between and within: {', '.join(spreads)}")
        return f"measured parts, population {self.source}: {'; '.join(notes)}"

    def __str__(self) -> str:
        lots = f" in {len(self.members)} lots" if self.lots else ""
        gauge = ", gauge taken off" if any(self.gauge) else ""
        return f"population {self.source}: {len(self.values)} rows{lots} of {', '.join(self.columns)}{gauge}"


def _root(matrix: np.ndarray) -> np.ndarray:
    """Return the symmetric root of a positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def population(
    source: Any, columns: Mapping[str, str] | None, declared_at: str, *, units: str = "mm",
    sizes: Mapping[str, float] | None = None, gauge: float | Mapping[str, float] = 0.0, lots: str | None = None,
    gaps: Gaps = "refused",
) -> Population:  # fmt: skip
    """Return the Population of a CSV file, a DataFrame, an xarray Dataset of one dimension, or a mapping of columns.

    `sizes` are the nominal sizes [mm] by label, if columns of sizes hold absolute values; Assembly.population explains the
    others. Entries of a table in memory that are not numbers become NaN, and a fault of the population. Raises ValueError for
    an unreadable table, a cell of a file that is no number, or a missing column.
    """
    for option, value, choices in (("units", units, tuple(UNITS)), ("gaps", gaps, get_args(Gaps))):
        if value not in choices:
            raise ValueError(f"population: {option} is {value!r}; expected one of: {', '.join(choices)}")
    is_file = isinstance(source, str | Path)
    measured = _of_file(source, columns, units, lots, gaps) if is_file else _of_memory(source, columns, units, lots)
    title, labels, values, is_gap, stated_lots = measured
    kept = np.asarray(~is_gap.any(axis=1) | (gaps == "refused"))
    if not kept.any() and len(kept):
        raise ValueError(f'population "{title}": each of its {len(kept)} rows has a gap; leave out the column that is empty')
    values, row_lots = UNITS[units] * values[kept], np.array(stated_lots)[kept[: len(stated_lots)]]
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
    stated = tuple(float(UNITS[units] * u) for u in uncertainties) if any(uncertainties) else ()
    left_out = int((~kept).sum())
    return Population(tuple(labels), values, title, declared_at, stated, tuple(map(str, row_lots)), left_out)


def _of_memory(source: Any, columns: Mapping[str, str] | None, units: str, lots: str | None) -> Measured:
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
    labels, indices, lot_index = _columns(title, list(map(str, table.columns)), columns, units, lots)
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
    return title, labels, values, gaps, _lots(title, cells, range(1, len(table) + 1), "row")


def _of_file(source: str | Path, columns: Mapping[str, str] | None, units: str, lots: str | None, gaps: Gaps) -> Measured:
    """Return the table of a CSV file."""
    title = shown(Path(source).name)
    try:
        table = read_table(Path(source), (columns or {}).values())
    except (OSError, ValueError) as error:
        raise ValueError(f'population "{title}" cannot be read as CSV: {error}') from error
    labels, indices, lot_index = _columns(title, table.heading, columns, units, lots)
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
                values[row, column] = number(cells[index], has_decimal_commas=table.has_decimal_commas)
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
    return title, labels, values, is_gap, _lots(title, cells_of_lots, [line for line, _ in rows], "line")


def _lots(title: str, cells: list[str], numbers: Sequence[int], kind: str) -> list[str]:
    """Return the lots of rows. Raises ValueError, with the number of a row or line, for a row without one."""
    lots = [cell.strip() for cell in cells]
    if "" in lots:
        raise ValueError(f'population "{title}": {kind} {numbers[lots.index("")]} has no lot; name it, or leave out the row')
    return lots


def _columns(
    title: str, heading: Sequence[str], columns: Mapping[str, str] | None, units: str, lots: str | None
) -> tuple[list[str], list[int], int | None]:
    """Return labels and the indices of their columns, and the index of the column of lots, if there is one.

    A heading may state its unit in brackets, which has to be `units`.
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
            fault = f"has no column {name!r}; its columns are: {listed}" if name else "has a column without a name; name it"
            raise ValueError(f'population "{title}" {fault}')
        if len(matching) > 1:
            places = " and ".join(str(k + 1) for k in matching)
            raise ValueError(f'population "{title}": columns {places} are both named "{name}"; rename one of them')
        unit = stated[matching[0]][1].translate(_MICRO)
        if unit in UNITS and unit != units:
            raise ValueError(f'population "{title}": column "{heading[matching[0]]}" is in {unit}; give units="{unit}"')
        indices.append(matching[0])
    return labels, indices[: len(names)], None if lots is None else indices[-1]
