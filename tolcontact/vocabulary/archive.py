"""Variables of an archive: its coordinates and root, contact, fields, and the groups station/NAME of stations."""

import unicodedata

from tolcontact.vocabulary.labels import (
    AXIS,
    BODY_AXIS,
    BOUND,
    BY_OBJECTIVE,
    CLASH_DEPTH,
    CLASH_OTHER,
    CLASH_PART,
    CLASHES,
    COMPONENT,
    MEASURE,
    PAIR,
    PART,
    STATE,
    STATUS_MEANINGS,
    label,
    surface_variables,
    variable,
)
from tolcontact.vocabulary.variation import DEVIATION

BREP_FACE, ROUND_POINT = "brep_face", "round_point"
TOUCHING_GAP = 1e-4  # mm: a contact point with a smaller gap touches


BREP_OF_FACE = variable("i4 brep_of_face(face)", "number of the B-rep face of each triangle, counted from 0")
OF_BREP_FACE = surface_variables("surface", BREP_FACE, "the surface of a B-rep face, as the file stated it")
NAME_OF_BREP_FACE = variable("str surface_name(brep_face)", "what the file calls a B-rep face; empty: it has no name")

POINT_OF_ROUND = variable(
    "i4 point_of_round(round_point)", "number of the contact point that is one of round faces, counted from 0"
)
OF_WALL = surface_variables("wall", ROUND_POINT, "the wall that a ball or shaft may touch, nominal")
OF_ROUND = {
    "is_hollow": variable("i1 wall_is_hollow(round_point) [1]", "1 if the wall is around the ball or shaft"),
    "towards": variable("f8 wall_middle(round_point, axis) [1]", "unit vector from a hollow wall's axis to its middle"),
    "opening": variable("f8 wall_opening(round_point) [rad]", "angle that a hollow wall reaches to either side; pi: whole"),
    "cut": variable(
        "f8 wall_end(round_point, axis) [1]", "unit normal of the plane at the end of the wall; 0: the shaft itself ends"
    ),
    "centre": variable("f8 round_centre(round_point, axis) [mm]", "centre of the ball, or of the shaft's end, nominal"),
    "axis": variable("f8 round_axis(round_point, axis) [1]", "unit vector of the shaft's axis, nominal; 0 of a ball"),
    "radius": variable("f8 round_radius(round_point) [mm]", "radius of the ball or shaft"),
    "on_moving": variable(
        "i1 round_on_moving(round_point) [1]", "1 if ball or shaft belong to the moving part, 0 if the wall does"
    ),
}
ROUND = (POINT_OF_ROUND, *OF_WALL.values(), *OF_ROUND.values())
KNOWN_SURFACES = (BREP_OF_FACE, *OF_BREP_FACE.values())


NUMBERS = variable("i8 realization(realization) [1]", "number of the realization", {"standard_name": "realization"})
COORDINATES = (
    NUMBERS,
    label(STATE, "state: raw as located, corrected after contact"),
    label(PART, "part"),
    label(PAIR, "contact pair"),
    label(MEASURE, "measure (key characteristic)"),
    label(AXIS, "axis of the nominal assembly frame"),
    label(BODY_AXIS, "axis of the part's nominal orientation"),
)

MEASURED = variable(
    "f8 measured(realization, state, measure)",
    "value of a measure: displacement of a point, distance of two points, or the user's expression",
)
TRANSLATION = variable(
    "f8 translation(realization, state, part, axis) [mm]", "t of the pose x = R x0 + t, x0 in the nominal assembly frame"
)
ROTATION = variable(
    "f8 rotation(realization, state, part, axis, body_axis) [1]", "R of the pose x = R x0 + t; rows are assembly axes"
)
GAP_MIN = variable(
    "f8 gap_min(realization, state, pair) [mm]",
    "smallest gap of all contact points of a pair, larger by coordinate_error if there is one; negative: penetration; "
    "infinite: the faces are opposite each other nowhere",
)
ACTIVE = variable("i4 active(realization, pair) [1]", "number of active contact points in the raw state")
CARRYING = variable("i4 carrying(realization, pair) [1]", "number of contact points under load in the corrected state")
REACTION = variable("f8 reaction(realization, pair)", "sum of the reactions of the contact points of a pair")
KKT_RESIDUAL = variable(
    "f8 kkt_residual(realization) [mm]",
    "largest residual of the optimality conditions of the contact problem; in an exact resolution also its last step",
)
ITERATIONS = variable("i4 iterations(realization) [1]", "number of linear steps that the contact problem took")
STARTS = variable("i1 starts(realization) [1]", "number of places that the steps were started from")
SECOND_ANSWERS = variable("i4 second_answers(realization) [1]", "number of QPs that another solver had to answer")
SEARCHED = variable(
    "i1 searched(realization) [1]",
    "1: contact points were projected again, or found, at the poses themselves, and gap_min refers to those; "
    "0: it refers to the archived ones",
)
STATUS = variable(
    "i1 status(realization)",
    "outcome of the realization",
    {"flag_values": [*range(len(STATUS_MEANINGS))], "flag_meanings": " ".join(STATUS_MEANINGS)},
)
LOCATOR_OFFSET = variable(
    "f8 locator_offset(realization, part) [mm]",
    "largest distance by which contact moved a part off a rigid two-sided locator, along the locator; 0: it has none",
)
ROWS = (
    MEASURED, TRANSLATION, ROTATION, GAP_MIN, ACTIVE, CARRYING, REACTION, KKT_RESIDUAL, ITERATIONS, STARTS, SECOND_ANSWERS,
    SEARCHED, CLASHES, CLASH_DEPTH, CLASH_PART, CLASH_OTHER, LOCATOR_OFFSET, STATUS,
)  # fmt: skip
POSES = (TRANSLATION, ROTATION)

