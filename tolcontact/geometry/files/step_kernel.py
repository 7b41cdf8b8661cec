"""STEP files read by the CAD kernel, Open CASCADE Technology through the package OCP. Lengths in mm.

`worker` loads this program by its path when the first STEP file comes. Of tolcontact it imports only `child`.

A product has a shape, which stands at one or several places. Each solid of a shape is a body, and so is each closed shell that
is no part of a solid. All other faces of a shape are one body together: surfaces of a part need not be sewn.
"""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.collections import Sequence_TDF_Label
from OCP.gp import gp_Cone, gp_Cylinder, gp_Pln, gp_Sphere
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.ShapeAnalysis import ShapeAnalysis_CanonicalRecognition
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.StepShape import StepShape_ClosedShell
from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_AttributeIterator, TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Iterator
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from tolcontact.child import Refusal

RECOGNITION_TOLERANCE = 1e-4  # [mm] between a B-spline surface and the simple surface for which it is taken
NAMED_FACE = re.compile(rb"\b(?:ADVANCED_FACE|FACE_SURFACE)\s*\(\s*'(?!'|NONE')")  # in the text of a file
SOLID = re.compile(rb"\b(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|FACETED_BREP)\s*\(")
PMI_FACE = re.compile(rb"\b(?:GEOMETRIC_ITEM_SPECIFIC_USAGE|ITEM_IDENTIFIED_REPRESENTATION_USAGE)\s*\(")
NAMELESS, LABEL = ("NONE", ""), "=>["  # some systems' names of nameless faces; begins the kernel's label of a nameless shape

Piece = tuple[np.ndarray, np.ndarray]  # vertices (vertex, 3) and triangles (face, 3)


@dataclass(frozen=True)
class BodyShape:
    """The faces of a body, their names, its name if it is a solid, and the number of faces stated for it; 0 for no solid."""

    faces: list[Any]
    face_names: list[str]
    is_solid: bool
    name: str = ""
    face_count: int = 0


@dataclass(frozen=True)
class PlacedShape:
    """A shape at a place: `names` from the root on, its `product`, its motion (4, 4) to there, and the label that holds it."""

    names: list[str]
    product: str
    transform: np.ndarray
    label: Any


def read(path: Path, chord: float, angle: float) -> tuple[list[Piece], dict[str, np.ndarray]]:
    """Return the triangles of the bodies in a STEP file, each in the frame of its product, and arrays that describe them.

    brep                (face,) the B-rep face of each triangle, from 0 in the file's order within its body
    surfaces            (shape,) JSON with the surfaces of the B-rep faces, null for one that is not simple
    face_names          (shape,) JSON with the names of the B-rep faces
    face_records        (shape,) JSON with the places of the records of B-rep faces among all, `record_count`, if it has PMI
    face_count          (shape,) number of B-rep faces that the file states for a solid; 0 if it is unknown
    shape, transforms   (body,), (body, 4, 4) the shape of each body in the file's order, and its motion to its place
    paths, names        (body,) JSON with the names of the products that contain the body, and its own name
    """
    document = Document(path)
    shape_numbers: dict[str, list[int]] = {}  # of a label
    shapes: list[BodyShape] = []
    pieces: list[Piece] = []
    breps = [np.zeros(0, dtype=np.int64)]
    placed: list[tuple[int, PlacedShape]] = []
    places = list(document.places())
    for place in places:
        key = entry(place.label)
        if key not in shape_numbers:
            shape_numbers[key] = []
            for body in document.body_shapes(place.label, chord, angle, is_alone=len(places) == 1):
                piece, brep = triangulation(body.faces)
                if len(brep):
                    shape_numbers[key].append(len(shapes))
                    shapes.append(body)
                    pieces.append(piece)
                    breps.append(brep)
        placed.extend((number, place) for number in shape_numbers[key])
    return pieces, {
        "brep": np.concatenate(breps),
        "surfaces": np.array([json.dumps([surface(face) for face in body.faces]) for body in shapes], dtype=str),
        "face_names": np.array([json.dumps(body.face_names) for body in shapes], dtype=str),
        "face_records": np.array([json.dumps(document.face_records(body.faces)) for body in shapes], dtype=str),
        "record_count": np.array(len(document.entities)),
        "face_count": np.array([body.face_count for body in shapes], dtype=np.int64),
        "shape": np.array([number for number, _ in placed], dtype=np.int64),
        "transforms": np.array([place.transform for _, place in placed]).reshape(-1, 4, 4),
        "paths": np.array([json.dumps(place.names) for _, place in placed], dtype=str),
        "names": np.array(body_names([(shapes[number], place) for number, place in placed]), dtype=str),
    }


