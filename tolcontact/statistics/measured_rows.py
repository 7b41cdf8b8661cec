"""Rows of measured parts: how often each occurs, which one a realization has, and their weights in a posterior draw.

Numbers identify the parts that a contributor is known from, so that two runs recognize the same parts.
"""

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from tolcontact.declaration import Population


class MeasuredRows(NamedTuple):
    """A population of measured parts.

    columns         of the deviations
    of_realization  (realization,) the row that each realization has
    counts          (row,) how often each row occurs
    by_lot          (lot, row) how often in each lot, if realizations draw a lot first
    """

    columns: np.ndarray
    of_realization: np.ndarray
    counts: np.ndarray
    by_lot: np.ndarray | None = None

    @property
    def known(self) -> int:
        """The number of independent draws that the population is known from: parts, or lots."""
        return int(self.counts.sum()) if self.by_lot is None else len(self.by_lot)

    def weights(self, rng: np.random.Generator, worlds: int) -> np.ndarray:
        """Return weights (world, row) of the rows in a number of worlds: of the parts in each lot, and of the lots."""
        if self.by_lot is None:
            return np.asarray(rng.dirichlet(self.counts, worlds) * self.counts.sum() / self.counts)
        shares = rng.dirichlet(np.ones(len(self.by_lot)), worlds)
        drawn = np.zeros((worlds, len(self.counts)))
        for lot, counts in enumerate(self.by_lot):
            rows = np.flatnonzero(counts)
            drawn[:, rows] += shares[:, lot, None] * rng.dirichlet(counts[rows], worlds)
        return np.asarray(drawn / (self.by_lot / self.by_lot.sum(axis=1, keepdims=True)).mean(axis=0))


def measured_rows(population: Mapping[str, Any], labels: list[str], x: np.ndarray) -> MeasuredRows:
    """Return the rows of a declared population, and the row of each realization with deviations x, named by labels."""
    columns, gauge, lots = (tuple(population.get(name, ())) for name in ("columns", "gauge", "lots"))
    drawn = Population(columns, np.array(population["values"], dtype=float), gauge=gauge, lots=lots).drawn
    values, row, counts = np.unique(drawn, axis=0, return_inverse=True, return_counts=True)
    by_lot = np.zeros((len(set(lots)), len(values)), dtype=int)
    if lots:
        np.add.at(by_lot, (np.unique(lots, return_inverse=True)[1], row.ravel()), 1)
    scale = np.where(np.ptp(values, axis=0) > 0, np.ptp(values, axis=0), 1.0)
    indices = [labels.index(label) for label in columns]
    of_realization = scipy.spatial.cKDTree(values / scale).query(x[:, indices] / scale)[1]
    return MeasuredRows(np.array(indices), of_realization, counts, by_lot if lots else None)


def sources(document: Mapping[str, Any], labels: Sequence[str]) -> list[int]:
    """Return a number for each contributor and population of a declaration: equal ones are known from the same parts.

    A variable is if its name and its tolerance are equal, and another contributor if all tolerances of few parts are.
    """
    tolerances = {variable["name"]: variable["tolerance"] for variable in document.get("variables", [])}
    others = [*_of_few_parts({key: value for key, value in document.items() if key != "variables"})]
    entries = [[label, tolerances.get(label, others)] for label in labels] + document.get("populations", [])
    return [zlib.crc32(json.dumps(_without_lines(entry), sort_keys=True).encode()) for entry in entries]


def _of_few_parts(entry: Any) -> Iterator[Any]:
    """Yield the tolerances in a document that state a number of parts."""
    if isinstance(entry, dict) and isinstance(entry.get("parts"), int):
        yield entry
    elif isinstance(entry, dict | list):
        for value in entry.values() if isinstance(entry, dict) else entry:
            yield from _of_few_parts(value)


def _without_lines(entry: Any) -> Any:
    """Return an entry without the script lines that declared it."""
    return {key: value for key, value in entry.items() if key != "declared_at"} if isinstance(entry, dict) else entry
