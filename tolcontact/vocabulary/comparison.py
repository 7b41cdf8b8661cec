"""Every variable of a comparison: of solvers, or of runs."""

from tolcontact.vocabulary.labels import EXTENT, MEASURE, RUN, SOLVER, STATE, STATUS_MEANING
from tolcontact.vocabulary.summary import CHANGE_OF, INTERVAL, OUTSIDE, PPK, SHIFT, SPREAD_RATIO, STATISTIC
from tolcontact.vocabulary.variable import ArchiveVariable, label

COMPARED_LABELS = (
    label(SOLVER, "solver, and what the methods differ in"),
    label(STATUS_MEANING, "meaning of a status"),
    label(EXTENT, "median, or largest, of all realizations"),
)
COMPARED = (
    ArchiveVariable("seconds", (SOLVER,), "f8", "wall time of all realizations, from draws to measures", "s"),
    ArchiveVariable("by_status", (SOLVER, STATUS_MEANING), "i8", "number of realizations", "1"),
    ArchiveVariable("kkt_residual", (SOLVER,), "f8", "largest KKT residual of the certified realizations", "mm"),
    ArchiveVariable("penetration", (SOLVER,), "f8", "largest true penetration left", "mm"),
    ArchiveVariable(
        "pose_difference", (SOLVER, EXTENT), "f8", "largest distance between both answers, corners of bounding boxes", "mm"
    ),
    ArchiveVariable("measure_difference", (SOLVER, EXTENT, MEASURE), "f8", "difference of a measure, in its own units"),
    ArchiveVariable("both_resolved", (SOLVER,), "i8", "number of realizations that the differences cover", "1"),
)

SAME_DRAWS, SAME_SEED, OTHER_DRAWS = "same", "same seed", "other"
COMPARED_STATISTICS = ("mean", "6 sigma", PPK, OUTSIDE)
CHANGES_OF_RUNS = (SHIFT, SPREAD_RATIO, "shift of the share outside")
COMPARED_RUNS = (
    ArchiveVariable(
        "value", (RUN, STATE, MEASURE, STATISTIC, INTERVAL), "f8", "estimate, in the measure's units; shares are of 1"
    ),
    ArchiveVariable(
        "change", (RUN, STATE, MEASURE, CHANGE_OF, INTERVAL), "f8", "difference from the first run, or ratio to it"
    ),
    ArchiveVariable("furthest", (RUN, STATE, MEASURE), "f8", "largest difference of a realization from the first run's"),
    ArchiveVariable("by_status", (RUN, STATUS_MEANING), "i8", "number of realizations", "1"),
    ArchiveVariable("penetration", (RUN, STATE), "f8", "largest true penetration of any contact point", "mm"),
    ArchiveVariable("draws", (RUN,), str, "draws: same as the first run's, of the same seed, or other ones"),
)
