"""The faces of fasteners, of their holes and of their seats in the nominal assembly. Lengths in mm."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Cylinder as CylinderSelection, Face, Geometry, Part
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.files import Shape
from tolcontact.geometry.shapes import shape

DIRECTION_DIGITS = 9  # of the parts of a direction: what is beyond is rounding
SHAPES = 16  # that stay in memory while a script declares its fasteners


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


@dataclass(frozen=True, eq=False)
class PlacedCylinder:
    """A cylindrical face: the ends (3,) of its axis, its radius [mm], and True for a hole."""

    face: Face
    ends: tuple[np.ndarray, np.ndarray]
    radius: float
    is_inner: bool

    @property
    def middle(self) -> np.ndarray:
        """The middle (3,) of its axis."""
        return (self.ends[0] + self.ends[1]) / 2

    @property
    def direction(self) -> np.ndarray:
        """The unit vector (3,) from its first end to the other one."""
        along = self.ends[1] - self.ends[0]
        return along / np.linalg.norm(along)

    def axis(self, towards: np.ndarray) -> Axis:
        """Return its axis from its middle, in the sense of a vector (3,)."""
        return Axis(self.middle, self.direction * (1.0 if self.direction @ towards >= 0 else -1.0))

    def extent(self, axis: Axis) -> tuple[float, float]:
        """Return the stations [mm] on the axis of a fastener between which it lies."""
        low, high = sorted(axis.station(end) for end in self.ends)
        return low, high

    def offset(self, axis: Axis) -> float:
        """Return the largest distance [mm] from its own axis to the axis of a fastener."""
        return max(axis.distance(end) for end in self.ends)


@dataclass(frozen=True, eq=False)
class PlacedPlane:
    """A flat face: a point (3,) on it, and its outward normal (3,)."""

    face: Face
    point: np.ndarray
    normal: np.ndarray


def placed_cylinder(face: Face) -> PlacedCylinder:
    """Return a face that is one cylinder. Raises GeometryFault for any other face."""
    surface = patch(face, meshes_of(face))
    pieces, rest = surface.pieces, len(surface.unknown.mesh.faces)
    if len(pieces) != 1 or rest or not isinstance(pieces[0].surface, Cylinder):
        kinds = [piece.surface.kind for piece in pieces] + (["plane" if surface.is_flat else "other triangles"] if rest else [])
        raise GeometryFault(f"face {face} is {', '.join(dict.fromkeys(kinds))}; expected one cylinder")
    cylinder = pieces[0].surface
    stations = (np.asarray(surface.mesh.vertices) - cylinder.origin) @ cylinder.axis
    R, t = placement(face.part)
    low, high = (R @ (cylinder.origin + float(end) * cylinder.axis) + t for end in (stations.min(), stations.max()))
    return PlacedCylinder(face, (low, high), cylinder.radius, pieces[0].is_hollow)


def placed_plane(face: Face) -> PlacedPlane:
    """Return a face that is flat. Raises GeometryFault for any other face."""
    surface = patch(face, meshes_of(face))
    if not surface.is_flat:
        raise GeometryFault(f"face {face} is not flat; expected the plane under the head")
    R, t = placement(face.part)
    normal = surface.mesh.area_faces @ surface.mesh.face_normals
    return PlacedPlane(face, R @ surface.mesh.vertices[0] + t, R @ normal / np.linalg.norm(normal))


def outer_cylinders(part: Part) -> Iterator[PlacedCylinder]:
    """Yield the outer cylinders of a part by radius, the largest first; several of one radius are left out."""
    descriptions = describe_faces(shape_of(part.geometry))
    radii = {face.radius for face in descriptions if face.kind == "cylinder" and face.radius and not face.is_inner}
    for radius in sorted(radii, reverse=True):
        try:
            yield placed_cylinder(part.face(CylinderSelection(radius=radius, inner=False)))
        except GeometryFault:
            continue


def placement(part: Part) -> tuple[np.ndarray, np.ndarray]:
    """Return R (3, 3) and t (3,) [mm] of a part in the nominal assembly."""
    return Rotation.from_rotvec(part.rotation).as_matrix(), np.array(part.at)


def meshes_of(face: Face) -> Meshes:
    """Return the meshes of the parts that a face refers to. Raises GeometryFault for the first fault of the face or a part."""
    for fault in (*face.faults(), *(fault for part in face.parts for fault in (*part.faults(), *part.geometry.faults()))):
        raise GeometryFault(fault)
    return {part: shape_of(part.geometry) for part in face.parts}


@lru_cache(SHAPES)
def shape_of(geometry: Geometry) -> Shape:
    """Return the triangles of a geometry, which are read once for several fasteners."""
    return shape(geometry)
