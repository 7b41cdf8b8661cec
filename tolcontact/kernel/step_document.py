"""A STEP file in the document of the CAD kernel: bodies of products, their places and names. Lengths in mm.

A process of its own imports this module (`geometry.files.worker`): the kernel may crash, and takes 230 MB and 1 s to import.

A product has a shape, which stands at one or several places. Each solid of a shape is a body, and so is each closed shell that
is no part of a solid. All other faces of a shape are one body together: surfaces of a part need not be sewn.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomToStep import GeomToStep_MakeCartesianPoint, GeomToStep_MakeDirection
from OCP.gp import gp_Dir, gp_Pnt, gp_Trsf
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.StepGeom import StepGeom_CartesianTransformationOperator3d
from OCP.StepShape import StepShape_ClosedShell
from OCP.StepToGeom import StepToGeom
from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_AttributeIterator, TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Iterator
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from tolcontact.child import Refusal
from tolcontact.kernel.brep_faces import box, explore, matrix, surface, triangulation

try:
    from OCP.collections import Sequence_TDF_Label as LabelSequence
except ModuleNotFoundError:  # release 7.9 of OCP, which CadQuery 2.8 installs
    from OCP.TDF import TDF_LabelSequence as LabelSequence

CODE_PAGES = {"utf-8": "UTF8", "gb18030": "GB", "shift_jis": "SJIS", "latin-1": "iso8859-1"}  # as the kernel calls them
CLOSE = 1e-9  # between numbers of a motion that is read as it is stated
SCALE_TOLERANCE = 1e-6
NAMELESS, LABEL = ("NONE", ""), "=>["  # some systems' names of nameless faces; begins the kernel's label of a nameless shape


@dataclass(frozen=True)
class BodyShape:
    """The faces of a body, their names, its name if it is a solid, and the number of faces stated for it; 0 for no solid."""

    faces: list[Any]
    face_names: list[str]
    is_solid: bool
    name: str = ""
    face_count: int = 0


def read(
    path: Path, chord: float, angle: float, *, encoding: str, has_face_names: bool, has_solids: bool, has_pmi: bool,
    operators: int,
) -> dict[str, Any]:  # fmt: skip
    """Return the shapes of a STEP file, each in the frame of its product, and the bodies in their places.

    shapes         a dictionary for each: `triangulation`, and of each B-rep face of it the surface, None if it is not simple,
                   the name and, if the file has PMI, the place of its record among all; and the number of faces that the file
                   states for a solid, 0 if it is unknown
    bodies         of each body the index of its shape, its motion (4, 4), the corners (2, 3) of the box around it in its
                   place, the names of the products that contain it, and its own name
    record_count   number of records in the file, if it has PMI

    `operators` is the number of records that may place a shape mirrored.
    """
    document = Document(path, encoding, operators, has_face_names=has_face_names, has_solids=has_solids, has_pmi=has_pmi)
    indices: dict[str, list[int]] = {}  # of shapes, by the label
    shapes: list[tuple[BodyShape, dict[str, Any]]] = []
    placed: list[tuple[int, Place]] = []
    places = list(document.places())
    for place in places:
        key = entry(place.label)
        if key not in indices:
            candidates = document.body_shapes(place.label, chord, angle, is_alone=len(places) == 1)
            triangulated = [(body, triangulation(body.faces)) for body in candidates]
            pieces = [(body, triangles) for body, triangles in triangulated if len(triangles["brep"])]
            indices[key] = [*range(len(shapes), len(shapes) + len(pieces))]
            shapes += pieces
        placed.extend((index, place) for index in indices[key])
    names = body_names([(shapes[index][0], place) for index, place in placed])
    return {
        "shapes": [
            dict(
                triangles,
                surfaces=[surface(face) for face in body.faces],
                names=body.face_names,
                records=document.face_records(body.faces),
                face_count=body.face_count,
            )
            for body, triangles in shapes
        ],
        "bodies": [
            (index, matrix(place.location.Transformation()), box(shapes[index][0].faces, place.location), place.names, name)
            for (index, place), name in zip(placed, names, strict=True)
        ],
        "record_count": len(document.entities),
    }


def body_names(placed: Sequence[tuple[BodyShape, "Place"]]) -> list[str]:
    """Return the name of each body: its place's or its product's; its own if the file consists of solids at one place."""
    is_one_place = len({id(place) for _, place in placed}) == 1 and all(body.is_solid for body, _ in placed)
    if is_one_place and len(placed) > 1:
        return [body.name for body, _ in placed]
    own = [body.name if is_one_place else "" for body, _ in placed]
    return [
        name or (place.names[-1] if place.names else "") or place.product for name, (_, place) in zip(own, placed, strict=True)
    ]


class Place(NamedTuple):
    """A place of a shape: `names` from the root on, its `product`, its location there, and the label that holds it."""

    names: list[str]
    product: str
    location: Any
    label: Any


class Document:
    """A STEP file in the kernel's document. It owns all that is taken from it."""

    def __init__(
        self, path: Path, encoding: str, operators: int, *, has_face_names: bool, has_solids: bool, has_pmi: bool
    ) -> None:
        self.document = TDocStd_Document(TCollection_ExtendedString("STEP"))
        self.reader = STEPCAFControl_Reader()
        self.reader.SetNameMode(True)
        for content in ("Color", "Layer", "Props", "GDT", "Mat"):
            getattr(self.reader, f"Set{content}Mode")(False)
        Interface_Static.SetIVal_s("read.stepcaf.subshapes.name", 1)  # names of solids and faces
        Interface_Static.SetCVal_s("read.step.codepage", CODE_PAGES[encoding])
        is_legible = self.reader.ReadFile(str(path)) == IFSelect_RetDone
        model = self.reader.Reader().WS().Model()
        if is_legible and operators:
            correct_operators(model, operators)
        if not (is_legible and self.reader.Transfer(self.document)):
            raise Refusal("cannot be read as STEP: it is cut off, damaged, or holds no shape; export it again")
        self.transfer = self.reader.Reader().WS().TransferReader()
        self.has_face_names, self.has_solids = has_face_names, has_solids
        # The records in the order of the file. The kernel itself finds no number, but has one object for each.
        self.entities = {model.Value(number): number for number in range(1, model.NbEntities() + 1)} if has_pmi else {}

    def places(self) -> Iterator[Place]:
        """Yield each place of a shape that is no assembly, in the file's order."""
        roots = LabelSequence()
        XCAFDoc_DocumentTool.ShapeTool_s(self.document.Main()).GetFreeShapes(roots)
        for label in roots:
            yield from self._places_within(label, [], TopLoc_Location())

    def _places_within(self, label: Any, parents: list[str], location: Any) -> Iterator[Place]:
        location = location.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(label))
        referred = TDF_Label()
        if not XCAFDoc_ShapeTool.GetReferredShape_s(label, referred):
            referred = label
        # A place without a name of its own has the name of its product.
        product = stated(label_name(referred))
        name = stated(label_name(label)) or product
        names = [*parents, name] if name else parents
        if XCAFDoc_ShapeTool.IsAssembly_s(referred):
            components = LabelSequence()
            XCAFDoc_ShapeTool.GetComponents_s(referred, components, False)
            for component in components:
                yield from self._places_within(component, names, location)
        else:
            yield Place(names, product, location, referred)

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
        faces = [*explore(piece, TopAbs_FACE)]
        cavities = [*explore(piece, TopAbs_SHELL)][1:]
        return BodyShape(faces, face_names(faces, self._record_names(cavities) | names), count > 0, name, count)

    def _record_names(self, shapes: Sequence[Any]) -> dict[int, str]:
        """Return the names of faces by their records: faces of cavities, and of some parts with drawings, have no labels."""
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

    def _entity(self, shape: Any) -> Any:
        """Return the record that the kernel made a shape from; None if it is unknown."""
        return self.transfer.EntityFromShapeResult(shape, 1)


