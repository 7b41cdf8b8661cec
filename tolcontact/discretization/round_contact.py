"""Whether two faces touch as round ones do: a ball, or a shaft, of one beside walls of the other. Assembly frame, mm."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import trimesh

from tolcontact.discretization.analytic import Form
from tolcontact.discretization.edges import rim
from tolcontact.discretization.round_points import RoundPoint
from tolcontact.discretization.surface import Piece, Surface

MOST = 40  # points of a pair
TANGENTS = 5  # of a whole hollow wall, besides the nearest
WHOLE = math.radians(50.0)  # of a round face no wider gap is missing
PARALLEL = 1e-3  # rad: how far the axis of a shaft may stand off its wall's
MARGIN = math.radians(5.0)  # between where a shaft that is not round all about touches, and its ends
STATIONS = 200  # places along an axis that are looked at
HALVINGS = 40
CLOSE = 1e-6  # of a face's size: what is no farther apart is in one place
CLOSED = 1e-3  # of a sphere: less than that is missing of a whole one
MISSING = 0.05  # of a cap: what its triangles leave out, and rims that are not round
FLAT = 1e-9  # rad: triangles that turn by less from each other are one plane


def round_points(own: Surface, target: Surface, reach: float) -> list[RoundPoint]:
    """The contact points of a moving face and a reference face, if all of them are those of balls or shafts; else none.

    Walls farther away than `reach` [mm], or beside which there is no ball or shaft, have none.
    """
    sides = _pieces(own), _pieces(target)
    found: list[RoundPoint] = []
    for moving, reference in itertools.product(*sides):
        points = _between(moving, reference, reach)
        if points is None:
            return []
        found += points
    return found if len(found) <= MOST else []


def _pieces(face: Surface) -> list[Piece]:
    """What a face consists of, with planes whose normals point out of the material; nothing if there is more to it."""
    found = [_outward(piece) for piece in face.pieces]
    rest = face.unknown
    if len(rest.mesh.faces):
        neighbours, angles = np.asarray(rest.mesh.face_adjacency), np.asarray(rest.mesh.face_adjacency_angles)
        label = trimesh.graph.connected_component_labels(neighbours[angles < FLAT], node_count=len(rest.mesh.faces))
        if label.max() >= MOST:
            return []
        for number in range(label.max() + 1):
            own = rest.part(np.flatnonzero(label == number))
            n = np.asarray(own.mesh.face_normals).mean(axis=0)
            found.append(Piece(Form("plane", np.asarray(own.mesh.vertices)[0], n / np.linalg.norm(n)), False, own))
    return found


def _outward(piece: Piece) -> Piece:
    form = piece.form
    if form.kind != "plane" or not piece.is_hollow:
        return piece
    return Piece(Form("plane", form.origin, -form.axis), False, piece.surface)


def _between(moving: Piece, reference: Piece, reach: float) -> list[RoundPoint] | None:
    """The points between two pieces; None if they are not those of a ball or a shaft."""
    for kind, find in (("sphere", _of_ball), ("cylinder", _of_shaft)):
        for body, wall, on_moving in ((moving, reference, True), (reference, moving, False)):
            if body.form.kind == kind and not body.is_hollow:
                points = find(body, wall, reach, on_moving)
                if points is not None:
                    return points
    return None


def _of_ball(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint] | None:
    c, r = body.form.origin, body.form.radius
    if wall.is_hollow and (wall.form.kind == "torus" or (wall.form.kind == "sphere" and not _is_cap(wall))):
        return None  # where it is open is not known
    side = -1.0 if wall.is_hollow else 1.0
    distance, slope = (each[0] for each in wall.form.distance(c[None]))
    if not -r < side * distance - r <= reach:
        return []
    nearest, tangents = RoundPoint.ball(wall, body.form, on_moving, *_arc(wall)), []
    if wall.is_hollow:
        for e in _directions(wall):
            touching = _on_wall(wall.form, c, e)
            normal = _tangent(wall.form, e).axis
            if _holds(wall, touching) and _holds(body, c - r * normal):
                tangents.append(RoundPoint.ball(Piece(_tangent(wall.form, e), False, wall.surface), body.form, on_moving))
        return [nearest, *tangents] if tangents else []
    normal = side * slope
    is_there = _holds(wall, c - side * distance * normal) and _holds(body, c - r * normal)
    return [nearest] if is_there else []


def _of_shaft(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint] | None:
    parallel = float(np.linalg.norm(np.cross(body.form.axis, wall.form.axis)))
    if wall.form.kind == "plane" and abs(float(body.form.axis @ wall.form.axis)) < PARALLEL:
        return _on_plane(body, wall, reach, on_moving)
    if wall.form.kind == "cylinder" and wall.is_hollow and parallel < PARALLEL:
        return _in_hole(body, wall, reach, on_moving)
    return None


def _on_plane(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint] | None:
    shaft, n = body.form, wall.form.axis
    towards, opening = _arc(body)
    if opening < math.pi and -n @ towards < math.cos(max(opening - MARGIN, 0)):
        return None  # a little turn, and its edge or the face beside it touches
    height = float((shaft.origin - wall.form.origin) @ n) - shaft.radius
    if not -shaft.radius < height <= reach:
        return []

    def touches(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether the shaft, and the wall, is where they would touch at places s (place,) [mm] along the axis."""
        line = shaft.origin + np.atleast_1d(s)[:, None] * shaft.axis - shaft.radius * n
        feet = line - ((line - wall.form.origin) @ n)[:, None] * n
        return tuple(  # type: ignore[return-value]
            piece.surface.overhang(places) <= CLOSE * piece.surface.mesh.scale for piece, places in ((body, line), (wall, feet))
        )

    start, end = _extent(body.surface, shaft)
    among = np.concatenate([(np.asarray(each.surface.mesh.vertices) - shaft.origin) @ shaft.axis for each in (body, wall)])
    places = np.unique(np.concatenate([np.linspace(start, end, STATIONS + 1), among.clip(start, end)]))
    places = np.unique(np.concatenate([places, (places[1:] + places[:-1]) / 2]))
    there = np.flatnonzero(np.logical_and(*touches(places)))
    if not there.size:
        return []
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
                return None  # the shaft's end is not square to its axis
            edge = _edge(wall.surface, shaft.origin + inside * shaft.axis - (height + shaft.radius) * n)
            cut = np.cross(n, edge[1] - edge[0])
            cut /= np.linalg.norm(cut)
            if abs(cut @ shaft.axis) < PARALLEL:
                return None
            place = float((edge[0] - shaft.origin) @ cut / (shaft.axis @ cut))
        elif abs(place - limit) > CLOSE * body.surface.mesh.scale:
            return None
        found.append(RoundPoint.end(wall, shaft, place, cut, on_moving))
    return found


