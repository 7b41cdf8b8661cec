"""The values of an archive that describe planes which touch datum features with form."""

from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.features import DatumShift
from tolcontact.vocabulary import ArchiveVariable

COORDINATES = 3  # of a plane


def tangents(program: Program) -> list[DatumShift]:
    """Return the shifts of the planes that touch datum features with form."""
    return [shift for pattern in program.nominal.patterns for shift in pattern.shifts if shift.form is not None]


def datum_sizes(program: Program) -> dict[str, int]:
    """Return the dimensions of these planes; none if there are none."""
    planes = tangents(program)
    if not planes:
        return {}
    places = {plane.datum.form_columns.start: len(plane.heights) for plane in planes}
    return {
        terms.TANGENT: len(planes), terms.TANGENT_PLACE: sum(places.values()),
        terms.COORDINATE: COORDINATES, terms.TANGENT_FREEDOM: COORDINATES,
    }  # fmt: skip


def datum_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return these planes and the places that they may touch; none if there are none."""
    planes, sizes = tangents(program), datum_sizes(program)
    if not sizes:
        return {}
    faces = {int(face.form_columns[0]): k for k, face in enumerate(program.nominal.faces) if face.form is not None}
    count = len(program.nominal.contributors)
    columns, leaning = np.full((len(planes), COORDINATES), -1), np.zeros((len(planes), COORDINATES, count))
    free = np.zeros((len(planes), COORDINATES, COORDINATES))
    for number, plane in enumerate(planes):
        columns[number, list(plane.coordinates)] = plane.columns
        leaning[number, :, : plane.residuals.shape[1]] = plane.residuals
        free[number, :, : plane.free.shape[1]] = plane.free
    touched = {faces[plane.datum.form_columns.start]: plane for plane in planes}
    places = [program.nominal.faces[face].form for face in touched]
    return {
        terms.TANGENT_FACE: [faces[plane.datum.form_columns.start] for plane in planes],
        terms.TANGENT_CONTRIBUTOR: columns,
        terms.TANGENT_LEANING: leaning,
        terms.TANGENT_FREE: free,
        terms.FACE_OF_TANGENT_PLACE: np.concatenate([np.full(len(plane.heights), k) for k, plane in touched.items()]),
        terms.TANGENT_PLACE_AT: np.vstack([form.places for form in places if form is not None]),
        terms.TANGENT_HEIGHT: np.vstack([plane.heights for plane in touched.values()]),
    }