def subshape_names(label: Any) -> dict[int, str]:
    """Return the names of the solids and faces in the shape of a label that have one, by their hashes."""
    labels = LabelSequence()
    XCAFDoc_ShapeTool.GetSubShapes_s(label, labels)
    return {hash(XCAFDoc_ShapeTool.GetShape_s(piece)): label_name(piece) for piece in labels}


def face_names(faces: Sequence[Any], names: dict[int, str]) -> list[str]:
    """Return the names of faces in the file, "" for a face without a name."""
    stripped = [names.get(hash(face), "").strip() for face in faces]
    return ["" if name in NAMELESS else stated(name) for name in stripped]


def entity_name(entity: Any) -> str:
    """Return the name that a record states; "" without one."""
    name = entity.Name() if hasattr(entity, "Name") else None
    return "" if name is None else str(name.ToCString())


def stated_face_count(entity: Any) -> int:
    """Return the number of faces that the record of a solid names, with its cavities; 0 if it is unknown."""
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


def stated(name: str) -> str:
    """Return the name of a label if the file states it; "" for the kernel's own name."""
    return "" if name.startswith(LABEL) else name


def entry(label: Any) -> str:
    """Return the place of a label in its document."""
    text = TCollection_AsciiString()
    TDF_Tool.Entry_s(label, text)
    return str(text.ToCString())


