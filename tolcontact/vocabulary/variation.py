"""Variables of an archive for contributors, locators, and faces of features with datums and form."""

from tolcontact.vocabulary.labels import CONTRIBUTOR, FEATURE_FACE, FREEDOM, LOCATOR, label, surface_variables, variable

FREEDOMS = ("tau x", "tau y", "tau z", "rho x", "rho y", "rho z")

DEVIATION = variable(
    "f8 deviation(realization, contributor)",
    "deviation of a contributor: of a locator along its direction, of a freedom or the size of a feature, or of a variable; "
    "with what shared variables add to it",
)
CONTRIBUTOR_LABEL = label(CONTRIBUTOR, "contributor, as part.locator, part.feature.freedom, or a variable's name")
CONTRIBUTOR_SOURCE = variable("str source(contributor)", "what a contributor is of: locator, feature or variable")
CONTRIBUTOR_UNITS = variable("str contributor_units(contributor)", "units of the deviation of a contributor")
TOLERANCE_RANGE = variable(
    "f8 tolerance_range(contributor)", "full width of the tolerance zone; NaN if the distribution alone defines the spread"
)
DISTRIBUTION = variable(
    "str distribution(contributor)",
    "distribution of the deviation; of a feature its tolerance, and the rule from zone to spread",
)
PARTS = variable("i8 parts(contributor) [1]", "number of parts that its distribution was estimated from; 0 if it is known")
MEAN_SHIFT = variable(
    "f8 mean_shift(contributor)", "mean of the contributor's own distribution, without what shared variables add to it"
)
IN_CONTRIBUTOR_UNITS = DEVIATION, TOLERANCE_RANGE, MEAN_SHIFT

LOCATOR_LABEL = label(LOCATOR, "locator, as part.locator: contributors of the same number")
STIFFNESS = variable("f8 stiffness(locator) [N mm-1]", "stiffness of the locator")
ONE_SIDED = variable("i1 one_sided(locator)", "1: a support that the part may lift off, 0: two-sided")
LOCATOR_POINT = variable("f8 locator_point(locator, axis) [mm]", "where the locator holds its part, nominal")
LOCATOR_DIRECTION = variable("f8 locator_direction(locator, axis) [1]", "direction of the deviation, into the part")
FACE_OF_LOCATOR = variable("i4 face_of_locator(locator)", "index of the feature's face at a locator; -1: none")

GROUND_OF_LOCATOR = variable(
    "i4 ground_of_locator(locator)",
    "number of the feature, of another part, that a locator is on and moves with, counted from 0 as faces are; -1: none",
)

FREEDOM_LABEL = label(FREEDOM, "component of a small displacement p -> p + tau + rho x (p - centre)")
FEATURE_OF_FACE = variable("str feature_of_face(feature_face)", "feature that a face belongs to, as part.feature")
FACE_CENTRE = variable("f8 face_centre(feature_face, axis) [mm]", "centre of rotation of a feature's face, nominal")
FACE_TWIST = variable(
    "f8 face_twist(feature_face, freedom, contributor) [1]",
    "displacement tau [mm], rho [rad] of a feature's face per unit deviation, nominal frame",
)
FACE_HEIGHT = variable("f8 face_height(feature_face, contributor) [1]", "outward offset of a feature's face per unit deviation")
FACE_OF_MOVING = variable(
    "i4 face_of_moving(pair)", "number of the feature's face that the moving side of a pair is, counted from 0; -1: none"
)
FACE_OF_REFERENCE = variable(
    "i4 face_of_reference(pair)", "number of the feature's face that the reference side is, counted from 0; -1: none"
)
FACING = variable(
    "f8 facing(point) [1]", "-n^m . n^r: share of the moving face's outward offset that closes the gap at a contact point"
)
FEATURE_FACES = (
    FEATURE_OF_FACE, FACE_CENTRE, FREEDOM_LABEL, FACE_TWIST, FACE_HEIGHT, FACE_OF_MOVING, FACE_OF_REFERENCE, FACING,
)  # fmt: skip


TANGENT = "tangent"

