"""A solver of contact QPs that exploits the graph of bodies: few bodies touch each other, so the matrices are sparse."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.elastic_solver import ElasticSolver
from tolcontact.compilation.graph.factor_kernel import Work
from tolcontact.compilation.graph.layout import Layout, layout
from tolcontact.compilation.graph.solve_kernel import solve_batch
from tolcontact.compilation.solver import Arrays, SolverChoice
from tolcontact.mechanics.correction import FREEDOMS

FEW_BODIES, ROUNDS_OF_FEW, ROUNDS = 2, 4, 40  # rounds of all joints at once
STEPS_PER_ROW = 4  # steps of single rows

Layouts = dict[bool, Layout]  # by whether H couples bodies


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
        self._nonzeros = {name: np.array(sparsities[name].find()) for name in ("g", "lba")}
        self._buffers: dict[bool, tuple[Work, np.ndarray, np.ndarray]] = {}

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"], slacks: Float[Array, "realization slack"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the solver failed.

        In the initial active set, rows with `reactions` are active, and `slacks` above zero are open.
        """
        count = len(reactions)
        assert slacks.shape == (count, self._slacks)  # otherwise machine code would read out of bounds
        rows, size = self._sparsities["a"].shape
        answer = {name: np.zeros((count, entries)) for name, entries in (("x", size), ("lam_a", rows), ("lam_x", size))}
        failed = np.zeros(count, dtype=np.bool_)
        arrays = (problem["h"], problem["a"], self._full("g", problem["g"]), self._full("lba", problem["lba"]))
        guess, results = (reactions, slacks), (*answer.values(), failed)
        coupled = (problem["h"] != self._identity).any(axis=1)
        for is_coupled in (False, True):
            members = np.flatnonzero(coupled == is_coupled)
            if len(members) == count:
                self._solve(is_coupled, arrays, guess, results)
            elif members.size:
                parts = [tuple(array[members] for array in group) for group in (arrays, guess, results)]
                self._solve(is_coupled, *parts)
                for array, values in zip(results, parts[2], strict=True):
                    array[members] = values
        return answer, failed

    def twin(self) -> "GraphSolver":
        """Return an equal solver with buffers of its own."""
        return GraphSolver(self._sparsities, slacks=self._slacks, equations=self._equations, layouts=self._layouts)

    def _full(self, name: str, stored: np.ndarray) -> np.ndarray:
        """Return all entries of a vector, (realization, entry)."""
        size = self._sparsities[name].numel()
        if stored.shape[1] == size:
            return stored
        entries = np.zeros((len(stored), size))
        entries[:, self._nonzeros[name]] = stored
        return entries

    def _solve(
        self, coupled: bool, problem: tuple[np.ndarray, ...], guess: tuple[np.ndarray, ...], answer: tuple[np.ndarray, ...]
    ) -> None:
        """Solve QPs (h, a, g, lba) into `answer` (x, lam_a, lam_x, failed); they are `coupled` if H has off-diagonal blocks.

        guess   reactions and slacks
        """
        if coupled not in self._layouts:
            h, a = self._sparsities["h"], self._sparsities["a"]
            self._layouts[coupled] = layout(h, a, slacks=self._slacks, equations=self._equations, coupled=coupled)
        arrays = self._layouts[coupled]
        if coupled not in self._buffers:
            self._buffers[coupled] = _buffers(arrays, coupled)
        work, buffer, blocks = self._buffers[coupled]
        rows, bodies, joints = len(work.bound), len(work.y), len(work.open)
        rounds = max(ROUNDS, bodies) if bodies > FEW_BODIES else ROUNDS_OF_FEW
        nonzeros, *vectors = (np.ascontiguousarray(array) for array in problem)
        solve_batch(
            arrays,
            work,
            (nonzeros if coupled else nonzeros[:, :0].copy(), blocks),
            (*vectors, buffer),
            tuple(np.ascontiguousarray(array) for array in guess),
            np.array([rounds, STEPS_PER_ROW * (rows + FREEDOMS)]),
            (np.zeros(joints), np.zeros(joints, dtype=np.int64), np.zeros((len(nonzeros), 2), dtype=np.int64)),
            answer,
        )


def _buffers(layout: Layout, coupled: bool) -> tuple[Work, np.ndarray, np.ndarray]:
    """Return the numbers of one QP, the buffer of its slopes and openings, and the buffer (block, 6, 6) of the factor of H."""
    rows, width, bodies = len(layout.blocks), layout.blocks.shape[1] - 1, len(layout.bodies)
    joints, positions, cut = len(layout.slack), int(layout.first[-1]), rows * width * FREEDOMS
    buffer = np.zeros(cut + rows)
    work = Work(
        slopes=buffer[:cut].reshape(rows, width, FREEDOMS),
        opening=buffer[cut:],
        bound=np.zeros(rows),
        position=np.zeros(rows, dtype=np.int64),
        **{name: np.zeros((bodies, FREEDOMS)) for name in ("gradient", "y", "scatter", "direction")},
        **{name: np.zeros(joints, dtype=np.int64) for name in ("counts", "fresh", "changed", "open")},
        **{name: np.zeros(joints) for name in ("price", "value", "change")},
        factor=np.zeros((positions, positions)),
        active=np.zeros(positions, dtype=np.int64),
        **{name: np.zeros(positions) for name in ("multiplier", "step", "column")},
    )
    return work, buffer, np.zeros((len(layout.columns) if coupled else 0, FREEDOMS, FREEDOMS))
