"""Variables of an archive that describe planes which touch datum features with form outside of the material."""

from tolcontact.vocabulary.labels import AXIS, CONTRIBUTOR, ArchiveVariable

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
