"""Bounds of measures over everything that drawings allow, in the linear model: no pose free of penetration lies beyond.

With any objective, gaps are non-negative at the corrected pose, and bilateral locators keep their positions where forces press.
So the largest value of a measure over all deviations and all these poses is a linear program. Its zones are approximated by
tangents (Kelley, 1960), and each round gives an outer bound of the measure. This is the worst case with float of fasteners.
Where only the objective holds a part, for instance a part that contact may lift without limit, the bound is infinite.

The objective "all points" has the same quadratic term everywhere. Here the optimality conditions are added to the program, with
a binary variable for each row that may be active or open; HiGHS also gives a bound for this program when its time is up.

A measure with a kink at the nominal assembly (a minimum, a clearance, an angle that is nominally 0) has no linear model, and
no bound.

The bounds are of first order in deviations and motions. Pairs of round faces and springy supports have no rows, which only
widens the bounds.
"""

import contextlib
import ctypes
import functools
import os
import platform
import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.linear_model import LinearModel
from tolcontact.compilation import Program

MAX_ROUNDS = 30
SLACK = 1e-7  # of a zone's width
MAX_BINARY, MAX_SECONDS = 64, 30.0  # rows that may be active or open; time for one bound
MAX_CONDITION = 1e8  # of the objective's quadratic term: above this, contact points do not constrain all freedoms
_LOCK = threading.Lock()
_inside = 0  # number of threads inside `muted_c_stdout`
_stream: int | None = None  # the address of the replaced stream


def farthest_poses(program: Program, region: AllowedRegion, model: LinearModel) -> np.ndarray:
    """Return bounds (measure, state, end); bounds of the raw state are without contact."""
    bounds = np.empty((len(model.measures), len(terms.STATES), len(terms.ENDS)))
    # With stations, reactions in a later one do not act on the motions in an earlier one.
    has_optimum = program.method.objective == "all points" and not program.stations
    reactions = _reactions(model, region) if has_optimum else None
    for measure in range(len(model.measures)):
        for end, sense in enumerate(terms.SENSES):
            raw = _Problem(model, region, measure, sense, is_moved=False, reactions=None)
            moved = _Problem(model, region, measure, sense, is_moved=True, reactions=reactions)
            unbounded = model.kinked[0, measure], model.kinked[:, measure].any()
            bounds[measure, :, end] = [
                sense * np.inf if is_unbounded else model.measures[measure] + sense * problem.bound()
                for problem, is_unbounded in zip((raw, moved), unbounded, strict=True)
            ]
    return bounds


@dataclass(frozen=True, eq=False)
class _Reactions:
    """The data of the optimality conditions of the objective "all points".

    hessian           (freedom, freedom) of the objective
    largest_gap       (row,) bound of each gap at a corrected pose [mm]
    largest_reaction  (row,) bound of each reaction
    """

    hessian: np.ndarray
    largest_gap: np.ndarray
    largest_reaction: np.ndarray


def _reactions(model: LinearModel, region: AllowedRegion) -> _Reactions | None:
    """Return bounds of gaps and reactions.

    The result is None if there are too many rows, if contact points do not constrain all freedoms, or if no motion opens all
    gaps.
    """
    A, hessian = model.gaps_by_motion, 2 * model.displacements.T @ model.displacements
    if not 0 < len(A) <= MAX_BINARY or model.round_pairs or np.linalg.cond(hessian) >= MAX_CONDITION:
        return None
    # A motion d that opens all gaps by 1, with the least sum of |d|: nearly the least energy suffices.
    freedoms, eye = A.shape[1], np.eye(A.shape[1])
    lift = scipy.optimize.milp(
        np.r_[np.zeros(freedoms), np.ones(freedoms)],
        constraints=[
            scipy.optimize.LinearConstraint(np.hstack([A, np.zeros_like(A)]), 1.0, np.inf),
            scipy.optimize.LinearConstraint(np.hstack([eye, eye]), 0.0, np.inf),
            scipy.optimize.LinearConstraint(np.hstack([-eye, eye]), 0.0, np.inf),
        ],
        bounds=scipy.optimize.Bounds(-np.inf, np.inf),
    )
    if not lift.success:
        return None
    d = lift.x[:freedoms]
    energy = float(np.sqrt(d @ hessian @ d))
    slopes = region.slopes(model.gaps_by_deviations)
    middle, half = (region.lower + region.upper) / 2, (region.upper - region.lower) / 2
    lowest = model.gaps + slopes @ middle - np.abs(slopes) @ half
    highest = model.gaps + slopes @ middle + np.abs(slopes) @ half
    deepest = max(float(-lowest.min()), 0.0)
    # The corrected motion has no more energy than `deepest` d, which opens all gaps; this also bounds the sum of reactions.
    opening = np.sqrt(np.einsum("ij,jk,ik->i", A, np.linalg.inv(hessian), A)) * deepest * energy
    return _Reactions(hessian, np.maximum(highest + opening, 1e-9), np.full(len(A), max(deepest, 1e-9) * energy**2))


