"""Every variable of an allocation."""

from tolcontact.vocabulary.contributions import GROUP
from tolcontact.vocabulary.labels import MEASURE
from tolcontact.vocabulary.summary import INTERVAL, OUTSIDE
from tolcontact.vocabulary.variable import Variable

STAGE, STAGES = "stage", ("before", "after")
REQUIREMENT = "requirement"
OF_EFFECT, EFFECTS = "of_effect", ("6 sigma", OUTSIDE)
ALLOCATION = (
    Variable("range", (GROUP, STAGE), "f8", "full width of the zones of a group; not a number if they differ"),
    Variable("factor", (GROUP,), "f8", "full width after over that before", "1"),
    Variable("cost", (GROUP, STAGE), "f8", "cost of the ranges", "1"),
    Variable("kept", (REQUIREMENT, STAGE, INTERVAL), "f8", "share outside of the limits, or Ppk, in a fresh run", "1"),
    Variable("required", (REQUIREMENT,), "f8", "share outside of the limits at most, or Ppk at least", "1"),
    Variable("effect", (MEASURE, OF_EFFECT, GROUP, INTERVAL), "f8", "change if zones were a tenth narrower"),
)
