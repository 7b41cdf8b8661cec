"""Every variable of worst cases."""

from dataclasses import replace

from tolcontact.vocabulary.archive import GAP_MIN, KKT_RESIDUAL, MEASURED, ROTATION, STATUS, TRANSLATION
from tolcontact.vocabulary.labels import CONTRIBUTOR, MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.variable import ArchiveVariable

END = "end"
ENDS, SENSES = ("least", "largest"), (-1, 1)
CASE = "case"  # a corrected worst case as a realization, with what archives keep of these
OF_CASES = tuple(
    replace(each, dims=(CASE, *each.dims[1:])) for each in (MEASURED, TRANSLATION, ROTATION, GAP_MIN, KKT_RESIDUAL, STATUS)
)
WORST_CASE = (
    ArchiveVariable("worst", (MEASURE, STATE, END), "f8", "worst case found: the least and the largest value"),
    ArchiveVariable("deviations", (MEASURE, STATE, END, CONTRIBUTOR), "f8", "combination of deviations that gives it"),
    ArchiveVariable("bound", (MEASURE, STATE, END), "f8", "no pose free of penetration lies beyond, to first order"),
    ArchiveVariable("random", (MEASURE, STATE, END), "f8", "worst of the random combinations"),
    ArchiveVariable("ends", (MEASURE, STATE, END), "i8", "number of different values that searches ended at", "1"),
    ArchiveVariable("unseen", (MEASURE, STATE, END), "f8", "expected share of starts that lead to ends not seen", "1"),
    ArchiveVariable("by_status", (STATUS_MEANING,), "i8", "number of realizations simulated", "1"),
    *OF_CASES,
)
