"""Balance of a load by forces within friction cones, as second-order cone programs for Clarabel.

The force of contact point i is N_i n_i + t_i with N_i >= 0, t_i across n_i, |t_i| <= k m_i N_i, and its wrench W_i (N_i, t_i).
A load w can be balanced if  sum W_i (N_i, t_i) + s w = 0  for some s > 0. Scaled by sum N_i + s = 1, the origin then lies in
the convex hull of cones and load. Its distance from that hull is 0 for k at or above the critical factor. Below the critical
factor, the nearest point of the hull gives a motion y of the parts that separates hull and origin:

    a_i >= k m_i |b_i|  with  (a_i, b_i) = W_i' y,   and   w' y > 0

In this motion every contact closes at least k m_i times as fast as it slides. So no factor below the minimum of
a_i / (m_i |b_i|) can balance the load, and this is the next trial factor. The factors increase to the critical factor within a
few steps.
"""

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from tolcontact.arrays import Array, Float

ACCURACY = 1e-12  # of the solver
SEPARATION = 1e-10  # a smaller distance from the hull is rounding
MIN_HELD = 1e-6  # of the sum of all normal forces: a smaller balanced load is rounding
MAX_FACTOR = 1e3  # of friction: larger factors do not exist
MAX_TRIALS, BISECTIONS = 60, 40
TRIAL_MARGIN = 1e-4  # of the critical factor: the load is tried at a factor larger by this share


@dataclass(frozen=True, eq=False)
class ForceCones:
    """Contact points with the wrenches of unit forces, and the load.

    normals    (row, point): wrenches of normal forces
    tangents   (2, row, point): wrenches of forces along two directions across
    load       (row,)
    roughness  (point,): m_i
    """

    normals: Float[Array, "row point"]
    tangents: Float[Array, "2 row point"]
    load: Float[Array, " row"]
    roughness: Float[Array, " point"]

    def critical_factor(self) -> tuple[float, np.ndarray]:
        """Return the smallest factor k at which the load can be balanced, and the shares (point,) of the normal forces there.

        The factor is infinite if the load cannot be balanced at any friction.
        """
        factor, shares = self._closing_factor()
        if factor > MAX_FACTOR:
            return np.inf, np.zeros(len(self.roughness))
        trial = factor + TRIAL_MARGIN * (1 + factor)
        if self.held(trial) > MIN_HELD:
            return factor, shares
        return self._bisected(trial)  # contacts can press against each other at `factor`, but do not balance the load

    def held(self, factor: float) -> float:
        """Return the largest balanced load, as a multiple s of the load, for normal forces with the sum 1 - s."""
        program = _Program(self, factor)
        program.add(program.wrenches, clarabel.ZeroConeT(len(self.load)))
        x, _ = program.solve(-program.load)
        return float(x @ program.load)

    def _bisected(self, low: float) -> tuple[float, np.ndarray]:
        """Return the smallest factor above `low` at which the load is balanced, and the shares, like `critical_factor`."""
        high = MAX_FACTOR
        if self.held(high) <= MIN_HELD:
            return np.inf, np.zeros(len(self.roughness))
        for _ in range(BISECTIONS):
            midpoint = (low * high) ** 0.5
            low, high = (low, midpoint) if self.held(midpoint) > MIN_HELD else (midpoint, high)
        return high, self._nearest(high)[2]

    def _closing_factor(self) -> tuple[float, np.ndarray]:
        """Return the smallest factor at which the hull contains the origin, and the shares (point,) of the normal forces."""
        factor = 0.0
        for _ in range(MAX_TRIALS):
            distance, y, shares = self._nearest(factor)
            bound = self._excluded(y) if distance > SEPARATION else 0.0
            if bound <= factor:
                break
            factor = bound
            if factor > MAX_FACTOR:
                break
        return factor, shares

    def _excluded(self, y: np.ndarray) -> float:
        """Return the factor below which a motion y (row,) proves that the load is not balanced."""
        closing, sliding = self.normals.T @ y, self.roughness * np.hypot(*(tangents.T @ y for tangents in self.tangents))
        factors = np.divide(closing, sliding, out=np.full(len(sliding), np.inf), where=sliding > 0)
        return float(factors.min(initial=np.inf)) if self.load @ y > 0 else 0.0

    def _nearest(self, factor: float) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the distance of the hull from the origin, the separating motion y (row,), and the shares (point,)."""
        program = _Program(self, factor)
        program.add(-np.vstack([program.distance, program.wrenches]), clarabel.SecondOrderConeT(1 + len(self.load)))
        x, dual = program.solve(program.distance)
        return float(x @ program.distance), -dual[1:], x[: len(self.roughness)]


class _Program:
    """A second-order cone program with the unknowns N_i, t_i of contact points with friction, s, and a distance.

    wrenches        (row, column): the sum of all wrenches
    load, distance  (column,): unit vectors of s, and of the distance
    """

    def __init__(self, cones: ForceCones, factor: float) -> None:
        points, rough = len(cones.roughness), np.flatnonzero(factor * cones.roughness > 0)  # indices of points with friction
        count = points + 2 * len(rough) + 2
        self.load, self.distance = np.eye(1, count, count - 2)[0], np.eye(1, count, count - 1)[0]
        self.wrenches = np.zeros((len(cones.load), count))
        self.wrenches[:, :-1] = np.column_stack([cones.normals, *cones.tangents[:, :, rough], cones.load])
        normals = np.append(np.arange(points), [count - 2, count - 1])
        self._matrices = [sparse.csc_matrix(np.where(np.arange(count) < points, 1.0, self.load))]
        self._cones: list[Any] = [clarabel.ZeroConeT(1)]
        self.add(_entries(-np.ones(len(normals)), normals, count), clarabel.NonnegativeConeT(len(normals)))
        # The three rows of a cone: its radius, and both components of its friction force.
        columns = np.column_stack([rough, points + np.arange(len(rough)), points + len(rough) + np.arange(len(rough))])
        values = np.column_stack([factor * cones.roughness[rough], np.ones((len(rough), 2))])
        self.add(_entries(-values.ravel(), columns.ravel(), count), *[clarabel.SecondOrderConeT(3)] * len(rough))

    def add(self, matrix: Any, *cones: Any) -> None:
        """Add the constraint that -matrix @ x lies in a product of cones."""
        self._matrices.append(sparse.csc_matrix(matrix))
        self._cones += cones

    def solve(self, cost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x (column,) with minimal cost (column,), and the multipliers of the last added rows."""
        A = sparse.csc_matrix(sparse.vstack(self._matrices))
        b = np.zeros(A.shape[0])
        b[0] = 1.0
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
        no_quadratic = sparse.csc_matrix((len(cost), len(cost)))
        solution = clarabel.DefaultSolver(no_quadratic, cost, A, b, self._cones, settings).solve()
        return np.array(solution.x), np.array(solution.z)[A.shape[0] - self._matrices[-1].shape[0] :]


def _entries(values: np.ndarray, columns: np.ndarray, count: int) -> sparse.csc_matrix:
    """Return a matrix (row, count) with one entry in each row."""
    return sparse.csc_matrix((values, (np.arange(len(values)), columns)), shape=(len(values), count))
