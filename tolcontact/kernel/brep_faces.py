"""B-rep faces as the CAD kernel has them: their surfaces, triangles, areas and boxes. Lengths in mm."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Pnt, gp_Sphere, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face

RECOGNITION_TOLERANCE = 1e-4  # [mm] between a B-spline surface and the simple surface for which it is taken
AREA_TOLERANCE = 1e-9  # relative, of the areas of planes, and 1e-7 of B-spline surfaces

Measure = tuple[float, tuple[float, ...], list[float]]  # area of a face [mm2], a point on it, and its outward normal there
as_face = getattr(TopoDS, "Face_s", TopoDS.Face)  # a shape as the face that it is; its name in release 7.9 is the former


def explore(shape: Any, kind: Any) -> Iterator[Any]:
    """Yield the pieces of a kind in a shape, each once, in their order."""
    explorer = TopExp_Explorer(shape, kind)
    visited: set[int] = set()
    while explorer.More():
        piece = explorer.Current()
        if hash(piece) not in visited:
            visited.add(hash(piece))
            yield piece
        explorer.Next()


def matrix(transform: Any) -> np.ndarray:
    """Return a transform of the kernel as an array (4, 4)."""
    rows = [[transform.Value(row, column) for column in range(1, 5)] for row in range(1, 4)]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def triangulation(faces: Sequence[Any]) -> dict[str, Any]:
    """Return the triangles of faces, seen from outside, and the measures of the faces.

    vertices    (vertex, 3) [mm]
    triangles   (triangle, 3)
    brep        (triangle,) the face of each triangle, from 0
    measures    of each face; None for a face without a surface
    """
    corners, triangles, brep = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    measures: list[Measure | None] = []
    count = 0
    for number, face in enumerate(faces):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(as_face(face), location)
        if mesh is None:
            measures.append(measure(face, middle_of_parameters(face)))
            continue
        nodes = np.array([mesh.Node(k).Coord() for k in range(1, mesh.NbNodes() + 1)]).reshape(-1, 3)
        if not location.IsIdentity():
            transform = matrix(location.Transformation())
            nodes = nodes @ transform[:3, :3].T + transform[:3, 3]
        indices = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3)
        edges = nodes[indices[:, 1:] - 1] - nodes[indices[:, :1] - 1]
        sizes = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        has_parameters = mesh.HasUVNodes() and len(indices) > 0
        measures.append(
            measure(face, [mesh.UVNode(int(k)).Coord() for k in indices[sizes.argmax()]]) if has_parameters else None
        )
        corners.append(nodes)
        triangles.append((indices[:, ::-1] if face.Orientation() == TopAbs_REVERSED else indices) - 1 + count)
        brep.append(np.full(len(indices), number))
        count += len(nodes)
    arrays: dict[str, list[np.ndarray]] = {"vertices": corners, "triangles": triangles, "brep": brep}
    return {name: np.concatenate(pieces) for name, pieces in arrays.items()} | {"measures": measures}


def middle_of_parameters(face: Any) -> list[tuple[float, float]]:
    """Return the parameters in the middle of a face without triangles. The point there may lie in one of its holes."""
    adaptor = BRepAdaptor_Surface(as_face(face))
    u, v = (adaptor.FirstUParameter(), adaptor.LastUParameter()), (adaptor.FirstVParameter(), adaptor.LastVParameter())
    return [(float(np.mean(u)), float(np.mean(v)))]


def measure(face: Any, parameters: Sequence[tuple[float, float]]) -> Measure | None:
    """Return the area of a face [mm2], the point amid the `parameters` of some of its points, and the outward normal there.

    The result is None if there is no surface, or no normal.
    """
    if BRep_Tool.Surface_s(as_face(face)) is None:
        return None
    properties, point, along, across = GProp_GProps(), gp_Pnt(), gp_Vec(), gp_Vec()
    BRepGProp.SurfaceProperties_s(as_face(face), properties, AREA_TOLERANCE)
    BRepAdaptor_Surface(as_face(face)).D1(*np.mean(parameters, axis=0), point, along, across)
    normal = np.cross(along.Coord(), across.Coord())
    length = float(np.linalg.norm(normal)) * (-1 if face.Orientation() == TopAbs_REVERSED else 1)
    return (properties.Mass(), point.Coord(), (normal / length).tolist()) if length else None


def box(faces: Sequence[Any], location: Any) -> np.ndarray:
    """Return the lower and the upper corner (2, 3) of the box around faces that are moved to a location."""
    bounds = Bnd_Box()
    for face in faces:
        is_tessellated = BRep_Tool.Surface_s(as_face(face)) is None
        BRepBndLib.AddOptimal_s(face.Moved(location), bounds, is_tessellated, False)
    bounds.SetGap(0.0)
    return np.array([bounds.CornerMin().Coord(), bounds.CornerMax().Coord()])


def surface(face: Any) -> dict[str, Any] | None:
    """Return the plane, with its outward normal, the cylinder, cone, sphere or torus of a face; None for another surface."""
    adaptor = BRepAdaptor_Surface(as_face(face))
    kind = adaptor.GetType().name.removeprefix("GeomAbs_")
    if kind in ("Plane", "Cylinder", "Cone", "Sphere", "Torus"):
        return described(kind.lower(), getattr(adaptor, kind)(), face.Orientation() == TopAbs_REVERSED)
    is_spline = kind in ("BSplineSurface", "BezierSurface")
    return recognized_surface(getattr(adaptor, kind.removesuffix("Surface"))()) if is_spline else None


def recognized_surface(spline: Any) -> dict[str, Any] | None:
    """Return the simple surface that a B-spline surface represents; None if there is none."""
    face = TopoDS_Face()  # of the whole surface: the kernel fails at faces whose surface is stated as a part of one
    BRep_Builder().MakeFace(face, spline, RECOGNITION_TOLERANCE)
    recognition = ShapeAnalysis_CanonicalRecognition(face)
    for kind, geometry in (("Plane", gp_Pln()), ("Cylinder", gp_Cylinder()), ("Cone", gp_Cone()), ("Sphere", gp_Sphere())):
        if getattr(recognition, f"Is{kind}")(RECOGNITION_TOLERANCE, geometry):
            return described(kind.lower(), geometry, False)
    return None


def described(kind: str, geometry: Any, is_reversed: bool) -> dict[str, Any]:
    """Return the kind and the numbers of a simple surface. A cone's axis points from its apex into it."""
    position = geometry.Position()
    origin, axis = position.Location().Coord(), np.array(position.Direction().Coord())
    sizes: dict[str, float] = {}
    match kind:
        case "plane":
            axis = -axis if is_reversed != (not position.Direct()) else axis
        case "cone":  # the kernel's cones may open against their axis
            sizes["angle"] = abs(geometry.SemiAngle())
            origin, axis = geometry.Apex().Coord(), np.sign(geometry.SemiAngle()) * axis
        case "cylinder" | "sphere":
            sizes["radius"] = geometry.Radius()
        case "torus":
            sizes |= {"radius": geometry.MajorRadius(), "minor": geometry.MinorRadius()}
    return {"kind": kind, "origin": list(origin), "axis": axis.tolist(), **sizes}
