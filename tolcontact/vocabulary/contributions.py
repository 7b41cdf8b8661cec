"""Every variable of contributions."""

from tolcontact.vocabulary.labels import MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import Variable

GROUP = "group"
GROUPED_BY = ("contributor", "feature", "part")
UNIT = "unit"
FIRST, TOTAL, SHAPLEY, MISSED, LINEAR = "first", "total", "shapley", "missed", "linear"
CONTRIBUTIONS = (
    Variable(
        FIRST, (MEASURE, STATE, GROUP, INTERVAL), "f8", "first-order Sobol' index: share of variance by a group alone", "1"
    ),
    Variable(TOTAL, (MEASURE, STATE, GROUP, INTERVAL), "f8", "total Sobol' index: with all that it does with others", "1"),
    Variable(
        SHAPLEY, (MEASURE, STATE, UNIT, INTERVAL), "f8", "Shapley effect: share of variance, also of what is correlated", "1"
    ),
    Variable(LINEAR, (MEASURE, GROUP), "f8", "share of variance that linear sensitivities at the nominal assembly say", "1"),
    Variable(MISSED, (MEASURE, STATE, INTERVAL), "f8", "share of variance that the linear prediction misses", "1"),
    Variable("by_status", (STATUS_MEANING,), "i8", "number of realizations", "1"),
)