TANGENT_FACE = variable("i4 tangent_face(tangent)", "number of the feature's face that a plane touches, counted from 0")
TANGENT_CONTRIBUTOR = variable(
    "i4 tangent_contributor(tangent, plane_coordinate)",
    "number of the contributor that is the offset or a tilt of the plane, from the datum by least squares, counted from 0; -1: "
    "it makes no difference",
)
TANGENT_RESIDUAL = variable(
    "f8 tangent_leaning(tangent, plane_coordinate, contributor)",
    "offset and tilts of the face from the least-squares datum per unit deviation",
)
TANGENT_FREE = variable(
    "f8 tangent_free(tangent, plane_coordinate, tangent_freedom) [1]", "possible offsets and tilts of the plane; 0: no more"
)
FACE_OF_TANGENT_PLACE = variable(
    "i4 face_of_tangent_place(tangent_place)", "number of the feature's face that a place is on, counted from 0"
)
TANGENT_PLACE_AT = variable("f8 tangent_place_at(tangent_place, axis) [mm]", "place that a plane may touch, nominal")
TANGENT_HEIGHT = variable(
    "f8 tangent_height(tangent_place, plane_coordinate) [1]", "height of a plane at the place, for an offset or a tilt of 1 mm"
)
TANGENTS = (
    TANGENT_FACE, TANGENT_CONTRIBUTOR, TANGENT_RESIDUAL, TANGENT_FREE, FACE_OF_TANGENT_PLACE, TANGENT_PLACE_AT, TANGENT_HEIGHT,
)  # fmt: skip


FORM_COVARIANCE = variable(
    "str form_covariance(feature_face)", "covariance of the form of a feature's face, by distance; empty: it keeps its shape"
)
FORM_LENGTH = variable(
    "f8 form_length(feature_face) [mm]", "correlation length of the form, across the axis of a surface with one; NaN: none"
)
FORM_LENGTH_ALONG = variable(
    "f8 form_length_along(feature_face) [mm]", "correlation length of the form along the axis of its surface; NaN: none"
)
FORM_LOBES = variable(
    "i4 form_lobes(feature_face) [1]", "number of lobes around the axis that all of the form has; 0: any number"
)
FORM_ASSOCIATED = variable(
    "str form_associated(feature_face)",
    'what the form is measured from: the "surface", the "circles" of sections across its axis, or its "lines"; empty: none',
)
FORM_START, FORM_END = (
    variable(f"f8 form_{end}(feature_face) [mm]", f"place along the axis at the {end} of the face; NaN: no form")
    for end in ("start", "end")
)
FORM_SURFACE = surface_variables("form_surface", FEATURE_FACE, "the surface of a face with form, nominal")
FORM_SPREAD = variable(
    "f8 form_spread(feature_face) [mm]",
    "standard deviation of the coefficients of the form's modes; NaN: none, or one for each, as measured",
)
FORM_LEFT_OUT = variable(
    "f8 form_left_out(feature_face) [1]",
    "share of the variance of the form that the modes leave out, or of the mean square of measured forms; NaN: none",
)
FORM_MEAN_ZONE = variable(
    "f8 form_mean_zone(feature_face) [mm]", "mean width of the minimum zones of faces with this form; NaN: none"
)
FORM_CONTRIBUTOR = variable(
    "i4 form_contributor(feature_face, form_mode)",
    "number of the contributor that is the coefficient of a mode, counted from 0; -1: none",
)
FACE_OF_FORM_STATION = variable(
    "i4 face_of_station(form_station)", "number of the feature's face whose form a station is of, counted from 0"
)
FORM_STATION_PLACE = variable("f8 station(form_station, axis) [mm]", "point of the covariance, nominal")
FORM_STATION_WEIGHT = variable(
    "f8 station_weight(form_station, form_mode) [1]", "factor of the covariance with a station in the height of a mode"
)
FORM_REMOVED = variable(
    "f8 form_removed(feature_face, form_mode, form_term) [1]",
    "growth, translation, and rotation [mm-1] about the origin, of the face as a whole, which is subtracted from a mode",
)
FORMS = (
    FORM_COVARIANCE, FORM_LENGTH, FORM_LENGTH_ALONG, FORM_LOBES, FORM_ASSOCIATED, FORM_START, FORM_END,
    *FORM_SURFACE.values(), FORM_SPREAD, FORM_LEFT_OUT, FORM_MEAN_ZONE, FORM_CONTRIBUTOR, FACE_OF_FORM_STATION,
    FORM_STATION_PLACE, FORM_STATION_WEIGHT, FORM_REMOVED,
)  # fmt: skip
