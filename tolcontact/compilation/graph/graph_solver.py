"""A solver of contact QPs that exploits the graph of bodies: few bodies touch each other, so the matrices are sparse."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.elastic_solver import ElasticSolver
from tolcontact.compilation.graph.factor_kernel import Work
from tolcontact.compilation.graph.layout import POSITION, Layout, Storage, layout
from tolcontact.compilation.graph.solve_kernel import solve_batch
from tolcontact.compilation.solver import Arrays, SolverChoice
from tolcontact.mechanics.correction import FREEDOMS

FEW_BODIES, ROUNDS_OF_FEW, ROUNDS = 2, 4, 40  # rounds of all joints at once
STEPS_PER_ROW = 4  # steps of single rows

Layouts = dict[bool, tuple[Layout, Storage]]  # by whether H couples bodies


class GraphChoice(SolverChoice):
    """The choice of the solver on the graph of bodies."""

    def is_usable(self) -> bool:
        """Return True: the solver is part of this package."""
        return True

    def solver(self, qp: ContactQP) -> "GraphSolver | ElasticSolver":
        if qp.flexibility is not None:
            return ElasticSolver(qp)
        sparsities = {name: qp.sparsity(name) for name in ("h", "g", "a", "lba")}
        return GraphSolver(sparsities, slacks=qp.slacks, equations=qp.equations)


class GraphSolver:
    """A solver of QPs with the sparsities of h, g, a and lba. Threads must not share it.

    The last `equations` rows are equations. The last `slacks` variables are not negative, with unit entries in h. Twins share
    their `layouts`, which are created on demand.

    remembers   whether it starts each problem from the previous answer: never
    """

    remembers = False

    def __init__(
        self, sparsities: Mapping[str, ca.Sparsity], *, slacks: int, equations: int, layouts: Layouts | None = None
    ) -> None:
        self._layouts = {} if layouts is None else layouts
        self._sparsities, self._slacks, self._equations = dict(sparsities), slacks, equations
        rows, columns = (np.array(indices) for indices in sparsities["h"].get_triplet())
        self._identity = (rows == columns).astype(float)
        self._is_full = {name: sparsities[name].nnz() == sparsities[name].numel() for name in ("g", "lba")}
        self._nonzeros = {name: np.array(sparsities[name].find()) for name in ("g", "lba")}
        self._searches: dict[bool, _Search] = {}

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the solver failed.

        In the initial active set, rows with `reactions` are active, and `slacks` above zero are open.
        """
        count = len(reactions)
        assert slacks.shape == (count, self._slacks)  # otherwise machine code would read out of bounds
        answer = {name: np.zeros((count, size)) for name, size in self._sizes().items()}
        failed = np.zeros(count, dtype=np.bool_)
        arrays = (problem["h"], problem["a"], self._full("g", problem["g"]), self._full("lba", problem["lba"]))
        guess, results = (reactions, slacks), (*answer.values(), failed)
        coupled = (problem["h"] != self._identity).any(axis=1)
        for is_coupled in (False, True):
            rows = np.flatnonzero(coupled == is_coupled)
            if len(rows) == count:
                self._search(is_coupled)(arrays, guess, results)
            elif rows.size:
                part, part_guess, part_results = (tuple(array[rows] for array in group) for group in (arrays, guess, results))
                self._search(is_coupled)(part, part_guess, part_results)
                for array, values in zip(results, part_results, strict=True):
                    array[rows] = values
        return answer, failed

    def twin(self) -> "GraphSolver":
        """Return an equal solver with buffers of its own."""
        return GraphSolver(self._sparsities, slacks=self._slacks, equations=self._equations, layouts=self._layouts)

    def _sizes(self) -> dict[str, int]:
        rows, size = self._sparsities["a"].shape
        return {"x": size, "lam_a": rows, "lam_x": size}

    def _full(self, name: str, stored: np.ndarray) -> np.ndarray:
        """Return all entries of a vector, (realization, entry)."""
        if self._is_full[name]:
            return stored
        entries = np.zeros((len(stored), self._sparsities[name].numel()))
        entries[:, self._nonzeros[name]] = stored
        return entries

    def _search(self, coupled: bool) -> "_Search":
        if coupled not in self._searches:
            if coupled not in self._layouts:
                sparsities = self._sparsities["h"], self._sparsities["a"]
                self._layouts[coupled] = layout(*sparsities, slacks=self._slacks, equations=self._equations, coupled=coupled)
            self._searches[coupled] = _Search(*self._layouts[coupled], coupled=coupled)
        return self._searches[coupled]


class _Search:
    """The layout of QPs, with buffers for their solution; `coupled` if H has off-diagonal blocks."""

    def __init__(self, layout: Layout, storage: Storage, *, coupled: bool) -> None:
        self._layout, self._storage, self._coupled = layout, storage, coupled
        rows, width = len(layout.blocks), layout.blocks.shape[1] - 1
        bodies, joints, positions = len(storage.bodies), len(layout.joints) - 1, int(layout.joints[-1, POSITION])
        cut = rows * width * FREEDOMS
        self._buffer = np.zeros(cut + 2 * rows)
        self._work = Work(
            slopes=self._buffer[:cut].reshape(rows, width, FREEDOMS),
            rows=self._buffer[cut:].reshape(rows, 2),
            position=np.zeros(rows, dtype=np.int64),
            vectors=np.zeros((4, bodies, FREEDOMS)),
            joints=np.zeros((joints, 4), dtype=np.int64),
            slacks=np.zeros((3, joints)),
            factor=np.zeros((positions, positions)),
            active=np.zeros(positions, dtype=np.int64),
            positions=np.zeros((3, positions)),
        )
        self._blocks = np.zeros((len(storage.columns) if coupled else 0, FREEDOMS, FREEDOMS))
        self._guesses = np.zeros(joints), np.zeros(joints, dtype=np.int64)
        self._limits = np.array(
            [max(ROUNDS, bodies) if bodies > FEW_BODIES else ROUNDS_OF_FEW, STEPS_PER_ROW * (rows + FREEDOMS)]
        )

    def __call__(
        self, problem: tuple[np.ndarray, ...], guess: tuple[np.ndarray, ...], answer: tuple[np.ndarray, ...]
    ) -> Int[Array, "realization 2"]:
        """Solve QPs (h, a, g, lba) into `answer` (x, lam_a, lam_x, failed); return the counters of `solve_batch`.

        guess   reactions and slacks
        """
        h, *vectors = (np.ascontiguousarray(array) for array in problem)
        counters = np.zeros((len(h), 2), dtype=np.int64)
        solve_batch(
            self._layout,
            self._storage,
            self._work,
            (h if self._coupled else h[:, :0].copy(), self._blocks),
            (*vectors, self._buffer),
            tuple(np.ascontiguousarray(array) for array in guess),
            self._limits,
            (*self._guesses, counters),
            answer,
        )
        return counters