def correct_operators(model: Any, count: int) -> None:
    """Let the kernel read each of `count` operators in its model of a file as it is stated. Raises Refusal if it cannot.

    Operators place copies of shapes: moved, mirrored or scaled (ISO 10303-42). The CAD kernel reads a mirror as a rotation, and
    an operator that lacks parameters as no motion at all. Here its model of the file is corrected before it makes shapes: a
    mirror is stated as a scale of -1, which is a point reflection, after a rotation.
    """
    entities = (model.Value(number) for number in range(1, model.NbEntities() + 1))
    operators = [entity for entity in entities if isinstance(entity, StepGeom_CartesianTransformationOperator3d)]
    if len(operators) < count or any(operator.LocalOrigin() is None for operator in operators):
        raise Refusal("is damaged: a CARTESIAN_TRANSFORMATION_OPERATOR_3D has other parameters than ISO 10303; export it again")
    for operator in operators:
        _correct(operator)


def _correct(operator: Any) -> None:
    scale = operator.Scale() if operator.HasScale() else 1.0
    if abs(scale + 1) <= SCALE_TOLERANCE and np.linalg.det(_motion(operator)[:, :3]) < 0:
        return  # a mirror as the kernel itself writes and reads it, against the norm, which permits no scale below 0
    if abs(scale - 1) > SCALE_TOLERANCE:
        raise Refusal("places a body scaled, which bodies of a rigid assembly are not; export it as it is")
    axes, origin = _axes(operator), np.array([operator.LocalOrigin().CoordinatesValue(k) for k in (1, 2, 3)])
    sense = np.sign(np.linalg.det(axes))
    if sense < 0:
        operator.SetScale(-1.0)
    operator.SetAxis1(_direction(sense * axes[:, 0]))
    operator.SetAxis3(_direction(sense * axes[:, 2]))
    for local_origin in (origin, sense * origin):  # some releases of the kernel scale it, too
        operator.SetLocalOrigin(GeomToStep_MakeCartesianPoint(gp_Pnt(*local_origin), 1.0).Value())
        if np.abs(_motion(operator) - np.column_stack([axes, origin])).max() <= CLOSE * max(1.0, np.abs(origin).max()):
            return
    raise Refusal("places a body mirrored, which this release of the CAD kernel cannot read; export the body itself")


def _motion(operator: Any) -> np.ndarray:
    """Return the motion (3, 4) of an operator as the kernel reads it."""
    motion = gp_Trsf()
    StepToGeom.MakeTransformation3d_s(operator, motion)
    return matrix(motion)[:3]


def _axes(operator: Any) -> np.ndarray:
    """Return the directions of the three axes of an operator as columns (3, 3)."""
    z = _stated_axis(operator.Axis3(), np.array([0.0, 0.0, 1.0]))
    x = _stated_axis(operator.Axis1(), np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 1 - CLOSE else np.array([0.0, 1.0, 0.0]))
    x = _unit(x - (x @ z) * z)
    y = _stated_axis(operator.Axis2(), np.array([0.0, 1.0, 0.0]))
    y = y - (y @ z) * z - (y @ x) * x
    is_left_out = operator.Axis2() is None and np.linalg.norm(y) < CLOSE  # for the norm it would then have no direction
    return np.column_stack([x, np.cross(z, x) if is_left_out else _unit(y), z])


def _stated_axis(direction: Any, default: np.ndarray) -> np.ndarray:
    return default if direction is None else _unit(np.array([direction.DirectionRatiosValue(k) for k in (1, 2, 3)]))


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    if length < CLOSE:
        raise Refusal(
            "is damaged: a CARTESIAN_TRANSFORMATION_OPERATOR_3D has parallel axes, or one of length 0; export it again"
        )
    return np.asarray(vector / length)


def _direction(axis: np.ndarray) -> Any:
    return GeomToStep_MakeDirection(gp_Dir(*axis)).Value()
