"""Every variable of rare events."""

from tolcontact.vocabulary.labels import STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import Variable

EVENT = "event"
TAILS = (
    Variable("probability", (EVENT, INTERVAL), "f8", "probability of a rare event", "1"),
    Variable("simulated", (EVENT,), "i8", "number of realizations simulated", "1"),
    Variable("by_status", (EVENT, STATUS_MEANING), "i8", "number of realizations simulated", "1"),
)
