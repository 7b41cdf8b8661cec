"""Expansion of a fastener into a part, its location, contact pairs and a force."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Cylinder, Face, Feature, Locator, Part, Pin, Size, Station
from tolcontact.declaration.part import face_of
from tolcontact.declaration.values import is_finite, is_length, script_line, vector
from tolcontact.errors import Faults, GeometryFault
from tolcontact.fasteners.fit import INTO, SEAT, Fit, made_fit, meshes_of, part_fit, placed_cylinder, placed_plane
from tolcontact.features import PlaneFeature
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.faces import face_area
from tolcontact.geometry.shapes import HEAD_WIDTH, placement_of

DIGITS = 12  # of places [mm]: what is beyond is rounding
SAME_FACE = 1 - 1e-6  # share of its area that a face has in common with the face of its feature


def _locate(scene: Assembly | Station, name: str, part: Part, fit: Fit, faces: Mapping[str, Face], seat: Face | None) -> None:
    """Locate a fastener in the hole that holds it, or let it float: with its head on its seat, or held at an end alone.

    `faces` are the walls of its holes by label, from its head on.
    """
    if INTO in faces:
        ground = _feature_of(faces[INTO], f"{name} hole")
        scene.locate(part, list(_hole_locators(part, fit, fit.holes[INTO])), on=ground)
    elif seat is not None and fit.seat is not None:
        ground = _feature_of(seat, f"{name} seat")
        scene.locate(part, list(_seat_locators(part, fit, fit.seat)), on=ground, floating=True)
    else:
        first, *_ = faces.values()
        end = _locator(part, "end", fit.axis.at(fit.reach[1]), fit.axis.head)
        scene.locate(part, [end], on=first.part, floating=True)


def _hole_locators(part: Part, fit: Fit, hole: CylinderFeature) -> Iterator[Locator]:
    """Yield locators at both ends of the axis of the hole that holds a fastener, along it, and against turning."""
    x, y = fit.axis.across
    low, high = fit.axis.extent(hole)
    for number, station in enumerate((low, high), start=1):
        yield _locator(part, f"x{number}", fit.axis.at(station), x)
        yield _locator(part, f"y{number}", fit.axis.at(station), y)
    yield _locator(part, "end", fit.axis.at(low), fit.axis.head)
    # Within the material: on its surface, along which it points, it would look like a mistake (see tolcontact.plausibility).
    yield _locator(part, "turn", fit.axis.at((low + high) / 2) + fit.radius / 2 * x, y)


def _seat_locators(part: Part, fit: Fit, seat: PlaneFeature) -> Iterator[Locator]:
    """Yield supports under the head of a fastener, and above it: it slides on its seat, and neither lifts off nor tilts."""
    x, y = fit.axis.across
    middle, arm = fit.axis.at(fit.axis.station(seat.centre)), HEAD_WIDTH * fit.radius
    for number in range(3):
        angle = 2 * math.pi * number / 3
        foot = middle + arm * (math.cos(angle) * x + math.sin(angle) * y)
        for name, direction in (("seat", fit.axis.head), ("clamp", -fit.axis.head)):
            yield _locator(part, f"{name} {number + 1}", foot, direction, one_sided=True)


def _locator(part: Part, name: str, point: np.ndarray, direction: np.ndarray, *, one_sided: bool = False) -> Locator:
    R, _ = placement_of(part)
    return Locator(name, _in_part(part, point), direction @ R, 0.0, one_sided=one_sided)


def _in_part(part: Part, point: np.ndarray) -> np.ndarray:
    """Return a point (3,) of the nominal assembly in the frame of a part."""
    R, t = placement_of(part)
    return np.round((point - t) @ R, DIGITS) + 0.0


def _feature_of(face: Face, name: str) -> Feature:
    """Return the feature of its part that a face belongs to, or declare one with this name, which has no tolerances."""
    meshes = meshes_of(face)
    area, mesh = face_area(face, meshes), meshes[face.part]
    for feature in face.part.features:
        if len(feature.faces) == 1 and area.share(face_area(feature.faces[0], meshes), mesh) > SAME_FACE:
            return feature
    return face.part.feature(name, face)


def fasten(
    scene: Assembly | Station,
    name: str,
    fastener: Part | Face | Feature | Size | float,
    *,
    through: Sequence[Face | Feature],
    into: Face | Feature | None = None,
    seat: Face | Feature | None = None,
    pushed: Any = None,
) -> Part:
    """Declare a fastener in the holes of several parts of a scene, and return its part.

    `tc.fasten(model, "screw", 10, through=[hole], into=thread, seat=cover.face("+z"))`

    scene      the assembly, or the station of its location, contacts and force
    name       of the part
    fastener   its diameter [mm] or its tc.Size, and a part is made; or a part, or the face of its shank
    through    the holes that it passes through, from its head on
    into       a threaded or press-fit hole, which holds it; without one it floats in the clearance of its holes
    seat       the plane under its head
    pushed     a force (x, y, z) [N], in the assembly frame, on a fastener that floats

    In a station its part is there alone; join it to the parts that it fastens if later stations need it.
    Raises ModelError with all its faults, also if the fastener does not fit into the nominal assembly.
    """
    _check_types(scene, name, fastener, through, into, seat)
    assembly = scene.assembly
    shank = face_of(fastener) if isinstance(fastener, Face | Feature) else None
    subject: Part | Size | float = fastener.part if isinstance(fastener, Face | Feature) else fastener
    faces = {f"through[{k}]": face_of(hole) for k, hole in enumerate(through)} | ({INTO: face_of(into)} if into else {})
    plane_face = face_of(seat) if seat else None
    place = f'fastener "{name}" ({script_line()})'
    faults = Faults(f"{place}: {fault}" for fault in _reference_faults(scene, subject, faces, plane_face, pushed))
    faults.refuse(assembly.name)
    holes = {label: faults.attempt(f"{place}: {label}", _hole, face) for label, face in faces.items()}
    plane = faults.attempt(f"{place}: {SEAT}", placed_plane, plane_face) if plane_face else None
    faults.refuse(assembly.name)
    if isinstance(subject, Part):
        fit = faults.attempt(f"{place}: the fastener", part_fit, subject, shank, holes, plane)
        faults.refuse(assembly.name)
    else:
        fit = made_fit(subject.nominal if isinstance(subject, Size) else float(subject), holes, plane)
    Faults(f"{place}: {fault}" for fault in fit.faults(plane_face)).refuse(assembly.name)
    part = subject if isinstance(subject, Part) else _made_part(assembly, name, subject, fit)
    _declare_contacts(scene, name, fit.shank or _shank_face(part, fit), faces)
    _locate(scene, name, part, fit, faces, plane_face)
    if pushed is not None:
        middle = fit.axis.at(sum(fit.reach) / 2)
        scene.force(f"{name} push", at=part.point(*_in_part(part, middle)), vector=pushed)
    return part


def _hole(face: Face) -> CylinderFeature:
    hole = placed_cylinder(face)
    if not hole.is_inner:
        raise GeometryFault(f"face {face} is the outside of a cylinder; expected the wall of a hole")
    return hole


def _shank_face(part: Part, fit: Fit) -> Face:
    return part.face(Cylinder(radius=fit.radius, inner=False))


def _made_part(assembly: Assembly, name: str, size: Size | float, fit: Fit) -> Part:
    """Declare the part of a fastener that is known by its diameter: its origin is under its head, and z points to the head."""
    x, y = fit.axis.across
    rotation = Rotation.from_matrix(np.column_stack([x, y, fit.axis.head])).as_rotvec()
    shape = Pin(2 * fit.radius, round(fit.reach[1] - fit.reach[0], DIGITS), fit.seat is not None)
    at, turn = (np.round(vector, DIGITS) + 0.0 for vector in (fit.axis.origin, rotation))
    part = assembly.part(name, shape, at=at, rotation=turn)
    if isinstance(size, Size):
        part.feature("shank", _shank_face(part, fit), size)
    return part


def _declare_contacts(scene: Assembly | Station, name: str, shank: Face, faces: Mapping[str, Face]) -> None:
    """Declare contact of the shank with the face of each hole that it passes through, by labels.

    Parts before the last one are moving sides, so that contact may move them. The last one holds the fastener, or is the
    reference of it.
    """
    *_, last = faces
    for label, face in faces.items():
        if label != INTO:
            moving, reference = (shank, face) if label == last else (face, shank)
            scene.contact(f"{name} in {face.part.name}", moving=moving, reference=reference)


def _check_types(scene: Any, name: str, fastener: Any, through: Any, into: Any, seat: Any) -> None:
    """Raise TypeError for an argument of a wrong type."""
    kinds: Any = Part | Face | Feature | Size | int | float
    face: Any = Face | Feature
    hole = "the wall of a hole: part.face(tc.select.Cylinder(...)), or a feature"
    arguments = [
        ("the first argument", scene, Assembly | Station, "an assembly, or one of its stations"),
        ("fastener", fastener, kinds, "a diameter in mm, a tc.Size, a part, or the face of its shank"),
        ("through", through, list | tuple, "a list of holes, from the head on"),
        *((f"through[{k}]", item, face, hole) for k, item in enumerate(through if isinstance(through, list | tuple) else ())),
        ("into", into, face | None, f"{hole}, or None"),
        ("seat", seat, face | None, 'the plane under the head: part.face("+z"), or a feature'),
    ]
    for label, value, kind, expected in arguments:
        if not isinstance(value, kind) or isinstance(value, bool):
            raise TypeError(f'fasten "{name}": {label} is a {type(value).__name__}; expected {expected}')


def _reference_faults(
    scene: Assembly | Station, fastener: Part | Size | float, holes: Mapping[str, Face], seat: Face | None, pushed: Any
) -> Iterator[str]:
    """Yield the faults that show before any shape is read."""
    assembly: Assembly = scene.assembly
    if assembly.stations and scene is assembly:
        yield f"it belongs to no station; declare it in one: tc.fasten({assembly.stations[0].name}, ...)"
    passed = [label for label in holes if label != INTO]
    if not passed:
        yield "through is empty; give the holes that it passes through, from its head on: through=[hole, ...]"
    elif len(holes) < 2:
        yield "it passes through one part, and goes into none; give the hole of a second part, in through or as into"
    owners = {label: face.part for label, face in holes.items()}
    if isinstance(fastener, Part):
        owners["the fastener"] = fastener
    elif isinstance(fastener, Size):
        yield from fastener.faults()
    elif not (is_length(fastener) and fastener > 0):
        yield f"its diameter is {fastener!r}; expected a length in mm above 0"
    yield from _owner_faults(assembly, owners | ({SEAT: seat.part} if seat else {}))
    if seat is not None and not any(seat.part is owners[label] for label in passed):
        yield f'seat is on part "{seat.part.name}", which it does not pass through; choose the face under its head'
    if seat is not None and isinstance(fastener, Part) and INTO in holes:
        yield "seat has no effect on a part that stands in a hole, which holds it; leave it out"
    if pushed is not None:
        yield from _push_faults(assembly, holes, pushed)


def _owner_faults(assembly: Assembly, owners: Mapping[str, Part]) -> Iterator[str]:
    """Yield parts that the assembly does not have, and parts with two holes. `owners` are parts by the labels of faces."""
    earlier: dict[int, str] = {}
    for label, part in owners.items():
        if not any(part is member for member in assembly.parts):
            names = ", ".join(member.name for member in assembly.parts) or "none"
            yield f'{label} is on part "{part.name}", which "{assembly.name}" does not have; its parts are: {names}'
        elif label != SEAT and id(part) in earlier:
            yield f'{earlier[id(part)]} and {label} are of one part, "{part.name}"; expected one hole of each part'
        earlier.setdefault(id(part), label)


def _push_faults(assembly: Assembly, holes: Mapping[str, Face], pushed: Any) -> Iterator[str]:
    force = vector(pushed)
    if not (is_finite(force) and any(force)):
        yield f"pushed is {pushed!r}; expected a force (x, y, z) in N that is not zero"
    elif INTO in holes:
        yield f"pushed has no effect on a fastener that the hole in {INTO} holds; leave it out, or push a part"
    elif assembly.method is not None and not assembly.method.minimizes.presses:
        yield (
            'pushed is a force, which only the objective "seating" uses; state it in the model: '
            'tc.Assembly(..., method=tc.Method(objective="seating")), or leave the method out'
        )
