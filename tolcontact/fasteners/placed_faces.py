"""The faces of fasteners, of their holes and of their seats in the nominal assembly. Lengths in mm."""

import contextlib
from collections.abc import Iterator
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


def outer_cylinders(part: Part) -> Iterator[tuple[Face, CylinderFeature]]:
    """Yield the outer cylinders of a part by radius, the largest first; several of one radius are left out."""
    descriptions = describe_faces(shape_of(part.geometry))
    radii = {face.radius for face in descriptions if face.kind == "cylinder" and face.radius and not face.is_inner}
    for radius in sorted(radii, reverse=True):
        face = part.face(CylinderSelection(radius=radius, inner=False))
        with contextlib.suppress(GeometryFault):
            yield face, placed_cylinder(face)


def meshes_of(face: Face) -> Meshes:
    """Return the meshes of the parts that a face refers to. Raises GeometryFault for the first fault of the face or a part."""
    for fault in (*face.faults(), *(fault for part in face.parts for fault in (*part.faults(), *part.geometry.faults()))):
        raise GeometryFault(fault)
    return {part: shape_of(part.geometry) for part in face.parts}


@lru_cache(SHAPES)
def shape_of(geometry: Geometry) -> Shape:
    """Return the triangles of a geometry, which are read once for several fasteners."""
    return shape(geometry)
