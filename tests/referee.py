"""The contact problem of the paper, written a second time and solved by another library.

Plain NumPy and Clarabel: every contact point has a row, rows and Q are built point by point from paper (5) to (11)
by hand-derived formulae, nothing comes from tolcontact's symbols. Increments are world displacements (dt, w), x moving by
dt + w x (x - c).
"""

import clarabel
import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from studies.certificates.judge import as_archived, faces


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def solve(nominal, R, t, *, eta=1e-6, regularization="points", rows="closed", activity=1e-9):
    """Corrected (R, t) of all parts, and the objective, for raw R (part, 3, 3), t (part, 3).

    Free parts that stand on other free parts are not covered.
    """
    free = [k for k, part in enumerate(nominal.parts) if part.free and any(k in (p.moving, p.reference) for p in nominal.pairs)]
    position = {part: 6 * k for k, part in enumerate(free)}
    every = np.vstack([pair.P_m for pair in nominal.pairs])
    centre, length = every.mean(axis=0), every.std()
    scale = np.array([1, 1, 1, 1 / length, 1 / length, 1 / length])
    radius = 0.01 * np.sqrt(((every - centre) ** 2).sum(axis=1).mean())  # of the ball that a contact point stands for

    def displacement(part, x):
        B = np.zeros((3, 6 * len(free)))
        if part in position:
            B[:, position[part] : position[part] + 6] = np.hstack([np.eye(3), -cross(x - centre)]) * scale
        return B

    Q, reg, A, b, active_points = 0.0, 0.0, [], [], 0
    for pair in nominal.pairs:
        Rm, Rr = R[pair.moving], R[pair.reference]
        for P_m, P_r, n_r in zip(pair.P_m, pair.P_r, pair.n_r, strict=True):
            x_m, x_r, n = Rm @ P_m + t[pair.moving], Rr @ P_r + t[pair.reference], Rr @ n_r
            gap = n @ (x_m - x_r)
            B_m, B_r = displacement(pair.moving, x_m), displacement(pair.reference, x_r)
            row = n @ (B_m - B_r)
            if pair.reference in position:  # the normal turns with its part: (w x n)'(x_m - x_r)
                k = position[pair.reference]
                row[k + 3 : k + 6] += np.cross(n, x_m - x_r) * scale[3:]
            for part, B in ((pair.moving, B_m), (pair.reference, B_r)):
                if part in position:
                    active_points += gap < activity
                    Q = Q + B.T @ B * (gap < activity)
                    W = np.zeros((3, 6 * len(free)))
                    W[:, position[part] + 3 : position[part] + 6] = np.eye(3) / length
                    reg = reg + eta * (B.T @ B + 2 * radius**2 * W.T @ W)
            if rows == "closed" or gap < activity:
                A.append(row)
                b.append(gap)
    if regularization == "identity":
        reg = np.zeros_like(Q)
        for part in free:
            D = displacement(part, t[part])  # the paper's dt is the displacement of the part's own origin
            W = np.zeros((3, 6 * len(free)))
            W[:, position[part] + 3 : position[part] + 6] = np.eye(3) / length
            reg += eta * (D.T @ D + W.T @ W)
    if not active_points:
        return R.copy(), t.copy(), 0.0
    Q = (Q + reg) / active_points
    U = np.linalg.cholesky(Q).T
    A = np.linalg.solve(U.T, np.array(A).T).T
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    solver = clarabel.DefaultSolver(
        sparse.eye(len(U), format="csc"), np.zeros(len(U)), sparse.csc_matrix(-A), np.array(b),
        [clarabel.NonnegativeConeT(len(b))], settings,
    )  # fmt: skip
    answer = solver.solve()
    y = _polished(A, np.array(b), np.array(answer.x), np.array(answer.z), np.array(answer.s))
    z = np.linalg.solve(U, y) * np.tile(scale, len(free))
    R_new, t_new = R.copy(), t.copy()
    references = {pair.reference for pair in nominal.pairs}
    for part in free:
        dt, w = z[position[part] : position[part] + 3], z[position[part] + 3 : position[part] + 6]
        own = np.mean([p for pair in nominal.pairs for k, P in ((pair.moving, pair.P_m), (pair.reference, pair.P_r))
                       if k == part for p in P], axis=0)  # fmt: skip
        c = R[part] @ own + t[part]
        d = dt + np.cross(w, c - centre)
        turn = Rotation.from_rotvec(w).as_matrix() if part in references else np.eye(3) + cross(w)
        R_new[part], t_new[part] = turn @ R[part], turn @ (t[part] - c) + c + d
    return R_new, t_new, 0.5 * y @ y


def _polished(A, b, y, multipliers, slacks):
    """min |y|^2 on the rows that carry, which an interior-point method only approaches; it must satisfy all others."""
    carrying = multipliers > slacks
    exact = np.linalg.pinv(A[carrying], rcond=1e-12) @ -b[carrying] if carrying.any() else np.zeros_like(y)
    assert (A @ exact + b).min() > -1e-9, "the referee failed: penetration"
    assert exact @ exact <= y @ y + 1e-7, "the referee failed: not the least motion"
    return exact


def gaps(pair, R, t, deviations=None):
    """True gaps (point,) by paper (2) to (5), with R (part, 3, 3), t (part, 3); of round faces those of any pose.

    With deviations (contributor,) faces of features are displaced in their parts, and lie farther out.
    """
    drawn = None if deviations is None else np.atleast_2d(deviations)
    (R_m, t_m, h_m), (R_r, t_r, h_r) = ((each[0] for each in side) for side in faces(pair, R[None], t[None], drawn))
    if not pair.samples_faces:
        return np.array([p.gaps(R_r.T @ R_m, R_r.T @ (t_m - t_r), h_m, h_r) for p in as_archived(pair.round)])
    n = pair.n_r @ R_r.T
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    apart = pair.P_m @ R_m.T + t_m - pair.P_r @ R_r.T - t_r
    return (apart * n).sum(axis=1) - h_m * pair.facing - h_r
