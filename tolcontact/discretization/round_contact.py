"""Contact of round faces: a ball or shaft of one part against walls of the other. Nominal assembly frame, mm.

Its gaps are in mechanics/round_gap.
"""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import trimesh

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.discretization.fixed_contact import Offsets
from tolcontact.discretization.following_contact import FollowingContact
from tolcontact.discretization.round_points import NO_DIRECTION, NotRoundError, RoundPoint, RoundPoints, arc, tangent_directions
from tolcontact.geometry.analytic_surfaces import Cone, Cylinder, Plane, RoundSurface, Sphere
from tolcontact.geometry.surface import Piece, Surface
from tolcontact.geometry.tolerances import PARALLEL, SAME_PLACE
from tolcontact.geometry.triangle_mesh import CREASE, have_area

MAX_POINTS = 40  # of a pair
ARC_MARGIN = math.radians(5.0)  # between the line of contact and the ends of a shaft's arc
AXIS_PLACES = 200  # places along an axis that are examined
BISECTIONS = 40
OVERHANG_SHARE = 0.01  # of their radius: overhang beyond a wall at which balls and shafts that travelled far may be active
MAX_FACET_SINE = 0.3  # of half the angle between facets
NORMAL_TOLERANCE = 1e-7  # between the normals of neighbouring triangles of one plane


