"""Every variable of an archive."""

import unicodedata

from tolcontact.vocabulary.labels import (
    AXIS,
    BLOCK,
    BODY_AXIS,
    BOUND,
    CHECKPOINT,
    COMPONENT,
    CORNER,
    FACE,
    MEASURE,
    NUMBER,
    PAIR,
    PART,
    POINT,
    REALIZATION,
    ROW_VARIABLE,
    STATE,
    STATUS_MEANINGS,
    UNFINISHED,
    VERTEX,
    ArchiveVariable,
    label,
)
from tolcontact.vocabulary.surface import CLASH_DEPTH, CLASH_OTHER, CLASH_PART, CLASHES
from tolcontact.vocabulary.variation import DEVIATION

BREP_FACE, ROUND_POINT = "brep_face", "round_point"
SURFACE_KINDS = ("plane", "cylinder", "cone", "sphere", "torus")  # in the order of their numbers
TOUCHING_GAP = 1e-4  # mm: a contact point with a smaller gap touches
KINDS_MEAN = {"flag_values": list(range(len(SURFACE_KINDS))), "flag_meanings": " ".join(SURFACE_KINDS)}


def surface_variables(prefix: str, dim: str, surface: str) -> dict[str, ArchiveVariable]:
    """Return the variables of a surface, by the names of the attributes that they hold."""
    return {
        "kind": ArchiveVariable(f"{prefix}_kind", (dim,), "i1", f"kind of {surface}; -1: not known", "1", KINDS_MEAN),
        "origin": ArchiveVariable(
            f"{prefix}_point",
            (dim, AXIS),
            "f8",
            f"a point of {surface}, if it is a plane, or its centre; of a cone the apex",
            "mm",
        ),
        "axis": ArchiveVariable(
            f"{prefix}_axis", (dim, AXIS), "f8", f"unit normal or axis of {surface}; of a cone from the apex inward", "1"
        ),
        "radius": ArchiveVariable(
            f"{prefix}_radius", (dim,), "f8", f"radius of {surface}; of a torus that of the tube's middle", "mm"
        ),
        "minor": ArchiveVariable(f"{prefix}_tube_radius", (dim,), "f8", f"radius of the tube, if {surface} is a torus", "mm"),
        "angle": ArchiveVariable(f"{prefix}_angle", (dim,), "f8", f"angle between axis and {surface}, if it is a cone", "rad"),
    }


BREP_OF_FACE = ArchiveVariable("brep_of_face", (FACE,), "i4", "number of the B-rep face of each triangle, counted from 0")
OF_BREP_FACE = surface_variables("surface", BREP_FACE, "the surface of a B-rep face, as the file stated it")
NAME_OF_BREP_FACE = ArchiveVariable(
    "surface_name", (BREP_FACE,), str, "what the file calls a B-rep face; empty: it has no name"
)

POINT_OF_ROUND = ArchiveVariable(
    "point_of_round", (ROUND_POINT,), "i4", "number of the contact point that is one of round faces, counted from 0"
)
OF_WALL = surface_variables("wall", ROUND_POINT, "the wall that a ball or shaft may touch, nominal")
OF_ROUND = {
    "is_hollow": ArchiveVariable("wall_is_hollow", (ROUND_POINT,), "i1", "1 if the wall is around the ball or shaft", "1"),
    "towards": ArchiveVariable(
        "wall_middle", (ROUND_POINT, AXIS), "f8", "unit vector from a hollow wall's axis to its middle", "1"
    ),
    "opening": ArchiveVariable(
        "wall_opening", (ROUND_POINT,), "f8", "angle that a hollow wall reaches to either side; pi: whole", "rad"
    ),
    "cut": ArchiveVariable(
        "wall_end", (ROUND_POINT, AXIS), "f8", "unit normal of the plane in which the wall ends; 0: the shaft itself ends", "1"
    ),
    "centre": ArchiveVariable(
        "round_centre", (ROUND_POINT, AXIS), "f8", "centre of the ball, or of the shaft's end, nominal", "mm"
    ),
    "axis": ArchiveVariable(
        "round_axis", (ROUND_POINT, AXIS), "f8", "unit vector of the shaft's axis, nominal; 0 of a ball", "1"
    ),
    "radius": ArchiveVariable("round_radius", (ROUND_POINT,), "f8", "radius of the ball or shaft", "mm"),
    "on_moving": ArchiveVariable(
        "round_on_moving", (ROUND_POINT,), "i1", "1 if ball or shaft belong to the moving part, 0 if the wall does", "1"
    ),
}
ROUND = (POINT_OF_ROUND, *OF_WALL.values(), *OF_ROUND.values())
KNOWN_SURFACES = (BREP_OF_FACE, *OF_BREP_FACE.values())


