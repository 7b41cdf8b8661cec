"""Poses of bodies outside of each other with the least objective, found by an interior-point solver (ipopt).

Bodies are unions of convex pieces; two pieces are apart if a plane lies between them, and each plane is four unknowns of the
problem. Nothing is shared with the simulation but the points, areas, forces and locators that define the objective.
"""

import itertools
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

import tolcontact as tc
from studies.certificates import ends
from studies.certificates.polyhedra import Body, Polyhedron, separation

# Shares of the tolerance range
FEASIBLE = 2e-7  # penetration that a pose may have
CLOSE = 4.0  # distance of pieces that get a plane; others are compared afterwards
MAX_PIECES = 500  # pairs of pieces with a plane
STIFF, ALL, ACTIVE, SEATING = "locator stiffness", "all points", "active points", "seating"
ACTIVE_GAP = 1e-9  # mm
Poses = np.ndarray  # (body, 12)


class Scene(NamedTuple):
    """Bodies in the nominal assembly, of its parts in their order, the pairs of parts that may touch, and the range [mm].

    `deviates` says that faces deviate; bodies are convex then.
    """

    assembly: tc.Assembly
    bodies: list[Body]
    pairs: list[tuple[int, int]]
    range: float
    deviates: bool = False


class Moments(NamedTuple):
    """Of the points of a part that the objective counts: the part, weight, centre (3,) [mm], mean products (3, 3) [mm^2]."""

    part: int
    weight: float
    centre: np.ndarray
    products: np.ndarray


def counted(program: tc.Program, objective: str, raw: Poses) -> list[Moments]:
    """Return the moments of what the objective counts, from the faces or, at raw poses, from active points."""
    found = []
    for pair in program.nominal.pairs:
        assert pair.reference is not None
        regions = [region for region in (pair.moving_region, pair.reference_region) if region is not None]
        if objective == ALL and len(regions) == 2:
            sides = [(region.places, region.shares) for region in regions]
        else:
            is_active = np.ones(len(pair.P_m)) if objective == ALL else gaps(pair, raw) < ACTIVE_GAP
            sides = [(points, pair.weights * is_active) for points in (pair.P_m, pair.P_r)]
        for part, (points, weights) in zip((pair.moving, pair.reference), sides, strict=True):
            if weights.sum() > 0:
                centre = weights @ points / weights.sum()
                products = (points - centre).T @ ((points - centre) * weights[:, None]) / weights.sum()
                found.append(Moments(part, float(weights.sum()), centre, products))
    return found


def gaps(pair: Any, poses: Poses) -> np.ndarray:
    """Return the gaps (point,) [mm] of fixed contact points, paper (2) to (5)."""
    (R_m, t_m), (R_r, t_r) = (split(poses[part]) for part in (pair.moving, pair.reference))
    return (((pair.P_m @ R_m.T + t_m) - (pair.P_r @ R_r.T + t_r)) * (pair.n_r @ R_r.T)).sum(axis=1)


