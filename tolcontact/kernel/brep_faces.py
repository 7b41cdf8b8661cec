"""B-rep faces as the CAD kernel has them: their surfaces and triangles. Lengths in mm."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Sphere
from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

RECOGNITION_TOLERANCE = 1e-4  # [mm] between a B-spline surface and the simple surface for which it is taken

Piece = tuple[np.ndarray, np.ndarray]  # vertices (vertex, 3) and triangles (face, 3)


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


def matrix(location: Any) -> np.ndarray:
    """Return the transform (4, 4) of a location."""
    transform = location.Transformation()
    rows = [[transform.Value(row, column) for column in range(1, 5)] for row in range(1, 4)]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def triangulation(faces: Sequence[Any]) -> tuple[Piece, np.ndarray]:
    """Return the vertices and triangles of faces, seen from outside, and the number (face,) of the face of each triangle."""
    corners, triangles, brep = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    count = 0
    for number, face in enumerate(faces):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face(face), location)
        if mesh is None:
            continue
        nodes = np.array([mesh.Node(k).Coord() for k in range(1, mesh.NbNodes() + 1)]).reshape(-1, 3)
        if not location.IsIdentity():
            transform = matrix(location)
            nodes = nodes @ transform[:3, :3].T + transform[:3, 3]
        indices = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)], dtype=np.int64).reshape(-1, 3)
        corners.append(nodes)
        triangles.append((indices[:, ::-1] if face.Orientation() == TopAbs_REVERSED else indices) - 1 + count)
        brep.append(np.full(len(indices), number))
        count += len(nodes)
    return (np.concatenate(corners), np.concatenate(triangles)), np.concatenate(brep)


def surface(face: Any) -> dict[str, Any] | None:
    """Return the plane, with its outward normal, the cylinder, cone, sphere or torus of a face; None for another surface."""
    adaptor = BRepAdaptor_Surface(TopoDS.Face(face))
    kind = adaptor.GetType().name.removeprefix("GeomAbs_")
    if kind in ("BSplineSurface", "BezierSurface"):
        return recognized_surface(face)
    if kind not in ("Plane", "Cylinder", "Cone", "Sphere", "Torus"):
        return None
    return described(kind.lower(), getattr(adaptor, kind)(), face.Orientation() == TopAbs_REVERSED)


def recognized_surface(face: Any) -> dict[str, Any] | None:
    """Return the simple surface that a B-spline surface represents; None if there is none."""
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