NUMBERS = ArchiveVariable(REALIZATION, (REALIZATION,), "i8", "number of the realization", "1", {"standard_name": "realization"})
COORDINATES = (
    NUMBERS,
    label(STATE, "state: raw as located, corrected after contact"),
    label(PART, "part"),
    label(PAIR, "contact pair"),
    label(MEASURE, "measure (key characteristic)"),
    label(AXIS, "axis of the nominal assembly frame"),
    label(BODY_AXIS, "axis of the part's nominal orientation"),
)

MEASURED = ArchiveVariable(
    "measured",
    (REALIZATION, STATE, MEASURE),
    "f8",
    "value of a measure: displacement of a point, distance of two points, or the user's expression",
    "mm",
)
TRANSLATION = ArchiveVariable(
    "translation",
    (REALIZATION, STATE, PART, AXIS),
    "f8",
    "t of the pose x = R x0 + t, x0 in the nominal assembly frame",
    "mm",
)
ROTATION = ArchiveVariable(
    "rotation",
    (REALIZATION, STATE, PART, AXIS, BODY_AXIS),
    "f8",
    "R of the pose x = R x0 + t; rows are assembly axes",
    "1",
)
GAP_MIN = ArchiveVariable(
    "gap_min",
    (REALIZATION, STATE, PAIR),
    "f8",
    "smallest gap of all contact points of a pair, larger by coordinate_error if there is one; negative: penetration",
    "mm",
)
ACTIVE = ArchiveVariable("active", (REALIZATION, PAIR), "i4", "number of active contact points in the raw state", "1")
CARRYING = ArchiveVariable(
    "carrying", (REALIZATION, PAIR), "i4", "number of contact points under load in the corrected state", "1"
)
REACTION = ArchiveVariable("reaction", (REALIZATION, PAIR), "f8", "sum of the reactions of the contact points of a pair")
KKT_RESIDUAL = ArchiveVariable(
    "kkt_residual",
    (REALIZATION,),
    "f8",
    "largest residual of the optimality conditions of the contact problem; in an exact resolution also its last step",
    "mm",
)
ITERATIONS = ArchiveVariable("iterations", (REALIZATION,), "i4", "number of linear steps that the contact problem took", "1")
STARTS = ArchiveVariable("starts", (REALIZATION,), "i1", "number of places that the steps were started from", "1")
SECOND_ANSWERS = ArchiveVariable("second_answers", (REALIZATION,), "i4", "number of QPs that another solver had to answer", "1")
SEARCHED = ArchiveVariable(
    "searched",
    (REALIZATION,),
    "i1",
    "1: contact points were projected again, or found, at the poses themselves, and gap_min refers to those; "
    "0: it refers to the archived ones",
    "1",
)
STATUS = ArchiveVariable(
    "status",
    (REALIZATION,),
    "i1",
    "outcome of the realization",
    None,
    {
        "flag_values": [UNFINISHED, *range(len(STATUS_MEANINGS))],
        "flag_meanings": " ".join(["unfinished", *STATUS_MEANINGS]),
    },
)
ROWS = (
    MEASURED,
    TRANSLATION,
    ROTATION,
    GAP_MIN,
    ACTIVE,
    CARRYING,
    REACTION,
    KKT_RESIDUAL,
    ITERATIONS,
    STARTS,
    SECOND_ANSWERS,
    SEARCHED,
    CLASHES,
    CLASH_DEPTH,
    CLASH_PART,
    CLASH_OTHER,
    STATUS,
)
POSES = (TRANSLATION, ROTATION)

