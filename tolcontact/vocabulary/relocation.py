"""Every variable of the best place of a locator."""

from tolcontact.vocabulary.allocation import STAGE
from tolcontact.vocabulary.labels import AXIS
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import ArchiveVariable

TRIAL = "trial"
RELOCATION = (
    ArchiveVariable("point", (STAGE, AXIS), "f8", "place of the locator, in its part's own frame", "mm"),
    ArchiveVariable("reached", (STAGE, INTERVAL), "f8", "what is to be least, in a fresh run"),
    ArchiveVariable("change", (INTERVAL,), "f8", "6 sigma after over before; or share outside, after less before", "1"),
    ArchiveVariable("unresolved", (STAGE,), "i8", "number of realizations of the fresh run that were not resolved", "1"),
    ArchiveVariable("tried", (TRIAL, AXIS), "f8", "places tried, in the part's own frame", "mm"),
    ArchiveVariable("tried_value", (TRIAL,), "f8", "what is to be least, at the places tried"),
)
