"""The program that a person would write instead: NumPy geometry and a loop over QPs, solved by DAQP through qpsolvers.

One part moves, the other one stays where its locators place it. Geometry is vectorized over blocks of realizations; the loop
holds nothing but rows and solver. The QP starts from the points that are inside, and adds the points that the correction drives
inside until none is left.
"""

import importlib.util

import numpy as np
from scipy.spatial.transform import Rotation

has_qpsolvers = importlib.util.find_spec("qpsolvers") is not None
if has_qpsolvers:
    import qpsolvers
ETA, ACTIVITY = 1e-6, 1e-9
BLOCK = 500


def solve(Q: np.ndarray, A: np.ndarray, b: np.ndarray) -> np.ndarray | None:
    """Minimize x Q x / 2 subject to A x + b >= 0."""
    return qpsolvers.solve_qp(Q, np.zeros(6), -A, b, solver="daqp", primal_tol=1e-11)


class Loop:
    """The pair of a model, as plain arrays."""

    def __init__(self, program) -> None:
        nominal = program.nominal
        (pair, *_), self.pairs = nominal.pairs, nominal.pairs
        self.program, self.moving, self.reference = program, pair.moving, pair.reference
        self.P = np.vstack([p.P_m for p in nominal.pairs])
        self.n = np.vstack([p.n_r for p in nominal.pairs])
        self.c = self.P.mean(axis=0)
        p = self.P - self.c
        self.length = np.sqrt((p**2).sum(axis=1).mean())
        self.table = np.column_stack([np.ones(len(p)), p, *(p[:, i] * p[:, j] for i in range(3) for j in range(3))])
        foot = np.vstack([p.P_r for p in nominal.pairs])
        self.G = np.vstack(
            [(self.n[:, :, None] * self.P[:, None, :]).reshape(len(p), 9).T, self.n.T, -(self.n * foot).sum(axis=1)]
        )
        self.schemes = []  # per part: inverse of the locator matrix about the locators' centroid, and that centroid
        for part in nominal.parts:
            centre = part.locators.points.mean(axis=0) if len(part.locators.points) else np.zeros(3)
            arms = part.locators.points - centre
            rows = [np.r_[n, np.cross(x, n)] for x, n in zip(arms, part.locators.directions, strict=True)]
            self.schemes.append((np.linalg.inv(np.array(rows)) if rows else np.zeros((6, 0)), centre))
        measure = nominal.assembly.measures[0]
        self.at, self.along = nominal.position(measure.of), np.array(measure.along)

    def measure(self, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measures, and where the answer has no penetration left, for deviations (realization, locator)."""
        blocks = [self._block(deviations[k : k + BLOCK]) for k in range(0, len(deviations), BLOCK)]
        return np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])

    def _block(self, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        poses, start = [], 0
        for inverse, centre in self.schemes:
            q = deviations[:, start : start + inverse.shape[1]] @ inverse.T
            start += inverse.shape[1]
            R = Rotation.from_rotvec(q[:, 3:]).as_matrix()
            poses.append((R, q[:, :3] + centre - R @ centre))
        (R_m, t_m), (R_r, t_r) = poses[self.moving], poses[self.reference]
        R = R_r.swapaxes(1, 2) @ R_m
        t = np.einsum("kji,kj->ki", R_r, t_m - t_r)
        X = np.hstack([R.reshape(-1, 9), t, np.ones((len(R), 1))])
        gaps = X @ self.G
        active = gaps < ACTIVITY
        touched = np.flatnonzero((gaps < 0).any(axis=1))
        # Moments of the active points, and eta times those of all, turned into the reference frame.
        M = active[touched].astype(float) @ self.table + ETA * self.table.sum(axis=0)
        count, first = M[:, 0], np.einsum("kij,kj->ki", R[touched], M[:, 1:4])
        second = R[touched] @ M[:, 4:].reshape(-1, 3, 3) @ R[touched].swapaxes(1, 2)
        Q = np.zeros((len(touched), 6, 6))
        Q[:, :3, :3] = count[:, None, None] * np.eye(3)
        Q[:, :3, 3:] = -_skew(first)
        Q[:, 3:, :3] = _skew(first)
        Q[:, 3:, 3:] = np.trace(second, axis1=1, axis2=2)[:, None, None] * np.eye(3) - second
        scale = np.r_[1, 1, 1, np.full(3, 1 / self.length)]
        Q *= scale * scale[:, None] / count[:, None, None]
        x = np.zeros((len(R), 6))
        for k, number in enumerate(touched):
            arm = (self.P - self.c) @ R[number].T
            A = np.hstack([self.n, np.cross(arm, self.n) / self.length])
            found = _closed(Q[k], A, gaps[number], active[number])
            x[number] = np.nan if found is None else found * scale
        centre = np.einsum("kij,j->ki", R, self.c) + t
        turn = np.eye(3) + _skew(x[:, 3:])
        R_new = turn @ R
        t_new = np.einsum("kij,kj->ki", turn, t - centre) + centre + x[:, :3]
        open_ = (np.hstack([R_new.reshape(-1, 9), t_new, np.ones((len(R), 1))]) @ self.G).min(axis=1) > -1e-7
        world = R_r @ R_new, np.einsum("kij,kj->ki", R_r, t_new) + t_r
        return (world[0] @ self.at + world[1] - self.at) @ self.along, open_


def _closed(Q: np.ndarray, A: np.ndarray, gaps: np.ndarray, rows: np.ndarray) -> np.ndarray | None:
    rows = rows.copy()
    while True:
        found = solve(Q, A[rows], gaps[rows])
        if found is None:
            return None
        inside = (gaps + A @ found < -1e-9) & ~rows
        if not inside.any():
            return found
        rows |= inside


def _skew(w: np.ndarray) -> np.ndarray:
    zero = np.zeros(len(w))
    return np.array([[zero, -w[:, 2], w[:, 1]], [w[:, 2], zero, -w[:, 0]], [-w[:, 1], w[:, 0], zero]]).transpose(2, 0, 1)
