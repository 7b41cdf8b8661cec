"""Variables of coordinates as files store them."""

from tolcontact.vocabulary.labels import AXIS, PAIR, ArchiveVariable

STORED_COORDINATES = "stored_coordinates"  # attribute of archives and summaries: how exactly files store which parts
STATED_ERROR_SHARE = 1e-4  # of the smallest tolerance range: a larger error of coordinates in files is told

COORDINATE_SPACING = ArchiveVariable(
    "coordinate_spacing", (AXIS,), "f8", "spacing of the coordinates that the file of the mesh can store", "mm"
)
COORDINATE_ERROR = ArchiveVariable(
    "coordinate_error",
    (PAIR,),
    "f8",
    "error of coordinates in the files of a pair, by which its gaps count larger, also in gap_min and in reference_point",
    "mm",
)
