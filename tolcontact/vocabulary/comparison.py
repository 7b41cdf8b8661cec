"""Every variable of a comparison of solvers."""

from tolcontact.vocabulary.labels import EXTENT, MEASURE, SOLVER, STATUS_MEANING
from tolcontact.vocabulary.variable import Variable, label

COMPARED_LABELS = (
    label(SOLVER, "solver, and what the methods differ in"),
    label(STATUS_MEANING, "meaning of a status"),
    label(EXTENT, "median, or largest, of all realizations"),
)
COMPARED = (
    Variable("seconds", (SOLVER,), "f8", "wall time of all realizations, from draws to measures", "s"),
    Variable("by_status", (SOLVER, STATUS_MEANING), "i8", "number of realizations", "1"),
    Variable("kkt_residual", (SOLVER,), "f8", "largest KKT residual of the certified realizations", "mm"),
    Variable("penetration", (SOLVER,), "f8", "largest true penetration left", "mm"),
    Variable(
        "pose_difference", (SOLVER, EXTENT), "f8", "largest distance between both answers, corners of bounding boxes", "mm"
    ),
    Variable("measure_difference", (SOLVER, EXTENT, MEASURE), "f8", "difference of a measure, in its own units"),
    Variable("both_resolved", (SOLVER,), "i8", "number of realizations that the differences cover", "1"),
)