def split(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation (3, 3) and translation (3,) of a pose (12,)."""
    return pose[:9].reshape(3, 3), pose[9:]


class Search:
    """Poses of bodies that stay outside of each other, as near to raw poses as can be.

    deviations   by contributor [mm]; only "seating" needs them, where locators hold exactly
    movers       the bodies that move
    """

    def __init__(self, scene: Scene, program: tc.Program, objective: str, deviations: np.ndarray | None = None) -> None:
        self.scene, self.program, self.objective = scene, program, objective
        self.deviations = {} if deviations is None else dict(zip(program.draws.labels, deviations, strict=True))
        nominal = program.nominal
        self.movers = [k for k in range(len(scene.bodies)) if nominal.parts[k].movers]
        corners = [np.concatenate([piece.corners for piece in body]) for body in scene.bodies]
        self.centre = np.mean(np.concatenate(corners), axis=0)
        self.corners = [points - self.centre for points in corners]
        self.size = float(np.abs(np.concatenate(self.corners)).max())
        self.power = 1 if objective == SEATING else 2  # of lengths in the objective

    def centred(self, poses: Poses) -> Poses:
        """Return poses of coordinates about the centre of the scene, where numbers are small."""
        R, t = poses[..., :9].reshape(*poses.shape[:-1], 3, 3), poses[..., 9:]
        return np.concatenate([poses[..., :9], t + R @ self.centre - self.centre], axis=-1)

    def energy(self, raw: Poses, poses: Poses, sides: list[Moments]) -> float:
        """Return the objective at centred poses: [mm^2], or [mm] for "seating"."""
        return float(ca.DM(self._energy([ca.DM(row) for row in raw], [ca.DM(row) for row in poses], sides)))

    def _energy(self, raw: list, poses: list, sides: list[Moments]):  # type: ignore[no-untyped-def]
        value, total = 0.0, 0.0
        if self.objective == SEATING:  # without the quadratic term, whose share is a thousandth of travel / size
            for force in self.program.nominal.assembly.forces:
                k, point, vector = (
                    self.program.nominal.part_index(force.at.part),
                    ca.DM(np.asarray(force.at.position)),
                    ca.DM(force.vector),
                )
                value -= ca.dot(vector, applied(poses[k], point - self.centre) - applied(raw[k], point - self.centre))
                total += float(np.linalg.norm(force.vector))
            return value / total
        if self.objective == STIFF:
            for k in self.movers:
                locators = self.program.nominal.parts[k].locators
                for p, n, stiffness in zip(locators.points - self.centre, locators.directions, locators.stiffness, strict=True):
                    value += stiffness * ca.dot(n, applied(poses[k], p) - applied(raw[k], p)) ** 2 / 2
                    total += stiffness
            return value / total
        for part, weight, centre, products in sides:
            if part in self.movers:
                D = matrix(poses[part]) - matrix(raw[part])
                a = applied(poses[part], centre - self.centre) - applied(raw[part], centre - self.centre)
                value += weight * (ca.dot(a, a) + ca.trace(D @ ca.DM(products) @ D.T)) / 2
                total += weight
        return value / (total or 1.0)  # no active point counts: any pose is as good

    def distance(self, poses: Poses) -> float:
        """Return the least signed distance [mm] of bodies that may touch, at centred poses."""
        return min((self._separation(pair, poses) for pair in self.pieces(poses, 0.0)), default=np.inf)

    def pieces(self, poses: Poses, within: float) -> list[tuple[int, int, Polyhedron, Polyhedron]]:
        """Return the pairs of pieces whose bounding spheres are within a distance."""
        found = []
        for m, r in self.scene.pairs:
            (R_m, t_m), (R_r, t_r) = split(poses[m]), split(poses[r])
            for a, b in itertools.product(self.scene.bodies[m], self.scene.bodies[r]):
                centres = R_m @ (a.centre - self.centre) + t_m, R_r @ (b.centre - self.centre) + t_r
                if np.linalg.norm(centres[0] - centres[1]) < a.radius + b.radius + within:
                    found.append((m, r, a, b))
        return found

    def _separation(self, pieces: tuple[int, int, Polyhedron, Polyhedron], poses: Poses) -> float:
        m, r, a, b = pieces
        (R_m, t_m), (R_r, t_r) = split(poses[m]), split(poses[r])
        c = self.centre
        R, t = R_r.T @ R_m, R_r.T @ (t_m - t_r + c - R_m @ c) - R_r.T @ c + c
        return float(separation(a, b, R[None], t[None])[0])

    def least(self, raw: Poses, start: Poses, sides: list[Moments]) -> tuple[float, Poses] | None:
        """Return objective and centred poses that a search from `start` comes to; None if they penetrate each other."""
        near = self.pieces(start, CLOSE * self.scene.range)
        near = [pieces for pieces in near if self._separation(pieces, start) < CLOSE * self.scene.range]
        if len(near) > MAX_PIECES:
            return None
        count = len(self.movers)
        z = ca.SX.sym("z", 6 * count + 4 * len(near))
        poses = [ca.SX(ca.DM(row)) for row in start]
        for k, mover in enumerate(self.movers):
            poses[mover] = self._moved(start[mover], z[6 * k : 6 * k + 6])
        rows, lower, upper, first = [], list[float](), list[float](), [np.zeros(6 * count)]
        for k, (m, r, a, b) in enumerate(near):
            n, c = z[6 * count + 4 * k : 6 * count + 4 * k + 3], z[6 * count + 4 * k + 3]
            sides_of = [ca.DM(piece.corners - self.centre) for piece in (a, b)]
            for sign, part, corners in ((1, m, sides_of[0]), (-1, r, sides_of[1])):
                moved = matrix(poses[part]) @ corners.T + ca.repmat(poses[part][9:], 1, corners.size1())
                rows.append(sign * (moved.T @ n - c))
            rows.append(ca.sumsqr(n))
            lower += [0.0] * (len(a.corners) + len(b.corners)) + [1.0]
            upper += [np.inf] * (len(a.corners) + len(b.corners)) + [1.0]
            first.append(plane(*(piece_at(piece, start[part], self.centre) for part, piece in ((m, a), (r, b)))))
        if self.objective == SEATING:
            for k in self.movers:
                locators = self.program.nominal.parts[k].locators
                for p, n, label, is_stop in zip(
                    locators.points - self.centre, locators.directions, locators.labels, locators.one_sided, strict=True
                ):
                    rows.append(ca.dot(n, applied(poses[k], p) - p) - self.deviations[label])
                    lower, upper = [*lower, 0.0], [*upper, np.inf if is_stop else 0.0]
        energy = self._energy([ca.DM(row) for row in raw], poses, sides) / self.scene.range**self.power
        quiet: dict[str, Any] = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 200}
        exact: dict[str, Any] = {"ipopt.tol": 1e-10, "ipopt.bound_relax_factor": 0.0, "ipopt.constr_viol_tol": 1e-10}
        warm: dict[str, Any] = {"ipopt.mu_init": 1e-4, "ipopt.mu_strategy": "adaptive"}
        solver = ca.nlpsol("least", "ipopt", {"x": z, "f": energy, "g": ca.vertcat(*rows)}, {**quiet, **exact, **warm})
        answer = solver(x0=np.concatenate(first), lbg=lower, ubg=upper)["x"]
        found = np.array([np.asarray(ca.DM(row)).ravel() for row in ca.Function("poses", [z], poses)(answer)])
        return (self.energy(raw, found, sides), found) if self.distance(found) > -FEASIBLE * self.scene.range else None

    def _moved(self, start: np.ndarray, q):  # type: ignore[no-untyped-def]
        K = ca.skew(q[3:] / self.size)
        turn = ca.SX.eye(3) + (4 * K + 2 * K @ K) / (4 + ca.sumsqr(q[3:] / self.size))  # Cayley: a rotation for any q
        return ca.vertcat(ca.vec((turn @ ca.DM(start[:9].reshape(3, 3))).T), ca.DM(start[9:]) + q[:3])

    def way(self, poses: Poses, others: Poses) -> float:
        """Return how far [mm] any corner is moved between two poses."""
        moved = [
            self.corners[k] @ (split(poses[k])[0] - split(others[k])[0]).T + poses[k][9:] - others[k][9:] for k in self.movers
        ]
        return max(float(np.linalg.norm(each, axis=1).max()) for each in moved)


def matrix(pose):  # type: ignore[no-untyped-def]
    """Return the rotation of a symbolic pose (12, 1)."""
    return ca.reshape(pose[:9], 3, 3).T


def applied(pose, point):  # type: ignore[no-untyped-def]
    """Return a point, moved by a symbolic pose."""
    return matrix(pose) @ ca.DM(point) + pose[9:]


def piece_at(piece: Polyhedron, pose: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return corners, normals and directions of edges of a piece at a centred pose."""
    R, t = split(pose)
    return (piece.corners - centre) @ R.T + t, piece.normals @ R.T, piece.directions @ R.T


def plane(above: tuple[np.ndarray, ...], below: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return normal and offset (4,) of the plane between two convex pieces, with most room or least overlap."""
    across = np.cross(above[2][:, None], below[2][None]).reshape(-1, 3)
    length = np.linalg.norm(across, axis=1)
    across = across[length > ends.ON_FACET] / length[length > ends.ON_FACET, None]
    axes = np.concatenate([below[1], -above[1], across, -across])
    low, high = (above[0] @ axes.T).min(axis=0), (below[0] @ axes.T).max(axis=0)
    best = int((low - high).argmax())
    return np.array([*axes[best], (low[best] + high[best]) / 2])
