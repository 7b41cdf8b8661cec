"""Guards of bounded pairs: they detect bodies that interfere where the list of places shows nothing."""

from dataclasses import dataclass

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import Program
from tolcontact.features import FaceDeviation
from tolcontact.geometry.places import Places
from tolcontact.interference import Neighbours, WayOut, ordered

GUARD = 1 << 41  # first label of places that a guard adds: a label encodes the direction that separates the bodies
PARTING = 2 * GUARD  # first label of places along which convex bodies part best (see Parting)
LEVELS = 1 << 12  # of a component of that direction
APART = 2.0 * 8.0 ** np.arange(3)  # insets of both bodies: the distances at which a place that holds them apart is searched


def is_guard(labels: Int[Array, "..."]) -> Bool[Array, "..."]:
    """Return which labels belong to places that a guard added."""
    return (labels >= GUARD) & (labels < PARTING)


def _label(normals: Float[Array, "n 3"]) -> Int[Array, " n"]:
    digits = np.round((normals + 1) / 2 * (LEVELS - 1)).astype(np.int64)
    return GUARD + (digits[:, 0] * LEVELS + digits[:, 1]) * LEVELS + digits[:, 2]


def _direction(labels: Int[Array, " n"]) -> Float[Array, "n 3"]:
    code = labels - GUARD
    digits = np.stack([code // LEVELS**2, code // LEVELS % LEVELS, code % LEVELS], axis=1)
    normals = digits / (LEVELS - 1) * 2 - 1
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Guard:
    """The bodies of a pair, with all of their deviating faces.

    is_swapped   whether the moving body is the second one of the neighbours
    faces        the deviations of the moving and the reference face, whose frames X_RM belongs to
    """

    neighbours: Neighbours
    is_swapped: bool
    faces: tuple[FaceDeviation | None, FaceDeviation | None]

    @classmethod
    def of(cls, program: Program, index: int) -> "Guard | None":
        """Return the guard of a pair; None if its bodies may interfere, or have no inside."""
        pair = program.nominal.pairs[index]
        assert pair.reference is not None
        bodies = ordered(pair.moving, pair.reference)
        neighbours = program.watch.neighbours(bodies)
        return None if neighbours is None else cls(neighbours, pair.moving != bodies[0], pair.deviating)

    def interferes(self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"]) -> Bool[Array, " n"]:
        """Return whether the bodies interfere at X_RM (n,)."""
        X, _, _ = self._body_poses(X_RM, deviations)
        return self.neighbours.interfere(pose.inverse(X) if self.is_swapped else X, deviations)

    def _body_poses(self, X_RM: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
        """Return the poses (n, 12) of the moving body in the frame of the reference body, and of both faces in their bodies."""
        moving, reference = (None if face is None else face.poses(deviations) for face in self.faces)
        X = X_RM if moving is None else pose.compose(X_RM, pose.inverse(moving))
        return X if reference is None else pose.compose(reference, X), moving, reference

    def places(self, X_RM: Float[Array, "n 12"], labels: Int[Array, " n"], deviations: Float[Array, "n contributor"]) -> Places:
        """Return a place (n, 1) that separates the bodies at X_RM where they interfere, or touch; an infinite gap for none.

        labels   (n,) of the places that held the bodies apart before, -1 for none: these bodies touch, or are a little apart
        """
        found = Places.none(len(X_RM), 1)
        self._part(found, np.arange(len(X_RM)), X_RM, np.zeros((len(X_RM), 3)), deviations)
        for apart in APART * sum(self.neighbours.insets):
            rows = np.flatnonzero((found.labels[:, 0] < 0) & (labels >= 0))
            if rows.size:
                self._part(found, rows, X_RM, -apart * _direction(labels[rows]), deviations)
        return found

    def _part(
        self,
        found: Places,
        rows: Int[Array, " k"],
        X_RM: Float[Array, "n 12"],
        shift: Float[Array, "k 3"],
        deviations: Float[Array, "n contributor"],
    ) -> None:
        """Write the place that separates bodies in some rows, which overlap once the moving one is shifted."""
        shifted = X_RM[rows]
        shifted[:, 9:] += shift
        way = self.ways_out(shifted, deviations[rows], -shift)
        is_known = way.widths > 0
        rows, way = rows[is_known], WayOut(*(values[is_known] for values in way))
        arms = np.einsum("nij,nj->ni", pose.rotation(X_RM[rows]), way.places) + pose.translation(X_RM[rows]) - way.feet
        gaps = (arms * way.normals).sum(axis=1)
        for values, of_rows in zip(found[:-1], (_label(way.normals), gaps, way.places, way.feet, way.normals), strict=True):
            values[rows, 0] = of_rows

    def ways_out(
        self,
        X_RM: Float[Array, "n 12"],
        deviations: Float[Array, "n contributor"],
        directions: Float[Array, "n 3"] | None = None,
    ) -> WayOut:
        """Return how the bodies separate: P_m, P_r and n_r of the paper, and how deep the place P_m lies (n,) [mm].

        directions   (n, 3) of separation, if known (see Neighbours)
        """
        X, moving, reference = self._body_poses(X_RM, deviations)
        if directions is not None and reference is not None:
            directions = np.einsum("nij,nj->ni", pose.rotation(reference), directions)
        way = self._ways_of_bodies(X, deviations, directions)
        if moving is not None:
            way = way._replace(places=_at(pose.inverse(moving), way.places))
        if reference is None:
            return way
        back = pose.inverse(reference)
        return way._replace(feet=_at(back, way.feet), normals=np.einsum("nij,nj->ni", pose.rotation(back), way.normals))

    def _ways_of_bodies(self, X: np.ndarray, deviations: np.ndarray, directions: np.ndarray | None) -> WayOut:
        """Return how the bodies separate, in their own frames, at poses (n, 12) of the moving body relative to the other."""
        if not self.is_swapped:
            return self.neighbours.ways_out(X, deviations, directions)
        R = pose.rotation(X)
        given = None if directions is None else -np.einsum("nji,nj->ni", R, directions)
        way = self.neighbours.ways_out(pose.inverse(X), deviations, given)
        return WayOut(way.feet, way.places, -np.einsum("nij,nj->ni", R, way.normals), way.widths)


def _at(X: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return where points (n, 3) [mm] are at the poses X (n, 12)."""
    return pose.apply(X, points[:, None])[:, 0]
