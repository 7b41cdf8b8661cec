"""The fit of a fastener in its holes in the nominal assembly, and the faults of what it refers to. Lengths in mm."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from tolcontact.declaration import Cylinder as CylinderSelection, Face, Geometry, Part
from tolcontact.errors import GeometryFault
from tolcontact.features import PlaneFeature, feature_geometry
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.files import Shape
from tolcontact.geometry.shapes import placement_of, shape
from tolcontact.geometry.tolerances import SQUARE

INTO, SEAT = "into", "seat"  # labels of faces, in addition to "through[0]" and so on
FREE_END = 0.25  # of the diameter: how far a made shank reaches out of the parts
ROUNDING = 1e-6  # of a diameter: what counts as nothing
PRESSED = 1e-3  # of a diameter: distance allowed between the axes of a part and of the hole that it goes into
DIRECTION_DIGITS = 9  # of the parts of a direction: what is beyond is rounding
SHAPES = 16  # that stay in memory while a script declares its fasteners
Holes = Mapping[str, CylinderFeature]  # by their labels, from the head on


@dataclass(frozen=True, eq=False)
class Axis:
    """The axis of a fastener: a point (3,) on it, and the unit vector (3,) towards its head."""

    origin: np.ndarray
    head: np.ndarray

    @cached_property
    def across(self) -> tuple[np.ndarray, np.ndarray]:
        """Two unit vectors (3,) that are right-handed with it."""
        x = np.cross(np.eye(3)[int(np.abs(np.round(self.head, DIRECTION_DIGITS)).argmin())], self.head)
        x /= np.linalg.norm(x)
        return x, np.cross(self.head, x)

    def at(self, station: float) -> np.ndarray:
        """Return the point (3,) at a station [mm] from its origin."""
        return self.origin + station * self.head

    def station(self, point: np.ndarray) -> float:
        """Return the station [mm] of the projection of a point (3,)."""
        return float((point - self.origin) @ self.head)

    def distance(self, point: np.ndarray) -> float:
        """Return the distance [mm] of a point (3,)."""
        return float(np.linalg.norm(np.cross(point - self.origin, self.head)))

    def extent(self, cylinder: CylinderFeature) -> tuple[float, float]:
        """Return the stations [mm] between which a cylinder lies."""
        low, high = sorted(self.station(cylinder.end(number)) for number in (0, 1))
        return low, high


def axis_of(cylinder: CylinderFeature, towards: np.ndarray) -> Axis:
    """Return the axis of a cylinder from its middle, in the sense of a vector (3,)."""
    along = cylinder.end(1) - cylinder.end(0)
    direction = along / np.linalg.norm(along)
    return Axis(cylinder.centre, direction * (1.0 if direction @ towards >= 0 else -1.0))


def placed_cylinder(face: Face) -> CylinderFeature:
    """Return a face that is one cylinder, in the nominal assembly. Raises GeometryFault for any other face."""
    surface = patch(face, meshes_of(face))
    pieces, rest = surface.pieces, len(surface.unknown.mesh.faces)
    if len(pieces) != 1 or rest or not isinstance(pieces[0].surface, Cylinder):
        kinds = [piece.surface.kind for piece in pieces] + (["plane" if surface.is_flat else "other triangles"] if rest else [])
        raise GeometryFault(f"face {face} is {', '.join(dict.fromkeys(kinds))}; expected one cylinder")
    geometry = feature_geometry([surface.placed(*placement_of(face.part))])
    assert isinstance(geometry, CylinderFeature)
    return geometry


def placed_plane(face: Face) -> PlaneFeature:
    """Return a face that is flat, in the nominal assembly. Raises GeometryFault for any other face."""
    surface = patch(face, meshes_of(face))
    if not surface.is_flat:
        raise GeometryFault(f"face {face} is not flat; expected the plane under the head")
    geometry = feature_geometry([surface.placed(*placement_of(face.part))])
    assert isinstance(geometry, PlaneFeature)
    return geometry


def meshes_of(face: Face) -> Meshes:
    """Return the meshes of the parts that a face refers to. Raises GeometryFault for the first fault of the face or a part."""
    for fault in (*face.faults(), *(fault for part in face.parts for fault in (*part.faults(), *part.geometry.faults()))):
        raise GeometryFault(fault)
    return {part: shape_of(part.geometry) for part in face.parts}


@lru_cache(SHAPES)
def shape_of(geometry: Geometry) -> Shape:
    """Return the triangles of a geometry, which are read once for several fasteners."""
    return shape(geometry)


@dataclass(frozen=True, eq=False)
class Fit:
    """A shank in its holes.

    seat     the plane under its head; None without a seat
    radius   [mm] of the shank
    reach    stations [mm] of its ends on its axis
    shank    its face; None for a fastener that is to be made
    """

    holes: Holes
    seat: PlaneFeature | None
    axis: Axis
    radius: float
    reach: tuple[float, float]
    shank: Face | None = None

    def faults(self, seat: Face | None) -> Iterator[str]:
        """Yield why the shank does not stand in its holes, or its head on the face of the seat."""
        axis, radius = self.axis, self.radius
        if self.seat and np.linalg.norm(np.cross(self.seat.normal, axis.head)) > SQUARE:
            yield f"{SEAT}: face {seat} is not square to the axis of the holes; expected the plane under the head"
            return
        for label, hole in self.holes.items():
            clearance, (low, high) = hole.size / 2 - radius, axis.extent(hole)
            offset = max(axis.distance(hole.end(number)) for number in (0, 1))
            limit = PRESSED * 2 * radius if label == INTO else clearance
            if label != INTO and clearance < -ROUNDING * radius:
                yield (
                    f"{label} has a diameter of {hole.size:.6g} mm, and the fastener {2 * radius:.6g} mm; expected a "
                    "fastener that is not thicker than its hole"
                )
            elif offset > limit + ROUNDING * radius:
                yield (
                    f"{label}: its axis is {offset:.4g} mm off that of the fastener in the nominal assembly, where at most "
                    f"{limit:.4g} mm are possible; move the part, or choose another hole"
                )
            elif min(high, self.reach[1]) - max(low, self.reach[0]) < ROUNDING * radius:
                yield f"{label}: the fastener does not reach into this hole; move it, or choose another one"


def made_fit(diameter: float, holes: Holes, seat: PlaneFeature | None) -> Fit:
    """Return the fit of a fastener that is to be made: on the axis of its last hole, with its origin under its head."""
    axis = _axis_of(list(holes.values()), seat)
    extents = {label: axis.extent(hole) for label, hole in holes.items()}
    top = axis.station(seat.centre) if seat else max(high for _, high in extents.values()) + FREE_END * diameter
    bottom = extents[INTO][0] if INTO in extents else min(low for low, _ in extents.values()) - FREE_END * diameter
    return Fit(holes, seat, Axis(axis.at(top), axis.head), diameter / 2, (bottom - top, 0.0))


def part_fit(part: Part, face: Face | None, holes: Holes, seat: PlaneFeature | None) -> Fit:
    """Return the fit of a part whose shank is a face, or the thickest outer cylinder about the middle of the first hole.

    Raises GeometryFault if there is none.
    """
    first, *_ = holes.values()
    if face is not None:
        shank = placed_cylinder(face)
        if shank.is_inner:
            raise GeometryFault(f"face {face} is the wall of a hole; expected the outside of the shank")
        return _fit_of(face, shank, holes, seat)
    descriptions = describe_faces(shape_of(part.geometry))
    radii = {one.radius for one in descriptions if one.kind == "cylinder" and one.radius and not one.is_inner}
    for radius in sorted(radii, reverse=True):
        face = part.face(CylinderSelection(radius=radius, inner=False))
        try:
            shank = placed_cylinder(face)
        except GeometryFault:  # several cylinders of one radius are no shank
            continue
        axis = axis_of(shank, shank.axis)
        low, high = axis.extent(shank)
        if axis.distance(first.centre) < shank.size / 2 and low < axis.station(first.centre) < high:
            return _fit_of(face, shank, holes, seat)
    raise GeometryFault(
        f'no outer cylinder of part "{part.name}" stands in the first hole; move the part there, or give the face of '
        "its shank in place of the part"
    )


def _fit_of(face: Face, shank: CylinderFeature, holes: Holes, seat: PlaneFeature | None) -> Fit:
    axis = axis_of(shank, _axis_of(list(holes.values()), seat).head)
    return Fit(holes, seat, axis, shank.size / 2, axis.extent(shank), face)


def _axis_of(holes: list[CylinderFeature], seat: PlaneFeature | None) -> Axis:
    """Return the axis of the last hole, towards the first one, or out of the seat."""
    first, last = holes[0], holes[-1]
    return axis_of(last, seat.normal if seat else first.centre - last.centre)
