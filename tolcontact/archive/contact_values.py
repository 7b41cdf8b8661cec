"""The values of the group `contact` of an archive: which parts touch, where, and how their faces deviate."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.features import FaceDeviation
from tolcontact.features.associated_features import TERMS
from tolcontact.geometry import surface_arrays
from tolcontact.mechanics.displacement import central_moments
from tolcontact.vocabulary import ArchiveVariable

Values = dict[ArchiveVariable, Any]
COORDINATES = 3  # of a plane
NUMBERS = (
    terms.FORM_LENGTH, terms.FORM_LENGTH_ALONG, terms.FORM_START, terms.FORM_END, terms.FORM_SPREAD, terms.FORM_LEFT_OUT,
    terms.FORM_MEAN_ZONE,
)  # fmt: skip


def contact_values(program: Program) -> Values:
    """Return the values of the group: which parts touch, and where. A variable that does not apply to the model is left out."""
    nominal, pairs = program.nominal, program.nominal.pairs
    values: Values = {
        terms.MOVING_PART: [nominal.number(pair.moving) for pair in pairs],
        terms.REFERENCE_PART: [-1 if pair.reference is None else nominal.number(pair.reference) for pair in pairs],
    }
    if pairs:
        counts = [len(pair.P_m) for pair in pairs]
        locators = [np.full(len(pair.P_m), -1) if pair.locators is None else pair.locators for pair in pairs]
        values |= {
            terms.PAIR_OF_POINT: np.repeat(np.arange(len(pairs)), counts),
            terms.MOVING_POINT: np.vstack([pair.P_m for pair in pairs]),
            terms.REFERENCE_POINT: np.vstack([pair.P_r for pair in pairs]),
            terms.REFERENCE_NORMAL: np.vstack([pair.n_r for pair in pairs]),
            terms.LOCATOR_OF_POINT: np.concatenate(locators),
        }
        if any(pair.is_springy for pair in pairs):
            stiffness = [np.full(len(pair.P_m), np.inf) if pair.stiffness is None else pair.stiffness for pair in pairs]
            values[terms.POINT_STIFFNESS] = np.concatenate(stiffness)
        values |= _objective_values(program) | _bounded_values(program)
        errors = [pair.coordinate_error for pair in pairs]  # which are added to gaps
        if any(errors):
            values[terms.COORDINATE_ERROR] = errors
        values |= _round_values(nominal, np.cumsum([0, *counts]))
    return values | _face_values(nominal) | _form_values(program) | _datum_values(nominal)


def _objective_values(program: Program) -> Values:
    """Return the moments of the faces that the objective counts; none if it does not count faces."""
    if not program.method.counts_faces:
        return {}
    count = len(program.nominal.pairs)
    areas, centres, seconds = np.zeros((count, 2)), np.zeros((count, 2, 3)), np.zeros((count, 2, 3, 3))
    for group in (compiled.group for compiled in program.groups):
        for side in group.sides:
            number, index = group.pairs[side.pair], 1 - side.is_moving
            if not program.nominal.pairs[number].is_supports:
                areas[number, index] = side.moments[0] / side.density
                centres[number, index], seconds[number, index] = central_moments(np.asarray(side.centre), side.moments)
    return dict(zip(terms.OBJECTIVE, (terms.SIDES, areas, centres, seconds), strict=True))


def _bounded_values(program: Program) -> Values:
    """Return which pairs touch where their faces end, and the error of fixed contact points there; none unless some may."""
    if not program.method.is_bounded:
        return {}
    numbers = range(len(program.nominal.pairs))
    return {
        terms.BOUNDED: [k in program.meetings for k in numbers],
        terms.PLANE_ERROR: [program.trials[k].error if k in program.trials else np.nan for k in numbers],
    }


def _round_values(nominal: Nominal, starts: np.ndarray) -> Values:
    """Return the values that determine where round faces touch, at any pose; `starts` are the first points of pairs."""
    shapes = {k: pair.shapes for k, pair in enumerate(nominal.pairs) if pair.shapes is not None}
    if not shapes:
        return {}
    return {
        terms.POINT_OF_ROUND: np.concatenate([np.arange(starts[k], starts[k + 1]) for k in shapes]),
        **{v: np.concatenate([walls[name] for walls, _ in shapes.values()]) for name, v in terms.OF_WALL.items()},
        **{v: np.concatenate([points[name] for _, points in shapes.values()]) for name, v in terms.OF_ROUND.items()},
    }


def _face_values(nominal: Nominal) -> Values:
    """Return how the faces of features deviate, and which sides of pairs they are."""
    faces, count = nominal.faces, len(nominal.contributors)
    if not faces:
        return {}
    twists, heights = np.zeros((len(faces), 6, count)), np.zeros((len(faces), count))
    for number, face in enumerate(faces):
        twists[number][:, face.columns], heights[number, face.columns] = face.twist, face.height
    moving, reference = (face_numbers(nominal, [pair.deviating[side] for pair in nominal.pairs]) for side in (0, 1))
    return {
        terms.FEATURE_OF_FACE: [face.name for face in faces],
        terms.FACE_CENTRE: np.array([face.centre for face in faces]),
        terms.FREEDOM_LABEL: terms.FREEDOMS,
        terms.FACE_TWIST: twists,
        terms.FACE_HEIGHT: heights,
        terms.FACE_OF_MOVING: moving,
        terms.FACE_OF_REFERENCE: reference,
        terms.FACING: np.concatenate([np.zeros(0), *(pair.facing for pair in nominal.pairs)]),
    }


def face_numbers(nominal: Nominal, faces: Sequence[FaceDeviation | None]) -> list[int]:
    """Return the zero-based indices of the faces of features, -1 for None."""
    return [-1 if face is None else nominal.faces.index(face) for face in faces]


def _form_values(program: Program) -> Values:
    """Return the forms of faces; none if no face has form."""
    faces, contributors = program.nominal.faces, program.draws.contributors
    with_form = [(number, face, face.form) for number, face in enumerate(faces) if face.form is not None]
    if not with_form:
        return {}
    modes = max(form.modes for _, _, form in with_form)
    numbers = np.full((len(NUMBERS), len(faces)), np.nan)
    columns, removed = np.full((len(faces), modes), -1), np.zeros((len(faces), modes, TERMS))
    weights = []
    for number, face, form in with_form:
        spread = np.nan if form.spreads is not None else contributors[face.form_columns[0]].spread
        width = program.draws.mean_widths[face.name]
        numbers[:, number] = (*form.lengths, *form.associated.ends, spread, form.left_out, width)
        columns[number, : form.modes], removed[number, : form.modes] = face.form_columns, form.removed.T
        weights.append(np.pad(form.weights, ((0, 0), (0, modes - form.modes))))
    surfaces = [None if face.form is None else face.form.associated.surface for face in faces]
    return {
        terms.FORM_COVARIANCE: ["" if face.form is None else face.form.form.covariance for face in faces],
        terms.FORM_LOBES: [0 if face.form is None else face.form.form.lobes or 0 for face in faces],
        terms.FORM_ASSOCIATED: ["" if face.form is None else face.form.associated.name for face in faces],
        **{terms.FORM_SURFACE[name]: values for name, values in surface_arrays(surfaces).items()},
        **dict(zip(NUMBERS, numbers, strict=True)),
        terms.FORM_CONTRIBUTOR: columns,
        terms.FACE_OF_FORM_STATION: np.concatenate([np.full(len(form.stations), number) for number, _, form in with_form]),
        terms.FORM_STATION_PLACE: np.concatenate([form.stations for _, _, form in with_form]),
        terms.FORM_STATION_WEIGHT: np.concatenate(weights),
        terms.FORM_REMOVED: removed,
    }


def _datum_values(nominal: Nominal) -> Values:
    """Return the planes that touch datum features with form, and the places that they may touch; none if there are none."""
    planes = [shift for pattern in nominal.patterns for shift in pattern.shifts if shift.form is not None]
    if not planes:
        return {}
    faces = {int(face.form_columns[0]): k for k, face in enumerate(nominal.faces) if face.form is not None}
    columns, free = np.full((len(planes), COORDINATES), -1), np.zeros((len(planes), COORDINATES, COORDINATES))
    residuals = np.zeros((len(planes), COORDINATES, len(nominal.contributors)))
    for number, plane in enumerate(planes):
        columns[number, list(plane.coordinates)] = plane.columns
        residuals[number, :, : plane.residuals.shape[1]] = plane.residuals
        free[number, :, : plane.free.shape[1]] = plane.free
    touched = {faces[plane.datum.form_columns.start]: plane for plane in planes}
    places = [nominal.faces[face].form for face in touched]
    return {
        terms.TANGENT_FACE: [faces[plane.datum.form_columns.start] for plane in planes],
        terms.TANGENT_CONTRIBUTOR: columns,
        terms.TANGENT_RESIDUAL: residuals,
        terms.TANGENT_FREE: free,
        terms.FACE_OF_TANGENT_PLACE: np.concatenate([np.full(len(plane.heights), k) for k, plane in touched.items()]),
        terms.TANGENT_PLACE_AT: np.vstack([form.places for form in places if form is not None]),
        terms.TANGENT_HEIGHT: np.vstack([plane.heights for plane in touched.values()]),
    }
