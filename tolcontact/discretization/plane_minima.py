"""Local minima of the gap between two planes with form: where they touch between their contact points.

The spacing of contact points on faces with form is a share of the correlation length, and the faces bulge between them. At a
given pose the gap is a smooth function of position on the moving plane. Newton steps find its minima over both faces: inside
the faces, along their rims, and at corners. Heights are evaluated from splines. The label of a minimum is its position on the
moving plane.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.features import FaceDeviation, FormField
from tolcontact.geometry import height_kernel, minima_kernel
from tolcontact.geometry.height_kernel import HeightSums, HeightTable, Plane
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.places import Places
from tolcontact.geometry.spreading import face_frame
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import SAME_PLACE
from tolcontact.geometry.triangle_mesh import on_rim

STEP_SHARE = 1 / 10  # of the correlation length: the distance between two nodes
ROUGH_STEP_SHARE = 1 / 40  # the same for a covariance whose fields have kinks at stations
ROUGH = "matern 3/2"
PADDING = 10  # nodes around a face, which keep the ends of splines from affecting it
MAX_NODES = 60_000
MAX_STARTS = 16  # of searches at a pose
STEP_DISTANCE = 1.6  # times the reach: distance between starts for a first search in smooth fields
SMOOTH = "squared exponential"
START_DISTANCE = 0.9  # times the reach: distance between starts
MAX_MINIMA = 6  # of a pair that are added at a pose
MAX_FORMER = 24  # that are kept from one pose to the next
BEND_FACTOR = 1.6  # times the root mean square second difference over the reach: largest dip of a gap between points
EXTREME = 5.0  # times the root mean square height: the largest height, and divided by the correlation length the largest slope


@dataclass(frozen=True, eq=False)
class PlaneMinima:
    """The gap between two planes that face each other, at any of their points.

    deviating           deviations of the moving and the reference face, if these belong to features
    moving, reference   the planes
    reach               [mm] of a search step: the contact-point spacing
    slack               [mm] that positions may overhang a rim
    """

    deviating: tuple[FaceDeviation | None, FaceDeviation | None]
    moving: Plane
    reference: Plane
    reach: float
    slack: float

    @classmethod
    def of(
        cls, faces: tuple[Surface, Surface], deviating: tuple[FaceDeviation | None, FaceDeviation | None], reach: float
    ) -> "PlaneMinima":
        """Return the gap between a moving and a reference plane, whose contact points are `reach` [mm] apart."""
        moving, reference = map(_plane, faces, deviating)
        return cls(deviating, moving, reference, reach, SAME_PLACE * max(float(face.mesh.scale) for face in faces))

    def heights(
        self,
        X_RM: Float[Array, "n 12"],
        deviations: Float[Array, "n contributor"],
        P_m: Float[Array, "m point 3"],
        is_required: Bool[Array, "n point"],
    ) -> Float[Array, "n point"]:
        """Return the sums of both heights [mm] at points P_m of the moving plane and their projections at X_RM.

        P_m differ from pose to pose, or are the same for all poses (m = 1). Heights that are not required are 0.
        """
        heights = np.zeros(is_required.shape)
        height_kernel.write_heights(*self._inputs(X_RM, deviations), np.ascontiguousarray(P_m), is_required, heights)
        return heights

    def bulge(self, deviations: Float[Array, "n contributor"]) -> Float[Array, " n"]:
        """Return the largest dip [mm] of the gap between contact points."""
        return BEND_FACTOR * self._root_sums(self._bends, deviations).sum(axis=0)

    def bound(self, deviations: Float[Array, "n contributor"]) -> Float[Array, " n"]:
        """Return a bound [mm] of the absolute sum of both heights."""
        return EXTREME * self._root_sums(self._squares, deviations).sum(axis=0)

    def projection_error(self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"]) -> Float[Array, " n"]:
        """Return a bound [mm] of the error of heights at nominal projections: a slope times their displacement at X_RM."""
        form = self._forms[1]
        if form is None:
            return np.zeros(len(X_RM))
        moving = self.moving
        corners = moving.origin + np.array([(u, v) for u in moving.corners[:, 0] for v in moving.corners[:, 1]]) @ moving.axes
        travel = np.linalg.norm((pose.apply(X_RM, corners) - corners) @ self.reference.axes.T, axis=2).max(axis=1)
        return EXTREME * self._root_sums(self._squares, deviations)[1] / min(form.scales) * travel

    def _root_sums(self, mean_squares: Sequence[np.ndarray], deviations: np.ndarray) -> np.ndarray:
        """Return root mean squares (face, n) [mm] over both faces, from mean squares (mode,) of their modes."""
        roots = np.zeros((2, len(deviations)))
        for k, (face, squares) in enumerate(zip(self.deviating, mean_squares, strict=True)):
            if face is not None:
                roots[k] = np.sqrt(deviations[:, face.form_columns] ** 2 @ squares)
        return roots

    @property
    def _forms(self) -> list[FormField | None]:
        """The forms of the moving and the reference face."""
        return [None if face is None else face.form for face in self.deviating]

    @cached_property
    def _is_smooth(self) -> bool:
        return all(form is None or (form.form.covariance == SMOOTH and not form.scans) for form in self._forms)

    @cached_property
    def _squares(self) -> list[np.ndarray]:
        """The mean squares (mode,) of the modes of both faces."""
        return [np.zeros(0) if form is None else (form.place_heights**2).mean(axis=1) for form in self._forms]

    @cached_property
    def _bends(self) -> list[np.ndarray]:
        """The mean squares (mode,) of second differences of the modes of both faces, over the reach."""
        bends = []
        for form, plane in zip(self._forms, (self.moving, self.reference), strict=True):
            differences = [
                form.heights(form.places + self.reach * axis)
                + form.heights(form.places - self.reach * axis)
                - 2 * form.place_heights.T
                for axis in plane.axes
                if form is not None
            ]
            bends.append((np.concatenate(differences) ** 2).mean(axis=0) if differences else np.zeros(0))
        return bends

    def find(
        self,
        X_RM: Float[Array, "n 12"],
        deviations: Float[Array, "n contributor"],
        grown: Float[Array, " n"],
        P_m: Float[Array, "m point 3"],
        gaps: Float[Array, "n point"],
        limits: Float[Array, " n"],
        depth: float,
        *,
        in_steps: bool = False,
    ) -> Int[Array, "n minimum"]:
        """Return the labels of the minima at X_RM that are deeper than `depth` [mm], the deepest first; -1 for none.

        grown    [mm] outward offset of both faces
        P_m      points [mm] of the moving plane, for each pose or the same for all poses (m = 1): the search starts from points
                 with the least `gaps` [mm], below `limits` [mm]
        in_steps whether a closer search follows
        """
        points = np.ascontiguousarray(P_m)
        starts, labels = (np.empty((len(X_RM), count), dtype=np.int64) for count in (MAX_STARTS, MAX_MINIMA))
        distance = STEP_DISTANCE if in_steps and self._is_smooth else START_DISTANCE
        minima_kernel.choose_starts(points, gaps, limits, distance * self.reach, starts)
        inputs = self._inputs(X_RM, deviations)
        minima_kernel.find_minima(*inputs, grown, points, starts, self.reach, self.slack, depth, labels)
        return labels

    def at(
        self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], labels: Int[Array, "n place"]
    ) -> Places:
        """Return the candidates with labels at X_RM, -1 for none, with the form deviations there."""
        P_m, P_r = np.zeros((2, *labels.shape, 3))
        gaps, heights = np.empty((2, *labels.shape))
        inputs = self._inputs(X_RM, deviations)
        minima_kernel.write_places(*inputs, np.ascontiguousarray(labels), self.slack, P_m, P_r, gaps, heights)
        n_r = np.tile(self.reference.normal, (*labels.shape, 1))
        return Places(np.where(np.isfinite(gaps), labels, -1), gaps, P_m, P_r, n_r, heights)

    def points(self, labels: Int[Array, " place"]) -> Float[Array, "place 3"]:
        """Return the nominal positions [mm] of labels on the moving plane."""
        plane, cell = self.moving, labels - FIRST_PLACE
        shares = (np.stack([cell // minima_kernel.CELLS, cell % minima_kernel.CELLS], axis=-1) + 0.5) / minima_kernel.CELLS
        return np.asarray(plane.origin + (plane.corners[0] + shares * (plane.corners[1] - plane.corners[0])) @ plane.axes)

    def _inputs(self, X_RM: np.ndarray, deviations: np.ndarray) -> tuple[Plane, Plane, np.ndarray, HeightSums, HeightSums]:
        """Return the planes, the poses, and the factors of the modes of both, for compiled functions."""
        planes, sums = (self.moving, self.reference), []
        for face, plane in zip(self.deviating, planes, strict=True):
            columns = np.zeros(0, dtype=int) if face is None or face.form is None else face.form_columns
            sums.append(HeightSums.of(plane.table, np.ascontiguousarray(deviations[:, columns])))
        return *planes, np.ascontiguousarray(X_RM), sums[0], sums[1]


def with_former(labels: Int[Array, "n a"], former: Int[Array, "n b"]) -> Int[Array, "n c"]:
    """Return labels of minima, followed by labels of former ones up to MAX_FORMER; -1 for none."""
    joined = np.empty((len(labels), min(labels.shape[1] + former.shape[1], MAX_FORMER)), dtype=np.int64)
    width = minima_kernel.join(labels, np.ascontiguousarray(former), joined)
    return np.ascontiguousarray(joined[:, :width])


def _plane(face: Surface, deviation: FaceDeviation | None) -> Plane:
    """Return a flat face with the table of its form."""
    frame = face_frame(face.mesh)
    axes, origin = np.ascontiguousarray(frame.axes[:, :2].T), np.asarray(frame.centre)
    vertices = (face.vertices - origin) @ axes.T
    corners = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    form = None if deviation is None else deviation.form
    no_table = HeightTable(np.zeros(2), 1.0, np.zeros((0, 0, 0)))
    table = no_table if form is None else _table(form, origin, axes, corners)
    return Plane(origin, axes, np.array(face.corner_normals[0, 0]), _edges(face, vertices), corners, table)


def _edges(face: Surface, vertices: np.ndarray) -> np.ndarray:
    """Return the edges (edge, 7) of the rim of a flat face, see Plane; `vertices` (vertex, 2) [mm] are its coordinates."""
    faces = face.faces
    triangle, first = np.nonzero(on_rim(faces))
    start, end, opposite = (vertices[faces[triangle, (first + k) % 3]] for k in range(3))
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    direction = (end - start) / length
    inward = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    inward *= np.sign(((opposite - start) * inward).sum(axis=1, keepdims=True))
    return np.ascontiguousarray(np.hstack([start, direction, length, inward]))


def _table(form: FormField, origin: np.ndarray, axes: np.ndarray, corners: np.ndarray) -> HeightTable:
    """Return the table of the modes of a form over the rectangle between two corners (2, 2) [mm]."""
    extent = corners[1] - corners[0]
    share = ROUGH_STEP_SHARE if form.form.covariance == ROUGH else STEP_SHARE
    step = max(share * min(form.scales), float(np.sqrt(extent.prod() / MAX_NODES)))
    counts = np.ceil(extent / step).astype(int) + 1 + 2 * PADDING
    along = [low + step * (np.arange(count) - PADDING) for low, count in zip(corners[0], counts, strict=True)]
    u, v = np.meshgrid(*along, indexing="ij")
    nodes = form.heights(origin + u[..., None] * axes[0] + v[..., None] * axes[1])
    for axis, count in enumerate(counts):
        off_diagonal = np.full(count - 1, 1 / 6)
        splines = np.diag(np.full(count, 2 / 3)) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1)
        nodes = np.moveaxis(np.tensordot(np.linalg.inv(splines), nodes, axes=(1, axis)), 0, axis)
    kept = slice(PADDING - 2, 1 - PADDING)  # a node before and two after each interval
    return HeightTable(corners[0] - step, step, np.ascontiguousarray(nodes[kept, kept]))
