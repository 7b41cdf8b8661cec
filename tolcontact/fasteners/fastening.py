"""Expansion of a fastener into a part, its location, contact pairs and a force."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Cylinder, Face, Feature, Part, Pin, Size, Station
from tolcontact.declaration.part import face_of
from tolcontact.declaration.values import script_line
from tolcontact.errors import GeometryFault, ModelError
from tolcontact.fasteners.fit import INTO, SEAT, Fit, check_types, made_fit, part_fit, reference_faults, station_faults
from tolcontact.fasteners.location import DIGITS, in_part, locate
from tolcontact.fasteners.placed_faces import PlacedCylinder, placed_cylinder, placed_plane


class Faults:
    """The faults of one fastener."""

    def __init__(self, assembly: Assembly, name: str) -> None:
        self._model, self._place, self._faults = assembly.name, f'fastener "{name}" ({script_line()})', list[str]()

    def add(self, faults: Iterable[str]) -> None:
        """Add faults, each with the name of the fastener."""
        self._faults += [f"{self._place}: {fault}" for fault in faults]

    def attempt(self, label: str, place: Callable[..., Any], *arguments: Any) -> Any:
        """Return what `place` returns; None, and a fault, if the geometry does not allow it."""
        try:
            return place(*arguments)
        except GeometryFault as fault:
            self.add([f"{label}: {fault}"])
            return None

    def refuse(self) -> None:
        """Raise ModelError if there are faults."""
        if self._faults:
            raise ModelError(self._model, self._faults)


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

    scene      the assembly, or the station of its location, contacts and force
    fastener   its diameter or its tc.Size, and a part is made; or a part, or the face of its shank
    through    the holes that it passes through, from its head on
    into       a threaded or press-fit hole, which holds it; without one it floats in the clearance of its holes
    seat       the plane under its head
    pushed     a force (x, y, z) [N], in the assembly frame, on a fastener that floats

    In a station its part is there alone; join it to the parts that it fastens if later stations need it.
    Raises ModelError with all its faults, also if the fastener does not fit into the nominal assembly.
    """
    check_types(scene, name, fastener, through, into, seat)
    assembly = scene.assembly
    shank = face_of(fastener) if isinstance(fastener, Face | Feature) else None
    subject: Part | Size | float = fastener.part if isinstance(fastener, Face | Feature) else fastener
    faces = {f"through[{k}]": face_of(hole) for k, hole in enumerate(through)} | ({INTO: face_of(into)} if into else {})
    plane_face = face_of(seat) if seat else None
    faults = Faults(assembly, name)
    faults.add(station_faults(assembly, scene))
    faults.add(reference_faults(assembly, subject, faces, plane_face, pushed))
    faults.refuse()
    holes = {label: faults.attempt(label, _hole, face) for label, face in faces.items()}
    plane = faults.attempt(SEAT, placed_plane, plane_face) if plane_face else None
    faults.refuse()
    if isinstance(subject, Part):
        fit = faults.attempt("the fastener", part_fit, subject, shank, holes, plane)
    else:
        fit = made_fit(subject.nominal if isinstance(subject, Size) else float(subject), holes, plane)
    faults.refuse()
    faults.add(fit.faults())
    faults.refuse()
    part = subject if isinstance(subject, Part) else _made_part(assembly, name, subject, fit)
    _declare_contacts(scene, name, fit.shank or _shank_face(part, fit), fit)
    locate(scene, name, part, fit)
    if pushed is not None:
        middle = fit.axis.at(sum(fit.reach) / 2)
        scene.force(f"{name} push", at=part.point(*in_part(part, middle)), vector=pushed)
    return part


def _hole(face: Face) -> PlacedCylinder:
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


def _declare_contacts(scene: Assembly | Station, name: str, shank: Face, fit: Fit) -> None:
    """Declare contact of the shank with each hole that it passes through.

    Parts before the last one are moving sides, so that contact may move them. The last one holds the fastener, or is the
    reference of it.
    """
    for label, hole in fit.holes.items():
        pair = f"{name} in {hole.face.part.name}"
        if label == INTO:
            continue
        if hole is list(fit.holes.values())[-1]:
            scene.contact(pair, moving=shank, reference=hole.face)
        else:
            scene.contact(pair, moving=hole.face, reference=shank)
