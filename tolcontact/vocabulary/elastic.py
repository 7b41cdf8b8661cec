"""Variables of the archive's group `elastic`: loads between elastic parts, and the flexibility of the parts at them."""

from tolcontact.vocabulary.labels import MEASURE, label, variable

ELASTIC_GROUP, LOADS, WELD_ROWS, ELASTIC_PART = "elastic", "load", "weld_row", "elastic_part"

ELASTIC_PARTS = "elastic_parts"  # attribute of archives and summaries: elastic parts, and the source of their stiffness

LOAD = variable(
    f"f8 reaction_at_load(realization, {LOADS})",
    "reaction at a contact point or two-sided locator of an elastic part; negative: the locator pulls",
    "N",
)
WELD_GAP = variable(f"f8 weld_gap(realization, {WELD_ROWS})", "gap that a weld keeps in all later stations", "mm")
WELD_OF_LOAD = variable(f"i4 weld_of_load({LOADS})", "number of the weld row whose gap a load keeps; -1: none", "1")
POINT_OF_LOAD = variable(f"i4 point_of_load({LOADS})", "number of the contact point that a load acts at, counted from 0")
HOLDS = variable(f"i1 holds({LOADS})", "1: a two-sided locator, whose gap is zero; 0: contact, which only pushes", "1")
FLEXIBILITY = variable(
    f"f8 flexibility({LOADS}, load_)",
    "opening of a gap by the unit of each load, of elastic parts and springs",
    "mm N-1",
)
OPENING = variable(f"f8 opening({LOADS})", "opening of the gap at a load by the constant forces, weights among them", "mm")
MEASURED_BY_LOAD = variable(
    f"f8 measured_by_load({MEASURE}, {LOADS})", "elastic change of a measure by the unit of a load, at nominal poses", "mm N-1"
)
MEASURED_BY_FORCES = variable(
    f"f8 measured_by_forces({MEASURE})", "elastic change of a measure by the constant forces, at nominal poses", "mm"
)
ELASTIC_LABEL = label(ELASTIC_PART, "elastic part")
ELASTIC_SOURCE = variable(f"str elastic_source({ELASTIC_PART})", "where the stiffness of an elastic part comes from")
ELASTIC_HASH = variable(f"str elastic_hash({ELASTIC_PART})", "SHA-256 of its files, or of its mesh and material")
OF_ELASTIC = (POINT_OF_LOAD, WELD_OF_LOAD, HOLDS, FLEXIBILITY, OPENING, MEASURED_BY_LOAD, MEASURED_BY_FORCES)
ELASTIC_ROWS = (LOAD, WELD_GAP)
