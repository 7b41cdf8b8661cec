"""Records of analyses: the variables of their datasets; and the words of terminal, page, pictures and spreadsheet."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

from tolcontact.vocabulary.archive import GAP_MIN, KKT_RESIDUAL, MEASURED, ROTATION, STATION_POSES, STATUS, TRANSLATION
from tolcontact.vocabulary.labels import (
    AXES,
    AXIS,
    BODY_AXIS,
    STATE,
    STATES,
    STATUS_MEANING,
    STATUS_MEANINGS,
    ArchiveVariable,
    variable,
)
from tolcontact.vocabulary.summary import ESTIMATE, INTERVAL, OUTSIDE

ANALYSES_GROUP = "statistics"  # the group of an archive that holds a group for each analysis
GroupedBy = Literal["contributor", "feature", "part"]
GROUP, GROUPED_BY, UNIT = "group", get_args(GroupedBy), "unit"
CONTACT, CONTACT_STATES = "contact", ("untouched", "touched")
END, ENDS, SENSES = "end", ("least", "largest"), (-1, 1)
CASE = "case"  # a corrected worst case as a realization, with the variables that archives have of realizations
EVENT, REQUIREMENT, TRIAL = "event", "requirement", "trial"
SEAT, HOLDER = "seat", "holder"  # contacts: one that a part may not reach, and those that may hold it short of that
STAGE, STAGES = "stage", ("before", "after")
APPROACH, APPROACHES = "approach", ("worst case", "RSS", "MRSS", "1.5 RSS")  # to a stack, by linear sensitivities
OF_EFFECT, EFFECTS = "of_effect", ("6 sigma", OUTSIDE)
OF_ENVELOPE, ENVELOPE = "of_envelope", ("mean", "6 sigma", "outer percentile")  # of extremes over the positions of a mechanism
PARAMETER_NAME = "parameter_name"
MAX_POSITIONS = 1000  # of a mechanism: each is a model of its own, which is kept
FIXED_LABELS = {
    STATE: STATES, INTERVAL: ESTIMATE, STATUS_MEANING: STATUS_MEANINGS, AXIS: AXES, BODY_AXIS: AXES,
    CONTACT: CONTACT_STATES, END: ENDS, STAGE: STAGES, OF_EFFECT: EFFECTS,
    APPROACH: APPROACHES, OF_ENVELOPE: ENVELOPE,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class AnalysisRecord:
    """The form of an analysis, as it is returned and archived; `title` is a format of the assembly's name and of attributes.

    Only assemblies that are built in stations have variables `of_stations`. In an archive an answer that `grows` is replaced by
    one of more realizations; other complete answers stay.
    """

    name: str
    title: str
    variables: tuple[ArchiveVariable, ...]
    of_stations: tuple[ArchiveVariable, ...] = ()
    grows: bool = False

    @property
    def known(self) -> dict[str, ArchiveVariable]:
        """All variables by name."""
        return {variable.name: variable for variable in (*self.variables, *self.of_stations)}

    @property
    def dims(self) -> tuple[str, ...]:
        """The dimensions of all variables, each once."""
        return tuple(dict.fromkeys(dim for variable in self.variables for dim in variable.dims))

    def has_units_of(self, dim: str) -> bool:
        """Return whether a number is in the units of a label of this dimension, which then need a coordinate."""
        return any(dim in v.dims and v.units is None and v.kind == "f8" for v in self.variables)


def _by_status(*dims: str) -> ArchiveVariable:
    return variable(f"i8 by_status({', '.join((*dims, STATUS_MEANING))}) [1]", "number of realizations")


CONTRIBUTIONS = AnalysisRecord("contributions", "contributions to the measurements of {assembly}", (
    variable("f8 first(measure, state, group, interval) [1]", "first-order Sobol' index: share of variance by a group alone"),
    variable(
        "f8 total(measure, state, group, interval) [1]", "total Sobol' index: share of variance by a group and its interactions"
    ),
    variable("i1 minor(group) [1]", "1: estimated together with all other minor groups; 0: alone"),
    variable("f8 minor_total(measure, state, interval) [1]", "total Sobol' index of all minor groups together"),
    variable("f8 shapley(measure, state, unit, interval) [1]", "Shapley effect: share of variance, also of what is correlated"),
    variable("f8 linear(measure, group) [1]", "share of variance by the linear sensitivities at the nominal assembly"),
    variable("f8 missed(measure, state, interval) [1]", "share of variance that the linear prediction misses"),
    _by_status(),
))  # fmt: skip
SENSITIVITIES = AnalysisRecord("sensitivities", "sensitivities of the measurements of {assembly}", (
    variable("f8 nominal(measure, contributor)", "derivative of the raw measure at the nominal assembly"),
    variable("f8 leverage(contributor) [1]", "largest displacement of the located part for a unit of its locator"),
    variable("f8 sensitivity(measure, state, contributor, interval)", "mean derivative over all realizations"),
    variable("f8 spread(measure, state, contributor)", "standard deviation of the derivative over realizations"),
    variable(
        "f8 by_contact(measure, contact, contributor, interval)",
        "mean derivative with contact: where parts stay apart, and where they touch",
    ),
    variable("f8 changing(contributor, interval) [1]", "share of realizations with a kink or a jump within the step"),
    variable("f8 step(contributor)", "step of the differences, up and down"),
    variable("i8 not_a_number(measure) [1]", "number of realizations left out: the measure, or a step of it, is not a number"),
    _by_status(),
))  # fmt: skip
WORST_CASE = AnalysisRecord("worst_case", "worst cases of the measurements of {assembly}", (
    variable("f8 worst(measure, state, end)", "worst-case minimum and maximum, found by searches"),
    variable("f8 deviations(measure, state, end, contributor)", "combination of deviations that gives it"),
    variable("f8 bound(measure, state, end)", "linear estimate of the worst case, which large tilts may exceed"),
    variable("f8 random(measure, state, end)", "worst of the random combinations"),
    variable("i8 agreeing(measure, state, end) [1]", "number of searches that ended at the worst case"),
    variable("i8 ends(measure, state, end) [1]", "number of different values that searches ended at"),
    variable("f8 unseen(measure, state, end) [1]", "expected share of starts that lead to ends not seen"),
    replace(_by_status(), long_name="number of realizations simulated"),
    *(
        replace(variable, dims=(CASE, *variable.dims[1:]))
        for variable in (MEASURED, TRANSLATION, ROTATION, GAP_MIN, KKT_RESIDUAL, STATUS)
    ),
), of_stations=tuple(replace(variable, dims=(CASE, *variable.dims[1:])) for variable in STATION_POSES))  # fmt: skip
COARSE = "coarse"  # attribute of an analysis that was stopped, or whose time ended: what its answer rests on
WITHOUT_FORM = "without_form"  # attribute of worst cases: features with form, which is left out
TAILS = AnalysisRecord("tails", "rare events of {assembly}", (
    variable("f8 probability(event, interval) [1]", "probability of a rare event"),
    variable("f8 disagreement(event) [1]", "factor between two searches for the event; 1: they agree"),
    variable("i1 stop(event) [1]", "1: many values were at a limit, and none beyond; 0: not so"),
    variable("i8 simulated(event) [1]", "number of realizations simulated"),
    replace(_by_status(EVENT), long_name="number of realizations simulated"),
))  # fmt: skip
ALLOCATION = AnalysisRecord("allocation", "allocation of tolerances of {assembly}", (
    variable("f8 range(group, stage)", "full width of the zones of a group; not a number if they differ"),
    variable("f8 factor(group) [1]", "full width after / before"),
    variable("f8 cost(group, stage) [1]", "cost of the ranges"),
    variable("f8 kept(requirement, stage, interval) [1]", "share outside of the limits, or Ppk, in a fresh run"),
    variable("i1 met(requirement) [1]", "1: kept in the fresh run after; 0: not, by any ranges found"),
    variable("f8 required(requirement) [1]", "share outside of the limits at most, or Ppk at least"),
    variable("i1 idle(group) [1]", "1: no influence on any requirement, so the ranges stay; 0: not so"),
    variable("f8 effect(measure, of_effect, group, interval)", "change if zones were a tenth narrower"),
))  # fmt: skip
RELOCATION = AnalysisRecord("relocation", "place of {locator} in {assembly}", (
    variable("f8 point(stage, axis) [mm]", "place of the locator, in its part's own frame"),
    variable("f8 reached(stage, interval)", "value of the objective in a fresh run"),
    variable("f8 change(interval) [1]", "6 sigma after / before; or share outside, after minus before"),
    variable("i8 unresolved(stage) [1]", "number of realizations of the fresh run that were not resolved"),
    variable("f8 tried(trial, axis) [mm]", "trial positions, in the part's own frame"),
    variable("f8 tried_value(trial)", "value of the objective at each trial position"),
))  # fmt: skip
SEATING = AnalysisRecord("seating", "friction at the seats of {assembly}", (
    variable("f8 critical(seat) [1]", "least coefficient of friction that can hold the part short of the seat"),
    variable("f8 reserve(seat) [1]", "least factor of the stated coefficients at which the part can be held short of the seat"),
    variable("f8 share(seat, holder) [1]", "share of the normal forces that then hold the part"),
))  # fmt: skip
STACK_UP = AnalysisRecord("stack_up", "stack-up of the measurements of {assembly}", (
    variable("f8 drawn(measure)", "value without deviations"),
    variable("f8 centred(measure)", "linear value at the centres of all zones"),
    variable("f8 half_width(measure, approach)", "half of the range about the centred value, by linear sensitivities"),
    variable("f8 lots(measure)", "largest shift of the mean by lots with means on either side, by linear sensitivities"),
    variable("f8 simulated(measure, state, end, interval)", "0.135 % and 99.865 % percentiles of the realizations"),
    variable("i8 links(measure) [1]", "number of contributors that have an effect"),
    variable("i8 forms(measure) [1]", "number of forms of faces among them"),
    _by_status(),
), grows=True)  # fmt: skip
SWEEP = AnalysisRecord("sweep", "envelope of the measurements of {assembly}", (
    variable(
        "f8 envelope(measure, state, end, of_envelope, interval)",
        "mean, 6 sigma and outer percentile of the least and of the largest value over all positions",
    ),
    variable("f8 outside(measure, state, interval) [1]", "share of realizations out of specification at any position"),
    variable("f8 extreme_share(measure, state, end, position) [1]", "share of realizations with this extreme there"),
    variable("f8 mean(measure, state, position, interval)", "mean at each position"),
    variable("f8 swept(position, realization, state, measure)", "values at each position"),
    variable("f8 parameter(parameter_name, position) [1]", "parameters of the mechanism"),
    _by_status("position"),
))  # fmt: skip
_RECORDS = STACK_UP, CONTRIBUTIONS, SENSITIVITIES, WORST_CASE, TAILS, ALLOCATION, RELOCATION, SEATING, SWEEP
ANALYSES = {record.name: record for record in _RECORDS}


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
    OUT_OF_SPECIFICATION: "The share of realizations beyond a limit of the measurement or, with contact, not assemblable.",
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