@dataclass(frozen=True, eq=False, kw_only=True)
class RoundContact(FollowingContact):
    """Contact of balls and shafts with walls.

    round   the balls and shafts, and their walls; P^m, P^r, n^r are their nominal contact points
    """

    _accuracy_in_words: ClassVar[str] = ", exact on round faces"

    round: RoundPoints

    @classmethod
    def between(
        cls, moving: Surface, reference: Surface, reach: float, rounding: float, common: Mapping[str, Any]
    ) -> Self | None:
        points = round_points(moving, reference, reach)
        if not points:
            return None
        if any(point.is_hollow for point in points):
            rounding = 0.0  # a hollow wall is fitted to many vertices: rounding hardly moves it
        P_m, P_r, n_r = (np.array(rows) for rows in zip(*(point.nominal() for point in points), strict=True))
        P_r, offsets = P_r - rounding * n_r if rounding else P_r, Offsets.joined([], len(P_m))
        found = RoundPoints.of(points)
        return cls(P_m=P_m, P_r=P_r, n_r=n_r, offsets=offsets, coordinate_error=rounding, round=found, **common)

    @property
    def counts_centres(self) -> bool:
        return self.round.are_beside

    def counted(self, *, of_moving: bool) -> tuple[Float[Array, "point 3"], Float[Array, " point"]]:
        """Return the centres of round faces: a point on one would leave its part free to roll.

        It could then move aside at no cost until it is clear. In a hollow wall the tangent planes have contact points on all
        sides, which is as good. An end of a shaft's axis has no radius, since the other end holds the shaft.
        """
        if not self.counts_centres:
            return super().counted(of_moving=of_moving)
        centres, radii = zip(*(point.curvature(of_moving=of_moving) for point in self.round), strict=True)
        is_end = self.round.points["axis"].any(axis=1) & (self.round.points["on_moving"] == of_moving)
        return np.array(centres), np.where(is_end, 0.0, radii)

    @property
    def shapes(self) -> tuple[Mapping[str, np.ndarray], Mapping[str, np.ndarray]]:
        return self.round.walls, self.round.points

    @property
    def stays(self) -> Bool[Array, " point"]:
        return ~self.round.points["is_hollow"]

    def stiffness_shares(self) -> np.ndarray:
        return np.where(self.round.points["axis"].any(axis=1), 0.5, 1.0)  # a shaft has two ends

    def touching(self, X_RM: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        centres, radii, on_moving = (self.round.points[name][points] for name in ("centre", "radius", "on_moving"))
        at_body = np.where(on_moving[:, None], pose.apply(X_RM, centres), centres)
        return np.asarray(at_body - np.where(on_moving, radii, -radii)[:, None] * normals)

    def ends(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        points = self.round.points
        is_inside = np.logical_not(points["cut"].any(axis=1))  # a shaft may continue beyond a wall
        return points["centre"], points["on_moving"], is_inside, OVERHANG_SHARE * float(points["radius"].max())


def round_points(moving: Surface, reference: Surface, reach: float) -> list[RoundPoint]:
    """Return the contact points of two faces that touch as balls or shafts and walls; none if they may touch otherwise.

    Walls at a distance above `reach` [mm] have no points.
    """
    try:
        pieces = itertools.product(_pieces(moving), _pieces(reference))
        points = [point for pair in pieces for point in _points_between(*pair, reach)]
    except NotRoundError:
        return []
    return points if len(points) <= MAX_POINTS else []


def _pieces(face: Surface) -> list[Piece]:
    """Return the pieces of a face; the normals of planes point out of the material.

    Raises NotRoundError if a part of the face is neither flat nor on an analytic surface.
    """
    pieces = []
    for piece in face.pieces:
        plane = piece.surface
        is_inward = isinstance(plane, Plane) and piece.is_hollow
        pieces.append(Piece(Plane(plane.origin, -plane.axis), False, piece.face) if is_inward else piece)
    remainder = face.unknown
    if not len(remainder.mesh.faces):
        return pieces
    if not have_area(remainder.mesh).all():
        raise NotRoundError
    neighbours, normals = np.asarray(remainder.mesh.face_adjacency), np.asarray(remainder.mesh.face_normals)
    left_normals, right_normals = normals[neighbours[:, 0]], normals[neighbours[:, 1]]
    is_coplanar = np.linalg.norm(left_normals - right_normals, axis=1) < NORMAL_TOLERANCE
    if (~is_coplanar & ((left_normals * right_normals).sum(axis=1) > CREASE)).any():  # a curved face that is not recognized
        raise NotRoundError
    label = trimesh.graph.connected_component_labels(neighbours[is_coplanar], node_count=len(remainder.mesh.faces))
    if label.max() >= MAX_POINTS:
        raise NotRoundError
    for number in range(label.max() + 1):
        flat = remainder.part(np.flatnonzero(label == number))
        n = (np.asarray(flat.mesh.face_normals) * np.asarray(flat.mesh.area_faces)[:, None]).sum(axis=0)
        pieces.append(Piece(Plane(flat.vertices[0], n / np.linalg.norm(n)), False, flat))
    return pieces


def _points_between(moving: Piece, reference: Piece, reach: float) -> list[RoundPoint]:
    """Return the points between two pieces; none if they are too far apart.

    Raises NotRoundError if neither piece is a ball or shaft that touches the other as a wall.
    """
    sides = ((moving, reference, True), (reference, moving, False))
    for body, wall, on_moving in sides:
        if isinstance(body.surface, Sphere) and not body.is_hollow:
            return _ball_points(body, wall, reach, on_moving)
    for body, wall, on_moving in sides:
        if isinstance(body.surface, Cylinder) and not body.is_hollow:
            if isinstance(wall.surface, Plane) and abs(float(body.surface.axis @ wall.surface.axis)) < PARALLEL:
                return _shaft_on_plane(body, body.surface, wall, reach, on_moving)
            sine = float(np.linalg.norm(np.cross(body.surface.axis, wall.surface.axis)))
            if isinstance(wall.surface, Cylinder) and wall.is_hollow and sine < PARALLEL:
                return _shaft_in_hole(body, body.surface, wall, wall.surface, reach, on_moving)
    raise NotRoundError


def _no_points(wall: Piece, places: np.ndarray, reach: float) -> list[RoundPoint]:
    """Return no points. Raises NotRoundError if an edge of the wall is within reach [mm] of some places (place, 3)."""
    _, nearest = wall.face.nearest(places)
    if np.linalg.norm(nearest - places, axis=1).min() <= reach:
        raise NotRoundError
    return []


def _ball_points(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    """Return the points of a ball against a wall: the nearest, and on a hollow wall also its tangent planes."""
    c, r = body.surface.origin, body.surface.radius
    side = -1.0 if wall.is_hollow else 1.0
    distances, slopes = wall.surface.distance(c[None])
    distance, slope = distances[0], slopes[0]
    if side * distance - r > reach:
        return []
    if wall.is_hollow:
        # It is not known where a groove is open; a ball too large for a hollow touches its rim.
        if not isinstance(wall.surface, RoundSurface) or (not isinstance(wall.surface, Cone) and r > wall.surface.radius):
            raise NotRoundError
        directions = tangent_directions(wall)
        touches = [_contains(wall, wall.surface.touched(c, e)) for e in directions]
        touches += [_contains(body, c - r * wall.surface.tangent(e).axis) for e in directions]
    else:
        touches = [_contains(wall, c - distance * slope), _contains(body, c - r * slope)]
    if not all(touches):
        return _no_points(wall, c[None], r + reach)
    nearest = RoundPoint(wall.surface, wall.is_hollow, c, NO_DIRECTION, NO_DIRECTION, r, on_moving)
    if not wall.is_hollow:
        return [nearest]
    towards, opening = arc(wall)
    return [replace(nearest, towards=towards, opening=opening), *nearest.tangents(directions)]


class _ContactLine:
    """The line of contact of a shaft and a plane; its places are coordinates [mm] along the shaft's axis."""

    def __init__(self, body: Piece, wall: Piece) -> None:
        self._body, self._wall = body, wall
        # Near the rim of a flat triangle, points of the round face are shifted by a part of the height between the two.
        self._tolerances = [
            SAME_PLACE * piece.face.mesh.scale + MAX_FACET_SINE * piece.face.chord_height for piece in (body, wall)
        ]

    def on_shaft(self, places: np.ndarray) -> np.ndarray:
        """Return whether the shaft's face is there (place,)."""
        return self._body.face.overhang(self._points(places)) <= self._tolerances[0]

    def on_wall(self, places: np.ndarray) -> np.ndarray:
        """Return whether the wall's face is there (place,)."""
        plane, points = self._wall.surface, self._points(places)
        feet = points - ((points - plane.origin) @ plane.axis)[:, None] * plane.axis
        return self._wall.face.overhang(feet) <= self._tolerances[1]

    def is_touching(self, places: np.ndarray) -> np.ndarray:
        """Return whether both faces are there (place,)."""
        return self.on_shaft(places) & self.on_wall(places)

    def places(self, start: float, end: float) -> np.ndarray:
        """Return places from `start` to `end` that miss no part of the faces: even ones, all vertices, and midpoints."""
        shaft = self._body.surface
        vertices = [piece.face.vertices for piece in (self._body, self._wall)]
        of_vertices = np.concatenate(list(map(shaft.along, vertices)))
        places = np.unique(np.concatenate([np.linspace(start, end, AXIS_PLACES + 1), of_vertices.clip(start, end)]))
        return np.unique(np.concatenate([places, (places[1:] + places[:-1]) / 2]))

    def bracket(self, inside: float, outside: float) -> tuple[float, float]:
        """Return a touching place and one beyond it, narrowed down by bisection."""
        for _ in range(BISECTIONS):
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if self.is_touching(np.array([middle]))[0] else (inside, middle)
        return inside, outside

    def _points(self, places: np.ndarray) -> np.ndarray:
        shaft = self._body.surface
        return shaft.origin + places[:, None] * shaft.axis - shaft.radius * self._wall.surface.axis


def _shaft_on_plane(body: Piece, shaft: Cylinder, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    """Return the two points of a shaft along a plane, at the ends of their line of contact."""
    n = wall.surface.axis
    height = float((shaft.origin - wall.surface.origin) @ n) - shaft.radius
    if height > reach:
        return []
    towards, opening = arc(body)
    if opening < math.pi and -n @ towards < math.cos(max(opening - ARC_MARGIN, 0)):
        raise NotRoundError  # after a small rotation the shaft's edge touches, or the face next to it
    line = _ContactLine(body, wall)
    start, end = shaft.extent(body.face.vertices)
    places = line.places(start, end)
    touching = np.flatnonzero(line.is_touching(places))
    if not touching.size or height <= -shaft.radius:
        return _no_points(wall, shaft.origin + places[:, None] * shaft.axis, shaft.radius + reach)
    points = []
    for number, outer, limit in ((touching[0], touching[0] - 1, start), (touching[-1], touching[-1] + 1, end)):
        place, cut = float(places[number]), NO_DIRECTION
        if 0 <= outer < len(places):
            inside, outside = line.bracket(place, float(places[outer]))
            if line.on_wall(np.array([outside]))[0] or not line.on_shaft(np.array([outside]))[0]:
                raise NotRoundError  # the shaft's end is not square to its axis
            foot = shaft.origin + inside * shaft.axis - (height + shaft.radius) * n
            place, cut = _cut_by_edge(shaft, n, _nearest_edge(wall.face, foot))
        elif abs(place - limit) > SAME_PLACE * body.face.mesh.scale:
            raise NotRoundError
        centre = shaft.origin + place * shaft.axis
        points.append(RoundPoint(wall.surface, wall.is_hollow, centre, shaft.axis, cut, shaft.radius, on_moving))
    return points


def _cut_by_edge(shaft: Cylinder, n: np.ndarray, edge: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the place [mm] on the axis, and the unit normal (3,), where the plane along n through an edge (2, 3) cuts it."""
    cut = np.cross(n, edge[1] - edge[0])
    cut /= np.linalg.norm(cut)
    if abs(cut @ shaft.axis) < PARALLEL:
        raise NotRoundError
    return float((edge[0] - shaft.origin) @ cut / (shaft.axis @ cut)), cut


def _shaft_in_hole(
    body: Piece, shaft: Cylinder, wall: Piece, hole: Cylinder, reach: float, on_moving: bool
) -> list[RoundPoint]:
    """Return the points of a shaft in a parallel hole: at the first end of either, the nearest and the tangent planes."""
    (start, end), (lower, upper) = (shaft.extent(piece.face.vertices) for piece in (body, wall))
    tolerance = SAME_PLACE * max(body.face.mesh.scale, wall.face.mesh.scale)
    ends = ((max(start, lower), start >= lower - tolerance), (min(end, upper), end <= upper + tolerance))
    offsets = [shaft.origin + place * shaft.axis - hole.origin for place, _ in ends]
    clearances = [
        hole.radius - shaft.radius - float(np.linalg.norm(offset - (offset @ hole.axis) * hole.axis)) for offset in offsets
    ]
    if min(clearances) > reach or ends[1][0] - ends[0][0] <= tolerance:
        return _no_points(wall, shaft.origin + np.linspace(start, end, AXIS_PLACES)[:, None] * shaft.axis, shaft.radius)
    (towards, opening), (_, shaft_opening) = arc(wall), arc(body)
    is_wide = hole.radius >= shaft.radius or opening == math.pi
    is_square = _has_square_ends(body) and _has_square_ends(wall)
    if shaft_opening < math.pi or not is_wide or min(clearances) < -reach or not is_square:
        raise NotRoundError
    points = []
    for place, shaft_ends in ends:
        centre, cut = shaft.origin + place * shaft.axis, NO_DIRECTION if shaft_ends else hole.axis
        nearest = RoundPoint(hole, True, centre, shaft.axis, cut, shaft.radius, on_moving, towards, opening)
        points += [nearest, *nearest.tangents(tangent_directions(wall))]
    return points


def _has_square_ends(piece: Piece) -> bool:
    """Return whether the rim of a cylinder lies in two planes across its axis."""
    along = piece.surface.along(piece.face.rim_corners)
    distances = np.minimum(along - along.min(initial=np.inf), along.max(initial=-np.inf) - along)
    return bool(along.size) and bool((distances < SAME_PLACE * piece.face.mesh.scale + piece.surface.residual).all())


def _contains(piece: Piece, point: np.ndarray) -> bool:
    """Return whether a point (3,) of a piece's surface is on its face."""
    tolerance = SAME_PLACE * piece.face.mesh.scale
    return bool(piece.face.overhang(point[None])[0] <= tolerance) and bool(
        np.linalg.norm(piece.face.project(point[None])[0][0] - point) <= tolerance
    )


def _nearest_edge(face: Surface, point: np.ndarray) -> np.ndarray:
    """Return the ends (2, 3) of the edge of the rim that is nearest to a point (3,)."""
    ends = face.rim_ends
    along = ends[:, 1] - ends[:, 0]
    share = (((point - ends[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1)).clip(0, 1)
    return ends[np.linalg.norm(ends[:, 0] + share[:, None] * along - point, axis=1).argmin()]