BY_REALIZATION = (*ROWS, DEVIATION)

LOCATOR_VARIATION = variable(
    "f8 locator_variation(part) [mm]",
    "largest deviation of a rigid two-sided locator of a part: half its range, with those of its features; NaN: it has none",
)
MEASURE_NOMINAL = variable("f8 measure_nominal(measure)", "value of the measure in the nominal assembly")
MEASURE_TOLERANCE = variable("f8 measure_tolerance(measure)", "full width of the allowed zone; NaN if it is open")
LOWER_LIMIT = variable("f8 measure_lower_limit(measure)", "least allowed value of the measure; NaN if that side is open")
UPPER_LIMIT = variable("f8 measure_upper_limit(measure)", "largest allowed value of the measure; NaN if that side is open")
MEASURE_ACCURACY = variable(
    "f8 measure_accuracy(measure)", "by how much a value may be beyond a limit and still count as at the limit"
)
QUANTITY = variable(
    "str measure_quantity(measure)",
    "what a measure is the value of: displacement, coordinate, distance, deviation of distance, a kind of measurement such as "
    "gap, clearance or angle, or expression of the poses",
)
MEASURE_UNITS = variable("str measure_units(measure)", "units of the measure")
IN_MEASURE_UNITS = MEASURED, MEASURE_NOMINAL, MEASURE_TOLERANCE, LOWER_LIMIT, UPPER_LIMIT, MEASURE_ACCURACY

LINE_END = "line_end"
MEASURE_OF_LINE = variable("i4 measure_of_line(measure_line)", "number of the measure that a line shows, counted from 0")
LINE_ENDS = variable(
    "f8 measure_line_ends(measure_line, line_end, axis) [mm]",
    "ends of the lines that show what is measured, nominal; gaps, axes and directions",
)

DECLARATION = variable("str declaration()", "the declared model as JSON, enough to rebuild it")
MESH_VERTICES = variable("f8 vertices(vertex, axis) [mm]", "vertices of a mesh in its part's own frame")
MESH_FACES = variable("i4 faces(face, corner)", "vertex numbers of each triangle, counted from 0")

PAIR_OF_POINT = variable("i4 pair_of_point(point)", "number of the pair of each contact point, counted from 0")
MOVING_PART = variable("i4 moving_part(pair)", "number of the moving part of each pair, counted from 0")
REFERENCE_PART = variable("i4 reference_part(pair)", "number of the reference part of each pair, -1: the ground")
MOVING_POINT = variable("f8 moving_point(point, axis) [mm]", "P^m: contact point of the moving part, nominal")
REFERENCE_POINT = variable("f8 reference_point(point, axis) [mm]", "P^r: its projection on the reference part, nominal")
REFERENCE_NORMAL = variable(
    "f8 reference_normal(point, axis) [1]", "n^r: outward unit normal of the reference part there, nominal"
)

POINT_STIFFNESS = variable("f8 point_stiffness(point) [N mm-1]", "stiffness of a contact point; infinite: it is rigid")
LOCATOR_OF_POINT = variable(
    "i4 locator_of_point(point)",
    "number of the one-sided locator that a contact point represents, whose deviation is subtracted from its gap; -1: none",
)

BOUNDED = variable(
    "i1 bounded(pair) [1]", "1: faces end, and places of contact are found at every pose; 0: contact points are fixed"
)
PLANE_ERROR = variable(
    "f8 plane_error(pair) [mm]",
    "largest error of fixed contact points in the depth of contact, at 1024 raw poses; NaN: not compared",
)

SIDE = "side"
SIDE_LABEL = label(SIDE, "side of a pair")
SIDES = ("moving", "reference")
OBJECTIVE_AREA = variable(
    "f8 objective_area(pair, side) [mm2]", "area of the part of a face that the objective counts; 0: its part is fixed"
)
OBJECTIVE_CENTRE = variable("f8 objective_centre(pair, side, axis) [mm]", "centre of this part of the face, nominal")
OBJECTIVE_MOMENT = variable(
    "f8 objective_moment(pair, side, axis, body_axis) [mm2]", "mean product of coordinates over this part, about its centre"
)
OBJECTIVE = (SIDE_LABEL, OBJECTIVE_AREA, OBJECTIVE_CENTRE, OBJECTIVE_MOMENT)

