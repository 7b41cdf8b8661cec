"""Variables of bodies: their surfaces, checks against these, clashes without contact, and coordinates in files."""

from typing import Literal, get_args

from tolcontact.vocabulary.labels import ArchiveVariable, variable

SurfaceKind = Literal["plane", "cylinder", "cone", "sphere", "torus"]
SURFACE_KINDS = get_args(SurfaceKind)  # in the order of their numbers
KINDS_MEAN = {"flag_values": list(range(len(SURFACE_KINDS))), "flag_meanings": " ".join(SURFACE_KINDS)}


def surface_variables(prefix: str, dim: str, surface: str) -> dict[str, ArchiveVariable]:
    """Return the variables of a surface, by the names of the attributes that they hold."""
    return {
        "kind": variable(f"i1 {prefix}_kind({dim})", f"kind of {surface}; -1: not known", "1", KINDS_MEAN),
        "origin": variable(
            f"f8 {prefix}_point({dim}, axis)",
            f"a point of {surface}, if it is a plane, or its centre; of a cone the apex",
            "mm",
        ),
        "axis": variable(
            f"f8 {prefix}_axis({dim}, axis)", f"unit normal or axis of {surface}; of a cone from the apex inward", "1"
        ),
        "radius": variable(
            f"f8 {prefix}_radius({dim})", f"radius of {surface}; of a torus to the centre line of its tube", "mm"
        ),
        "minor": variable(f"f8 {prefix}_tube_radius({dim})", f"radius of the tube, if {surface} is a torus", "mm"),
        "angle": variable(f"f8 {prefix}_angle({dim})", f"angle between axis and {surface}, if it is a cone", "rad"),
    }


CLASHES = variable(
    "i2 clashes(realization)",
    "number of pairs of parts without declared contact that lie in each other in the corrected state; -1: not tested",
    "1",
)
CLASH_DEPTH = variable(
    "f8 clash_depth(realization)",
    "how deep the parts of the deepest of these pairs lie in each other; without such a pair, parts with declared contact "
    "whose answer is doubtful; 0: no parts; NaN: not measured",
    "mm",
)
CLASH_PART = variable(
    "i2 clash_part(realization)", "index along `part` of the first of the two parts that clash_depth is of; -1: no parts", "1"
)
CLASH_OTHER = variable("i2 clash_other(realization)", "index along `part` of the second of these parts; -1: no parts", "1")


CHECKED_REALIZATION = variable("i8 realization_checked(checked)", "number of a realization that was checked; -1: none", "1")
SURFACE_PENETRATION = variable(
    "f8 surface_penetration(checked, pair)",
    "largest depth of one face in the other part's body in the corrected state, at points much denser than contact points; "
    "NaN: one-sided locators, which have no faces",
    "mm",
)
BESIDE = variable(
    "f8 beside(checked, pair)",
    "how far contact points that touch lie outside the rim of the reference face; NaN if that is not known",
    "mm",
)
FALSE_CONTACT = variable(
    "f8 false_contact(checked, pair)",
    "how deep contact points lay inside in the raw state, where the surfaces themselves were apart; NaN if that is not known",
    "mm",
)
NOTICED_SHARE = 0.01  # of the smallest tolerance range: deeper penetration or false contact of surfaces is reported
CONTACTS = variable(
    "f8 contacts(checked, pair)", "number of contact points that touch in the corrected state; NaN if that is not known", "1"
)
CONTACTS_ENDED = variable(
    "f8 contacts_ended(checked, pair)", "number of these that touch a plane where its face has ended; NaN: not known", "1"
)
AT_RANDOM = variable(
    "i1 at_random(checked)",
    "1: the realization was chosen at random; 0: for the deepest penetration, or the most active points",
    "1",
)
SURFACE = (
    CHECKED_REALIZATION, SURFACE_PENETRATION, BESIDE, FALSE_CONTACT, CONTACTS, CONTACTS_ENDED, AT_RANDOM,
)  # fmt: skip


CORRELATIONS = (
    "correlations"  # attribute of archives and summaries: lines on coefficients of each kind, sides of means and few parts
)
STORED_COORDINATES = "stored_coordinates"  # attribute of archives and summaries: how exactly files store which parts
STATED_ERROR_SHARE = 1e-4  # of the smallest tolerance range: a larger error of coordinates in files is reported

COORDINATE_SPACING = variable(
    "f8 coordinate_spacing(axis)", "spacing of the coordinates that the file of the mesh can store", "mm"
)
COORDINATE_ERROR = variable(
    "f8 coordinate_error(pair)",
    "error of coordinates in the files of a pair; its gaps count larger by it, also in gap_min and in reference_point",
    "mm",
)
