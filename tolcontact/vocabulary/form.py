"""Variables of an archive that describe the form of faces: random fields of heights, as few functions of place."""

from tolcontact.vocabulary.archive import surface_variables
from tolcontact.vocabulary.labels import AXIS, FEATURE_FACE, ArchiveVariable

FORM_STATION, FORM_MODE, FORM_TERM = "form_station", "form_mode", "form_term"

FORM_COVARIANCE = ArchiveVariable(
    "form_covariance",
    (FEATURE_FACE,),
    str,
    "covariance of the form of a feature's face, by distance; empty: it keeps its shape",
)
FORM_LENGTH = ArchiveVariable(
    "form_length",
    (FEATURE_FACE,),
    "f8",
    "correlation length of the form, across the axis of a surface with one; NaN: none",
    "mm",
)
FORM_LENGTH_ALONG = ArchiveVariable(
    "form_length_along", (FEATURE_FACE,), "f8", "correlation length of the form along the axis of its surface; NaN: none", "mm"
)
FORM_LOBES = ArchiveVariable(
    "form_lobes", (FEATURE_FACE,), "i4", "number of lobes around the axis that all of the form has; 0: any number", "1"
)
FORM_ASSOCIATED = ArchiveVariable(
    "form_associated",
    (FEATURE_FACE,),
    str,
    'what the form is measured from: the "surface", the "circles" of sections across its axis, or its "lines"; empty: none',
)
FORM_START, FORM_END = (
    ArchiveVariable(f"form_{end}", (FEATURE_FACE,), "f8", f"place along the axis at the {end} of the face; NaN: no form", "mm")
    for end in ("start", "end")
)
FORM_SURFACE = surface_variables("form_surface", FEATURE_FACE, "the surface of a face with form, nominal")
FORM_SPREAD = ArchiveVariable(
    "form_spread",
    (FEATURE_FACE,),
    "f8",
    "standard deviation of the coefficients of the form's modes; NaN: none, or one for each, as measured",
    "mm",
)
FORM_LEFT_OUT = ArchiveVariable(
    "form_left_out",
    (FEATURE_FACE,),
    "f8",
    "share of the variance of the form that the modes leave out, or of the mean square of measured forms; NaN: none",
    "1",
)
FORM_MEAN_ZONE = ArchiveVariable(
    "form_mean_zone", (FEATURE_FACE,), "f8", "mean width of the least zones of faces with this form; NaN: none", "mm"
)
FORM_CONTRIBUTOR = ArchiveVariable(
    "form_contributor",
    (FEATURE_FACE, FORM_MODE),
    "i4",
    "number of the contributor that is the coefficient of a mode, counted from 0; -1: none",
)
FACE_OF_FORM_STATION = ArchiveVariable(
    "face_of_station", (FORM_STATION,), "i4", "number of the feature's face whose form a station is of, counted from 0"
)
FORM_STATION_PLACE = ArchiveVariable(
    "station", (FORM_STATION, AXIS), "f8", "place from which the covariance counts, nominal", "mm"
)
FORM_STATION_WEIGHT = ArchiveVariable(
    "station_weight", (FORM_STATION, FORM_MODE), "f8", "factor of the covariance with a station in the height of a mode", "1"
)
FORM_REMOVED = ArchiveVariable(
    "form_removed",
    (FEATURE_FACE, FORM_MODE, FORM_TERM),
    "f8",
    "growth, translation, and rotation [mm-1] about the origin, of the face as a whole, which is subtracted from a mode",
    "1",
)
FORMS = (
    FORM_COVARIANCE, FORM_LENGTH, FORM_LENGTH_ALONG, FORM_LOBES, FORM_ASSOCIATED, FORM_START, FORM_END,
    *FORM_SURFACE.values(), FORM_SPREAD, FORM_LEFT_OUT, FORM_MEAN_ZONE, FORM_CONTRIBUTOR, FACE_OF_FORM_STATION,
    FORM_STATION_PLACE, FORM_STATION_WEIGHT, FORM_REMOVED,
)  # fmt: skip
