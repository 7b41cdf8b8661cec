"""Where two bodies can meet: a corner on a facet, a facet on a corner, an edge across an edge, or corners of facing planes.

Two polyhedra first touch in one of three ways: a corner of the moving body on a facet of the reference body, a corner of the
reference body on a facet of the moving body, or an edge across an edge. A contact point counts only while it lies within the
facet or on both edges, and while its normal fits between the facets around the corner or edge. This bounds the faces.

Planes that face each other touch at the corners of their overlap. There the gap is measured along the normal of the reference
plane, since the common normal of two rims can tilt without limit as they become parallel.

A body that rests on another one with its end only is nominally behind the side of the other body, by the length of the
overlap. If it penetrates, its corners are also behind that side, although it did not penetrate through it. Such contact points
do not count where a neighbouring corner is already held by another facet. Free bodies have no such points.
"""

import itertools
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.geometry import kernel, places_kernel
from tolcontact.geometry.facing_planes import facing_planes, moot_corners
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER, TINY
from tolcontact.geometry.places import PLAIN, Look, Places
from tolcontact.geometry.polyhedron import Polyhedron, polyhedron
from tolcontact.geometry.sorted_candidates import sorted_candidates
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import blocks, overlaps

TILT_MARGIN = 0.1  # rad: tilt of candidates in addition to the largest tilt of the body
MAX_COMPARISONS = 100_000_000  # of corners with facets, and of edges with edges
MAX_CANDIDATES = 100_000
EXTENSION_FACTOR = 4.0  # factor of travel and rotation for bodies beyond reach
MAX_TRAVEL = 1e4  # in sizes
MAX_POINTS = 32  # contact points returned per pose
DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if 0 < np.abs(d).sum() < 3])  # 18
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
ARC = np.linspace(0, 1, 17)  # shares at which the normals between two facets are compared
ARC_SPACING = np.pi / 16  # rad: the largest angle between two of them
MIN_SLOPE = 1.02  # length from which the slope of a gap between rims counts, if nothing else is asked for
BLOCK_ARCS = 4096  # pairs of edges whose arcs are compared in one block


class Reach(NamedTuple):
    """Bounds on the displacement of a moving body from its nominal pose relative to a reference body.

    travel, tilt   [mm], [rad]: largest translation and rotation
    spread         [mm]: largest translation from deviations alone, without contact
    overlap        [mm]: largest nominal penetration of the bodies
    clearance      [mm]: smallest nominal gap between them
    """

    travel: float
    tilt: float
    spread: float
    overlap: float
    clearance: float

    @property
    def depth(self) -> float:
        """The largest depth [mm] at which a contact point counts."""
        return self.travel + self.overlap

    @property
    def height(self) -> float:
        """The largest gap [mm] at which a contact point counts."""
        return self.clearance + self.depth

    @property
    def tilt_sine(self) -> float:
        """The largest sine of the nominal tilt of normals out of a cone."""
        return min(kernel.MAX_TILT_SINE + self.tilt + TILT_MARGIN, 1.0)


