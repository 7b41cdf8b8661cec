"""The critical friction at which a part can stick short of a seat: a locator, or a face that it touches.

The force of contact point i is N_i n_i + t_i with N_i >= 0, t_i across n_i, |t_i| <= k m_i N_i, and its wrench W_i (N_i, t_i).
A load w can be balanced if  sum W_i (N_i, t_i) + s w = 0  for some s > 0, scaled by sum N_i + s = 1. The largest s decides: if
friction k balances the load, any larger one does, and the critical factor is found by bisection. Each step of the bisection
solves a second-order cone program with Clarabel.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import clarabel
import numpy as np
import scipy
from scipy import sparse
from scipy.sparse import csgraph

from tolcontact.arrays import Array, Float
from tolcontact.statics.touching import Contact, Touching, across, wrenches

HIGH_FRICTION = 0.5  # coefficient: higher ones are unusual
MIN_LOAD = 1e-9  # of the sum of all forces: a smaller load is rounding
MAX_UNBALANCED = 1e-7  # of the sum of all forces: a smaller load component that no contact can balance is rounding
MAX_TURNED = 1e-6  # of the largest singular value of contacts: a motion that displaces them less is free
MIN_TURN = 1e-3  # share of rotation in a motion: a smaller one is rounding
MIN_GUIDE = 1e-9  # of the largest singular value of the guides: a smaller one is rounding
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


@dataclass(frozen=True, eq=False)
class Seat:
    """A contact, and the friction at which its part can stick short of it.

    critical   the smallest coefficient of friction, equal at all other contacts, at which they can balance the forces: 0 if
               they can without friction, infinite if they cannot at any friction
    reserve    the smallest factor of the stated coefficients at which the other contacts can; NaN if not all are stated
    shares     (contact,): share of the sum of all normal forces at the critical coefficient
    """

    contact: Contact
    critical: float
    reserve: float
    shares: Float[Array, " contact"]


class Balance:
    """The balance of forces of parts that contacts connect to each other.

    parts, contacts   indices of the parts and of the contacts
    """

    def __init__(self, touching: Touching, parts: Sequence[int], contacts: Sequence[int]) -> None:
        self.parts, self.contacts, self._touching = list(parts), list(contacts), touching
        points = np.vstack([touching.contacts[index].points for index in contacts])
        self._centre, self._length = points.mean(axis=0), float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
        forces, moments = np.split(touching.loads[self.parts], 2, axis=1)
        moments = (moments - np.cross(self._centre, forces)) / self._length
        self._load = np.hstack([forces, moments]).ravel() / (touching.force or 1.0)

    @property
    def is_pressed(self) -> bool:
        """Whether forces act on the parts."""
        return bool(np.abs(self._load).max() > MIN_LOAD)

    @property
    def is_held(self) -> bool:
        """Whether all contacts together can balance the forces, with a friction coefficient of at most HIGH_FRICTION."""
        cones = self._cones(self.contacts, self._equal(self.contacts))
        return not self._is_loaded(cones) or cones.held(HIGH_FRICTION) > MIN_HELD

    def seats(self) -> Iterator[Seat]:
        """Yield all contacts as seats."""
        for index in self.contacts:
            others = [other for other in self.contacts if other != index]
            critical, shares = self._critical(others, self._equal(others))
            yield Seat(self._touching.contacts[index], critical, self._reserve(others, critical), shares)

    def free_turns(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Yield each part that can rotate by itself, to first order, though forces press it: a point (3,) [mm], an axis (3,).

        Its rotation about the axis opens and closes no contact that a load presses together without friction, and takes no
        work. Contacts that are under load in no balance of the forces, such as a stop that nothing pushes at, do not hold it.
        """
        smooth = self._cones(self.contacts, 0 * self._equal(self.contacts))
        if not self._is_loaded(smooth) or smooth.held(0.0) <= MIN_HELD:
            return
        owners, holds = self._owners(self.contacts), set[int]()
        for index in self.contacts:
            contact, points = self._touching.contacts[index], np.flatnonzero(owners == index)
            if contact.is_guide or len(points) > 1 or smooth.may_be_loaded(int(points[0])):
                holds.add(index)
        contacts = [self._touching.contacts[index] for index in sorted(holds)]
        W = np.hstack([self._wrenches(contact, contact.normals) for contact in contacts])
        for k, part in enumerate(self.parts):
            U, sizes, _ = np.linalg.svd(W[6 * k : 6 * k + 6])
            motions = U[:, int((sizes > MAX_TURNED * sizes.max(initial=0.0)).sum()) :]
            for motion in motions.T if motions.shape[1] == 1 else ():
                turn, size = motion[3:], float(np.linalg.norm(motion[3:]))
                if size > MIN_TURN and abs(motion[:3] @ turn) < MAX_TURNED * size:
                    yield part, self._centre + self._length * np.cross(turn, motion[:3]) / size**2, turn / size

    def _reserve(self, indices: Sequence[int], critical: float) -> float:
        """Return the smallest factor of the stated coefficients of contacts (k,); NaN if one of them has none."""
        stated = [self._touching.contacts[index].mu for index in indices if not self._touching.contacts[index].is_guide]
        if None in stated:
            return np.nan
        if len(values := {mu for mu in stated if mu}) == 1:
            return critical / float(values.pop())
        return self._critical(indices, np.array([self._touching.contacts[index].mu or 0.0 for index in indices]))[0]

    def _equal(self, indices: Sequence[int]) -> np.ndarray:
        """Return 1 for each contact (k,), but 0 where the stated friction is 0."""
        return np.array([0.0 if self._touching.contacts[index].mu == 0 else 1.0 for index in indices])

    def _critical(self, indices: Sequence[int], roughness: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the critical factor of the roughness (k,) of contacts, and the shares of all contacts (contact,)."""
        shares = np.zeros(len(self._touching.contacts))
        cones = self._cones(indices, roughness)
        if not self._is_loaded(cones):
            return 0.0, shares
        factor, point_shares = cones.critical_factor()
        np.add.at(shares, self._owners(indices), point_shares / (point_shares.sum() or 1.0))
        return factor, shares

    @staticmethod
    def _is_loaded(cones: ForceCones) -> bool:
        return bool(np.linalg.norm(cones.load) > MIN_LOAD)

    def _owners(self, indices: Sequence[int]) -> np.ndarray:
        """Return the contact of each point (point,) that has friction or may lift off."""
        contacts = self._touching.contacts
        return np.repeat(indices, [0 if contacts[k].is_guide else len(contacts[k].points) for k in indices]).astype(int)

    def _cones(self, indices: Sequence[int], roughness: np.ndarray) -> ForceCones:
        """Return the force cones of contacts with a roughness (k,) in the directions that guides leave free."""
        contacts = [self._touching.contacts[index] for index in indices]
        guides = [self._wrenches(contact, contact.normals) for contact in contacts if contact.is_guide]
        lifting = [contact for contact in contacts if not contact.is_guide]
        forces = [(contact.normals, *across(contact.normals)) for contact in lifting]
        columns = [
            [self._wrenches(contact, vectors[k]) for contact, vectors in zip(lifting, forces, strict=True)] for k in range(3)
        ]
        nothing = np.zeros((len(self._load), 0))
        normals, *tangents = (np.hstack([nothing, *column]) for column in columns)
        U, sizes, _ = np.linalg.svd(np.hstack([nothing, *guides]))
        Z = U[:, int((sizes > MIN_GUIDE * sizes.max(initial=0.0)).sum()) :]
        point_roughness = np.repeat(roughness, [0 if contact.is_guide else len(contact.points) for contact in contacts])
        return _spanned(
            ForceCones(Z.T @ normals, np.array([Z.T @ tangent for tangent in tangents]), Z.T @ self._load, point_roughness)
        )

    def _wrenches(self, contact: Contact, forces: np.ndarray) -> np.ndarray:
        """Return the wrenches (row, point) on all parts due to unit forces (point, 3) on the moving part."""
        wrench = wrenches(contact.points - self._centre, forces).T
        wrench[3:] /= self._length
        rows = np.zeros((len(self.parts), 6, len(forces)))
        for part, sign in ((contact.moving, 1), (contact.reference, -1)):
            if part in self.parts:
                rows[self.parts.index(part)] += sign * wrench
        return rows.reshape(-1, len(forces))


def _spanned(cones: ForceCones) -> ForceCones:
    """Return force cones in the directions that their forces span, if the load component outside them is negligible.

    A moment about the line through two contacts cannot be balanced by forces there. If it is rounding, it is neglected.
    """
    U, sizes, _ = np.linalg.svd(np.hstack([cones.normals, *cones.tangents * cones.roughness]), full_matrices=False)
    span = U[:, sizes > MIN_GUIDE * sizes.max(initial=0.0)].T
    if not len(span) or np.linalg.norm(cones.load - span.T @ (span @ cones.load)) > MAX_UNBALANCED:
        return cones
    return ForceCones(span @ cones.normals, span @ cones.tangents, span @ cones.load, cones.roughness)


def balances(touching: Touching) -> Iterator[Balance]:
    """Yield the force balance of each set of connected parts that are located."""
    located = np.flatnonzero(touching.is_located)
    ends = np.array([(contact.moving, contact.reference) for contact in touching.contacts]).reshape(-1, 2)
    inner = ends[np.isin(ends, located).all(axis=1)]
    count = len(touching.is_located)
    links = sparse.coo_matrix((np.ones(len(inner)), inner.T), shape=(count, count))
    _, labels = csgraph.connected_components(links, directed=False)
    for label in dict.fromkeys(labels[located]):
        parts = [int(part) for part in located if labels[part] == label]
        contacts = np.flatnonzero(np.isin(ends, parts).any(axis=1))
        if contacts.size:
            yield Balance(touching, parts, [int(contact) for contact in contacts])
