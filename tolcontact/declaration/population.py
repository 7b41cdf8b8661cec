"""Populations: measured parts whose rows are drawn as a whole, perhaps by lots, without the scatter of their gauge."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.values import is_length
from tolcontact.tables import MAX_NUMBER

MAX_LISTED = 3  # columns in words
ROUNDING = 1e-12  # of a variance: a smaller negative one is zero


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
        """The upper ends (row,) of the numbers between 0 and 1 that draw each row: lots have equal shares of them."""
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