@dataclass(frozen=True, eq=False)
class Meeting:
    """The points at which two faces can touch as long as they stay near their nominal poses.

    candidates   kinds, firsts, seconds (candidate,): the kind, and the indices of the corner, edge or facet of the moving and
             of the reference body; planes (candidate,): for corners of facing planes the index of these planes, else -1;
             facing (plane, 2): a facet of the moving and of the reference plane
    reach    bounds on the displacement of the bodies from their nominal poses
    size     [mm] of the larger face
    overhang [mm]: largest distance outside its edges at which a contact point counts
    has_form whether faces have form, so that planes may touch first at any of their corners
    is_free  whether bodies are free, so that no contact point is behind another one
    slope    length from which the slope of a gap between rims counts, and not the normal of the plane, whose length is 1
    original the meeting that has the same candidates, if this one differs from it in what counts
    """

    moving: Polyhedron
    reference: Polyhedron
    candidates: places_kernel.Candidates
    reach: Reach
    size: float
    has_form: bool = field(kw_only=True)
    overhang: float = field(default=0.0, kw_only=True)
    is_free: bool = field(default=False, kw_only=True)
    slope: float = field(default=MIN_SLOPE, kw_only=True)
    original: "Meeting | None" = field(default=None, kw_only=True)

    def __len__(self) -> int:
        return len(self.candidates.kinds)

    def of_free_bodies(self, overhang: float = 0.0) -> "Meeting":
        """Return the same candidates for bodies that are free; they count up to `overhang` [mm] outside their edges."""
        return replace(self, overhang=overhang, is_free=True, original=self)

    @cached_property
    def sloped(self) -> "Meeting":
        """The same candidates; those where rims of facing planes cross have the slope of their gap as normals."""
        return replace(self, slope=1.0, original=self)

    def slants(self, X_RM: Float[Array, "n 12"], labels: Int[Array, " n"]) -> Float[Array, " n"]:
        """Return the tangents of the angles between slopes of gaps and the normals that rows have instead, at poses (n, 12).

        This is 0 but for candidates where rims of facing planes cross. It is 0 there, too, if the slope counts already, and for
        candidates of extended meetings.
        """
        found, candidates = np.zeros(len(labels)), self.candidates
        rows = np.flatnonzero((labels >= 0) & (labels < len(self)))
        rows = rows[(candidates.kinds[labels[rows]] == kernel.EDGE_ON_EDGE) & (candidates.planes[labels[rows]] >= 0)]
        chosen = labels[rows]
        d = np.einsum(
            "nij,nj->ni", pose.rotation(X_RM[rows]), np.diff(self.moving.edges[candidates.firsts[chosen]], axis=1)[:, 0]
        )
        e = np.diff(self.reference.edges[candidates.seconds[chosen]], axis=1)[:, 0]
        n = self.reference.normals[candidates.facing[candidates.planes[chosen], 1]]
        c = np.cross(d, e)
        across = np.abs((c * n).sum(axis=1))
        slant = np.linalg.norm(np.cross(c, n), axis=1) / np.maximum(across, kernel.TINY)
        found[rows] = np.where(1 + slant**2 < self.slope**2, slant, 0.0)
        return found

    @property
    def kinds(self) -> Int[Array, " c"]:
        """The kinds of the candidates, followed by the kinds of the extended meeting's candidates if it has been built."""
        extended = self.__dict__.get("extended")
        return self.candidates.kinds if extended is None else np.concatenate([self.candidates.kinds, extended.kinds])

    @cached_property
    def extended(self) -> "Meeting | None":
        """The meeting for bodies that are further apart; None if its travel has no bound, or if it has too many candidates."""
        if self.original is not None:
            extended = self.original.extended
            if extended is None:
                return None
            return replace(extended, overhang=self.overhang, is_free=self.is_free, slope=self.slope, original=extended)
        if self.reach.travel > MAX_TRAVEL * self.size:
            return None
        travel, tilt = EXTENSION_FACTOR * self.reach.travel, EXTENSION_FACTOR * (self.reach.tilt + TILT_MARGIN)
        reach = self.reach._replace(travel=travel, tilt=tilt)
        candidates = _candidates(self.moving, self.reference, reach, self.size, has_form=self.has_form)
        return None if candidates is None else replace(self, candidates=candidates, reach=reach)

    @property
    def turn(self) -> float:
        """The rotation [rad] about the centre of the moving face that moves its ends by the largest travel of the body."""
        return 2 * self.reach.travel / float(np.ptp(self.moving.vertices, axis=0).max())

    def covers(self, X_RM: Float[Array, "n 12"]) -> Bool[Array, " n"]:
        """Return whether the bodies are near enough to their nominal poses that no candidate is missed (n,)."""
        covered = np.empty(len(X_RM), dtype=bool)
        turn = self.reach.tilt + TILT_MARGIN if self.reach.tilt_sine < 1 else np.inf
        places_kernel.cover(np.ascontiguousarray(X_RM), self._extremes, self.reach.travel, turn, covered)
        return covered

    def reaches(self, X_RM: Float[Array, "n 12"]) -> Bool[Array, " n"]:
        """Return whether no candidate is missed at poses X_RM (n, 12), including the extended meetings (n,)."""
        reached = self.covers(X_RM)
        if not reached.all() and self.extended is not None:
            reached[~reached] = self.extended.reaches(X_RM[~reached])
        return reached

    @cached_property
    def _extremes(self) -> Float[Array, "v 3"]:
        """The outermost vertices of the moving body in a set of fixed directions."""
        numbers = np.unique((self.moving.vertices @ np.vstack([DIRECTIONS, CORNERS]).T).argmax(axis=0))
        return np.ascontiguousarray(self.moving.vertices[numbers])

    def at(self, X_RM: Float[Array, "n 12"], look: Look = PLAIN) -> Places:
        """Return the relevant contact points at poses X_RM (n, 12).

        Where bodies are beyond reach, the points belong to the `extended` meeting. Its indices follow the indices of this one.
        """
        beyond = np.flatnonzero(~self.covers(X_RM))
        if beyond.size and self.extended is not None:
            return self._beyond(beyond, X_RM, look)
        return self._near(X_RM, look)

    def _beyond(self, rows: np.ndarray, X_RM: np.ndarray, look: Look) -> Places:
        """Return contact points at poses; at some of them, `rows`, the bodies are beyond reach."""
        assert self.extended is not None
        count = len(self)
        nearby = self._near(X_RM, look)
        extended_places = self.extended.at(X_RM[rows], look.take(rows, count))
        extended_places = extended_places._replace(
            labels=np.where(extended_places.labels >= 0, extended_places.labels + count, -1)
        )
        width = max(nearby.gaps.shape[1], extended_places.gaps.shape[1])
        empty, padded = Places.none(len(rows), width), Places.none(len(X_RM), width)
        for values, nearby_values, no_values, extended_values in zip(padded, nearby, empty, extended_places, strict=True):
            values[:, : nearby_values.shape[1]] = nearby_values
            values[rows] = no_values
            values[rows, : extended_values.shape[1]] = extended_values
        return padded

    def _near(self, X_RM: np.ndarray, look: Look) -> Places:
        """Return contact points at poses within reach."""
        places = Places.none(len(X_RM), max(min(len(self), MAX_POINTS), 1))
        # Bodies that were beyond reach before may have kept candidates of the extended meeting.
        retained = np.zeros((len(X_RM), 0), dtype=np.int64) if look.retained is None else look.retained
        retained = np.where(retained < len(self), retained, -1)
        ceilings = np.full(len(X_RM), np.inf) if look.ceilings is None else look.ceilings
        count = places_kernel.find(
            self.moving, self.reference, self.candidates,
            np.array(
                [self.reach.depth, self.reach.height, np.inf if self.is_free else _passed(self.reach, self.size), self.slope]
            ),
            kernel.MARGIN * self.size + self.overhang,
            np.array([look.error, self.reach.depth, look.nearness, self.overhang]),
            np.ascontiguousarray(X_RM), retained, ceilings, DIRECTIONS, *places[:-1],
        )  # fmt: skip
        return Places(*(np.ascontiguousarray(values[:, : max(count, 1)]) for values in places))