COMPONENT_LABEL = label(COMPONENT, "component of the displacement")
FIELD_VERTICES = variable("f8 vertices(vertex, axis) [mm]", "surface points of the part, nominal")
FIELD_FACES = MESH_FACES
FIELD_MEAN = variable("f8 mean(state, vertex, component) [mm]", "mean displacement of a surface point")
FIELD_SIX_SIGMA = variable(
    "f8 six_sigma(state, vertex, component) [mm]", "six standard deviations of the displacement of a surface point"
)
BOUND_LABEL = label(BOUND, "bound of a 95 % confidence interval")
FIELD_INTERVAL = variable(
    "f8 magnitude_six_sigma_interval(state, vertex, bound) [mm]",
    "95 % confidence interval of six standard deviations of the displacement magnitude",
)
FIELD_REALIZATIONS = variable("i8 realizations() [1]", "number of realizations that the displacement field covers")
MAGNITUDE_REALIZATIONS = variable(
    "i8 magnitude_realizations() [1]",
    "number of realizations, the first ones, that the magnitude of the displacement field covers",
)
FIELDS = (FIELD_MEAN, FIELD_SIX_SIGMA, FIELD_INTERVAL, FIELD_REALIZATIONS, MAGNITUDE_REALIZATIONS)
TOUCHING_SHARE = variable(
    "f8 touching(point) [1]",
    f"share of realizations with a touching contact point, corrected: gap below {TOUCHING_GAP} mm; NaN: not known",
)
TOUCHING_INTERVAL = variable("f8 touching_interval(point, bound) [1]", "its 95 % confidence interval")
TOUCHING_REALIZATIONS = variable(
    "i8 touching_realizations() [1]", "number of realizations, of the first ones, that this share is of"
)
TOUCHING = (TOUCHING_SHARE, TOUCHING_INTERVAL, TOUCHING_REALIZATIONS)
SUMMED_ROWS = variable("i8 summed_rows() [1]", "number of realizations in `sums`; a resumed run continues after them")
FIELD_SUMS = variable("f8 sums(state, number) [1]", "running sums of the displacement field; a resumed run continues from them")


def group_of(part: str) -> str:
    """Return the name of a part's groups: its own, followed by an underscore if the archive uses that name.

    In xarray all groups inherit the coordinates of the root, and a group cannot have the name of one of them.
    """
    name = unicodedata.normalize("NFC", part)  # as the netCDF library stores it
    return f"{name}_" if name.rstrip("_") in {coordinate.name for coordinate in COORDINATES} else name


def field_of(part: str) -> str:
    """Return the path of a part's displacement field."""
    return f"field/{group_of(part)}"


OBJECTIVES_GROUP, ROW_OF_OBJECTIVES = "objectives", "row"
BY_OBJECTIVE_LABEL = label(BY_OBJECTIVE, "objective of the corrected pose; the first one is the objective of the run")
MEASURED_BY_OBJECTIVE = variable(
    f"f8 measured_by_objective({BY_OBJECTIVE}, {ROW_OF_OBJECTIVES}, {MEASURE})",
    "corrected measures of the first realizations under each objective; NaN: none",
)
STATUS_BY_OBJECTIVE = variable(f"i1 status_by_objective({BY_OBJECTIVE}, {ROW_OF_OBJECTIVES})", "their outcomes; -1: none")

STATIONS_GROUP, STATION_PART = "station", "station_part"

MEASURE_STATION = variable("str measure_station(measure)", "station of a measure")
PAIR_STATION = variable("str pair_station(pair)", "station of a contact pair")
PART_STATION = variable("str part_station(part)", "last station with a part, and of its pose")
OF_STATIONS = (MEASURE_STATION, PAIR_STATION, PART_STATION)

STATION_PART_LABEL = label(STATION_PART, "part in the station")
STATION_TRANSLATION = variable(
    "f8 station_translation(realization, state, station_part, axis) [mm]", f"{TRANSLATION.long_name}; in the station"
)
STATION_ROTATION = variable(
    "f8 station_rotation(realization, state, station_part, axis, body_axis) [1]", f"{ROTATION.long_name}; in the station"
)
STATION_STATUS = variable("i1 station_status(realization)", "outcome of the realization in the station", STATUS.attributes)
STATION_POSES = (STATION_TRANSLATION, STATION_ROTATION)
STATION_ROWS = (*STATION_POSES, STATION_STATUS)


def station_group(station: str) -> str:
    """Return the path of a station's group."""
    return f"{STATIONS_GROUP}/{group_of(station)}"
