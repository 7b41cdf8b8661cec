"""The solver of contact QPs with elastic parts, in the reactions alone; it names pairs that contradict each other."""

import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.conditioning import SLACK
from tolcontact.compilation.contact_qp import ContactQP, row_count
from tolcontact.compilation.dual_kernel import INFEASIBLE, SOLVED, solve_dual
from tolcontact.compilation.solver import ACCURACY, Arrays

TOLERANCE = 1e-11  # mm: rows that penetrate less are not active
BALANCED = 1e-10  # of the sum of its terms: what a ray may leave of forces and openings, by rounding

Systems = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # H, g, A, b of solve_dual


class ElasticSolver:
    """A solver of the QPs of a group with elastic parts. It has no memory, so threads may share it.

    Its rows are in another order: first those that push, last the equations. Slacks of rigid pairs are zero. A QP is solved with
    slacks if a ray proves that its rows contradict each other: reactions that balance each other and bend nothing, while the
    rows under these reactions penetrate in total. Then `depth` (realization, pair) [mm] is the penetration that is left.
    """

    remembers = False

    def __init__(self, qp: ContactQP) -> None:
        elastic = qp.elastic
        assert elastic is not None
        pairs, count = len(qp.spans), len(elastic.flexibility.holds)
        rows, size = qp.assemble.size_out("a")
        holds = np.ones(rows, dtype=bool)
        holds[:count] = elastic.flexibility.holds
        self._movers, self._count, self._elastic = size - pairs, count, elastic
        self._order = np.argsort(holds, kind="stable")
        self._equations = int(holds.sum())
        C = np.zeros((rows, rows))
        C[:count, :count] = elastic.flexibility.C * elastic.scale
        self._C = np.ascontiguousarray(C[np.ix_(self._order, self._order)])
        position = np.argsort(self._order)
        self._h, self._a = (np.array(qp.assemble.sparsity_out(name).get_triplet()) for name in ("h", "a"))
        self._slopes = self._a[1] < self._movers
        self._places = position[self._a[0][self._slopes]] * self._movers + self._a[1][self._slopes]
        of_row = np.repeat(np.arange(pairs), [row_count(points) for points in qp.standing])
        pushing = np.flatnonzero(~holds)
        self._pairs = np.unique(of_row[pushing])
        self._opens = np.equal.outer(of_row[pushing], self._pairs) * SLACK  # of these rows by slacks of these pairs
        self._pair_count = pairs
        self._is_rigid = np.zeros(size, dtype=bool)
        self._is_rigid[self._a[1][~self._slopes]] = True

    def twin(self) -> "ElasticSolver":
        """Return the solver itself."""
        return self

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a, lam_x and `depth` of assembled QPs, (realization, entry), and whether none was found (realization,).

        Probably, rows with `reactions` are active.
        """
        count, length = len(reactions), self._length(problem)
        systems = self._systems(problem, length)
        guess = np.zeros((count, len(self._order)))
        guess[:, : self._count] = reactions
        x, forces, status = _solved(systems, self._C, self._equations, guess[:, self._order])
        values = np.zeros((count, self._movers + self._pair_count))
        values[:, : self._movers] = x
        depth = np.zeros((count, self._pair_count))
        for k in np.flatnonzero(status == INFEASIBLE):
            system = tuple(array[k] for array in systems)
            if self._is_ray(system, forces[k]):
                values[k], forces[k], status[k] = self._nearest(system)
        depth[:, self._pairs] = SLACK * values[:, self._movers + self._pairs]
        is_rigid = self._is_rigid[self._movers :]
        depth[:, is_rigid] = 0  # their slacks are variables of the QP
        values[:, self._movers :][:, ~is_rigid] = 0
        lam_a = np.empty((count, len(self._order)))
        lam_a[:, self._order] = -forces
        lam_a *= length
        answer = {"x": values, "lam_a": lam_a, "lam_x": self._lam_x(problem, values, lam_a), "depth": depth}
        return answer, status != SOLVED

    def _length(self, problem: Arrays) -> np.ndarray:
        """Return the lengths (realization, row) of the unscaled rows, 1 for exact locators."""
        length = np.ones((len(problem["length"]), len(self._order)))
        length[:, : self._count] = problem["length"]
        return length

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
        if self._is_rigid.any():
            lam_x[:, self._is_rigid] = -(problem["g"] + x)[:, self._is_rigid]
            for entry in np.flatnonzero(~self._slopes):
                row, column = self._a[:, entry]
                lam_x[:, column] -= problem["a"][:, entry] * lam_a[:, row]
        return lam_x

    def _is_ray(self, system: tuple[np.ndarray, ...], ray: Float[Array, " row"]) -> bool:
        """Return whether reactions prove that no increment and no other reactions open all rows."""
        _, _, A, b = system
        own = np.sqrt(np.diag(self._C))
        balance, bending = np.abs(A.T @ ray), np.abs(self._C @ ray)
        is_balanced = (balance <= BALANCED * (np.abs(A).T @ np.abs(ray))).all()
        bends_nothing = (bending <= BALANCED * own * (own @ np.abs(ray))).all()
        return bool(is_balanced and bends_nothing and b @ ray < -ACCURACY * np.abs(ray).sum())

    def _nearest(self, system: tuple[np.ndarray, ...]) -> tuple[np.ndarray, np.ndarray, int]:
        """Return x with slacks, reactions and the status of a QP whose rows a slack for each pair opens, with a price."""
        H, g, A, b = system
        size, pairs, first = self._movers, len(self._pairs), len(b) - self._equations
        rows = np.r_[:first, first + pairs : len(b) + pairs]
        wide_H = np.eye(size + pairs)
        wide_H[:size, :size] = H
        wide_A, wide_C = np.zeros((len(b) + pairs, size + pairs)), np.zeros((len(b) + pairs,) * 2)
        wide_A[rows, :size], wide_C[np.ix_(rows, rows)] = A, self._C
        wide_A[:first, size:], wide_A[first : first + pairs, size:] = self._opens, np.eye(pairs)
        wide_b = np.zeros(len(b) + pairs)
        wide_b[rows] = b
        price = np.full(pairs, self._elastic.length)
        wide = wide_H[None], np.concatenate([g, price])[None], wide_A[None], wide_b[None]
        x, forces, status = _solved(wide, wide_C, self._equations, np.zeros((1, len(wide_b))))
        values = np.zeros(size + self._pair_count)
        values[:size], values[size + self._pairs] = x[0, :size], np.maximum(x[0, size:], 0)
        return values, forces[0, rows], int(status[0])


def _solved(systems: Systems, C: np.ndarray, equations: int, guess: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x (QP, n), reactions (QP, row) and the status (QP,), see solve_dual."""
    count, rows, size = systems[2].shape
    x, forces, status = np.empty((count, size)), np.empty((count, rows)), np.empty(count, dtype=np.int64)
    solve_dual(*systems, C, equations, guess, TOLERANCE, x, forces, status)
    return x, forces, status
