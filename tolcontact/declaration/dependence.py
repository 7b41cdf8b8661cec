"""Dependence between deviations: shared causes, correlations, and measured populations.

Contributors are named by labels: "part.locator", "part.feature.freedom" ("cover.H1.size"), or the name of a variable.
"""

import importlib  # pandas takes longer to import than all the rest: only if it is needed
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import is_length, is_line
from tolcontact.declaration.written_tolerance import DIGITS, Deviations
from tolcontact.input_files import check_inputs
from tolcontact.texts import shown

SEPARATORS = {";": "semicolons", "\t": "tabs"}
MIN_EIGENVALUE = 1e-12  # of a correlation matrix; of a smaller absolute value it is zero


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Variable(Declaration):
    """A cause that drives several contributors: `drives[label]` times its deviation is added to the draw of each.

    The variable is in `units`; a factor converts them to the units of its contributor. A variable with a `nominal` value is a
    dimension, the link of a chain, and may drive nothing.
    """

    tolerance: Tolerance
    drives: Mapping[str, float] = field(default_factory=dict)
    name: str
    units: str = "mm"
    declared_at: str = ""
    nominal: float | None = None
    noun: ClassVar[str] = "variable"

    def faults(self) -> Iterator[str]:
        yield from self.tolerance.faults()
        if self.nominal is not None and not is_length(self.nominal):
            yield f"nominal is {self.nominal!r}; expected a number in {self.units}"
        if not self.drives and self.nominal is None:
            yield 'it drives nothing; give drives={"part.locator": factor, ...}'
        for label, factor in self.drives.items():
            if not (isinstance(label, str) and is_length(factor)):
                yield f"drives has {label!r}: {factor!r}; expected the label of a contributor, and a number"
        if not (self.units and is_line(self.units)):
            yield f'units is {self.units!r}; expected a text such as "mm" or "K"'

    def __str__(self) -> str:
        drives = ", ".join(f"{label} by {factor:g}" for label, factor in self.drives.items())
        driven = f"; drives {drives}" if drives else ""
        if self.limits is None:
            return f"variable {self.name} [{self.units}]: {self.tolerance}{driven}"
        centred = f", centred {self.centred}" if self.limits.middle else ""
        return f"dimension {self.name} [{self.units}]: {self.drawn}{centred}{driven}"

    @property
    def limits(self) -> Deviations | None:
        """The limit deviations from the nominal value, as drawn; None without a nominal value or a range."""
        if self.nominal is None or not is_length(self.tolerance.range):
            return None
        half, middle = float(self.tolerance.range or 0) / 2, self.tolerance.shift
        return Deviations(round(middle - half, DIGITS), round(middle + half, DIGITS))

    @property
    def drawn(self) -> str:
        """The dimension with its limits as drawn: "0.375 0 -0.031", "40 ±0.05"."""
        is_equal = self.limits is not None and not self.limits.middle
        return self.centred if is_equal else f"{self.nominal or 0:.12g} {self.limits or self.tolerance}"

    @property
    def centred(self) -> str:
        """The dimension with equal limits: "0.3595 ±0.0155"; empty without limits."""
        if self.limits is None or self.nominal is None:
            return ""
        return f"{self.nominal + self.limits.middle:.12g} ±{self.limits.width / 2:.12g}"


@dataclass(frozen=True, eq=False, repr=False)
class Correlation(Declaration):
    """A correlation of contributors: a Gaussian copula with this matrix, which leaves their distributions unchanged."""

    labels: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    declared_at: str = ""
    noun: ClassVar[str] = "correlation"

    @property
    def name(self) -> str:  # type: ignore[override]
        return ", ".join(map(str, self.labels))

    def faults(self) -> Iterator[str]:
        if len(set(self.labels)) < len(self.labels) or len(self.labels) < 2:
            yield f"its labels are {', '.join(map(str, self.labels)) or 'none'}; expected two or more different contributors"
        try:
            matrix = np.array(self.matrix, dtype=float)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        count = len(self.labels)
        if matrix.shape != (count, count) or not np.isfinite(matrix).all():
            yield f"its matrix is not {count} x {count} finite numbers, one row for each contributor"
        elif not (np.allclose(matrix, matrix.T, atol=1e-12) and np.allclose(np.diag(matrix), 1, atol=1e-12)):
            yield "its matrix is not symmetric with ones on the diagonal; expected correlation coefficients, not covariances"
        elif (smallest := float(np.linalg.eigvalsh(matrix).min())) < -MIN_EIGENVALUE:
            yield (
                f"its matrix is not positive definite (smallest eigenvalue {smallest:.3g}): no variables have "
                "these correlations; check the signs, or make the coefficients smaller"
            )
        elif smallest < MIN_EIGENVALUE:
            yield (
                "its matrix is singular: a contributor in it follows from the others, as with a coefficient of 1 or -1; "
                "expected contributors with a part of their own. Give those that follow a tolerance of 0, and declare their "
                "common cause by variable(name, tolerance, drives={label: factor, ...}), with factors of opposite signs for -1"
            )

    def __str__(self) -> str:
        return f"correlation of {self.name}"


