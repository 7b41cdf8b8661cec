"""Every variable of rare events."""

from tolcontact.vocabulary.labels import STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import ArchiveVariable

EVENT = "event"
TAILS = (
    ArchiveVariable("probability", (EVENT, INTERVAL), "f8", "probability of a rare event", "1"),
    ArchiveVariable("simulated", (EVENT,), "i8", "number of realizations simulated", "1"),
    ArchiveVariable("by_status", (EVENT, STATUS_MEANING), "i8", "number of realizations simulated", "1"),
)
