"""The words of terminal, page, pictures and spreadsheet for what archives hold under shorter names."""

from typing import NamedTuple

from tolcontact.vocabulary.analyses import ENDS
from tolcontact.vocabulary.labels import STATES

WITHOUT_CONTACT, WITH_CONTACT = STATE_WORDS = ("without contact", "with contact")  # of `STATES`
WORD_OF_STATE = dict(zip(STATES, STATE_WORDS, strict=True))
EXTREME_WORDS = ("minimum", "maximum")  # of `ENDS`
WORD_OF_END = dict(zip(ENDS, EXTREME_WORDS, strict=True))
MEASUREMENT = "measurement"
OUT_OF_SPECIFICATION = "out of specification"
OUT_OF_SPECIFICATION_COLUMN = "out of\nspecification"  # heading of a narrow column
IN_CONTACT = "in contact,\nshare of realizations"
CONTRIBUTORS, SIMULATION_SETTINGS = "Contributors", "Simulation settings"
ESTIMATES_NOTE = "Estimates are shown with their 95 % confidence intervals"
ZONE_WIDTH = "tolerance (full width of the zone)"
GLOSSARY = {
    WITHOUT_CONTACT: "Parts stand where their locators put them, even if they penetrate each other.",
    WITH_CONTACT: "Contact has moved the parts until none penetrates another.",
    OUT_OF_SPECIFICATION: "The share of realizations beyond a limit of the measurement.",
    CONTRIBUTORS.lower(): "All that varies: deviations of locators and of features, and causes that drive several of them.",
    "realization": "One simulated assembly, with its own random deviations.",
    "Ppk": "The distance from the median to a limit, divided by the distance from the median to the percentile of 0.135 % or "
    "99.865 % on that side; the smaller of both ratios. 1 means 0.135 % beyond a limit."
    " For a normal distribution it is the classical index.",
}


class ReactionWords(NamedTuple):
    """The heading of the mean reaction of a pair, with its units, and a sentence that explains it."""

    heading: str
    explanation: str


def reaction_words(units: str) -> ReactionWords:
    """Return the words for reactions: forces [N] if the objective weighs forces or springs, multipliers otherwise."""
    if units == "N":
        return ReactionWords("mean\nreaction, N", "The reaction of a pair is the sum of the contact forces at its points.")
    return ReactionWords(
        f"mean\nmultiplier, {units}",
        "The multiplier of a pair is the sum of the Lagrange multipliers of its contact points. It says how strongly the pair "
        "displaces its parts, compared with other pairs. It is no force, because the objective has no stiffness and no force.",
    )
