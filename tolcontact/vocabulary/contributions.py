"""Every variable of contributions."""

from tolcontact.vocabulary.labels import MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import ArchiveVariable

GROUP = "group"
GROUPED_BY = ("contributor", "feature", "part")
UNIT = "unit"
FIRST, TOTAL, SHAPLEY, MISSED, LINEAR = "first", "total", "shapley", "missed", "linear"
CONTRIBUTIONS = (
    ArchiveVariable(
        FIRST, (MEASURE, STATE, GROUP, INTERVAL), "f8", "first-order Sobol' index: share of variance by a group alone", "1"
    ),
    ArchiveVariable(
        TOTAL, (MEASURE, STATE, GROUP, INTERVAL), "f8", "total Sobol' index: with all that it does with others", "1"
    ),
    ArchiveVariable(
        SHAPLEY, (MEASURE, STATE, UNIT, INTERVAL), "f8", "Shapley effect: share of variance, also of what is correlated", "1"
    ),
    ArchiveVariable(
        LINEAR, (MEASURE, GROUP), "f8", "share of variance that linear sensitivities at the nominal assembly say", "1"
    ),
    ArchiveVariable(MISSED, (MEASURE, STATE, INTERVAL), "f8", "share of variance that the linear prediction misses", "1"),
    ArchiveVariable("by_status", (STATUS_MEANING,), "i8", "number of realizations", "1"),
)
