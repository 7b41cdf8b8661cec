"""The values of an archive that describe the form of faces, and the datum planes that touch such faces."""

from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.features.associated_features import TERMS
from tolcontact.geometry.analytic_surfaces import surface_arrays
from tolcontact.vocabulary import ArchiveVariable

COORDINATES = 3  # of a plane


def form_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return the forms of faces; none if no face has form."""
    faces, contributors = program.nominal.faces, program.draws.contributors
    with_form = [(number, face, face.form) for number, face in enumerate(faces) if face.form is not None]
    if not with_form:
        return {}
    modes = max(form.modes for _, _, form in with_form)
    numbers = {variable: np.full(len(faces), np.nan) for variable in NUMBERS}
    columns, removed = np.full((len(faces), modes), -1), np.zeros((len(faces), modes, TERMS))
    surfaces = [None if face.form is None else face.form.associated.surface for face in faces]
    weights = []
    for number, face, form in with_form:
        spread = np.nan if form.spreads is not None else contributors[face.form_columns[0]].spread
        width = program.draws.mean_widths[face.name]
        values = (*form.lengths, *form.associated.ends, spread, form.left_out, width)
        for variable, value in zip(NUMBERS, values, strict=True):
            numbers[variable][number] = value
        columns[number, : form.modes], removed[number, : form.modes] = face.form_columns, form.removed.T
        weights.append(np.pad(form.weights, ((0, 0), (0, modes - form.modes))))
    return {
        terms.FORM_COVARIANCE: ["" if face.form is None else face.form.form.covariance for face in faces],
        terms.FORM_LOBES: [0 if face.form is None else face.form.form.lobes or 0 for face in faces],
        terms.FORM_ASSOCIATED: ["" if face.form is None else face.form.associated.name for face in faces],
        **{terms.FORM_SURFACE[name]: values for name, values in surface_arrays(surfaces).items()},
        **numbers,
        terms.FORM_CONTRIBUTOR: columns,
        terms.FACE_OF_FORM_STATION: np.concatenate([np.full(len(form.stations), number) for number, _, form in with_form]),
        terms.FORM_STATION_PLACE: np.concatenate([form.stations for _, _, form in with_form]),
        terms.FORM_STATION_WEIGHT: np.concatenate(weights),
        terms.FORM_REMOVED: removed,
    }


NUMBERS = (
    terms.FORM_LENGTH, terms.FORM_LENGTH_ALONG, terms.FORM_START, terms.FORM_END, terms.FORM_SPREAD, terms.FORM_LEFT_OUT,
    terms.FORM_MEAN_ZONE,
)  # fmt: skip


def datum_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return the planes that touch datum features with form, and the places that they may touch; none if there are none."""
    planes = [shift for pattern in program.nominal.patterns for shift in pattern.shifts if shift.form is not None]
    if not planes:
        return {}
    faces = {int(face.form_columns[0]): k for k, face in enumerate(program.nominal.faces) if face.form is not None}
    count = len(program.nominal.contributors)
    columns, residuals = np.full((len(planes), COORDINATES), -1), np.zeros((len(planes), COORDINATES, count))
    free = np.zeros((len(planes), COORDINATES, COORDINATES))
    for number, plane in enumerate(planes):
        columns[number, list(plane.coordinates)] = plane.columns
        residuals[number, :, : plane.residuals.shape[1]] = plane.residuals
        free[number, :, : plane.free.shape[1]] = plane.free
    touched = {faces[plane.datum.form_columns.start]: plane for plane in planes}
    places = [program.nominal.faces[face].form for face in touched]
    return {
        terms.TANGENT_FACE: [faces[plane.datum.form_columns.start] for plane in planes],
        terms.TANGENT_CONTRIBUTOR: columns,
        terms.TANGENT_RESIDUAL: residuals,
        terms.TANGENT_FREE: free,
        terms.FACE_OF_TANGENT_PLACE: np.concatenate([np.full(len(plane.heights), k) for k, plane in touched.items()]),
        terms.TANGENT_PLACE_AT: np.vstack([form.places for form in places if form is not None]),
        terms.TANGENT_HEIGHT: np.vstack([plane.heights for plane in touched.values()]),
    }
