"""Parts with a feature of every kind and a tolerance of every kind."""

import numpy as np
import trimesh

import tolcontact as tc
from tests.cases.frames import STILL, Frame
from tests.cases.round_contact import BARREL
from tolcontact.declaration import GeometricTolerance

BORE = tc.select.Cylinder(inner=True)


def block_with(feature: str, *tolerances, frame: Frame = STILL, **datums) -> tc.Assembly:
    """A fixed block of 100 x 50 x 10 with datums A (bottom), B (side), C (end), and tolerances of its top, end or thickness."""
    a = tc.Assembly("block")
    b = a.part("block", tc.Box(100, 50, 10), **frame.place(10, 20, 30), fixed=True)
    b.feature("bottom", b.face("-z"), *datums.get("A", ()), datum="A")
    if feature != "width":
        b.feature("side", b.face("-y"), *datums.get("B", ()), datum="B")
    b.feature("end", b.face("-x"), *datums.get("C", ()), datum="C")
    faces = {"top": ["+z"], "far": ["+x"], "width": ["+y", "-y"]}[feature]
    own = b.feature(feature, *map(b.face, faces), *tolerances)
    for name, point in {"corner": (100, 50, 10), "middle": (50, 25, 10), "edge": (100, 25, 10)}.items():
        a.measure(name, own.point(*point), along=frame.along(0, 0, 1))
    return a


def ring_with(feature: str, *tolerances, frame: Frame = STILL) -> tc.Assembly:
    """A fixed ring of 10 x 40 x 30, with datums A (bottom) and B (rim), and tolerances of its bore, or of its top."""
    a = tc.Assembly("ring")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(5, 20, 30, sections=48)), **frame.place(5, -7, 3), fixed=True)
    ring.feature("bottom", ring.face("-z"), datum="A")
    ring.feature("rim", ring.face(BARREL), datum="B")
    own = ring.feature(feature, ring.face(BORE if feature == "bore" else "+z"), *tolerances)
    point = own.axis(1) if feature == "bore" else own.point(0, 0, 15)
    a.measure("x", point, along=frame.along(1, 0, 0))
    a.measure("z", point, along=frame.along(0, 0, 1))
    return a


def ball_with(*tolerances, frame: Frame = STILL, letter: str | None = None) -> tc.Assembly:
    """A fixed block with a ball on it, which is toleranced to its faces."""
    a = tc.Assembly("ball")
    base = trimesh.creation.box(extents=(40, 40, 10))
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=6).apply_translation((3, 2, 20))
    part = a.part("base", tc.Mesh(trimesh.util.concatenate([base, sphere])), **frame.place(0, 0, 0), fixed=True)
    for datum, (direction, height) in {"A": ("-z", 5), "B": ("-x", 20), "C": ("-y", 20)}.items():
        axis = "xyz".index(direction[1])
        part.feature(datum, part.face(direction, lambda c, n, k=axis, h=height: abs(c[:, k] + h) < 1e-9), datum=datum)
    own = part.feature("ball", part.face(lambda c, n: np.linalg.norm(c - (3, 2, 20), axis=1) < 7), *tolerances, datum=letter)
    a.measure("x", own.axis(0), along=frame.along(1, 0, 0))
    return a


HOLES = ((-30.0, 0.0), (30.0, 0.0), (0.0, 20.0), (0.0, -20.0))


def plate_with_holes(count: int, *side: tc.Perpendicularity, frame: Frame = STILL, turn: np.ndarray | None = None):
    """A fixed plate of 100 x 60 x 10 about its middle, datums A (bottom), B (side) and C (end), and the faces of its holes.

    `side` are tolerances of datum B. With `turn` (3, 3) the shape itself is turned in its own frame.
    """
    a = tc.Assembly("plate")
    tubes = [trimesh.creation.cylinder(4, 9, sections=48).apply_translation((x, y, 0)) for x, y in HOLES[:count]]
    for tube in tubes:
        tube.invert()
    mesh = trimesh.util.concatenate([trimesh.creation.box(extents=(100, 60, 10)), *tubes])
    centres, normals = mesh.triangles_center, mesh.face_normals
    if turn is not None:
        mesh.vertices = mesh.vertices @ turn.T
    part = a.part("plate", tc.Mesh(mesh), **frame.place(5, -7, 3), fixed=True)
    for letter, axis, height in (("A", 2, 5), ("B", 1, 30), ("C", 0, 50)):
        is_face = (abs(centres[:, axis] + height) < 1e-9) & (normals[:, axis] < -0.5)
        part.feature(letter, part.face(np.flatnonzero(is_face).tolist()), *(side if letter == "B" else ()), datum=letter)
    beside = [np.hypot(centres[:, 0] - x, centres[:, 1] - y) < 4.5 for x, y in HOLES[:count]]
    faces = [part.face(np.flatnonzero(near & (abs(normals[:, 2]) < 0.5)).tolist()) for near in beside]
    return a, part, faces


def pattern_with(
    *tolerances, count: int = 4, follower: GeometricTolerance | None = None, side=(), frame: Frame = STILL
) -> tc.Assembly:
    """A plate with a pattern of holes, datum H; the last one is toleranced to the others if there is a `follower`."""
    a, part, faces = plate_with_holes(count, *side, frame=frame)
    pattern = part.pattern("H", *(faces[:-1] if follower else faces), *tolerances, datum="H")
    if follower:
        part.feature("last", faces[-1], follower)
    a.measure("x", pattern.members[0].axis(1), along=frame.along(1, 0, 0))
    return a


