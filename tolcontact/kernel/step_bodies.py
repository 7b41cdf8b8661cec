"""The bodies of a STEP file as arrays, read by the CAD kernel. Lengths in mm.

`geometry.files.worker` imports this module in a process of its own when the first STEP file comes: the kernel may crash, and
takes 230 MB and 1 s to import.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tolcontact.kernel.brep_faces import Measure, Piece, box, matrix, surface, triangulation
from tolcontact.kernel.step_document import BodyShape, Document, PlacedShape, entry


def read(path: Path, chord: float, angle: float) -> tuple[list[Piece], dict[str, np.ndarray]]:
    """Return the triangles of the bodies in a STEP file, each in the frame of its product, and arrays that describe them.

    brep                (face,) the B-rep face of each triangle, from 0 in the file's order within its body
    surfaces            (shape,) JSON with the surfaces of the B-rep faces, null for one that is not simple
    measures            (shape,) JSON with the areas of the B-rep faces [mm2], points on them and normals there, null if unknown
    face_names          (shape,) JSON with the names of the B-rep faces
    face_records        (shape,) JSON with the places of the records of B-rep faces among all, `record_count`, if it has PMI
    face_count          (shape,) number of B-rep faces that the file states for a solid; 0 if it is unknown
    shape, transforms   (body,), (body, 4, 4) the shape of each body in the file's order, and its motion to its place
    boxes               (body, 2, 3) the lower and the upper corner of the box around the body in its place
    paths, names        (body,) JSON with the names of the products that contain the body, and its own name
    """
    document = Document(path)
    shape_numbers: dict[str, list[int]] = {}  # of a label
    shapes: list[BodyShape] = []
    pieces: list[Piece] = []
    face_measures: list[list[Measure | None]] = []
    breps = [np.zeros(0, dtype=np.int64)]
    placed: list[tuple[int, PlacedShape]] = []
    places = list(document.places())
    for place in places:
        key = entry(place.label)
        if key not in shape_numbers:
            shape_numbers[key] = []
            for body in document.body_shapes(place.label, chord, angle, is_alone=len(places) == 1):
                piece, brep, measures = triangulation(body.faces)
                if len(brep):
                    shape_numbers[key].append(len(shapes))
                    shapes.append(body)
                    pieces.append(piece)
                    face_measures.append(measures)
                    breps.append(brep)
        placed.extend((number, place) for number in shape_numbers[key])
    names = body_names([(shapes[number], place) for number, place in placed])
    return pieces, {
        "brep": np.concatenate(breps),
        "surfaces": np.array([json.dumps([surface(face) for face in body.faces]) for body in shapes], dtype=str),
        "measures": np.array([json.dumps(measures) for measures in face_measures], dtype=str),
        "face_names": np.array([json.dumps(body.face_names) for body in shapes], dtype=str),
        "face_records": np.array([json.dumps(document.face_records(body.faces)) for body in shapes], dtype=str),
        "record_count": np.array(len(document.entities)),
        "face_count": np.array([body.face_count for body in shapes], dtype=np.int64),
        "shape": np.array([number for number, _ in placed], dtype=np.int64),
        "transforms": np.array([matrix(place.location) for _, place in placed]).reshape(-1, 4, 4),
        "boxes": np.array([box(shapes[number].faces, place.location) for number, place in placed]).reshape(-1, 2, 3),
        "paths": np.array([json.dumps(place.names) for _, place in placed], dtype=str),
        "names": np.array(names, dtype=str),
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
