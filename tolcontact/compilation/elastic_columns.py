"""The columns of a contact QP by which elastic parts bend: slacks s without bounds, which open many rows.

With L L' = C they open the rows by L s and cost s's/2, so that s = L'l for the reactions l, and the gaps open by C l.
C is the same in all realizations. So `assemble` leaves these columns out, `finish` judges answers by C l, and plugins get L.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.mechanics.flexibility import Flexibility


@dataclass(frozen=True, eq=False)
class ElasticColumns:
    """The columns of elastic parts of one group.

    scale    multipliers times this are reactions [N]
    length   [mm] of the group
    """

    flexibility: Flexibility
    scale: float
    length: float

    @cached_property
    def _entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row, column and value of the entries of L, column by column, for multipliers of rows that are not scaled."""
        L = self.flexibility.factor
        columns, rows = np.nonzero(L.T)
        return self.flexibility.rows[rows], columns, L[rows, columns] * np.sqrt(self.scale)

    def sparsity(self, name: str, sparsity: ca.Sparsity) -> ca.Sparsity:
        """Return the sparsity of an output of `assemble` with these columns."""
        count = len(self.flexibility.rows)
        if name == "h":
            return ca.diagcat(sparsity, ca.Sparsity.diag(count))
        if name == "g":
            return ca.vertcat(sparsity, ca.Sparsity.dense(count, 1))
        if name == "a":
            rows, columns, _ = self._entries
            starts = np.searchsorted(columns, np.arange(count + 1))
            return ca.horzcat(sparsity, ca.Sparsity(sparsity.size1(), count, starts.tolist(), rows.tolist()))
        return sparsity

    def joined(self, problem: Mapping[str, Float[Array, "realization _"]]) -> dict[str, Float[Array, "realization _"]]:
        """Return the outputs of `assemble` (realization, entry) with these columns."""
        rows, _, values = self._entries
        ones = np.ones((len(problem["h"]), len(self.flexibility.rows)))
        added = {"h": ones, "g": 0 * ones, "a": values / problem["length"][:, rows]}
        return dict(problem) | {name: np.concatenate([problem[name], entries], axis=1) for name, entries in added.items()}

    def reactions(self, lam_a: Float[Array, "realization _"], length: Float[Array, "realization row"]) -> np.ndarray:
        """Return the reactions (realization, row) [N], from the multipliers of all rows, and the lengths of unscaled rows."""
        return np.asarray(-lam_a[:, : length.shape[1]] / length * self.scale)
