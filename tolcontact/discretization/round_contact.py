"""Whether two faces touch as round ones do: a ball, or a shaft, of one beside walls of the other. Assembly frame, mm."""

import itertools
import math

import numpy as np
import trimesh

from tolcontact.discretization.round_points import RoundPoint
from tolcontact.discretization.round_walls import NotRoundError, arc, directions
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cylinder, Plane, RoundSurface
from tolcontact.geometry.curvature import chord_height
from tolcontact.geometry.edges import CREASE, rim
from tolcontact.geometry.surface import Piece, Surface

MOST = 40  # points of a pair
PARALLEL = 1e-3  # rad: how far the axis of a shaft may stand off its wall's
MARGIN = math.radians(5.0)  # between where a shaft that is not round all about touches, and its ends
STATIONS = 200  # places along an axis that are looked at
HALVINGS = 40
ASIDE = 0.3  # sine of half the angle between facets, at most
CLOSE = 1e-6  # of a face's size: what is no farther apart is in one place
FLAT = 1e-7  # between normals of neighbouring triangles of one plane


def round_points(own: Surface, target: Surface, reach: float) -> list[RoundPoint]:
    """The contact points of a moving face and a reference face, if all of them are those of balls or shafts; else none.

    Walls farther away than `reach` [mm] have none.
    """
    try:
        pieces = itertools.product(_pieces(own), _pieces(target))
        found = [point for moving, reference in pieces for point in _between(moving, reference, reach)]
    except NotRoundError:
        return []
    return found if len(found) <= MOST else []


def _pieces(face: Surface) -> list[Piece]:
    """What a face consists of, with planes whose normals point out of the material.

    Raises NotRoundError if something else is among it.
    """
    found = [_outward(piece) for piece in face.pieces]
    rest = face.unknown
    if not len(rest.mesh.faces):
        return found
    if not (np.asarray(rest.mesh.area_faces) > 0).all():
        raise NotRoundError
    neighbours, normals = np.asarray(rest.mesh.face_adjacency), np.asarray(rest.mesh.face_normals)
    first, second = normals[neighbours[:, 0]], normals[neighbours[:, 1]]
    is_one = np.linalg.norm(first - second, axis=1) < FLAT
    if (~is_one & ((first * second).sum(axis=1) > CREASE)).any():  # a curved face that is not known
        raise NotRoundError
    label = trimesh.graph.connected_component_labels(neighbours[is_one], node_count=len(rest.mesh.faces))
    if label.max() >= MOST:
        raise NotRoundError
    for number in range(label.max() + 1):
        own = rest.part(np.flatnonzero(label == number))
        n = (np.asarray(own.mesh.face_normals) * np.asarray(own.mesh.area_faces)[:, None]).sum(axis=0)
        found.append(Piece(Plane(np.asarray(own.mesh.vertices)[0], n / np.linalg.norm(n)), False, own))
    return found


def _outward(piece: Piece) -> Piece:
    plane = piece.surface
    if plane.kind != "plane" or not piece.is_hollow:
        return piece
    return Piece(Plane(plane.origin, -plane.axis), False, piece.face)


def _between(moving: Piece, reference: Piece, reach: float) -> list[RoundPoint]:
    """The points between two pieces; none if they are too far apart.

    Raises NotRoundError if one of them is no ball or shaft, or the other is no wall that it touches from the side.
    """
    for kind, find in (("sphere", _of_ball), ("cylinder", _of_shaft)):
        for body, wall, on_moving in ((moving, reference, True), (reference, moving, False)):
            if body.surface.kind == kind and not body.is_hollow and (kind == "sphere" or _is_wall(body, wall)):
                return find(body, wall, reach, on_moving)
    raise NotRoundError


def _is_wall(body: Piece, wall: Piece) -> bool:
    """Whether a shaft may lie along a piece: a plane, or a hole."""
    if wall.surface.kind == "plane":
        return abs(float(body.surface.axis @ wall.surface.axis)) < PARALLEL
    across = float(np.linalg.norm(np.cross(body.surface.axis, wall.surface.axis)))
    return wall.surface.kind == "cylinder" and wall.is_hollow and across < PARALLEL


