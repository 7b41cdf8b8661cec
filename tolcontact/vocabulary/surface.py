"""Variables of bodies: realizations checked against the surfaces, clashes without contact, coordinates in files."""

from tolcontact.vocabulary.labels import AXIS, CHECKED, PAIR, REALIZATION, ArchiveVariable

CLASHES = ArchiveVariable(
    "clashes",
    (REALIZATION,),
    "i2",
    "number of pairs of parts without declared contact that lie in each other in the corrected state; -1: not tested",
    "1",
)
CLASH_DEPTH = ArchiveVariable(
    "clash_depth",
    (REALIZATION,),
    "f8",
    "how deep the parts of the deepest of these pairs lie in each other; without such a pair, parts with declared contact "
    "whose answer is doubtful; 0: no parts; NaN: not measured",
    "mm",
)
CLASH_PART = ArchiveVariable(
    "clash_part",
    (REALIZATION,),
    "i2",
    "index along `part` of the first of the two parts that clash_depth is of; -1: no parts",
    "1",
)
CLASH_OTHER = ArchiveVariable(
    "clash_other", (REALIZATION,), "i2", "index along `part` of the second of these parts; -1: no parts", "1"
)


CHECKED_REALIZATION = ArchiveVariable(
    "realization_checked", (CHECKED,), "i8", "number of a realization that was checked; -1: none", "1"
)
SURFACE_PENETRATION = ArchiveVariable(
    "surface_penetration",
    (CHECKED, PAIR),
    "f8",
    "largest depth of one face in the other part's body in the corrected state, at points much denser than contact points; "
    "NaN: one-sided locators, which have no faces",
    "mm",
)
BESIDE = ArchiveVariable(
    "beside",
    (CHECKED, PAIR),
    "f8",
    "how far contact points that touch lie outside the rim of the reference face; NaN if that is not known",
    "mm",
)
FALSE_CONTACT = ArchiveVariable(
    "false_contact",
    (CHECKED, PAIR),
    "f8",
    "how deep contact points lay inside in the raw state, where the surfaces themselves were apart; NaN if that is not known",
    "mm",
)
NOTICED_SHARE = 0.01  # of the smallest tolerance range: deeper penetration or false contact of surfaces is told
CONTACTS = ArchiveVariable(
    "contacts",
    (CHECKED, PAIR),
    "f8",
    "number of contact points that touch in the corrected state; NaN if that is not known",
    "1",
)
CONTACTS_ENDED = ArchiveVariable(
    "contacts_ended", (CHECKED, PAIR), "f8", "number of these that touch a plane where its face has ended; NaN: not known", "1"
)
AT_RANDOM = ArchiveVariable(
    "at_random",
    (CHECKED,),
    "i1",
    "1: the realization was chosen at random; 0: because it penetrates most, or because most of its points carry",
    "1",
)
SURFACE = (
    CHECKED_REALIZATION, SURFACE_PENETRATION, BESIDE, FALSE_CONTACT, CONTACTS, CONTACTS_ENDED, AT_RANDOM,
)  # fmt: skip


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
