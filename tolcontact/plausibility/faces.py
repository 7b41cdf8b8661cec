"""Faces of features and contact pairs: a part of a surface that continues, or measured ones beyond their tolerance of form."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from tolcontact.declaration import Assembly, Brep, Face
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.faces import Meshes, triangles
from tolcontact.geometry.files import BREP
from tolcontact.plausibility.trial_draws import TrialDraws

ROUNDING = 1e-6  # of the width of a zone


def partial_surfaces(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each face on some B-rep faces of a curved surface that continues in faces not chosen.

    Only B-rep faces that are chosen individually are checked: other criteria leave out the rest on purpose.
    """
    nominal = draws.program.nominal
    meshes = nominal.meshes  # each access makes the mapping
    for owner, face in _faces(nominal.assembly):
        for doubt in islice(_doubts(face, meshes), 1):
            yield f"{owner}: its face {face} is {doubt}"


def _faces(assembly: Assembly) -> Iterator[tuple[str, Face]]:
    """Yield the faces of features and contact pairs, and how a message names these."""
    for part in assembly.parts:
        for feature in part.features:
            for face in feature.faces:
                yield f'part "{part.name}": {feature.designation}', face
    for pair in assembly.pairs:
        for face in (pair.moving, pair.reference):
            yield pair.designation, face


def _doubts(face: Face, meshes: Meshes) -> Iterator[str]:
    mesh = meshes[face.part]
    choices = [selection for selection in face.selections if isinstance(selection, Brep)]
    is_partial = len(choices) < len(face.selections) or any(choice.whole for choice in choices)
    if not choices or is_partial or BREP not in mesh.face_attributes:
        return
    chosen = {int(number) + 1 for number in np.unique(np.asarray(mesh.face_attributes[BREP]).ravel()[triangles(face, meshes)])}
    for description in describe_faces(mesh):
        if description.number in chosen and description.kind != "plane" and not chosen.issuperset(description.whole):
            count, kind = len(chosen.intersection(description.whole)), description.kind
            yield (
                f"{count} of the {len(description.whole)} faces of one {kind}; for all of them: "
                f"tc.select.Brep({description.number}, whole=True)"
            )


def measured_forms(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each feature with measured faces that lie in no zone of the stated width."""
    for pattern in draws.program.nominal.patterns:
        for member in pattern.members:
            if member.form is None or pattern.form is None:
                continue
            stated, widths = float(pattern.form.width), member.form.scans
            if beyond := [path for path, width in widths.items() if width > (1 + ROUNDING) * stated]:
                worst = max(beyond, key=lambda path: widths[path])
                yield (
                    f'part "{member.feature.part.name}": {member.feature.designation}: '
                    f"{len(beyond)} of {len(widths)} measured faces are beyond the {pattern.form.kind} of {stated:.4g} mm that "
                    f'is stated; "{Path(worst).name}" has {widths[worst]:.3g} mm; forms are drawn as they were measured, so '
                    "check the tolerance, and the files for outliers"
                )