def rails_with(*tolerances, frame: Frame = STILL) -> tc.Assembly:
    """A base with two rails, the tops of which are a pattern."""
    a = tc.Assembly("rails")
    boxes = [trimesh.creation.box(extents=(80, 10, 20)).apply_translation((0, y, 10)) for y in (-25, 25)]
    base = trimesh.creation.box(extents=(80, 80, 10)).apply_translation((0, 0, -10))
    part = a.part("base", tc.Mesh(trimesh.util.concatenate([base, *boxes])), **frame.place(5, -7, 3), fixed=True)
    part.feature("foot", part.face("-z", lambda c, n: c[:, 2] < -14), datum="A")
    tops = [part.face("+z", lambda c, n, s=s: (c[:, 2] > 19) & (s * c[:, 1] > 0)) for s in (-1, 1)]
    pattern = part.pattern("tops", *tops, *tolerances)
    a.measure("z", pattern.members[0].point(40, -20, 20), along=frame.along(0, 0, 1))
    return a


EVERY = {  # of the kinds that move features; all state 99.73 % inside
    "size of planes": lambda frame: block_with("width", tc.Size(50, 0.1, -0.05), frame=frame),
    "size of a bore": lambda frame: ring_with("bore", tc.Size(10, 0.05, 0.01), frame=frame),
    "position of a plane": lambda frame: block_with("far", tc.Position(0.2, "A|B|C"), frame=frame),
    "position of an axis": lambda frame: ring_with("bore", tc.Position(0.2, "A|B"), frame=frame),
    "position in a flat zone": lambda frame: ring_with("bore", tc.Position(0.2, "A|B", zone="flat", along="x"), frame=frame),
    "projected position": lambda frame: ring_with("bore", tc.Position(0.2, "A|B", projected=25), frame=frame),
    "position with a bonus": lambda frame: ring_with(
        "bore", tc.Size(10, 0.1, 0), tc.Position(0.2, "A|B", material="M"), frame=frame
    ),
    "bonus alone": lambda frame: ring_with("bore", tc.Size(10, 0.2, 0.1), tc.Position(0, "A|B", material="M"), frame=frame),
    "position of a centre": lambda frame: ball_with(tc.Position(0.2, "A|B|C"), frame=frame),
    "position as far as datums lock it": lambda frame: ring_with("bore", tc.Position(0.2, "A"), frame=frame),
    "symmetry": lambda frame: block_with("width", tc.Size(50, 0.1), tc.Symmetry(0.1, "A|C"), frame=frame),
    "coaxiality": lambda frame: ring_with("bore", tc.Coaxiality(0.1, "B"), frame=frame),
    "profile": lambda frame: block_with("top", tc.Profile(0.3, "A", outside=0.2), frame=frame),
    "line profile": lambda frame: block_with("top", tc.LineProfile(0.3, "A"), frame=frame),
    "parallelism": lambda frame: block_with("top", tc.Parallelism(0.1, "A"), frame=frame),
    "perpendicularity to one": lambda frame: block_with("far", tc.Perpendicularity(0.1, "A"), frame=frame),
    "perpendicularity of an axis": lambda frame: ring_with("bore", tc.Perpendicularity(0.1, "A"), frame=frame),
    "projected perpendicularity": lambda frame: ring_with("bore", tc.Perpendicularity(0.1, "A", projected=45), frame=frame),
    "angularity": lambda frame: block_with("far", tc.Angularity(0.1, "A|B"), frame=frame),
    "circular run-out": lambda frame: ring_with("bore", tc.CircularRunout(0.1, "B"), frame=frame),
    "total run-out": lambda frame: ring_with("bore", tc.TotalRunout(0.1, "B"), frame=frame),
    "axial run-out": lambda frame: ring_with("top", tc.TotalRunout(0.1, "B"), frame=frame),
    "orientation within location": lambda frame: block_with("top", tc.Profile(0.3, "A"), tc.Parallelism(0.1, "A"), frame=frame),
    "composite": lambda frame: ring_with("bore", tc.Position(0.4, "A|B"), tc.Position(0.1, "A"), frame=frame),
    "datums that deviate": lambda frame: block_with(
        "far", tc.Position(0.2, "B|A"), frame=frame, B=(tc.Perpendicularity(0.2, "A"),)
    ),
    "pattern": lambda frame: pattern_with(tc.Size(8, 0.1), tc.Position(0.5, "A|B|C"), frame=frame),
    "composite pattern": lambda frame: pattern_with(tc.Position(0.5, "A|B|C"), tc.Position(0.1, "A"), frame=frame),
    "pattern of three frames": lambda frame: pattern_with(
        tc.Position(0.5, "A|B|C"), tc.Position(0.2, "A|B"), tc.Position(0.05), frame=frame
    ),
    "pattern with orientation within": lambda frame: pattern_with(
        tc.Position(0.5, "A|B|C"), tc.Position(0.1, "A"), tc.Perpendicularity(0.05, "A"), frame=frame
    ),
    "pattern that follows a datum": lambda frame: pattern_with(
        tc.Position(0.1, "A|B|C"), tc.Position(0.05, "A"), side=[tc.Perpendicularity(0.3, "A")], frame=frame
    ),
    "common zone of axes": lambda frame: pattern_with(tc.Position(0.1), frame=frame),
    "pattern with a bonus": lambda frame: pattern_with(tc.Size(8, 0.1, 0), tc.Position(0, "A|B|C", material="M"), frame=frame),
    "common zone of planes": lambda frame: rails_with(tc.Profile(0.1), frame=frame),
    "uneven profile of a pattern": lambda frame: rails_with(tc.Profile(0.3, "A", outside=0.2), frame=frame),
    "datum of a pattern": lambda frame: pattern_with(
        tc.Position(0.5, "A|B|C"), tc.Position(0.1, "A"), count=3, follower=tc.Position(0.05, "A|H"), frame=frame
    ),
}