def meeting(faces: tuple[Surface, Surface], bodies: tuple, reach: Reach, *, has_form: bool = False) -> Meeting | None:
    """Return where a moving and a reference face can touch; None if they have too many corners and edges to compare.

    faces, bodies   in their nominal poses
    has_form        whether a face has form
    """
    A, B = (polyhedron(face, body) for face, body in zip(faces, bodies, strict=True))
    size = float(max(np.ptp(face.mesh.vertices, axis=0).max() for face in faces))
    candidates = _candidates(A, B, reach, size, has_form=has_form)
    return None if candidates is None else Meeting(A, B, candidates, reach, size, has_form=has_form)


def _candidates(A: Polyhedron, B: Polyhedron, reach: Reach, size: float, *, has_form: bool) -> places_kernel.Candidates | None:
    comparisons = len(A.vertices) * len(B.facets) + len(A.facets) * len(B.vertices) + len(A.edges) * len(B.edges)
    if comparisons > MAX_COMPARISONS:
        return None
    travel, tilt_sine = reach.depth, reach.tilt_sine
    facing, facets = facing_planes(A, B, _passed(reach, size), reach.height)
    parts = [
        _on_facets(A, B, facing, travel, tilt_sine, CORNER_ON_FACET),
        _on_facets(B, A, facing.T, travel, tilt_sine, FACET_ON_CORNER),
        _across_edges(A, B, facing, travel, tilt_sine),
    ]
    if sum(len(part) for part in parts) > MAX_CANDIDATES:
        return None
    kinds = np.repeat([CORNER_ON_FACET, FACET_ON_CORNER, EDGE_ON_EDGE], [len(part) for part in parts])
    table = np.column_stack([kinds, np.concatenate(parts)])
    if not has_form:
        table = table[~moot_corners(A, B, facets, table)]
    return sorted_candidates(A, B, table, facets, has_form=has_form)