def body_names(placed: Sequence[tuple[BodyShape, PlacedShape]]) -> list[str]:
    """Return the name of each body: its place's or its product's; its own if the file consists of solids at one place."""
    is_one_place = len({id(place) for _, place in placed}) == 1 and all(body.is_solid for body, _ in placed)
    if is_one_place and len(placed) > 1:
        return [body.name for body, _ in placed]
    own = [body.name if is_one_place else "" for body, _ in placed]
    return [
        name or (place.names[-1] if place.names else "") or place.product for name, (_, place) in zip(own, placed, strict=True)
    ]


class Document:
    """A STEP file in the kernel's document. It owns all that is taken from it."""

    def __init__(self, path: Path) -> None:
        self.document = TDocStd_Document(TCollection_ExtendedString("STEP"))
        self.reader = STEPCAFControl_Reader()
        self.reader.SetNameMode(True)
        for content in ("Color", "Layer", "Props", "GDT", "Mat"):
            getattr(self.reader, f"Set{content}Mode")(False)
        Interface_Static.SetIVal_s("read.stepcaf.subshapes.name", 1)  # names of solids and faces
        if self.reader.ReadFile(str(path)) != IFSelect_RetDone or not self.reader.Transfer(self.document):
            raise Refusal("cannot be read as STEP: it is cut off, damaged, or holds no shape; export it again")
        self.transfer = self.reader.Reader().WS().TransferReader()
        text = path.read_bytes()
        self.has_face_names, self.has_solids = (pattern.search(text) is not None for pattern in (NAMED_FACE, SOLID))
        self.entities = self._entities() if PMI_FACE.search(text) else {}

    def places(self) -> Iterator[PlacedShape]:
        """Yield each place of a shape that is no assembly, in the file's order."""
        roots = Sequence_TDF_Label()
        XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main()).GetFreeShapes(roots)
        for label in roots:
            yield from self._places_within(label, [], TopLoc_Location())

    def _places_within(self, label: Any, parents: list[str], location: Any) -> Iterator[PlacedShape]:
        location = location.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(label))
        referred = TDF_Label()
        if not XCAFDoc_ShapeTool.GetReferredShape_s(label, referred):
            referred = label
        names = parents if is_nameless(name := label_name(label) or label_name(referred)) else [*parents, name]
        if XCAFDoc_ShapeTool.IsAssembly_s(referred):
            components = Sequence_TDF_Label()
            XCAFDoc_ShapeTool.GetComponents_s(referred, components, False)
            for component in components:
                yield from self._places_within(component, names, location)
        else:
            product = label_name(referred)
            yield PlacedShape(names, "" if is_nameless(product) else product, matrix(location), referred)

    def body_shapes(self, label: Any, chord: float, angle: float, *, is_alone: bool) -> Iterator[BodyShape]:
        """Yield the bodies of a product's shape, in its own frame, with triangles on their faces.

        A shape that `is_alone` in its file may have records of more kinds, and it takes time to look for records.
        """
        shape = XCAFDoc_ShapeTool.GetShape_s(label).Located(TopLoc_Location())
        BRepMesh_IncrementalMesh(shape, chord, False, angle, False)
        names = subshape_names(label) or self._record_names([shape])
        pieces = list(self._pieces(shape, names, is_alone=is_alone))
        yield from (self._body(piece, names, name, count) for piece, name, count, is_solid in pieces if is_solid)
        sheets, lost_count = list[Any](), 0
        for piece, _, count, is_solid in pieces:
            if is_solid:
                continue
            if piece.ShapeType() == TopAbs_SHELL and BRep_Tool.IsClosed_s(piece):
                yield self._body(piece, names)
            else:
                sheets.extend(explore(piece, TopAbs_FACE))
                lost_count += count
        if sheets:
            yield BodyShape(sheets, face_names(sheets, names), False, "", lost_count)

    def _body(self, piece: Any, names: dict[int, str], name: str = "", count: int = 0) -> BodyShape:
        """Return the body of a solid or shell."""
        faces = [*explore(piece, TopAbs_FACE)]
        cavities = [*explore(piece, TopAbs_SHELL)][1:]
        return BodyShape(faces, face_names(faces, self._record_names(cavities) | names), count > 0, name, count)

    def _record_names(self, shapes: Sequence[Any]) -> dict[int, str]:
        """Return the names of faces by their records: those of cavities, and of some parts with drawings, have no labels."""
        faces = [face for shape in shapes for face in explore(shape, TopAbs_FACE)] if self.has_face_names else []
        return {hash(face): entity_name(self._entity(face)) for face in faces}

    def _pieces(self, shape: Any, names: dict[int, str], *, is_alone: bool) -> Iterator[tuple[Any, str, int, bool]]:
        """Yield the solids, shells and loose faces of a shape: name and number of faces in the file, whether it is a solid.

        Where the kernel mends a solid it may make several pieces of it, or one that is open.
        """
        is_compound = shape.ShapeType() == TopAbs_COMPOUND
        entity = self._entity(shape) if is_alone or is_compound else None
        if hasattr(entity, "Outer") or shape.ShapeType() == TopAbs_SOLID:
            name = entity_name(entity) or names.get(hash(shape), "")
            yield shape, name, stated_face_count(entity) or len([*explore(shape, TopAbs_FACE)]), True
        elif is_compound:
            children = TopoDS_Iterator(shape)
            while children.More():
                yield from self._pieces(children.Value(), names, is_alone=is_alone and shape.NbChildren() == 1)
                children.Next()
        else:
            is_damaged_solid = self.has_solids and isinstance(entity, StepShape_ClosedShell)
            yield shape, "", int(entity.NbCfsFaces()) if is_damaged_solid and entity is not None else 0, False

    def face_records(self, faces: Sequence[Any]) -> list[int]:
        """Return the numbers of the records of faces, from 1 in the file's order, 0 for none; nothing if there is no PMI."""
        return [self.entities.get(self._entity(face), 0) for face in faces] if self.entities else []

    def _entities(self) -> dict[Any, int]:
        """Return the records in the order of the file. The kernel itself finds no number, but has one object for each."""
        model = self.reader.Reader().WS().Model()
        return {model.Value(number): number for number in range(1, model.NbEntities() + 1)}

    def _entity(self, shape: Any) -> Any:
        """Return the record of which the kernel made a shape; None if it is unknown."""
        return self.transfer.EntityFromShapeResult(shape, 1)


