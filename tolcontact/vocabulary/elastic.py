"""Variables of the archive's group `elastic`: loads between elastic parts, and the flexibility of the parts at them."""

from tolcontact.vocabulary.labels import label, variable

ELASTIC_GROUP, LOADS, WELD_ROWS, ELASTIC_PART = "elastic", "load", "weld_row", "elastic_part"

ELASTIC_PARTS = "elastic_parts"  # attribute of archives and summaries: elastic parts, and the source of their stiffness

LOAD = variable(
    f"f8 reaction_at_load(realization, {LOADS}) [N]",
    "reaction at a contact point or two-sided locator of an elastic part; negative: the locator pulls",
)
WELD_GAP = variable(f"f8 weld_gap(realization, {WELD_ROWS}) [mm]", "gap that a weld keeps in all later stations")
WELD_OF_LOAD = variable(f"i4 weld_of_load({LOADS}) [1]", "number of the weld row whose gap a load keeps; -1: none")
POINT_OF_LOAD = variable(f"i4 point_of_load({LOADS})", "number of the contact point that a load acts at, counted from 0")
HOLDS = variable(f"i1 holds({LOADS}) [1]", "1: a two-sided locator, whose gap is zero; 0: contact, which only pushes")
FLEXIBILITY = variable(
    f"f8 flexibility({LOADS}, load_) [mm N-1]", "opening of a gap by the unit of each load, of elastic parts and springs"
)
OPENING = variable(f"f8 opening({LOADS}) [mm]", "opening of the gap at a load by the constant forces, weights among them")
MEASURED_BY_LOAD = variable(
    f"f8 measured_by_load(measure, {LOADS}) [mm N-1]", "elastic change of a measure by the unit of a load, at nominal poses"
)
MEASURED_BY_FORCES = variable(
    "f8 measured_by_forces(measure) [mm]", "elastic change of a measure by the constant forces, at nominal poses"
)
ELASTIC_LABEL = label(ELASTIC_PART, "elastic part")
ELASTIC_SOURCE = variable(f"str elastic_source({ELASTIC_PART})", "where the stiffness of an elastic part comes from")
ELASTIC_HASH = variable(f"str elastic_hash({ELASTIC_PART})", "SHA-256 of its files, or of its mesh and material")
OF_ELASTIC = (POINT_OF_LOAD, WELD_OF_LOAD, HOLDS, FLEXIBILITY, OPENING, MEASURED_BY_LOAD, MEASURED_BY_FORCES)
ELASTIC_ROWS = (LOAD, WELD_GAP)