BY_REALIZATION = (*ROWS, DEVIATION)
ROW_VARIABLE_LABEL = label(ROW_VARIABLE, "variable of realizations")
ROW_CHECKSUM = ArchiveVariable(
    "row_checksum",
    (BLOCK, ROW_VARIABLE),
    "i8",
    "CRC-32 of the values of a variable in a block of `block_rows` realizations (the last one may be shorter), little-endian; "
    "-1: unfinished",
    "1",
)

MEASURE_NOMINAL = ArchiveVariable("measure_nominal", (MEASURE,), "f8", "value of the measure in the nominal assembly")
MEASURE_TOLERANCE = ArchiveVariable(
    "measure_tolerance",
    (MEASURE,),
    "f8",
    "full width of the allowed zone; NaN if it is open",
)
LOWER_LIMIT = ArchiveVariable(
    "measure_lower_limit", (MEASURE,), "f8", "least allowed value of the measure; NaN if that side is open"
)
UPPER_LIMIT = ArchiveVariable(
    "measure_upper_limit", (MEASURE,), "f8", "largest allowed value of the measure; NaN if that side is open"
)
MEASURE_ACCURACY = ArchiveVariable(
    "measure_accuracy", (MEASURE,), "f8", "by how much a value may be beyond a limit and still count as at the limit"
)
QUANTITY = ArchiveVariable(
    "measure_quantity",
    (MEASURE,),
    str,
    "what a measure is the value of: displacement, coordinate, distance, deviation of distance, a kind of measurement such as "
    "gap, clearance or angle, or expression of the poses",
)
MEASURE_UNITS = ArchiveVariable("measure_units", (MEASURE,), str, "units of the measure")

MEASURE_LINE, LINE_END = "measure_line", "line_end"
MEASURE_OF_LINE = ArchiveVariable(
    "measure_of_line", (MEASURE_LINE,), "i4", "number of the measure that a line shows, counted from 0"
)
LINE_ENDS = ArchiveVariable(
    "measure_line_ends",
    (MEASURE_LINE, LINE_END, AXIS),
    "f8",
    "ends of the lines that show what is measured, nominal; gaps, axes and directions",
    "mm",
)

DECLARATION = ArchiveVariable("declaration", (), str, "the declared model as JSON, enough to rebuild it")
MESH_VERTICES = ArchiveVariable("vertices", (VERTEX, AXIS), "f8", "vertices of a mesh in its part's own frame", "mm")
MESH_FACES = ArchiveVariable("faces", (FACE, CORNER), "i4", "vertex numbers of each triangle, counted from 0")

PAIR_OF_POINT = ArchiveVariable("pair_of_point", (POINT,), "i4", "number of the pair of each contact point, counted from 0")
MOVING_PART = ArchiveVariable("moving_part", (PAIR,), "i4", "number of the moving part of each pair, counted from 0")
REFERENCE_PART = ArchiveVariable("reference_part", (PAIR,), "i4", "number of the reference part of each pair, -1: the ground")
MOVING_POINT = ArchiveVariable("moving_point", (POINT, AXIS), "f8", "P^m: contact point of the moving part, nominal", "mm")
REFERENCE_POINT = ArchiveVariable(
    "reference_point", (POINT, AXIS), "f8", "P^r: its projection on the reference part, nominal", "mm"
)
REFERENCE_NORMAL = ArchiveVariable(
    "reference_normal", (POINT, AXIS), "f8", "n^r: outward unit normal of the reference part there, nominal", "1"
)

POINT_STIFFNESS = ArchiveVariable(
    "point_stiffness", (POINT,), "f8", "stiffness of a contact point that gives way; infinite: it is rigid", "N mm-1"
)
LOCATOR_OF_POINT = ArchiveVariable(
    "locator_of_point",
    (POINT,),
    "i4",
    "number of the one-sided locator that a contact point represents, whose deviation is subtracted from its gap; -1: none",
)

