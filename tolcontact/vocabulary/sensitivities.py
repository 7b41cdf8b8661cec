"""Every variable of sensitivities."""

from tolcontact.vocabulary.labels import CONTRIBUTOR, MEASURE, STATE, STATUS_MEANING
from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import ArchiveVariable

CONTACT = "contact"
CONTACT_STATES = ("untouched", "touched")
SENSITIVITIES = (
    ArchiveVariable("nominal", (MEASURE, CONTRIBUTOR), "f8", "derivative of the raw measure at the nominal assembly"),
    ArchiveVariable(
        "leverage", (CONTRIBUTOR,), "f8", "largest displacement of the located part for a unit of its locator", "1"
    ),
    ArchiveVariable("sensitivity", (MEASURE, STATE, CONTRIBUTOR, INTERVAL), "f8", "mean derivative over all realizations"),
    ArchiveVariable("spread", (MEASURE, STATE, CONTRIBUTOR), "f8", "standard deviation of the derivative over realizations"),
    ArchiveVariable(
        "by_contact",
        (MEASURE, CONTACT, CONTRIBUTOR, INTERVAL),
        "f8",
        "mean derivative, corrected, where contact is or is not",
    ),
    ArchiveVariable(
        "changing", (CONTRIBUTOR, INTERVAL), "f8", "share of realizations with a kink or a jump within the step", "1"
    ),
    ArchiveVariable("step", (CONTRIBUTOR,), "f8", "step of the differences, up and down"),
    ArchiveVariable("by_status", (STATUS_MEANING,), "i8", "number of realizations", "1"),
)
