"""Variables of an archive that describe what varies: contributors, locators, faces of features, and planes of their datums."""

from tolcontact.vocabulary.labels import (
    CONTRIBUTOR,
    FREEDOM,
    LOCATOR,
    label,
    variable,
)

FREEDOMS = ("tau x", "tau y", "tau z", "rho x", "rho y", "rho z")

DEVIATION = variable(
    "f8 deviation(realization, contributor)",
    "deviation of a contributor: of a locator along its direction, of a freedom or the size of a feature, or of a variable; "
    "with what shared variables add to it",
    "mm",
)
CONTRIBUTOR_LABEL = label(CONTRIBUTOR, "contributor, as part.locator, part.feature.freedom, or a variable's name")
CONTRIBUTOR_SOURCE = variable("str source(contributor)", "what a contributor is of: locator, feature or variable")
CONTRIBUTOR_UNITS = variable("str contributor_units(contributor)", "units of the deviation of a contributor")
TOLERANCE_RANGE = variable(
    "f8 tolerance_range(contributor)",
    "full width of the tolerance zone; NaN if the distribution alone defines the spread",
    "mm",
)
DISTRIBUTION = variable(
    "str distribution(contributor)",
    "distribution of the deviation; of a feature its tolerance, and the rule from zone to spread",
)
MEAN_SHIFT = variable(
    "f8 mean_shift(contributor)", "mean of the contributor's own distribution, without what shared variables add to it", "mm"
)

LOCATOR_LABEL = label(LOCATOR, "locator, as part.locator: contributors of the same number")
STIFFNESS = variable("f8 stiffness(locator)", "stiffness of the locator", "N mm-1")
ONE_SIDED = variable("i1 one_sided(locator)", "1: a support that the part may lift off, 0: held both ways")
LOCATOR_POINT = variable("f8 locator_point(locator, axis)", "where the locator holds its part, nominal", "mm")
LOCATOR_DIRECTION = variable("f8 locator_direction(locator, axis)", "direction of the deviation, into the part", "1")
FACE_OF_LOCATOR = variable(
    "i4 face_of_locator(locator)", "number of the feature's face that a locator stands against, counted from 0; -1: none"
)

GROUND_OF_LOCATOR = variable(
    "i4 ground_of_locator(locator)",
    "number of the feature, of another part, that a locator is on and moves with, counted from 0 as faces are; -1: none",
)

FREEDOM_LABEL = label(FREEDOM, "component of a small displacement p -> p + tau + rho x (p - centre)")
FEATURE_OF_FACE = variable("str feature_of_face(feature_face)", "feature that a face belongs to, as part.feature")
FACE_CENTRE = variable("f8 face_centre(feature_face, axis)", "centre about which a feature's face turns, nominal", "mm")
FACE_TWIST = variable(
    "f8 face_twist(feature_face, freedom, contributor)",
    "displacement tau [mm], rho [rad] of a feature's face, nominal frame, for deviations of 1",
    "1",
)
FACE_HEIGHT = variable(
    "f8 face_height(feature_face, contributor)",
    "how much farther out of the material a feature's face lies everywhere, for deviations of 1",
    "1",
)
FACE_OF_MOVING = variable(
    "i4 face_of_moving(pair)", "number of the feature's face that the moving side of a pair is, counted from 0; -1: none"
)
FACE_OF_REFERENCE = variable(
    "i4 face_of_reference(pair)", "number of the feature's face that the reference side is, counted from 0; -1: none"
)
FACING = variable(
    "f8 facing(point)", "-n^m . n^r: share of the moving face's height by which it comes nearer at a contact point", "1"
)
FEATURE_FACES = (
    FEATURE_OF_FACE, FACE_CENTRE, FREEDOM_LABEL, FACE_TWIST, FACE_HEIGHT, FACE_OF_MOVING, FACE_OF_REFERENCE, FACING,
)  # fmt: skip


TANGENT, TANGENT_PLACE, COORDINATE, TANGENT_FREEDOM = "tangent", "tangent_place", "plane_coordinate", "tangent_freedom"

TANGENT_FACE = variable("i4 tangent_face(tangent)", "number of the feature's face that a plane touches, counted from 0")
TANGENT_CONTRIBUTOR = variable(
    "i4 tangent_contributor(tangent, plane_coordinate)",
    "number of the contributor that is the offset or a tilt of the plane, from the datum by least squares, counted from 0; -1: "
    "it makes no difference",
)
TANGENT_LEANING = variable(
    "f8 tangent_leaning(tangent, plane_coordinate, contributor)",
    "offset and tilts of the face from the datum by least squares, for deviations of 1",
)
TANGENT_FREE = variable(
    "f8 tangent_free(tangent, plane_coordinate, tangent_freedom)",
    "offset and tilts in which the plane may lie; 0: no more",
    "1",
)
FACE_OF_TANGENT_PLACE = variable(
    "i4 face_of_tangent_place(tangent_place)", "number of the feature's face that a place is on, counted from 0"
)
TANGENT_PLACE_AT = variable("f8 tangent_place_at(tangent_place, axis)", "place that a plane may touch, nominal", "mm")
TANGENT_HEIGHT = variable(
    "f8 tangent_height(tangent_place, plane_coordinate)", "height of a plane at the place, for an offset or a tilt of 1 mm", "1"
)
TANGENTS = (
    TANGENT_FACE, TANGENT_CONTRIBUTOR, TANGENT_LEANING, TANGENT_FREE, FACE_OF_TANGENT_PLACE, TANGENT_PLACE_AT, TANGENT_HEIGHT,
)  # fmt: skip
