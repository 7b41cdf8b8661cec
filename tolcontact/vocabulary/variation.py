"""Variables of an archive that describe what varies: contributors, locators, faces of features, and planes of their datums."""

from tolcontact.vocabulary.labels import (
    AXIS,
    CONTRIBUTOR,
    FEATURE_FACE,
    FREEDOM,
    LOCATOR,
    PAIR,
    POINT,
    REALIZATION,
    ArchiveVariable,
    label,
)

FREEDOMS = ("tau x", "tau y", "tau z", "rho x", "rho y", "rho z")

DEVIATION = ArchiveVariable(
    "deviation",
    (REALIZATION, CONTRIBUTOR),
    "f8",
    "deviation of a contributor: of a locator along its direction, of a freedom or the size of a feature, or of a variable; "
    "with what shared variables add to it",
    "mm",
)
CONTRIBUTOR_LABEL = label(CONTRIBUTOR, "contributor, as part.locator, part.feature.freedom, or a variable's name")
CONTRIBUTOR_SOURCE = ArchiveVariable("source", (CONTRIBUTOR,), str, "what a contributor is of: locator, feature or variable")
CONTRIBUTOR_UNITS = ArchiveVariable("contributor_units", (CONTRIBUTOR,), str, "units of the deviation of a contributor")
TOLERANCE_RANGE = ArchiveVariable(
    "tolerance_range",
    (CONTRIBUTOR,),
    "f8",
    "full width of the tolerance zone; NaN if the distribution alone defines the spread",
    "mm",
)
DISTRIBUTION = ArchiveVariable(
    "distribution",
    (CONTRIBUTOR,),
    str,
    "distribution of the deviation; of a feature its tolerance, and the rule from zone to spread",
)
MEAN_SHIFT = ArchiveVariable(
    "mean_shift",
    (CONTRIBUTOR,),
    "f8",
    "mean of the contributor's own distribution, without what shared variables add to it",
    "mm",
)

LOCATOR_LABEL = label(LOCATOR, "locator, as part.locator: contributors of the same number")
STIFFNESS = ArchiveVariable("stiffness", (LOCATOR,), "f8", "stiffness of the locator", "N mm-1")
ONE_SIDED = ArchiveVariable("one_sided", (LOCATOR,), "i1", "1: a support that the part may lift off, 0: held both ways")
LOCATOR_POINT = ArchiveVariable("locator_point", (LOCATOR, AXIS), "f8", "where the locator holds its part, nominal", "mm")
LOCATOR_DIRECTION = ArchiveVariable(
    "locator_direction", (LOCATOR, AXIS), "f8", "direction of the deviation, into the part", "1"
)
FACE_OF_LOCATOR = ArchiveVariable(
    "face_of_locator", (LOCATOR,), "i4", "number of the feature's face that a locator stands against, counted from 0; -1: none"
)

GROUND_OF_LOCATOR = ArchiveVariable(
    "ground_of_locator",
    (LOCATOR,),
    "i4",
    "number of the feature, of another part, that a locator is on and moves with, counted from 0 as faces are; -1: none",
)

FREEDOM_LABEL = label(FREEDOM, "component of a small displacement p -> p + tau + rho x (p - centre)")
FEATURE_OF_FACE = ArchiveVariable("feature_of_face", (FEATURE_FACE,), str, "feature that a face belongs to, as part.feature")
FACE_CENTRE = ArchiveVariable(
    "face_centre", (FEATURE_FACE, AXIS), "f8", "centre about which a feature's face turns, nominal", "mm"
)
FACE_TWIST = ArchiveVariable(
    "face_twist",
    (FEATURE_FACE, FREEDOM, CONTRIBUTOR),
    "f8",
    "displacement tau [mm], rho [rad] of a feature's face, nominal frame, for deviations of 1",
    "1",
)
FACE_HEIGHT = ArchiveVariable(
    "face_height",
    (FEATURE_FACE, CONTRIBUTOR),
    "f8",
    "how much farther out of the material a feature's face lies everywhere, for deviations of 1",
    "1",
)
FACE_OF_MOVING = ArchiveVariable(
    "face_of_moving", (PAIR,), "i4", "number of the feature's face that the moving side of a pair is, counted from 0; -1: none"
)
FACE_OF_REFERENCE = ArchiveVariable(
    "face_of_reference", (PAIR,), "i4", "number of the feature's face that the reference side is, counted from 0; -1: none"
)
FACING = ArchiveVariable(
    "facing", (POINT,), "f8", "-n^m . n^r: share of the moving face's height by which it comes nearer at a contact point", "1"
)
FEATURE_FACES = (
    FEATURE_OF_FACE, FACE_CENTRE, FREEDOM_LABEL, FACE_TWIST, FACE_HEIGHT, FACE_OF_MOVING, FACE_OF_REFERENCE, FACING,
)  # fmt: skip


TANGENT, TANGENT_PLACE, COORDINATE, TANGENT_FREEDOM = "tangent", "tangent_place", "plane_coordinate", "tangent_freedom"

TANGENT_FACE = ArchiveVariable(
    "tangent_face", (TANGENT,), "i4", "number of the feature's face that a plane touches, counted from 0"
)
TANGENT_CONTRIBUTOR = ArchiveVariable(
    "tangent_contributor",
    (TANGENT, COORDINATE),
    "i4",
    "number of the contributor that is the offset or a tilt of the plane, from the datum by least squares, counted from 0; -1: "
    "it makes no difference",
)
TANGENT_LEANING = ArchiveVariable(
    "tangent_leaning",
    (TANGENT, COORDINATE, CONTRIBUTOR),
    "f8",
    "offset and tilts of the face from the datum by least squares, for deviations of 1",
)
TANGENT_FREE = ArchiveVariable(
    "tangent_free", (TANGENT, COORDINATE, TANGENT_FREEDOM), "f8", "offset and tilts in which the plane may lie; 0: no more", "1"
)
FACE_OF_TANGENT_PLACE = ArchiveVariable(
    "face_of_tangent_place", (TANGENT_PLACE,), "i4", "number of the feature's face that a place is on, counted from 0"
)
TANGENT_PLACE_AT = ArchiveVariable(
    "tangent_place_at", (TANGENT_PLACE, AXIS), "f8", "place that a plane may touch, nominal", "mm"
)
TANGENT_HEIGHT = ArchiveVariable(
    "tangent_height", (TANGENT_PLACE, COORDINATE), "f8", "height of a plane at the place, for an offset or a tilt of 1 mm", "1"
)
TANGENTS = (
    TANGENT_FACE, TANGENT_CONTRIBUTOR, TANGENT_LEANING, TANGENT_FREE, FACE_OF_TANGENT_PLACE, TANGENT_PLACE_AT, TANGENT_HEIGHT,
)  # fmt: skip
