"""Contact points of a pair that are fixed for all realizations: samples of two faces, or locators; and heights of its faces.

Other kinds of contact derive from FollowingContact (see following_contact).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.discretization.form_points import COVER_SHARE, PairForm, form_lengths, form_spacing
from tolcontact.discretization.plane_minima import PlaneMinima
from tolcontact.discretization.point_weights import CountedRegion, counted_region, point_weights
from tolcontact.errors import GeometryFault
from tolcontact.features import FaceDeviation
from tolcontact.features.zone_kernel import sum_modes
from tolcontact.geometry.overlap import points_on_rim
from tolcontact.geometry.surface import Surface

EVERY_POINT = slice(None)
RIM_REACH = 0.1  # of the size of the moving face: how far from it, nominally, rim points of the other face count
GAPS_TOGETHER = 1 << 20  # that are computed at once
MIN_SHARE = 1e-3  # of the mean share of a point in the stiffness of a pair


@dataclass(frozen=True, eq=False)
class Offsets:
    """Heights of the contact points of a pair along n^r, linear in the deviations. Gaps are smaller by these heights.

    columns   (contributor,): columns of the deviations
    matrix    (contributor, point): height of each point per unit deviation
    """

    columns: np.ndarray
    matrix: np.ndarray

    @classmethod
    def joined(cls, terms: "Sequence[Offsets]", points: int) -> "Offsets":
        """Return the sum of offsets of the same points; without terms, heights do not vary."""
        columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(term.columns for term in terms)]))
        matrix = np.zeros((len(columns), points))
        for term in terms:
            matrix[np.searchsorted(columns, term.columns)] += term.matrix
        return cls(columns, matrix)

    def take(self, points: np.ndarray) -> "Offsets":
        """Return the offsets of some points."""
        return Offsets(self.columns, self.matrix[:, points])

    def heights(self, deviations: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return heights (row, slot) [mm] of `points` (row, slot) for deviations (row, column), summed in a fixed order."""
        heights = np.zeros(points.shape)
        for column, row in zip(self.columns, self.matrix, strict=True):
            heights += deviations[:, column, None] * row[points]
        return heights


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of one pair, fixed for all realizations: P^m, P^r, n^r of the paper, each (point, 3).

    The one-sided locators of a part are also a pair of this kind, and so is each compliant two-sided locator. Their reference
    is the part that they are on, or None for the ground. They have no faces; their offsets are the deviations.

    samples_faces   whether points are samples of faces, which are counted by their areas, with gaps that are affine in X_RM;
                    otherwise points follow from every pose, and no triangle enters their gaps
    moving_face, reference_face   in their nominal poses
    within      [mm] how far from each other opposite faces count in an objective
    coordinate_error   [mm] of both bodies, as their files store them: P_r lie below the reference face by it
    facets      [mm] largest distance between their triangles and the round faces that these approximate
    sampling_error   [mm] that bodies may penetrate undetected between points of curved faces; None for other points
    deviating   deviations of the moving and the reference face, if these belong to features; their heights at fixed points are
                among the offsets
    locators    (point,) indices of the one-sided locators
    stiffness   (point,) [N/mm] of springs, infinite for rigid one-sided locators; None for rigid faces
    pulls       (point,): whether the spring of a two-sided locator pulls at a point; None if none does
    holds, elastic   whether its point is a two-sided locator, which pushes and pulls; whether one of its parts is elastic
    """

    samples_faces: ClassVar[bool] = True
    _accuracy_in_words: ClassVar[str] = ""

    name: str
    moving: int
    reference: int | None
    P_m: np.ndarray
    P_r: np.ndarray
    n_r: np.ndarray
    offsets: Offsets
    reference_face: Surface | None = None
    moving_face: Surface | None = None
    within: float = np.inf
    coordinate_error: float = 0.0
    facets: float = 0.0
    sampling_error: float | None = None
    deviating: tuple[FaceDeviation | None, FaceDeviation | None] = (None, None)
    locators: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    pulls: np.ndarray | None = None
    holds: bool = False
    elastic: bool = False

    @cached_property
    def facing(self) -> np.ndarray:
        """The decrease -n^m . n^r (point,) of gaps per unit height of the moving face."""
        if self.moving_face is None:
            return np.ones(len(self.P_m))
        triangle, nearest = self.moving_face.nearest(self.P_m)
        return -(self.moving_face.normals(triangle, nearest) * self.n_r).sum(axis=1)

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """Return the sum of the outward offsets of both faces (row,) [mm] for deviations (row, contributor), without form."""
        heights = np.zeros(len(deviations))
        for face in self.deviating:
            if face is not None and face.grows:
                heights += face.heights(deviations)
        return heights

    @property
    def counts_centres(self) -> bool:
        """Whether an objective counts centres of curvature in place of contact points."""
        return False

    def counted(self, *, of_moving: bool) -> tuple[Float[Array, "point 3"], Float[Array, " point"]]:
        """Return the points whose displacement an objective counts on one side, and the radii [mm] of spheres around them."""
        return (self.P_m if of_moving else self.P_r), np.zeros(len(self.P_m))

    @property
    def shapes(self) -> tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]] | None:
        """The numbers (point, ...) of walls and of bodies from which points follow at any pose; None if they are fixed."""
        return None

    @property
    def stays(self) -> Bool[Array, " point"]:
        """Whether a contact point (point,) has its nominal place at any pose."""
        return np.ones(len(self.P_m), dtype=bool)

    def take(self, points: Int[Array, " point"]) -> Self:
        """Return the pair with some of its points, in this order."""
        names = "P_m", "P_r", "n_r", "locators", "stiffness", "pulls"
        arrays = {name: getattr(self, name)[points] for name in names if getattr(self, name) is not None}
        return replace(self, **arrays, offsets=self.offsets.take(points))

    def without(self, held: Float[Array, "place 3"], distance: float) -> Self:
        """Return the pair without its points up to a `distance` [mm] from places that are held.

        Raises GeometryFault if no point is left.
        """
        if self.is_supports:
            return self
        free = np.flatnonzero(KDTree(held).query(self.P_m)[0] > distance)
        if not free.size:
            raise GeometryFault(
                "guns or welds hold its parts at all its contact points; leave the pair out, or give more points"
            )
        return self.take(free)

    def with_heights(self) -> Self:
        """Return the pair with offsets by sizes and forms; heights of the moving face count along the reference normal."""
        if not any(self.deviating):
            return self
        offsets = [Offsets(*modes) for modes in self._modes]
        for face, share in zip(self.deviating, (self.facing, np.ones(len(self.P_m))), strict=True):
            if face is not None and face.grows:
                offsets.append(Offsets(face.columns[face.height != 0], np.outer(face.height[face.height != 0], share)))
        return replace(self, offsets=Offsets.joined(offsets, len(self.P_m)))

    def stiffness_shares(self) -> Float[Array, " point"]:
        """Return the share (point,) of each contact point in the stiffness of its pair.

        Raises GeometryFault for a curved face, which has no nominal area of contact.
        """
        assert self.moving_face is not None and self.reference_face is not None
        if not (self.moving_face.is_flat and self.reference_face.is_flat):
            raise GeometryFault(
                "it has a stiffness, which needs flat faces, or a ball or shaft against walls; leave stiffness out"
            )
        shares = self.weights / len(self.P_m)
        if shares.min() < MIN_SHARE / len(shares):  # a corner may represent no area
            shares = np.maximum(shares, MIN_SHARE / len(shares))
            shares /= shares.sum()
        return shares

    @property
    def has_form(self) -> bool:
        """Whether one of the faces has form."""
        return any(face is not None and face.form is not None for face in self.deviating)

    @property
    def form_spacing(self) -> float:
        """The usual spacing [mm] of contact points of faces with form."""
        return form_spacing(form_lengths(self.deviating))

    @cached_property
    def minima(self) -> PlaneMinima | None:
        """The gap between contact points of two rigid planes with form; None for other pairs."""
        moving, reference = self.moving_face, self.reference_face
        if moving is None or reference is None or not self.has_form or self.is_springy:
            return None
        if not (moving.is_flat and reference.is_flat):
            return None
        distance = np.quantile(KDTree(self.P_m).query(self.P_m, k=2)[0][:, 1], 0.9) if len(self.P_m) > 1 else 0.0
        reach = max(self.form_spacing / COVER_SHARE, float(distance))
        return PlaneMinima.of((moving, reference), self.deviating, reach)

    @cached_property
    def reference_rim(self) -> np.ndarray:
        """Points (point, 3) [mm] along the rim of a reference face where faces with form may touch."""
        assert self.moving_face is not None and self.reference_face is not None
        points = points_on_rim(self.reference_face, self.form_spacing)
        distance = np.linalg.norm(self.moving_face.nearest(points)[1] - points, axis=1)
        return points[distance < RIM_REACH * self.moving_face.mesh.scale]

    def form(self, deviations: np.ndarray) -> PairForm | None:
        """Return the forms of both faces for deviations (row, contributor); None if no face has form."""
        return PairForm(self.deviating, deviations) if self.has_form else None

    def highest(self, deviations: Float[Array, "row contributor"]) -> float:
        """Return a bound [mm] of the heights of both faces for some deviations."""
        form, highest = self.form(deviations), float(np.abs(self.heights(deviations)).max())
        return highest if form is None else highest + float(form.highest().sum(axis=0).max())

    def form_heights(self, deviations: np.ndarray, points: np.ndarray | slice = EVERY_POINT) -> np.ndarray:
        """Return the sums of both forms (row, point) [mm] at contact points, for deviations (row, contributor)."""
        heights = np.zeros((len(deviations), len(self.P_m[points])))
        for columns, modes in self._modes:
            sum_modes(np.ascontiguousarray(deviations[:, columns]), np.ascontiguousarray(modes[:, points]), heights)
        return heights

    @cached_property
    def _modes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The columns (mode,) of the forms of both faces, and their heights (mode, point) at the points per unit deviation."""
        sides = zip(self.deviating, (self.P_m, self.P_r), (self.facing, np.ones(len(self.P_m))), strict=True)
        return [
            (face.form_columns, np.ascontiguousarray((face.form.heights(P) * share[:, None]).T))
            for face, P, share in sides
            if face is not None and face.form is not None
        ]

    def nominal_gaps(self, X_RM: np.ndarray, points: np.ndarray | slice = EVERY_POINT) -> np.ndarray:
        """Return the gaps (row, point) [mm] of fixed contact points at X_RM (row, 12), without any deviation of the faces."""
        return np.asarray(((pose.apply(X_RM, self.P_m[points]) - self.P_r[points]) * self.n_r[points]).sum(axis=2))

    def least_gap(self, X_RM: np.ndarray, deviations: np.ndarray | None = None) -> np.ndarray:
        """Return the least gap (row,) [mm] of the points at X_RM (row, 12) for deviations (row, contributor) of the faces."""
        gaps, together = np.empty(len(X_RM)), max(1, GAPS_TOGETHER // max(len(self.P_m), 1))
        for rows in (slice(k, k + together) for k in range(0, len(X_RM), together)):
            of_points = self.nominal_gaps(X_RM[rows])
            if deviations is not None and self.has_form:
                of_points -= self.form_heights(deviations[rows])
            gaps[rows] = of_points.min(axis=1)
        return gaps if deviations is None else gaps - self.heights(deviations)

    def raw_depth(self, X_RM: Float[Array, "row 12"], deviations: Float[Array, "row contributor"]) -> float:
        """Return the largest penetration [mm] of the points at raw poses X_RM, for deviations of the faces."""
        return max(-float(self.least_gap(X_RM, deviations).min()), 0.0)

    def travel(self, X_RM: Float[Array, "row 12"]) -> float:
        """Return the travel [mm] of the moving face, or of points without one, from the nominal position."""
        bounds = self.moving_face.mesh.bounds if self.moving_face is not None else [self.P_m.min(axis=0), self.P_m.max(axis=0)]
        corners = np.array(np.meshgrid(*np.array(bounds).T)).reshape(3, -1).T
        return float(np.linalg.norm(pose.apply(X_RM - pose.AT_REST, corners), axis=2).max())

    @property
    def clearance(self) -> float:
        """The smallest nominal distance [mm] of contact points from their projections."""
        return float(np.linalg.norm(self.P_m - self.P_r, axis=1).min())

    @property
    def curvature(self) -> float:
        """The largest curvature [1/mm] of a reference face that fixed planes represent; 0 if it is flat."""
        return 0.0 if self.reference_face is None else self.reference_face.curvature

    @property
    def may_miss_ends(self) -> bool:
        """Whether the points may miss contact where faces end, so that places of contact may be searched at every pose."""
        if self.moving_face is None or self.reference_face is None or self.reference is None or self.is_springy:
            return False
        return not self.has_form or (self.moving_face.is_flat and self.reference_face.is_flat)

    @property
    def may_interfere(self) -> bool:
        """Whether the bodies of a certified answer may interfere: compliant faces do, and form is not part of a solid."""
        return self.is_springy or self.has_form

    @cached_property
    def weights(self) -> Float[Array, " point"]:
        """The weights of the points (point,), by the areas that they represent; equal ones without sampled faces."""
        if self.moving_face is None or self.reference_face is None:
            return np.ones(len(self.P_m))
        return point_weights(self.P_m, self.P_r, self.moving_face, self.reference_face)

    @cached_property
    def moving_region(self) -> CountedRegion | None:
        """The part of the moving face that an objective counts."""
        return counted_region(self.moving_face, self.reference_face, self.within)

    @cached_property
    def reference_region(self) -> CountedRegion | None:
        """The part of the reference face that an objective counts."""
        return counted_region(self.reference_face, self.moving_face, self.within)

    @cached_property
    def bulge(self) -> float:
        """The largest height [mm] of round surfaces over the triangles that they were fitted to and replace."""
        pieces = [piece for face in (self.moving_face, self.reference_face) if face is not None for piece in face.pieces]
        return max((piece.face.chord_height for piece in pieces if piece.surface.is_fitted), default=0.0)

    @property
    def in_words(self) -> str:
        """The number and the kind of the points, and their accuracy."""
        text = f"{len(self.P_m)} contact points{self._accuracy_in_words}"
        return text + (f"; triangles up to {self.bulge:.2g} mm inside" if self.bulge > 0 else "")

    @property
    def is_springy(self) -> bool:
        """Whether some of the points are compliant, by springs or by elastic parts."""
        return self.elastic or (self.stiffness is not None and bool(np.isfinite(self.stiffness).any()))

    @property
    def is_supports(self) -> bool:
        """Whether the points are locators."""
        return self.reference_face is None
