"""The true contact problem, written a second time and handed to an interior-point solver (ipopt).

All candidate points have their true gap as a constraint, displacements are those of rigid motions, and nothing is
linearized. Objectives are summed point by point. Nothing comes from tolcontact but where parts, points and locators are
nominally. Free parts that stand on other free parts are not covered.
"""

import casadi as ca
import numpy as np

YIELD, BALL, ETA = 1e-3, 0.01, 1e-6


def columns(values: ca.SX, points: np.ndarray) -> ca.SX:
    return ca.repmat(values, 1, len(points))


class TrueProblem:
    """Least motion, springs or seating of one model, to be solved for one realization at a time."""

    def __init__(self, nominal, objective: str) -> None:
        touching = {p for pair in nominal.pairs for p in (pair.moving, pair.reference)}
        self.free = [k for k, part in enumerate(nominal.parts) if part.free and k in touching]
        every = np.vstack([pair.P_m for pair in nominal.pairs])
        self.centre, self.length = every.mean(axis=0), every.std(axis=0) @ every.std(axis=0)
        self.length = np.sqrt(self.length)
        count = len(nominal.parts)
        raw, new = ca.SX.sym("raw", 12, count), ca.SX.sym("new", 12, count)
        deviations = ca.SX.sym("deviations", len(nominal.locator_labels))
        weights = [ca.SX.sym(f"w{k}", 1, len(pair.P_m)) for k, pair in enumerate(nominal.pairs)]

        def at(poses, part, points):
            R, t = ca.reshape(poses[:9, part], 3, 3).T, poses[9:, part]
            return R @ ca.DM(points.T) + columns(t, points)

        def turned(poses, part):
            return ca.reshape(poses[:9, part], 3, 3).T

        gaps, motion, held, total, points = [], 0, 0, 0, 0
        for pair, weight in zip(nominal.pairs, weights, strict=True):
            x_m = at(new, pair.moving, pair.P_m)
            if pair.reference is None:
                x_r, n = ca.DM(pair.P_r.T), ca.DM(pair.n_r.T)
            else:
                x_r, n = at(new, pair.reference, pair.P_r), turned(new, pair.reference) @ ca.DM(pair.n_r.T)
            gap = ca.sum1((x_m - x_r) * n).T
            if pair.locators is not None:
                gap -= ca.vertcat(*(deviations[int(k)] for k in pair.locators))
            gaps.append(gap)
            for part, P in ((pair.moving, pair.P_m), (pair.reference, pair.P_r)):
                if part not in self.free:
                    continue
                squares = ca.sum1((at(new, part, P) - at(raw, part, P)) ** 2)
                motion += ca.dot(weight, squares) / 2
                total += ca.sum2(weight)
                turn = ca.sumsqr(turned(new, part) - turned(raw, part))
                held += ca.sum2(squares) / 2 + len(P) * (BALL * self.length) ** 2 * turn / 2
                points += len(P)
        labels = np.cumsum([0, *(len(part.labels) for part in nominal.parts)])
        springs, stiffness, fixed = 0, 0, []
        for part in self.free:
            own = nominal.parts[part]
            for k in np.flatnonzero(~own.one_sided):
                a, b = own.locator_points[[k]], ca.DM(own.locator_directions[k])
                springs += own.stiffness[k] * ca.dot(b, at(new, part, a) - at(raw, part, a)) ** 2 / 2
                stiffness += own.stiffness[k]
                fixed.append(ca.dot(b, at(new, part, a) - ca.DM(a.T)) - deviations[int(labels[part] + k)])
        work, forces = 0, 0
        for force in nominal.assembly.forces:
            part = nominal.part_index(force.at.part)
            if part in self.free:
                P = np.asarray(nominal.place(force.at))[None]
                work += ca.dot(ca.DM(np.array(force.vector)), at(new, part, P) - at(raw, part, P))
                forces += np.linalg.norm(force.vector)
        if objective == "locator stiffness":
            energy = springs / stiffness + ETA * held / points
        elif objective == "seating":
            energy = YIELD * held / points / self.length - work / forces
        else:
            energy = (motion + ETA * held) / ca.fmax(total, 1)
        fixed = fixed if objective == "seating" else []
        inputs = [raw, new, deviations, *weights]
        self.energy = ca.Function("energy", inputs, [energy])
        self.gaps = ca.Function("gaps", inputs, [ca.vertcat(*gaps)])

        z = ca.SX.sym("z", 6 * len(self.free))
        moved = [raw[:, part] for part in range(count)]
        for k, part in enumerate(self.free):
            d, w = z[6 * k : 6 * k + 3], z[6 * k + 3 : 6 * k + 6] / self.length
            K = ca.skew(w)
            turn = ca.SX.eye(3) + (4 * K + 2 * K @ K) / (4 + ca.sumsqr(w))  # Cayley: a rotation for any w
            R, t = turned(raw, part), raw[9:, part]
            c = ca.DM(self.centre)
            moved[part] = ca.vertcat(ca.vec((turn @ R).T), c + d + turn @ (t - c))
        constraints = ca.substitute(ca.vertcat(*gaps, *fixed), new, ca.horzcat(*moved))
        self.lower = np.zeros(constraints.numel())
        self.upper = np.concatenate([np.full(constraints.numel() - len(fixed), np.inf), np.zeros(len(fixed))])
        parameters = ca.vertcat(ca.vec(raw), deviations, *(w.T for w in weights))
        quiet = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
        exact = {"ipopt.tol": 1e-11, "ipopt.bound_relax_factor": 0.0, "ipopt.constr_viol_tol": 1e-10, "ipopt.max_iter": 500}
        self.solver = ca.nlpsol(
            "true", "ipopt", {"x": z, "f": ca.substitute(energy, new, ca.horzcat(*moved)), "g": constraints, "p": parameters},
            {**quiet, **exact},
        )  # fmt: skip

    def solve(self, raw, deviations, weights) -> tuple[float, bool]:
        """Least energy from the raw pose, and whether ipopt is content; raw (part, 12), weights (point,) of each pair."""
        p = np.concatenate([raw.ravel(), deviations, *weights])
        answer = self.solver(x0=np.zeros(6 * len(self.free)), p=p, lbg=self.lower, ubg=self.upper)
        return float(answer["f"]), bool(self.solver.stats()["success"])

    def judge(self, raw, poses, deviations, weights) -> tuple[float, float]:
        """Energy and least gap [mm] of poses (part, 12)."""
        inputs = [raw.T, poses.T, deviations, *(w[None] for w in weights)]
        return float(self.energy(*inputs)), float(ca.mmin(self.gaps(*inputs)))
