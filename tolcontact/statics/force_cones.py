"""Balance of a load by forces within friction cones, as second-order cone programs for Clarabel.

The force of contact point i is N_i n_i + t_i with N_i >= 0, t_i across n_i, |t_i| <= k m_i N_i, and its wrench W_i (N_i, t_i).
A load w can be balanced if  sum W_i (N_i, t_i) + s w = 0  for some s > 0, scaled by sum N_i + s = 1. The largest s decides: if
friction k balances the load, any larger one does, and the critical factor is found by bisection.
"""

from dataclasses import dataclass

import clarabel
import numpy as np
import scipy
from scipy import sparse

from tolcontact.arrays import Array, Float

ACCURACY = 1e-12  # of the solver
SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
MIN_HELD = 1e-6  # of the sum of all normal forces: a smaller balanced load is rounding
MIN_FACTOR, MAX_FACTOR = 1e-6, 1e3  # of friction: smaller factors are 0, and larger ones do not exist
BISECTIONS = 40
MAX_FORCE = 1e3  # times the sum of all forces: bounds the forces of contacts that press against each other


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
        for factor in (0.0, MIN_FACTOR):
            if self.held(factor) > MIN_HELD:
                return 0.0, self._balanced(factor)[1]
        low, high = MIN_FACTOR, MAX_FACTOR
        if self.held(high) <= MIN_HELD:
            return np.inf, np.zeros(len(self.roughness))
        for _ in range(BISECTIONS):
            midpoint = (low * high) ** 0.5
            low, high = (low, midpoint) if self.held(midpoint) > MIN_HELD else (midpoint, high)
        return high, self._balanced(high)[1]

    def held(self, factor: float) -> float:
        """Return the largest balanced load, as a multiple s of the load, for normal forces with the sum 1 - s; 0 for none."""
        return self._balanced(factor)[0]

    def may_be_loaded(self, point: int) -> bool:
        """Return whether a point is under load in any balance of the forces without friction."""
        cost = -np.eye(1, len(self.roughness), point)[0]
        found = scipy.optimize.linprog(cost, A_eq=self.normals, b_eq=-self.load, bounds=(0, MAX_FORCE))
        return bool(found.status == 0 and -found.fun > MIN_HELD)

    def _balanced(self, factor: float) -> tuple[float, np.ndarray]:
        """Return the largest s, and the normal forces (point,) there; zeros if no forces balance each other or the load."""
        points, rough = len(self.roughness), np.flatnonzero(factor * self.roughness > 0)  # indices of points with friction
        count = points + 2 * len(rough) + 1  # N_i, t_i and s
        wrenches = np.column_stack([self.normals, *self.tangents[:, :, rough], self.load])
        total = np.where((np.arange(count) < points) | (np.arange(count) == count - 1), 1.0, 0.0)
        # The three rows of a cone: its radius, and both components of its friction force.
        columns = np.column_stack([rough, points + np.arange(len(rough)), points + len(rough) + np.arange(len(rough))])
        values = np.column_stack([factor * self.roughness[rough], np.ones((len(rough), 2))])
        positive = np.flatnonzero(total)
        A = sparse.csc_matrix(
            sparse.vstack([
                total[None], wrenches, _entries(-np.ones(len(positive)), positive, count),
                _entries(-values.ravel(), columns.ravel(), count),
            ])
        )  # fmt: skip
        cones = [clarabel.ZeroConeT(1 + len(self.load)), clarabel.NonnegativeConeT(len(positive))]
        cones += [clarabel.SecondOrderConeT(3)] * len(rough)
        b, cost = np.eye(1, A.shape[0])[0], -np.eye(1, count, count - 1)[0]
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
        solution = clarabel.DefaultSolver(sparse.csc_matrix((count, count)), cost, A, b, cones, settings).solve()
        # The solver fails where no forces balance each other and the load, or nearly none do: the load is not held there.
        if solution.status not in SOLVED:
            return 0.0, np.zeros(points)
        x = np.array(solution.x)
        return float(x[-1]), x[:points]


def _entries(values: np.ndarray, columns: np.ndarray, count: int) -> sparse.csc_matrix:
    """Return a matrix (row, count) with one entry in each row."""
    return sparse.csc_matrix((values, (np.arange(len(values)), columns)), shape=(len(values), count))