def _nothing_if_far(wall: Piece, places: np.ndarray, reach: float) -> list[RoundPoint]:
    """No points. Raises NotRoundError if an edge of the wall is within reach [mm] of some places (place, 3)."""
    _, nearest = wall.face.nearest(places)
    if np.linalg.norm(nearest - places, axis=1).min() <= reach:
        raise NotRoundError
    return []


def _of_ball(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    c, r = body.surface.origin, body.surface.radius
    side = -1.0 if wall.is_hollow else 1.0
    distance, slope = (each[0] for each in wall.surface.distance(c[None]))
    if side * distance - r > reach:
        return []
    if wall.is_hollow:
        if not isinstance(wall.surface, RoundSurface) or (wall.surface.kind != "cone" and r > wall.surface.radius):
            raise NotRoundError  # where a groove is open is not known; what is too large for a hollow touches its rim
        tangents = [wall.surface.tangent(e) for e in directions(wall)]
        held = [_holds(wall, wall.surface.touched(c, e)) for e in directions(wall)]
        held += [_holds(body, c - r * plane.axis) for plane in tangents]
        flat = [Piece(plane, False, wall.face) for plane in tangents]
    else:
        held, flat = [_holds(wall, c - distance * slope), _holds(body, c - r * slope)], []
    if not all(held):
        return _nothing_if_far(wall, c[None], r + reach)
    nearest = RoundPoint.ball(wall, body.surface, on_moving, *(arc(wall) if wall.is_hollow else ()))
    return [nearest, *(RoundPoint.ball(plane, body.surface, on_moving) for plane in flat)]


def _of_shaft(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    return (_on_plane if wall.surface.kind == "plane" else _in_hole)(body, wall, reach, on_moving)


def _on_plane(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    shaft, n = body.surface, wall.surface.axis
    height = float((shaft.origin - wall.surface.origin) @ n) - shaft.radius
    if height > reach:
        return []
    towards, opening = arc(body)
    if opening < math.pi and -n @ towards < math.cos(max(opening - MARGIN, 0)):
        raise NotRoundError  # a little turn, and its edge or the face beside it touches

    # Beside a flat triangle's rim what lies on the round face stands aside by some of the height between the two.
    slacks = [CLOSE * piece.face.mesh.scale + ASIDE * chord_height(piece.face) for piece in (body, wall)]

    def touches(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether the shaft, and the wall, is where they would touch at places s (place,) [mm] along the axis."""
        line = shaft.origin + np.atleast_1d(s)[:, None] * shaft.axis - shaft.radius * n
        feet = line - ((line - wall.surface.origin) @ n)[:, None] * n
        return tuple(  # type: ignore[return-value]
            surface.overhang(where) <= slack
            for surface, where, slack in ((body.face, line, slacks[0]), (wall.face, feet, slacks[1]))
        )

    start, end = _extent(body.face, shaft)
    among = np.concatenate([(np.asarray(each.face.mesh.vertices) - shaft.origin) @ shaft.axis for each in (body, wall)])
    places = np.unique(np.concatenate([np.linspace(start, end, STATIONS + 1), among.clip(start, end)]))
    places = np.unique(np.concatenate([places, (places[1:] + places[:-1]) / 2]))
    there = np.flatnonzero(np.logical_and(*touches(places)))
    if not there.size or height <= -shaft.radius:
        return _nothing_if_far(wall, shaft.origin + places[:, None] * shaft.axis, shaft.radius + reach)
    found = []
    for k, outer, limit in ((there[0], there[0] - 1, start), (there[-1], there[-1] + 1, end)):
        place, cut = float(places[k]), np.zeros(3)
        if 0 <= outer < len(places):
            inside, outside = place, float(places[outer])
            for _ in range(HALVINGS):
                middle = (inside + outside) / 2
                inside, outside = (middle, outside) if np.logical_and(*touches(np.array(middle)))[0] else (inside, middle)
            on_shaft, on_wall = (bool(each[0]) for each in touches(np.array(outside)))
            if on_wall or not on_shaft:
                raise NotRoundError  # the shaft's end is not square to its axis
            edge = _edge(wall.face, shaft.origin + inside * shaft.axis - (height + shaft.radius) * n)
            cut = np.cross(n, edge[1] - edge[0])
            cut /= np.linalg.norm(cut)
            if abs(cut @ shaft.axis) < PARALLEL:
                raise NotRoundError
            place = float((edge[0] - shaft.origin) @ cut / (shaft.axis @ cut))
        elif abs(place - limit) > CLOSE * body.face.mesh.scale:
            raise NotRoundError
        found.append(RoundPoint.end(wall, shaft, place, cut, on_moving))
    return found


def _in_hole(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint]:
    shaft, hole = body.surface, wall.surface
    assert isinstance(hole, Cylinder)
    (start, end), (lower, upper) = (_extent(piece.face, shaft) for piece in (body, wall))
    close = CLOSE * max(body.face.mesh.scale, wall.face.mesh.scale)
    ends = ((max(start, lower), start >= lower - close), (min(end, upper), end <= upper + close))
    apart = [shaft.origin + place * shaft.axis - hole.origin for place, _ in ends]
    clear = [hole.radius - shaft.radius - float(np.linalg.norm(p - (p @ hole.axis) * hole.axis)) for p in apart]
    if min(clear) > reach or ends[1][0] - ends[0][0] <= close:
        return _nothing_if_far(wall, shaft.origin + np.linspace(start, end, STATIONS)[:, None] * shaft.axis, shaft.radius)
    (towards, opening), (_, around) = arc(wall), arc(body)
    is_wide = hole.radius >= shaft.radius or opening == math.pi
    if around < math.pi or not is_wide or min(clear) < -reach or not (_is_square(body) and _is_square(wall)):
        raise NotRoundError
    found = []
    for place, is_own in ends:
        cut = np.zeros(3) if is_own else hole.axis
        found.append(RoundPoint.end(wall, shaft, place, cut, on_moving, towards, opening))
        for e in directions(wall):
            found.append(RoundPoint.end(Piece(hole.tangent(e), False, wall.face), shaft, place, cut, on_moving))
    return found


def _extent(face: Surface, shaft: AnalyticSurface) -> tuple[float, float]:
    """From where to where a face reaches along an axis [mm]."""
    along = (np.asarray(face.mesh.vertices) - shaft.origin) @ shaft.axis
    return float(along.min()), float(along.max())


def _is_square(piece: Piece) -> bool:
    """Whether the rim of a cylinder lies in two planes across its axis."""
    mesh = piece.face.mesh
    along = (np.asarray(mesh.vertices)[np.unique(rim(mesh.faces))] - piece.surface.origin) @ piece.surface.axis
    apart = np.minimum(along - along.min(initial=np.inf), along.max(initial=-np.inf) - along)
    return bool(along.size) and bool((apart < CLOSE * mesh.scale + piece.surface.residual).all())


def _holds(piece: Piece, point: np.ndarray) -> bool:
    """Whether a point (3,) of its surface is one of the piece."""
    scale = piece.face.mesh.scale
    return bool(piece.face.overhang(point[None])[0] <= CLOSE * scale) and bool(
        np.linalg.norm(piece.face.project(point[None])[0][0] - point) <= CLOSE * scale
    )


def _edge(face: Surface, point: np.ndarray) -> np.ndarray:
    """Ends (2, 3) of the edge of the rim that is nearest to a point (3,)."""
    ends = np.asarray(face.mesh.vertices)[rim(face.mesh.faces)]
    along = ends[:, 1] - ends[:, 0]
    share = (((point - ends[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1)).clip(0, 1)
    return np.asarray(ends[np.linalg.norm(ends[:, 0] + share[:, None] * along - point, axis=1).argmin()])
