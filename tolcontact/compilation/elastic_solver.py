"""The solver of contact QPs with elastic parts, in the reactions alone; it names pairs that contradict each other."""

import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.conditioning import SLACK
from tolcontact.compilation.contact_qp import ContactQP, row_count
from tolcontact.compilation.dual_kernel import INFEASIBLE, SOLVED, solve_dual
from tolcontact.compilation.solver import ACCURACY, Arrays

TOLERANCE = 1e-11  # mm: rows that penetrate less are not active

Systems = tuple[np.ndarray, ...]  # H, g, A, b of solve_dual


class ElasticSolver:
    """A solver of the QPs of a group with elastic parts. It has no memory, so threads may share it.

    Its rows are in another order: contact first, equations last. Slacks of rigid pairs are zero. A QP is solved with slacks if
    a ray proves that its rows contradict each other: reactions that balance each other and bend nothing, while the rows under
    these reactions penetrate in total. Then `opened` (realization, row) [mm] is the penetration that is left, by one slack for
    each pair in contact, and two for each two-sided locator, which opens either way.
    """

    remembers = False

    def __init__(self, qp: ContactQP) -> None:
        assert qp.flexibility is not None
        pairs, count = len(qp.spans), len(qp.flexibility.holds)
        rows, size = qp.assemble.size_out("a")
        holds = np.ones(rows, dtype=bool)
        holds[:count] = qp.flexibility.holds
        self._movers, self._count, self._length = size - pairs, count, qp.length
        self._order = np.argsort(holds, kind="stable")
        self._equations = int(holds.sum())
        C = np.zeros((rows, rows))
        C[:count, :count] = qp.flexibility.C * qp.scale
        self._C = np.ascontiguousarray(C[np.ix_(self._order, self._order)])
        position = np.argsort(self._order)
        self._h, self._a = (np.array(qp.assemble.sparsity_out(name).get_triplet()) for name in ("h", "a"))
        self._slopes = self._a[1] < self._movers
        self._places = position[self._a[0][self._slopes]] * self._movers + self._a[1][self._slopes]
        of_row = np.repeat(np.arange(pairs), [row_count(points) for points in qp.standing])
        pushing = np.flatnonzero(~holds)
        self._pairs, either_way = np.unique(of_row[pushing]), np.eye(rows)[:, np.flatnonzero(holds[:count])]
        by_pair = np.zeros((rows, len(self._pairs)))
        by_pair[pushing] = np.equal.outer(of_row[pushing], self._pairs)
        self._opens = SLACK * np.hstack([by_pair, either_way, -either_way])[self._order]
        self._rigid_slacks = np.unique(self._a[1][~self._slopes])  # variables of the QP
        self._rigid_rows = np.isin(of_row, self._rigid_slacks - self._movers)

    def twin(self) -> "ElasticSolver":
        """Return the solver itself."""
        return self

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a, lam_x and `opened` of assembled QPs, (realization, entry), and which have no answer (realization,).

        Probably, rows with `reactions` are active.
        """
        count = len(reactions)
        length = np.ones((count, len(self._order)))  # of the unscaled rows; 1 for exact locators
        length[:, : self._count] = problem["length"]
        systems = self._systems(problem, length)
        guess = np.zeros((count, len(self._order)))
        guess[:, : self._count] = reactions
        x, forces, status = _solved(systems, self._C, self._equations, guess[:, self._order])
        values, opened = np.zeros((count, problem["g"].shape[1])), np.zeros((count, self._count))
        values[:, : self._movers] = x
        is_huge = np.abs(forces).max(axis=1, initial=0) > self._length / SLACK  # more than the price of slacks
        for k in np.flatnonzero((status == INFEASIBLE) | is_huge):
            system = tuple(array[k] for array in systems)
            if status[k] == SOLVED and self._misfit(system, x[k], forces[k]) < ACCURACY:
                continue
            increments, slacks_there, reactions_there, outcome = self._nearest(system)
            if self._is_ray(system, forces[k], reactions_there):
                forces[k], status[k] = reactions_there, outcome
                values[k, : self._movers], values[k, self._movers + self._pairs] = increments, slacks_there[: len(self._pairs)]
                opened[k] = (self._opens @ slacks_there)[np.argsort(self._order)][: self._count]
        values[:, np.setdiff1d(np.arange(self._movers, values.shape[1]), self._rigid_slacks)] = 0
        opened[:, self._rigid_rows] = 0
        lam_a = np.empty((count, len(self._order)))
        lam_a[:, self._order] = -forces
        lam_a *= length
        answer = {"x": values, "lam_a": lam_a, "lam_x": self._lam_x(problem, values, lam_a), "opened": opened}
        return answer, status != SOLVED

    def _systems(self, problem: Arrays, length: np.ndarray) -> Systems:
        """Return H, g, A and b of solve_dual, with gaps in mm."""
        count, size = len(length), self._movers
        rows, columns = self._h
        inside = rows < size
        H = np.zeros((count, size * size))
        H[:, rows[inside] * size + columns[inside]] = problem["h"][:, inside]
        A = np.zeros((count, len(self._order) * size))
        A[:, self._places] = problem["a"][:, self._slopes]
        b = -(problem["lba"] * length)[:, self._order]
        A = A.reshape(count, -1, size) * length[:, self._order, None]
        return H.reshape(count, size, size), np.ascontiguousarray(problem["g"][:, :size]), A, b

    def _lam_x(self, problem: Arrays, x: np.ndarray, lam_a: np.ndarray) -> np.ndarray:
        """Return the multipliers of the slacks of rigid pairs, by which the slacks are stationary."""
        lam_x = np.zeros(x.shape)
        if self._rigid_slacks.size:
            lam_x[:, self._rigid_slacks] = -(problem["g"] + x)[:, self._rigid_slacks]
            for entry in np.flatnonzero(~self._slopes):
                row, column = self._a[:, entry]
                lam_x[:, column] -= problem["a"][:, entry] * lam_a[:, row]
        return lam_x

    def _misfit(self, system: tuple[np.ndarray, ...], x: Float[Array, " n"], forces: Float[Array, " row"]) -> float:
        """Return how far [mm] rows under load are from closed, and others inside."""
        _, _, A, b = system
        gaps, first = A @ x + self._C @ forces + b, len(b) - self._equations
        gaps[:first] = np.where(forces[:first] > 0, gaps[:first], np.minimum(gaps[:first], 0))
        return float(np.abs(gaps).max(initial=0))

    def _is_ray(self, system: tuple[np.ndarray, ...], ray: Float[Array, " row"], limits: Float[Array, " row"]) -> bool:
        """Return whether a ray proves that nothing opens all rows: no increments up to the length, no reactions up to `limits`.

        The work of the ray on the gaps A x + C l + b would not be negative if they were open.
        """
        _, _, A, b = system
        rounding = np.abs(A.T @ ray).sum() * self._length + np.abs(self._C @ ray) @ np.abs(limits)
        return bool(b @ ray + rounding < -ACCURACY * np.abs(ray).sum())

    def _nearest(self, system: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """Return increments, slacks, reactions and the status of a QP whose rows open by slacks, which have a price."""
        H, g, A, b = system
        (rows, size), slacks, first = A.shape, self._opens.shape[1], len(b) - self._equations
        at = np.r_[:first, first + slacks : rows + slacks]  # bounds of the slacks come between
        wide_H, wide_A, wide_C = np.eye(size + slacks), np.zeros((rows + slacks, size + slacks)), np.zeros((rows + slacks,) * 2)
        wide_H[:size, :size], wide_C[np.ix_(at, at)] = H, self._C
        wide_A[at, :size], wide_A[at, size:] = A, self._opens
        wide_A[first : first + slacks, size:] = np.eye(slacks)
        wide_b = np.zeros(rows + slacks)
        wide_b[at] = b
        wide = wide_H, np.concatenate([g, np.full(slacks, self._length)]), wide_A, wide_b
        x, forces, status = _solved(tuple(array[None] for array in wide), wide_C, self._equations, np.zeros((1, len(wide_b))))
        increments, opening, reactions = x[0, :size], np.maximum(x[0, size:], 0), forces[0, at]
        # Large reactions leave rounding in the increments: they close the rows under load again.
        closed = (reactions != 0) | (np.arange(rows) >= first)
        gaps = A @ increments + self._C @ reactions + b + self._opens @ opening
        increments = increments - np.linalg.lstsq(A[closed], gaps[closed])[0]
        return increments, opening, reactions, int(status[0])


def _solved(systems: Systems, C: np.ndarray, equations: int, guess: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x (QP, n), reactions (QP, row) and the status (QP,), see solve_dual."""
    count, rows, size = systems[2].shape
    x, forces, status = np.empty((count, size)), np.empty((count, rows)), np.empty(count, dtype=np.int64)
    solve_dual(*systems, C, equations, guess, TOLERANCE, x, forces, status)
    return x, forces, status
