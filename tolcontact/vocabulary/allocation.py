"""Every variable of an allocation."""

from tolcontact.vocabulary.contributions import GROUP
from tolcontact.vocabulary.labels import MEASURE
from tolcontact.vocabulary.summary import INTERVAL, OUTSIDE
from tolcontact.vocabulary.variable import ArchiveVariable

STAGE, STAGES = "stage", ("before", "after")
REQUIREMENT = "requirement"
OF_EFFECT, EFFECTS = "of_effect", ("6 sigma", OUTSIDE)
ALLOCATION = (
    ArchiveVariable("range", (GROUP, STAGE), "f8", "full width of the zones of a group; not a number if they differ"),
    ArchiveVariable("factor", (GROUP,), "f8", "full width after over that before", "1"),
    ArchiveVariable("cost", (GROUP, STAGE), "f8", "cost of the ranges", "1"),
    ArchiveVariable("kept", (REQUIREMENT, STAGE, INTERVAL), "f8", "share outside of the limits, or Ppk, in a fresh run", "1"),
    ArchiveVariable("required", (REQUIREMENT,), "f8", "share outside of the limits at most, or Ppk at least", "1"),
    ArchiveVariable("effect", (MEASURE, OF_EFFECT, GROUP, INTERVAL), "f8", "change if zones were a tenth narrower"),
)