def _passed(reach: Reach, size: float) -> float:
    """Return the nominal depth [mm] beyond which a body cannot have penetrated through a facet, or across an edge."""
    return reach.overlap + kernel.MARGIN * size


def _on_facets(
    corners: Polyhedron, facets: Polyhedron, facing: np.ndarray, travel: float, tilt_sine: float, kind: int
) -> np.ndarray:
    """Return candidates (candidate, 3), first, second and plane, of the corners of one body on the facets of the other.

    `facing` is the table of facing planes; its rows are the planes of `corners`.
    """
    candidates = [np.zeros((0, 3), dtype=int)]
    boxes = facets.facets.min(axis=1) - travel, facets.facets.max(axis=1) + travel
    for block in blocks(len(corners.vertices), len(facets.facets)):
        starts = corners.cones[block.start : block.stop + 1]
        slopes = corners.directions[starts[0] : starts[-1]] @ facets.normals.T
        fits = np.minimum.reduceat(slopes, starts[:-1] - starts[0], axis=0) >= -tilt_sine
        corner, facet = np.nonzero(overlaps(corners.vertices[block], corners.vertices[block], *boxes))
        fits = fits[corner, facet]
        corner += block.start
        plane = facing[corners.vertex_planes[corner], facets.facet_planes[facet][:, None]].max(axis=1, initial=-1)
        fits |= plane >= 0
        corner, facet, plane = corner[fits], facet[fits], plane[fits]
        # The facets of a facing plane count as one.
        keys = corner * (len(facets.facets) + facing.size) + np.where(plane >= 0, plane, -1 - facet)
        _, distinct = np.unique(keys, return_index=True)
        first, second = (corner, facet) if kind == CORNER_ON_FACET else (facet, corner)
        candidates.append(np.stack([first, second, plane], axis=1)[distinct])
    return np.concatenate(candidates)


def _across_edges(A: Polyhedron, B: Polyhedron, facing: np.ndarray, travel: float, tilt_sine: float) -> np.ndarray:
    """Return candidates (candidate, 3), first, second and plane, of edges of the moving body across edges of the reference."""
    candidates = [np.zeros((0, 3), dtype=int)]
    boxes = B.edges.min(axis=1) - travel, B.edges.max(axis=1) + travel
    arcs_A, arcs_B = _arcs(A), _arcs(B)
    for block in blocks(len(A.edges), len(B.edges)):
        first, second = np.nonzero(overlaps(A.edges[block].min(axis=1), A.edges[block].max(axis=1), *boxes))
        first += block.start
        planes = facing[A.edge_planes[first][:, :, None], B.edge_planes[second][:, None]]
        plane = planes.max(axis=(1, 2), initial=-1)
        meets = np.flatnonzero((plane < 0) & A.convex[first].astype(bool) & B.convex[second].astype(bool))
        retained = plane >= 0
        for some in np.array_split(meets, len(meets) // BLOCK_ARCS + 1):
            cosine = -np.einsum("pai,pki->pak", arcs_A[first[some]], arcs_B[second[some]]).min(axis=(1, 2))
            retained[some] = cosine >= np.cos(min(np.arcsin(tilt_sine) + ARC_SPACING, np.pi))
        candidates.append(np.stack([first, second, plane], axis=1)[retained])
    return np.concatenate(candidates)


def _arcs(body: Polyhedron) -> np.ndarray:
    """Return normals (edge, share, 3) at equal angles between the normals of the two facets at each edge."""
    first, second = body.edge_normals[:, 0], body.edge_normals[:, 1]
    cosine = (first * second).sum(axis=1, keepdims=True)
    across = second - cosine * first
    sine = np.linalg.norm(across, axis=1, keepdims=True)
    angles = np.arctan2(sine, cosine) * ARC
    return np.cos(angles)[..., None] * first[:, None] + np.sin(angles)[..., None] * (across / np.maximum(sine, TINY))[:, None]