def _in_hole(body: Piece, wall: Piece, reach: float, on_moving: bool) -> list[RoundPoint] | None:
    shaft, hole = body.form, wall.form
    close = CLOSE * max(body.surface.mesh.scale, wall.surface.mesh.scale)
    if _arc(body)[1] < math.pi or not all(_has_square_ends(piece, shaft, close) for piece in (body, wall)):
        return None
    (start, end), (lower, upper) = (_extent(piece.surface, shaft) for piece in (body, wall))
    if min(end, upper) - max(start, lower) <= close:
        return []
    arc, found = _arc(wall), []
    for place, is_own in ((max(start, lower), start >= lower), (min(end, upper), end <= upper)):
        apart = shaft.origin + place * shaft.axis - hole.origin
        clear = hole.radius - shaft.radius - float(np.linalg.norm(apart - (apart @ hole.axis) * hole.axis))
        if not -reach <= clear <= reach:
            return []
        cut = np.zeros(3) if is_own else hole.axis
        found.append(RoundPoint.end(wall, shaft, place, cut, on_moving, *arc))
        for e in _directions(wall):
            flat = Piece(_tangent(hole, e), False, wall.surface)
            found.append(RoundPoint.end(flat, shaft, place, cut, on_moving))
    return found


def _extent(face: Surface, shaft: Form) -> tuple[float, float]:
    """From where to where a face reaches along an axis [mm]."""
    along = (np.asarray(face.mesh.vertices) - shaft.origin) @ shaft.axis
    return float(along.min()), float(along.max())


def _has_square_ends(piece: Piece, shaft: Form, close: float) -> bool:
    """Whether its rim lies in two planes across the axis."""
    along = (np.asarray(piece.surface.mesh.vertices)[np.unique(rim(piece.surface.mesh.faces))] - shaft.origin) @ shaft.axis
    return bool(along.size) and bool((np.minimum(along - along.min(), along.max() - along) < close).all())


def _holds(piece: Piece, point: np.ndarray) -> bool:
    """Whether a point (3,) of its form is one of the piece."""
    scale = piece.surface.mesh.scale
    return bool(piece.surface.overhang(point[None])[0] <= CLOSE * scale) and bool(
        np.linalg.norm(piece.surface.project(point[None])[0][0] - point) <= CLOSE * scale
    )