BOUNDED = ArchiveVariable(
    "bounded", (PAIR,), "i1", "1: faces end, and places of contact are found at every pose; 0: contact points are fixed", "1"
)
PLANE_ERROR = ArchiveVariable(
    "plane_error",
    (PAIR,),
    "f8",
    "largest error of fixed contact points in the depth of contact, at 1024 raw poses; NaN: not compared",
    "mm",
)

COMPONENT_LABEL = label(COMPONENT, "component of the displacement")
FIELD_VERTICES = ArchiveVariable("vertices", (VERTEX, AXIS), "f8", "surface points of the part, nominal", "mm")
FIELD_FACES = MESH_FACES
FIELD_MEAN = ArchiveVariable("mean", (STATE, VERTEX, COMPONENT), "f8", "mean displacement of a surface point", "mm")
FIELD_SIX_SIGMA = ArchiveVariable(
    "six_sigma",
    (STATE, VERTEX, COMPONENT),
    "f8",
    "six standard deviations of the displacement of a surface point",
    "mm",
)
BOUND_LABEL = label(BOUND, "bound of a 95 % confidence interval")
FIELD_INTERVAL = ArchiveVariable(
    "magnitude_six_sigma_interval",
    (STATE, VERTEX, BOUND),
    "f8",
    "95 % confidence interval of six standard deviations of the displacement magnitude",
    "mm",
)
FIELD_REALIZATIONS = ArchiveVariable("realizations", (), "i8", "number of realizations that the displacement field covers", "1")
MAGNITUDE_REALIZATIONS = ArchiveVariable(
    "magnitude_realizations",
    (),
    "i8",
    "number of realizations, the first ones, that the magnitude of the displacement field covers",
    "1",
)
FIELDS = (FIELD_MEAN, FIELD_SIX_SIGMA, FIELD_INTERVAL, FIELD_REALIZATIONS, MAGNITUDE_REALIZATIONS)
TOUCHING_SHARE = ArchiveVariable(
    "touching",
    (POINT,),
    "f8",
    f"share of realizations in which a contact point touches, corrected: gap below {TOUCHING_GAP} mm; NaN: not known",
    "1",
)
TOUCHING_INTERVAL = ArchiveVariable("touching_interval", (POINT, BOUND), "f8", "its 95 % confidence interval", "1")
TOUCHING_REALIZATIONS = ArchiveVariable(
    "touching_realizations", (), "i8", "number of realizations, of the first ones, that this share is of", "1"
)
TOUCHING = (TOUCHING_SHARE, TOUCHING_INTERVAL, TOUCHING_REALIZATIONS)
GROUP_CHECKSUM = ArchiveVariable(
    "checksum",
    (),
    "i8",
    "CRC-32 of the variables of this group that may be overwritten, in their order; -1: being written",
    "1",
)
SUMMED_ROWS = ArchiveVariable(
    "summed_rows", (CHECKPOINT,), "i8", "number of realizations in the sums of a checkpoint; -1: none", "1"
)
FIELD_SUMS = ArchiveVariable(
    "sums",
    (CHECKPOINT, STATE, NUMBER),
    "f8",
    "running sums of the displacement field, from which an unfinished run continues",
    "1",
)
SUMS_CHECKSUM = ArchiveVariable("sums_checksum", (CHECKPOINT,), "i8", "CRC-32 of the sums of a checkpoint", "1")


def group_of(part: str) -> str:
    """Return the name of a part's groups: its own, followed by an underscore if the archive uses that name.

    In xarray all groups inherit the coordinates of the root, and a group cannot have the name of one of them.
    """
    name = unicodedata.normalize("NFC", part)  # as the netCDF library stores it
    return f"{name}_" if name.rstrip("_") in {coordinate.name for coordinate in COORDINATES} else name


def field_of(part: str) -> str:
    """Return the path of a part's displacement field."""
    return f"field/{group_of(part)}"
