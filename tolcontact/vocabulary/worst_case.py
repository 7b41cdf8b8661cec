"""Every variable of worst cases."""

from dataclasses import replace

from tolcontact.vocabulary.archive import GAP_MIN, KKT_RESIDUAL, MEASURED, ROTATION, STATUS, TRANSLATION
from tolcontact.vocabulary.labels import CONTRIBUTOR, MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.variable import Variable

END = "end"
ENDS, SENSES = ("least", "largest"), (-1, 1)
CASE = "case"  # a corrected worst case as a realization, with what archives keep of these
OF_CASES = tuple(
    replace(each, dims=(CASE, *each.dims[1:])) for each in (MEASURED, TRANSLATION, ROTATION, GAP_MIN, KKT_RESIDUAL, STATUS)
)
WORST_CASE = (
    Variable("worst", (MEASURE, STATE, END), "f8", "worst case found: the least and the largest value"),
    Variable("deviations", (MEASURE, STATE, END, CONTRIBUTOR), "f8", "combination of deviations that gives it"),
    Variable("bound", (MEASURE, STATE, END), "f8", "no pose free of penetration lies beyond, to first order"),
    Variable("random", (MEASURE, STATE, END), "f8", "worst of the random combinations"),
    Variable("ends", (MEASURE, STATE, END), "i8", "number of different values that searches ended at", "1"),
    Variable("unseen", (MEASURE, STATE, END), "f8", "expected share of starts that lead to ends not seen", "1"),
    Variable("by_status", (STATUS_MEANING,), "i8", "number of realizations simulated", "1"),
    *OF_CASES,
)