def _edge(face: Surface, point: np.ndarray) -> np.ndarray:
    """Ends (2, 3) of the edge of the rim that is nearest to a point (3,)."""
    ends = np.asarray(face.mesh.vertices)[rim(face.mesh.faces)]
    along = ends[:, 1] - ends[:, 0]
    share = (((point - ends[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1)).clip(0, 1)
    return np.asarray(ends[np.linalg.norm(ends[:, 0] + share[:, None] * along - point, axis=1).argmin()])


def _arc(wall: Piece) -> tuple[np.ndarray, float]:
    """The middle of a round face, seen from its axis (3,), and how far [rad] it reaches to either side of that."""
    vertices = np.asarray(wall.surface.mesh.vertices)
    across = vertices - wall.form.origin
    if wall.form.kind == "sphere":
        middle, cosine = _cap(wall)
        return middle, math.acos(max(cosine, -1.0)) if cosine > -1 + CLOSED else math.pi
    across -= (across @ wall.form.axis)[:, None] * wall.form.axis
    across = across[np.linalg.norm(across, axis=1) > CLOSE * wall.surface.mesh.scale]
    if wall.form.kind == "plane" or not len(across):
        return np.linalg.svd(wall.form.axis[None])[2][1], math.pi
    x = across[0] / np.linalg.norm(across[0])
    y = np.cross(wall.form.axis, x)
    azimuths = np.sort(np.arctan2(across @ y, across @ x))
    gaps = np.diff(azimuths, append=azimuths[0] + 2 * math.pi)
    widest = int(gaps.argmax())
    if gaps[widest] < WHOLE:
        return x, math.pi
    opening = math.pi - float(gaps[widest]) / 2
    turn = float(azimuths[widest] + gaps[widest]) + opening
    return math.cos(turn) * x + math.sin(turn) * y, opening


def _cap(wall: Piece) -> tuple[np.ndarray, float]:
    """The middle of a piece of a sphere (3,), seen from its centre, and the cosine of the angle as far as which it reaches."""
    apart = np.asarray(wall.surface.mesh.triangles_center) - wall.form.origin
    middle = (np.asarray(wall.surface.mesh.area_faces)[:, None] * apart).sum(axis=0)
    corners = (np.asarray(wall.surface.mesh.vertices) - wall.form.origin) / wall.form.radius
    if np.linalg.norm(middle) < CLOSED * wall.surface.mesh.area * wall.form.radius:  # it is all around
        return corners[0], -1.0
    middle /= np.linalg.norm(middle)
    return middle, float((corners @ middle).min())


def _is_cap(wall: Piece) -> bool:
    """Whether a piece of a sphere is all of a cap, or of the sphere."""
    _, cosine = _cap(wall)
    return bool(wall.surface.mesh.area > (1 - MISSING) * 2 * math.pi * wall.form.radius**2 * (1 - cosine))


def _directions(wall: Piece) -> Sequence[np.ndarray]:
    """Unit vectors (3,), from the axis, of tangent planes that a hollow wall has besides the nearest."""
    x, opening = _arc(wall)
    if wall.form.kind == "sphere":
        across = np.linalg.svd(x[None])[2][1:]
        lean, turns = min(opening, math.pi / 2), np.arange(TANGENTS - 1) * 2 * math.pi / (TANGENTS - 1)
        aside = [math.cos(turn) * across[0] + math.sin(turn) * across[1] for turn in turns]
        found = [x, *(math.cos(lean) * x + math.sin(lean) * each for each in aside)]
        return [*found, -x] if opening == math.pi else found
    y = np.cross(wall.form.axis, x)
    if opening == math.pi:
        azimuths = np.arange(TANGENTS) * 2 * math.pi / TANGENTS
    else:
        azimuths = np.linspace(-opening, opening, max(math.ceil(opening / math.pi * TANGENTS), 1) + 1)
    return [math.cos(azimuth) * x + math.sin(azimuth) * y for azimuth in azimuths]


def _tangent(wall: Form, e: np.ndarray) -> Form:
    """The plane that touches a hollow wall in a direction e (3,); it looks inward."""
    if wall.kind == "cone":
        return Form("plane", wall.origin, math.sin(wall.angle) * wall.axis - math.cos(wall.angle) * e)
    return Form("plane", wall.origin + wall.radius * e, -e)


def _on_wall(wall: Form, c: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Where a hollow wall in a direction e (3,) is nearest to c (3,)."""
    if wall.kind == "sphere":
        return np.asarray(wall.origin + wall.radius * e)
    if wall.kind == "cylinder":
        return np.asarray(wall.origin + ((c - wall.origin) @ wall.axis) * wall.axis + wall.radius * e)
    along = math.cos(wall.angle) * wall.axis + math.sin(wall.angle) * e
    return np.asarray(wall.origin + ((c - wall.origin) @ along) * along)
