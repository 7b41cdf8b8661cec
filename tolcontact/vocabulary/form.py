"""Variables of an archive that describe the form of faces: random fields of heights, as few functions of place."""

from tolcontact.vocabulary.archive import surface_variables
from tolcontact.vocabulary.labels import FEATURE_FACE, variable

FORM_STATION, FORM_MODE, FORM_TERM = "form_station", "form_mode", "form_term"

FORM_COVARIANCE = variable(
    "str form_covariance(feature_face)", "covariance of the form of a feature's face, by distance; empty: it keeps its shape"
)
FORM_LENGTH = variable(
    "f8 form_length(feature_face)", "correlation length of the form, across the axis of a surface with one; NaN: none", "mm"
)
FORM_LENGTH_ALONG = variable(
    "f8 form_length_along(feature_face)", "correlation length of the form along the axis of its surface; NaN: none", "mm"
)
FORM_LOBES = variable(
    "i4 form_lobes(feature_face)", "number of lobes around the axis that all of the form has; 0: any number", "1"
)
FORM_ASSOCIATED = variable(
    "str form_associated(feature_face)",
    'what the form is measured from: the "surface", the "circles" of sections across its axis, or its "lines"; empty: none',
)
FORM_START, FORM_END = (
    variable(f"f8 form_{end}(feature_face)", f"place along the axis at the {end} of the face; NaN: no form", "mm")
    for end in ("start", "end")
)
FORM_SURFACE = surface_variables("form_surface", FEATURE_FACE, "the surface of a face with form, nominal")
FORM_SPREAD = variable(
    "f8 form_spread(feature_face)",
    "standard deviation of the coefficients of the form's modes; NaN: none, or one for each, as measured",
    "mm",
)
FORM_LEFT_OUT = variable(
    "f8 form_left_out(feature_face)",
    "share of the variance of the form that the modes leave out, or of the mean square of measured forms; NaN: none",
    "1",
)
FORM_MEAN_ZONE = variable(
    "f8 form_mean_zone(feature_face)", "mean width of the least zones of faces with this form; NaN: none", "mm"
)
FORM_CONTRIBUTOR = variable(
    "i4 form_contributor(feature_face, form_mode)",
    "number of the contributor that is the coefficient of a mode, counted from 0; -1: none",
)
FACE_OF_FORM_STATION = variable(
    "i4 face_of_station(form_station)", "number of the feature's face whose form a station is of, counted from 0"
)
FORM_STATION_PLACE = variable("f8 station(form_station, axis)", "place from which the covariance counts, nominal", "mm")
FORM_STATION_WEIGHT = variable(
    "f8 station_weight(form_station, form_mode)", "factor of the covariance with a station in the height of a mode", "1"
)
FORM_REMOVED = variable(
    "f8 form_removed(feature_face, form_mode, form_term)",
    "growth, translation, and rotation [mm-1] about the origin, of the face as a whole, which is subtracted from a mode",
    "1",
)
FORMS = (
    FORM_COVARIANCE, FORM_LENGTH, FORM_LENGTH_ALONG, FORM_LOBES, FORM_ASSOCIATED, FORM_START, FORM_END,
    *FORM_SURFACE.values(), FORM_SPREAD, FORM_LEFT_OUT, FORM_MEAN_ZONE, FORM_CONTRIBUTOR, FACE_OF_FORM_STATION,
    FORM_STATION_PLACE, FORM_STATION_WEIGHT, FORM_REMOVED,
)  # fmt: skip