def subshape_names(label: Any) -> dict[int, str]:
    """Return the names of the solids and faces in the shape of a label that have one, by their hashes."""
    labels = Sequence_TDF_Label()
    XCAFDoc_ShapeTool.GetSubShapes_s(label, labels)
    return {hash(XCAFDoc_ShapeTool.GetShape_s(piece)): label_name(piece) for piece in labels}


def face_names(faces: Sequence[Any], names: dict[int, str]) -> list[str]:
    """Return the names of faces in the file, "" for a face without a name."""
    stripped = [names.get(hash(face), "").strip() for face in faces]
    return ["" if name in NAMELESS or is_nameless(name) else name for name in stripped]


def entity_name(entity: Any) -> str:
    """Return the name that a record states; "" without one."""
    name = entity.Name() if hasattr(entity, "Name") else None
    return "" if name is None else str(name.ToCString())


def stated_face_count(entity: Any) -> int:
    """Return the number of faces that the record of a solid names, those of its cavities included; 0 if it is unknown."""
    shells = [entity.Outer()] if hasattr(entity, "Outer") else []
    shells += [entity.VoidsValue(number) for number in range(1, entity.NbVoids() + 1)] if hasattr(entity, "NbVoids") else []
    return sum(shell.NbCfsFaces() for shell in shells if shell is not None)


def label_name(label: Any) -> str:
    """Return the name of a label; "" if it has none."""
    attributes = TDF_AttributeIterator(label, True)
    while attributes.More():
        if isinstance(attributes.Value(), TDataStd_Name):
            return str(attributes.Value().Get().ToExtString())
        attributes.Next()
    return ""


def is_nameless(name: str) -> bool:
    """Return whether a label has no name of the file."""
    return not name or name.startswith(LABEL)


def entry(label: Any) -> str:
    """Return the place of a label in its document."""
    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return str(text.ToCString())


def explore(shape: Any, kind: Any) -> Iterator[Any]:
    """Yield the pieces of a kind in a shape, each once, in their order."""
    explorer = TopExp_Explorer(shape, kind)
    pieces: dict[int, Any] = {}
    while explorer.More():
        pieces.setdefault(hash(explorer.Current()), explorer.Current())
        explorer.Next()
    yield from pieces.values()


def matrix(location: Any) -> np.ndarray:
    """Return the transform (4, 4) of a location."""
    rows = [[location.Transformation().Value(row, column) for column in range(1, 5)] for row in range(1, 4)]
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
