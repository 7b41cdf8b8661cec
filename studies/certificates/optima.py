"""Look for better poses than resolved ones, which would show that contact was not resolved with the least motion.

For each resolved realization, an interior-point solver (ipopt) looks for a pose with less displacement of the contact points.
Bodies are unions of convex pieces; two pieces are apart if a plane lies between them, and each plane is four unknowns of the
problem. One search starts at the resolved pose, others at random ones. Nothing is shared with the simulation but the points and
weights that define the objective "all points".
"""

import argparse
import collections
import json
import sys
import time
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.ends import RANGE, Convex, scene, separation
from tolcontact.vocabulary import CORRECTED, RAW, Status

BETTER = 1e-3  # share of the objective
LEAST = 1e-8  # mm^2 of the objective: 0.1 um
NEAR = RANGE / 10  # mm between two poses, at any corner of the body
FEASIBLE = 1e-7  # mm of penetration that the found pose may have
SPREAD = 0.05, 0.5  # rad and mm of random starts


class Search:
    """Poses of one body that stays outside of a fixed one, as near to a raw pose as can be."""

    def __init__(self, moving: list[Convex], fixed: list[Convex], points: np.ndarray, weights: np.ndarray) -> None:
        self.moving, self.fixed, self.points = moving, fixed, points
        self.weights = weights / weights.sum()
        self.pairs = [(a, b) for a in moving for b in fixed]
        z, raw = ca.SX.sym("z", 6 + 4 * len(self.pairs)), ca.SX.sym("raw", 12)
        start = ca.SX.sym("start", 12)
        self.size = float(np.abs(points - points.mean(axis=0)).max())
        R, t = self._pose(z, start)
        moved = R @ points.T + t - (ca.reshape(raw[:9], 3, 3).T @ points.T + raw[9:])
        energy = ca.dot(ca.DM(self.weights), ca.sum1(moved**2).T) / 2
        rows, self.lower, self.upper = [], [], []
        for k, (a, b) in enumerate(self.pairs):
            n, c = z[6 + 4 * k : 9 + 4 * k], z[9 + 4 * k]
            rows += [(R @ a.corners.T + t).T @ n - c, c - ca.DM(b.corners) @ n, ca.sumsqr(n)]
            count = len(a.corners) + len(b.corners)
            self.lower += [0.0] * count + [1.0]
            self.upper += [np.inf] * count + [1.0]
        quiet: dict[str, Any] = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 300}
        exact: dict[str, Any] = {"ipopt.tol": 1e-10, "ipopt.bound_relax_factor": 0.0, "ipopt.constr_viol_tol": 1e-10}
        warm: dict[str, Any] = {"ipopt.mu_init": 1e-4, "ipopt.mu_strategy": "adaptive"}
        of = {"x": z, "p": ca.vertcat(raw, start), "f": energy, "g": ca.vertcat(*rows)}
        self.solver = ca.nlpsol("least_motion", "ipopt", of, {**quiet, **exact, **warm})

    def _pose(self, z, start):
        w = z[3:6] / self.size
        K = ca.skew(w)
        turn = ca.SX.eye(3) + (4 * K + 2 * K @ K) / (4 + ca.sumsqr(w))  # Cayley: a rotation for any w
        return turn @ ca.reshape(start[:9], 3, 3).T, start[9:] + z[:3]

    def energy(self, raw, R, t) -> float:
        """Return half the mean squared displacement [mm^2] of the contact points from the raw pose (R, t)."""
        moved = self.points @ (R - raw[0]).T + t - raw[1]
        return float(self.weights @ (moved**2).sum(axis=1) / 2)

    def distance(self, R, t) -> float:
        """Return the signed distance [mm] from the fixed body."""
        return min(separation(a, b, R, t) for a, b in self.pairs)

    def least(self, raw, start) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Return energy and pose that a search from `start` comes to, if it keeps outside of the fixed body."""
        z = np.concatenate([np.zeros(6), *(plane(a.corners @ start[0].T + start[1], b.corners) for a, b in self.pairs)])
        p = np.concatenate([raw[0].ravel(), raw[1], start[0].ravel(), start[1]])
        answer = np.asarray(self.solver(x0=z, p=p, lbg=self.lower, ubg=self.upper)["x"]).ravel()
        R, t = (np.asarray(ca.DM(each)) for each in self._pose(ca.DM(answer), ca.DM(p[12:])))
        t = t.ravel()
        return (self.energy(raw, R, t), R, t) if self.distance(R, t) > -FEASIBLE else None


def plane(above, below) -> np.ndarray:
    """Return normal and offset (4,) of a plane between two sets of corners (v, 3), with most room or least overlap."""
    centre, best = below.mean(axis=0), None
    guess = above.mean(axis=0) - centre
    for _ in range(20):  # a linear program at a time: the normal has the length 1 along the last one
        guess = guess / np.linalg.norm(guess)
        sides = (-(above - centre), 1.0), (below - centre, -1.0)
        A = np.vstack([np.column_stack([side, np.full(len(side), sense), np.ones(len(side))]) for side, sense in sides])
        along = {"A_eq": [[*guess, 0, 0]], "b_eq": [1]}
        found = linprog([0, 0, 0, 0, -1], A_ub=A, b_ub=np.zeros(len(A)), bounds=[(None, None)] * 5, **along)
        if found.status != 0 or (best is not None and np.allclose(found.x[:3] / np.linalg.norm(found.x[:3]), guess)):
            break
        guess = best = found.x[:3]
    n = guess / np.linalg.norm(guess)
    return np.array([*n, ((above @ n).min() + (below @ n).max()) / 2])


def judged(assembly, bodies, *, samples: int, seed: int, solver: str = "daqp", starts: int = 4) -> list[dict]:
    """Return what the searches found for each resolved realization: objectives, and how far the better pose is away."""
    program = tc.build(assembly, solver=solver)
    run = tc.run(program, samples=samples, seed=seed, fields="none", surfaces=0)
    R, t, status = run.rotation.values, run.translation.values, run.status.values
    convex, rng, found = [[Convex(points) for points in pieces] for pieces in bodies], np.random.default_rng(seed), []
    for pair in program.nominal.pairs:
        search = Search(convex[pair.moving], convex[0], pair.P_m, pair.weights)
        for k in np.flatnonzero(status == Status.RESOLVED):
            raw, ours = ((R[k, state, pair.moving], t[k, state, pair.moving]) for state in (RAW, CORRECTED))
            if search.distance(*raw) > -FEASIBLE:
                continue
            own = search.energy(raw, *ours)
            near = search.least(raw, ours)
            others = [search.least(raw, at_random(rng, ours)) for _ in range(starts)]
            best = min((each for each in (near, *others) if each is not None), key=lambda each: each[0], default=None)
            again = sum(each is not None and abs(each[0] - own) <= BETTER * own + LEAST for each in others)
            row = {"seed": seed, "realization": int(k), "pair": pair.name, "ours": own, "found again": again}
            found.append(row | compared(own, ours, near, best, search))
    return found


def at_random(rng, pose):
    turn, shift = SPREAD
    return Rotation.from_rotvec(rng.normal(size=3) * turn).as_matrix() @ pose[0], pose[1] + rng.normal(size=3) * shift


def compared(own, ours, near, best, search) -> dict:
    """Return the least objectives found from the resolved pose and from anywhere, and the way [mm] there."""
    found: dict[str, Any] = {}
    for name, other in (("near", near), ("best", best)):
        is_better = other is not None and other[0] < own * (1 - BETTER) - LEAST
        way = np.linalg.norm(search.points @ (other[1] - ours[0]).T + other[2] - ours[1], axis=1).max() if other else 0.0
        found |= {name: other[0] if other else None, f"{name} is better": is_better, f"way to {name}": float(way)}
    return found


def main() -> int:
    """Judge scenes; return 1 if a better pose is near a resolved one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--samples", type=int, default=5)
    parser.add_argument("--starts", type=int, default=4, help="random ones, of each realization")
    parser.add_argument("--solver", default="daqp")
    options = parser.parse_args()
    counts: collections.Counter = collections.Counter()
    began = time.perf_counter()
    for seed in range(options.first, options.first + options.scenes):
        try:
            assembly, bodies = scene(seed)
            rows = judged(assembly, bodies, samples=options.samples, seed=seed, solver=options.solver, starts=options.starts)
        except tc.ModelError as error:
            counts["refused"] += 1
            print(f"scene {seed} is refused: {str(error).splitlines()[-1][:100]}")
            continue
        for row in rows:
            where = (
                "near" if row["near is better"] and row["way to near"] < NEAR else "far" if row["best is better"] else "none"
            )
            counts["resolved"] += 1
            counts["found again from a random start"] += row["found again"]
            counts[f"better pose: {where}"] += 1
            if where == "near":
                print(json.dumps(row), flush=True)
    print(dict(counts), f"{time.perf_counter() - began:.0f} s")
    return int(counts["better pose: near"] > 0)


if __name__ == "__main__":
    sys.exit(main())