class _Problem:
    """The largest sense * (measure - nominal) over points x of the region and motions y.

    With `reactions`, also over reactions r, and over binaries b of rows that are active (1) or open (0).
    """

    def __init__(
        self,
        model: LinearModel,
        region: AllowedRegion,
        measure: int,
        sense: int,
        *,
        is_moved: bool,
        reactions: _Reactions | None,
    ) -> None:
        self._region = region
        contributors = len(region.lower)
        freedoms = model.by_motion.shape[1] if is_moved else 0
        binaries = 0 if reactions is None else len(model.gaps)
        self._width = contributors + freedoms + 2 * binaries
        self._goal = np.zeros(self._width)
        self._goal[:contributors] = sense * region.slopes(model.by_deviations[measure])
        self._goal[contributors : contributors + freedoms] = sense * model.by_motion[measure, :freedoms]
        self._integer = np.r_[np.zeros(self._width - binaries), np.ones(binaries)]
        lower, upper = np.full(self._width, -np.inf), np.full(self._width, np.inf)
        lower[:contributors], upper[:contributors] = region.lower, region.upper
        if reactions is not None:
            lower[-2 * binaries :], upper[-2 * binaries :] = 0.0, np.r_[reactions.largest_reaction, np.ones(binaries)]
        self._bounds = scipy.optimize.Bounds(lower, upper)
        self._constraints: list[scipy.optimize.LinearConstraint] = []
        if freedoms:
            self._add_contact(model)
        if reactions is not None:
            self._add_optimality(model, reactions)

    def _add_contact(self, model: LinearModel) -> None:
        """Constrain gaps to be non-negative, and bilateral locators to their positions."""
        self._add(np.hstack([self._region.slopes(model.gaps_by_deviations), model.gaps_by_motion]), -model.gaps, np.inf)
        self._add(np.hstack([np.zeros((len(model.bilateral), len(self._region.lower))), model.bilateral]), 0.0, 0.0)

    def _add_optimality(self, model: LinearModel, reactions: _Reactions) -> None:
        """Balance the objective's gradient by the reactions; a row is active only if its gap is closed."""
        gaps = np.hstack([self._region.slopes(model.gaps_by_deviations), model.gaps_by_motion])
        count, freedoms = model.gaps_by_motion.shape
        eye, zeros = np.eye(count), np.zeros((count, count))
        self._add(
            np.hstack([np.zeros((freedoms, len(self._region.lower))), reactions.hessian, -model.gaps_by_motion.T]), 0.0, 0.0
        )
        self._add(np.hstack([np.zeros_like(gaps), eye, -reactions.largest_reaction * eye]), -np.inf, 0.0)
        self._add(np.hstack([gaps, zeros, reactions.largest_gap * eye]), -np.inf, reactions.largest_gap - model.gaps)

    def _add(self, rows: np.ndarray, lower: np.ndarray | float, upper: np.ndarray | float) -> None:
        """Add constraints with rows (row, variable) of the first variables."""
        if len(rows):
            self._constraints.append(
                scipy.optimize.LinearConstraint(np.pad(rows, ((0, 0), (0, self._width - rows.shape[1]))), lower, upper)
            )

    def bound(self) -> float:
        """Return an upper bound; infinite if there is none."""
        planes, ends = self._region.planes()
        bound, contributors = np.inf, len(self._region.lower)
        for _ in range(MAX_ROUNDS):
            self._add(planes, -np.inf, ends)
            with muted_c_stdout():  # HiGHS prints a line when a solution needs another solve in the space of all variables
                solution = scipy.optimize.milp(
                    -self._goal, constraints=self._constraints, bounds=self._bounds, integrality=self._integer,
                    options={"time_limit": MAX_SECONDS},
                )  # fmt: skip
            if solution.x is None:
                break
            bound = min(bound, -float(solution.mip_dual_bound if self._integer.any() else solution.fun))
            planes, ends = self._region.planes(solution.x[:contributors], SLACK)
            if not len(planes):
                break
        return bound


@functools.cache
def _null_stream() -> int | None:
    """Return the address of a C stream to the null device; it stays open, as another thread may be printing to it."""
    library = ctypes.CDLL(None)
    library.fopen.restype = ctypes.c_void_p
    return library.fopen(os.devnull.encode(), b"w")


@contextlib.contextmanager
def muted_c_stdout() -> Iterator[None]:
    """Suppress the output of C code to its stream `stdout`, such as HiGHS in integer programs; without glibc, do nothing.

    With glibc this stream is a variable. It leads to the null device while any thread is in this context. The file descriptor
    does not change, so that Python's own output, from any thread, is not affected.
    """
    global _inside, _stream  # noqa: PLW0603  the stream is global, so is its replacement
    if platform.libc_ver()[0] != "glibc":
        yield
        return
    variable = ctypes.c_void_p.in_dll(ctypes.CDLL(None), "stdout")
    with _LOCK:
        _inside += 1
        if _inside == 1:
            _stream, variable.value = variable.value, _null_stream()
    try:
        yield
    finally:
        with _LOCK:
            _inside -= 1
            if not _inside:
                variable.value = _stream
