"""Variables of the check against the surfaces, for each realization that was checked."""

from tolcontact.vocabulary.labels import CHECKED, PAIR, ArchiveVariable

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
