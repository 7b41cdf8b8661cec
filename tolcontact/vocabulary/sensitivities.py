"""Every variable of sensitivities."""

from tolcontact.vocabulary.labels import CONTRIBUTOR, MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import Variable

CONTACT = "contact"
CONTACT_STATES = ("untouched", "touched")
SENSITIVITIES = (
    Variable("nominal", (MEASURE, CONTRIBUTOR), "f8", "derivative of the raw measure at the nominal assembly"),
    Variable("leverage", (CONTRIBUTOR,), "f8", "largest displacement of the located part for a unit of its locator", "1"),
    Variable("sensitivity", (MEASURE, STATE, CONTRIBUTOR, INTERVAL), "f8", "mean derivative over all realizations"),
    Variable("spread", (MEASURE, STATE, CONTRIBUTOR), "f8", "standard deviation of the derivative over realizations"),
    Variable(
        "by_contact",
        (MEASURE, CONTACT, CONTRIBUTOR, INTERVAL),
        "f8",
        "mean derivative, corrected, where contact is or is not",
    ),
    Variable("changing", (CONTRIBUTOR, INTERVAL), "f8", "share of realizations with a kink or a jump within the step", "1"),
    Variable("step", (CONTRIBUTOR,), "f8", "step of the differences, up and down"),
    Variable("by_status", (STATUS_MEANING,), "i8", "number of realizations", "1"),
)
