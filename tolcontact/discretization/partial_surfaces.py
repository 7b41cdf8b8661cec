"""Doubts about faces that are a part of a surface: a file may split a hole into two halves."""

import itertools
import warnings
from collections.abc import Iterator

import numpy as np

from tolcontact.declaration import Assembly, Brep, Face
from tolcontact.errors import FaceWarning, designation
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.faces import Meshes, triangles
from tolcontact.geometry.files import BREP


def warn_of_partial_surfaces(assembly: Assembly, meshes: Meshes) -> None:
    """Warn of features and contact pairs on some faces of a curved surface that continues in faces not chosen.

    Only B-rep faces that are chosen one by one are looked at: other criteria are meant to leave out the rest.
    """
    for owner, face in _faces(assembly):
        for doubt in itertools.islice(_doubts(face, meshes), 1):
            warnings.warn(f"{owner}: its face {face} is {doubt}", FaceWarning, stacklevel=4)


def _faces(assembly: Assembly) -> Iterator[tuple[str, Face]]:
    """Yield the faces of features and contact pairs, and how a message names these."""
    for part in assembly.parts:
        for feature in part.features:
            for face in feature.faces:
                yield f'part "{part.name}": {designation("feature", feature)}', face
    for pair in assembly.pairs:
        for face in (pair.moving, pair.reference):
            yield designation("contact pair", pair), face


def _doubts(face: Face, meshes: Meshes) -> Iterator[str]:
    choices = [selection for selection in face.selections if isinstance(selection, Brep)]
    mesh = meshes[face.part]
    if not choices or len(choices) < len(face.selections) or BREP not in mesh.face_attributes:
        return
    if any(choice.whole for choice in choices):
        return
    chosen = {int(number) + 1 for number in np.unique(np.asarray(mesh.face_attributes[BREP]).ravel()[triangles(face, meshes)])}
    for description in describe_faces(mesh):
        if description.number in chosen and description.kind != "plane" and not chosen.issuperset(description.whole):
            count, kind = len(chosen.intersection(description.whole)), description.kind
            yield (
                f"{count} of the {len(description.whole)} faces of one {kind}; for all of them: "
                f"tc.Brep({description.number}, whole=True)"
            )
