"""A solver of contact QPs that follows the graph of bodies: few bodies touch each other, so most of the matrices is empty."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.graph.factor_kernel import Work
from tolcontact.compilation.graph.layout import Layout, layout
from tolcontact.compilation.graph.solve_kernel import solve_batch
from tolcontact.mechanics.correction import FREEDOMS

FEW_BODIES, ROUNDS_OF_FEW, ROUNDS = 2, 12, 40  # rounds in which rows of all joints enter at once
STEPS_PER_ROW = 40  # in which single rows enter or leave

Arrays = Mapping[str, Float[Array, "_ _"]]


class GraphSolver:
    """A solver of QPs with the sparsities of h, g, a and lba. Threads must not share it.

    The last `equations` rows are equations, the last `slacks` variables are not negative, with unit entries in h.
    """

    def __init__(self, sparsities: Mapping[str, ca.Sparsity], *, slacks: int, equations: int) -> None:
        self._sparsities, self._slacks, self._equations = dict(sparsities), slacks, equations
        rows, columns = (np.array(indices) for indices in sparsities["h"].get_triplet())
        self._identity = (rows == columns).astype(float)
        self._is_full = {name: sparsities[name].nnz() == sparsities[name].numel() for name in ("g", "lba")}
        self._nonzeros = {name: np.array(sparsities[name].find()) for name in ("g", "lba")}
        self._searches: dict[bool, _Search] = {}

    def __call__(
        self, problem: Arrays, reactions: Float[Array, "realization row"]
    ) -> tuple[dict[str, Float[Array, "realization _"]], Bool[Array, " realization"]]:
        """Return x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) whether the solver gave up.

        Rows with `reactions` carry in the first guess.
        """
        count = len(reactions)
        answer = {name: np.zeros((count, size)) for name, size in self._sizes().items()}
        failed = np.zeros(count, dtype=np.bool_)
        coupled = (problem["h"] != self._identity).any(axis=1)
        for is_coupled in (False, True):
            rows = np.flatnonzero(coupled == is_coupled)
            if len(rows) == count:
                self._search(is_coupled)(problem, self._full, reactions, (*answer.values(), failed))
            elif rows.size:
                part = {name: problem[name][rows] for name in ("h", "g", "a", "lba")}
                results = (*(values[rows] for values in answer.values()), failed[rows])
                self._search(is_coupled)(part, self._full, reactions[rows], results)
                for values, result in zip((*answer.values(), failed), results, strict=True):
                    values[rows] = result
        return answer, failed

    def _sizes(self) -> dict[str, int]:
        rows, size = self._sparsities["a"].shape
        return {"x": size, "lam_a": rows, "lam_x": size}

    def _full(self, name: str, stored: np.ndarray) -> np.ndarray:
        """Return all entries of a vector, (realization, entry)."""
        if self._is_full[name]:
            return np.ascontiguousarray(stored)
        entries = np.zeros((len(stored), self._sparsities[name].numel()))
        entries[:, self._nonzeros[name]] = stored
        return entries

    def _search(self, coupled: bool) -> "_Search":
        if coupled not in self._searches:
            sparsities = self._sparsities["h"], self._sparsities["a"]
            self._searches[coupled] = _Search(
                layout(*sparsities, slacks=self._slacks, equations=self._equations, coupled=coupled), coupled
            )
        return self._searches[coupled]


class _Search:
    """The layout of QPs, with buffers for their solution; `coupled` if H has blocks beside its diagonal."""

    def __init__(self, layout: Layout, coupled: bool) -> None:
        self._layout, self._coupled = layout, coupled
        rows, width = layout.blocks.shape
        bodies, joints, positions = len(layout.body_order), len(layout.slack), int(layout.positions[-1])
        self._buffer = np.zeros(rows * width * FREEDOMS + rows)
        cut = rows * width * FREEDOMS
        self._work = Work(
            slopes=self._buffer[:cut].reshape(rows, width, FREEDOMS),
            openings=self._buffer[cut:],
            bounds=np.zeros(rows),
            gradient=np.zeros((bodies, FREEDOMS)),
            prices=np.zeros(joints),
            y=np.zeros((bodies, FREEDOMS)),
            slack=np.zeros(joints),
            is_open=np.zeros(joints, dtype=np.bool_),
            counts=np.zeros(joints, dtype=np.int64),
            carrying=np.zeros(positions, dtype=np.int64),
            place=np.zeros(rows, dtype=np.int64),
            fresh=np.zeros(joints, dtype=np.int64),
            changed=np.zeros(joints, dtype=np.bool_),
            factor=np.zeros((positions, positions)),
            multipliers=np.zeros(positions),
            right_side=np.zeros(positions),
            column=np.zeros(positions),
            scatter=np.zeros((bodies, FREEDOMS)),
            direction=np.zeros((bodies, FREEDOMS)),
            slack_direction=np.zeros(joints),
        )
        self._blocks = np.zeros((len(layout.columns) if coupled else 0, FREEDOMS, FREEDOMS))
        self._block_of = np.full((bodies, bodies) if coupled else (0, 0), -1, dtype=np.int64)
        if coupled:
            rows_of_blocks = np.repeat(np.arange(bodies), np.diff(layout.body_starts))
            self._block_of[rows_of_blocks, layout.columns] = np.arange(len(layout.columns))
        self._guesses = np.zeros(joints), np.zeros(joints, dtype=np.int64)
        self._limits = np.array([ROUNDS if bodies > FEW_BODIES else ROUNDS_OF_FEW, STEPS_PER_ROW * (rows + FREEDOMS)])

    def __call__(self, problem: Arrays, full, reactions: np.ndarray, answer: tuple[np.ndarray, ...]) -> np.ndarray:  # type: ignore[no-untyped-def]
        """Solve QPs into `answer`: x, lam_a, lam_x, failed; return the counters of `solve_batch`."""
        hessian = problem["h"] if self._coupled else np.zeros((len(reactions), 0))
        counters = np.zeros((len(reactions), 2), dtype=np.int64)
        solve_batch(
            self._layout,
            self._work,
            (np.ascontiguousarray(hessian), self._blocks, self._block_of),
            (np.ascontiguousarray(problem["a"]), full("g", problem["g"]), full("lba", problem["lba"]), self._buffer),
            np.ascontiguousarray(reactions),
            self._limits,
            (*self._guesses, counters),
            answer,
        )
        return counters