@dataclass(frozen=True, eq=False, repr=False)
class Population(Declaration):
    """Measured parts: whole rows of deviations are drawn with replacement, which preserves their correlation.

    columns   labels of the contributors
    values    (row, column), in the units of the contributors
    source    the file or the kind of table
    """

    columns: tuple[str, ...]
    values: np.ndarray
    source: str = "given"
    declared_at: str = ""
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
        for column, label in enumerate(self.columns[: self.values.shape[1]] if self.values.ndim == 2 else ()):
            gaps = [row for row, value in enumerate(self.values[:, column]) if not np.isfinite(value)]
            if gaps:
                yield f"row {gaps[0] + 1} of the column for {label} is no finite number; mend the table, or leave out the row"

    def __str__(self) -> str:
        return f"population {self.source}: {len(self.values)} rows of {', '.join(self.columns)}"


def population(source: Any, columns: Mapping[str, str] | None, declared_at: str) -> Population:
    """Return the Population of a CSV file, a DataFrame, an xarray Dataset of one dimension, or a mapping of columns.

    `columns` maps the label of each contributor to the name of its column; by default the two are equal. Entries that are not
    numbers, among them True and False, become NaN, and a fault of the population. Raises ValueError for an unreadable table or
    a missing column.
    """
    pd = importlib.import_module("pandas")
    if isinstance(source, str | Path):
        title = shown(Path(source).name)
        table = _table_of(source, title, set(columns.values()) if columns is not None else set())
    else:
        try:
            table = source.to_dataframe() if hasattr(source, "to_dataframe") else pd.DataFrame(source)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"a population is a {type(source).__name__} that is no table ({error}); expected a CSV file, a DataFrame, a "
                "Dataset, or columns of equal length by name"
            ) from error
        title = f"of {len(table)} rows"
    names = dict(columns) if columns is not None else {str(name): name for name in table.columns}
    missing = [name for name in names.values() if name not in table.columns]
    if missing:
        raise ValueError(
            f'population "{title}" has no column {missing[0]!r}; its columns are: {", ".join(map(str, table.columns))}'
        )
    entries = [table[name].astype(object).mask(table[name].map(type).isin([bool, np.bool_])) for name in names.values()]
    numbers = [pd.to_numeric(column, errors="coerce").to_numpy(dtype=float) for column in entries]
    values = np.column_stack(numbers) if numbers else np.empty((len(table), 0))
    return Population(tuple(names), values, title, declared_at)


def _table_of(source: str | Path, title: str, names: Set[str]) -> Any:
    """Return the DataFrame of a CSV file. Raises ValueError if it cannot be read, or if its entries do not match its heading.

    names   the stated columns; their names may have any characters
    """
    pd = importlib.import_module("pandas")
    try:
        check_inputs([Path(source)])
        table = pd.read_csv(source)
    except (OSError, ValueError) as error:
        raise ValueError(f'population "{title}" cannot be read as CSV: {str(error).splitlines()[0]}') from error
    has_more_entries = not isinstance(table.index, pd.RangeIndex)  # pandas takes the first ones for names of rows
    heading = "".join(map(str, table.columns[:1])) if len(table.columns) == 1 else ""
    separator = next((mark for mark in ";\t" if mark in heading and heading not in names), None)
    if separator is not None:
        options = f"sep={separator!r}" + (', decimal=","' if has_more_entries else "")
        raise ValueError(
            f'population "{title}": expected commas between columns, got {SEPARATORS[separator]}; '
            f'read it with pandas: population(pandas.read_csv("{title}", {options}))'
        )
    if has_more_entries:
        raise ValueError(
            f'population "{title}": its rows have more entries than its heading has columns; expected one for each, '
            "separated by commas, and points in decimals"
        )
    return table


def correlation(labels: Sequence[str], matrix: Any, declared_at: str) -> Correlation:
    """Return the Correlation of contributors; `matrix` may be an array, or one coefficient for two of them."""
    if is_length(matrix):
        matrix = [[1.0, matrix], [matrix, 1.0]]
    try:
        rows = tuple(tuple(float(number) for number in row) for row in matrix)
    except (TypeError, ValueError):
        rows = ()
    return Correlation(tuple(labels), rows, declared_at)
