"""The values of an archive that describe the form of faces."""

from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.features.associated_features import TERMS
from tolcontact.geometry.analytic_surfaces import surface_arrays
from tolcontact.vocabulary import ArchiveVariable


def form_sizes(program: Program) -> dict[str, int]:
    """Return the dimensions of the forms of faces; none if no face has form."""
    forms = [face.form for face in program.nominal.faces if face.form is not None]
    if not forms:
        return {}
    return {
        terms.FORM_STATION: sum(len(form.stations) for form in forms),
        terms.FORM_MODE: max(form.modes for form in forms),
        terms.FORM_TERM: TERMS,
    }


def form_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return the forms of faces; none if no face has form."""
    faces, sizes = program.nominal.faces, form_sizes(program)
    if not sizes:
        return {}
    modes, contributors = sizes[terms.FORM_MODE], program.draws.contributors
    numbers = {variable: np.full(len(faces), np.nan) for variable in NUMBERS}
    columns, removed = np.full((len(faces), modes), -1), np.zeros((len(faces), modes, TERMS))
    surfaces = [None if face.form is None else face.form.associated.surface for face in faces]
    weights = []
    with_form = [(number, face, face.form) for number, face in enumerate(faces) if face.form is not None]
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
