"""The true contact problem, written a second time and handed to an interior-point solver (ipopt).

All candidate points have their true gap as a constraint, displacements are those of rigid motions, and nothing is
linearized. Objectives are summed point by point. Nothing comes from tolcontact but where parts, points and locators are
nominally. Free parts that stand on other free parts are not covered.
"""

import casadi as ca
import numpy as np
from scipy.optimize import nnls

YIELD, BALL, ETA = 1e-3, 0.01, 1e-6


class TrueProblem:
    """Least motion, springs or seating of one model, to be solved for one realization at a time."""

    def __init__(self, nominal, objective: str) -> None:
        touching = {p for pair in nominal.pairs for p in (pair.moving, pair.reference)}
        self.nominal, self.objective = nominal, objective
        self.free = [k for k, part in enumerate(nominal.parts) if part.free and k in touching]
        every = np.vstack([pair.P_m for pair in nominal.pairs])
        self.centre, self.length = every.mean(axis=0), np.linalg.norm(every.std(axis=0))
        parts = len(nominal.parts)
        raw, new = ca.SX.sym("raw", 12, parts), ca.SX.sym("new", 12, parts)
        deviations = ca.SX.sym("deviations", len(nominal.locators.labels))
        weights = [ca.SX.sym(f"w{k}", 1, len(pair.P_m)) for k, pair in enumerate(nominal.pairs)]
        gaps = ca.vertcat(*(self._gaps(pair, new, deviations) for pair in nominal.pairs))
        springs, stiffness, elongations = self._locators(raw, new, deviations)
        motion, held, count, points = self._motion(raw, new, weights)
        if objective == "locator stiffness":
            energy = springs / stiffness + ETA * held / points
        elif objective == "seating":
            work, forces = self._work(raw, new)
            energy = YIELD * held / points / self.length - work / forces
        else:
            energy = (motion + ETA * held) / ca.fmax(count, 1)
        fixed = elongations if objective == "seating" else []
        constraints = ca.vertcat(gaps, *fixed)
        self.lower = np.zeros(constraints.numel())
        self.upper = np.concatenate([np.full(gaps.numel(), np.inf), np.zeros(len(fixed))])
        inputs = [raw, new, deviations, *weights]
        self.energy, self.gaps = ca.Function("energy", inputs, [energy]), ca.Function("gaps", inputs, [gaps])

        z = ca.SX.sym("z", 6 * len(self.free))
        from_raw, from_new = (ca.horzcat(*self._moved(start, z)) for start in (raw, new))
        about = [ca.substitute(each, new, from_new) for each in (energy, constraints)]
        slopes = [ca.substitute(ca.jacobian(each, z), z, ca.SX.zeros(z.shape)) for each in about]
        self.slopes = ca.Function("slopes", inputs, slopes)
        problem = {"x": z, "p": ca.vertcat(ca.vec(raw), deviations, *(w.T for w in weights))}
        problem["f"], problem["g"] = (ca.substitute(each, new, from_raw) for each in (energy, constraints))
        quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
        exact = {"ipopt.tol": 1e-11, "ipopt.bound_relax_factor": 0.0, "ipopt.constr_viol_tol": 1e-10, "ipopt.max_iter": 500}
        self.solver = ca.nlpsol("true", "ipopt", problem, {**quiet, **exact})

    def _gaps(self, pair, new, deviations):
        """Paper (2) to (5), and for supports the distance from their tip."""
        x_m = at(new, pair.moving, pair.P_m)
        if pair.reference is None:
            x_r, n = ca.DM(pair.P_r.T), ca.DM(pair.n_r.T)
        else:
            x_r, n = at(new, pair.reference, pair.P_r), turned(new, pair.reference) @ ca.DM(pair.n_r.T)
        gap = ca.sum1((x_m - x_r) * n).T
        return gap - ca.DM(pair.offsets.matrix.T) @ deviations[pair.offsets.columns.tolist()] if pair.is_supports else gap

    def _motion(self, raw, new, weights):
        """1/2 sum of squared displacements: of the points that count, and of all points as small balls; their numbers."""
        motion, held, count, points = 0, 0, 0, 0
        for pair, weight in zip(self.nominal.pairs, weights, strict=True):
            counts_faces = self.objective == "all points" and pair.samples_faces
            regions = (pair.moving_region, pair.reference_region) if counts_faces else (None, None)
            for part, P, region in zip((pair.moving, pair.reference), (pair.P_m, pair.P_r), regions, strict=True):
                if part in self.free:
                    squares = ca.sum1((at(new, part, P) - at(raw, part, P)) ** 2)
                    if region is None:
                        motion += ca.dot(weight, squares) / 2
                        count += ca.sum2(weight)
                    else:  # the faces count, by their areas
                        moved = ca.sum1((at(new, part, region.places) - at(raw, part, region.places)) ** 2)
                        motion += ca.dot(ca.DM(region.shares[None]), moved) / 2
                        count += region.area
                    turn = ca.sumsqr(turned(new, part) - turned(raw, part))
                    held += ca.dot(ca.DM(pair.weights[None]), squares) / 2 + len(P) * (BALL * self.length) ** 2 * turn / 2
                    points += len(P)
        return motion, held, count, points

    def _locators(self, raw, new, deviations):
        """Energy of the two-sided locators as springs, their total stiffness, and their elongations from the deviation."""
        labels = np.cumsum([0, *(len(part.locators) for part in self.nominal.parts)])
        springs, stiffness, elongations = 0, 0, []
        for part in self.free:
            own = self.nominal.parts[part]
            for k in np.flatnonzero(~own.locators.one_sided):
                a, b = own.locators.points[[k]], ca.DM(own.locators.directions[k])
                springs += own.locators.stiffness[k] * ca.dot(b, at(new, part, a) - at(raw, part, a)) ** 2 / 2
                stiffness += own.locators.stiffness[k]
                elongations.append(ca.dot(b, at(new, part, a) - ca.DM(a.T)) - deviations[int(labels[part] + k)])
        return springs, stiffness, elongations

    def _work(self, raw, new):
        work, forces = 0, 0
        for force in self.nominal.assembly.forces:
            part = self.nominal.part_index(force.at.part)
            if part in self.free:
                P = np.asarray(self.nominal.position(force.at))[None]
                work += ca.dot(ca.DM(np.array(force.vector)), at(new, part, P) - at(raw, part, P))
                forces += np.linalg.norm(force.vector)
        return work, forces

    def _moved(self, start, z):
        moved = [start[:, part] for part in range(len(self.nominal.parts))]
        for k, part in enumerate(self.free):
            d, w = z[6 * k : 6 * k + 3], z[6 * k + 3 : 6 * k + 6] / self.length
            K = ca.skew(w)
            turn = ca.SX.eye(3) + (4 * K + 2 * K @ K) / (4 + ca.sumsqr(w))  # Cayley: a rotation for any w
            c = ca.DM(self.centre)
            moved[part] = ca.vertcat(ca.vec((turn @ turned(start, part)).T), c + d + turn @ (start[9:, part] - c))
        return moved

    def weights(self, raw, deviations):
        """How much the points (point,) of each pair count in the objective: by the areas that they stand for."""
        pairs = self.nominal.pairs
        every = [pair.weights for pair in pairs]
        raw_gaps = np.array(self.gaps(raw.T, raw.T, deviations, *(w[None] for w in every))).ravel()
        split = np.split(raw_gaps, np.cumsum([len(pair.P_m) for pair in pairs])[:-1])
        if self.objective != "active points":
            return every
        return [
            np.where(gap < 1e-9, pair.weights, 0.0) * (not pair.is_supports) for gap, pair in zip(split, pairs, strict=True)
        ]

    def solve(self, raw, deviations, weights) -> tuple[float, bool]:
        """Least energy from the raw poses (part, 12), and whether ipopt is content."""
        p = np.concatenate([raw.ravel(), deviations, *weights])
        answer = self.solver(x0=np.zeros(6 * len(self.free)), p=p, lbg=self.lower, ubg=self.upper)
        return float(answer["f"]), bool(self.solver.stats()["success"])

    def judge(self, raw, poses, deviations, weights) -> tuple[float, float, float]:
        """Energy [mm^2], least gap [mm] and KKT residual [mm] of poses (part, 12), its multipliers found by least squares."""
        inputs = [raw.T, poses.T, deviations, *(w[None] for w in weights)]
        gaps = np.array(self.gaps(*inputs)).ravel()
        by_energy, by_gaps = (np.array(slope) for slope in self.slopes(*inputs))
        carrying = np.concatenate([gaps < 1e-7, np.ones(len(by_gaps) - len(gaps), dtype=bool)])
        columns = by_gaps[carrying].T
        both = np.hstack([columns, -by_gaps[len(gaps) :].T])  # equalities may pull, too
        residual = nnls(both, by_energy.ravel())[1] if both.size else np.linalg.norm(by_energy)
        return float(self.energy(*inputs)), float(gaps.min()), float(residual)


def turned(poses, part):
    return ca.reshape(poses[:9, part], 3, 3).T


def at(poses, part, points):
    return turned(poses, part) @ ca.DM(points.T) + ca.repmat(poses[9:, part], 1, len(points))
