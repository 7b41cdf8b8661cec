"""Every analysis of a model beside its run: its group in an archive, its title, its variables and their labels."""

from dataclasses import dataclass, replace

from tolcontact.vocabulary.archive import GAP_MIN, KKT_RESIDUAL, MEASURED, ROTATION, STATUS, TRANSLATION
from tolcontact.vocabulary.labels import (
    AXES,
    AXIS,
    BODY_AXIS,
    CONTRIBUTOR,
    MEASURE,
    STATE,
    STATES,
    STATUS_MEANING,
    STATUS_MEANINGS,
    ArchiveVariable,
)
from tolcontact.vocabulary.stations import STATION_POSES
from tolcontact.vocabulary.summary import ESTIMATE, INTERVAL, OUTSIDE

ANALYSES_GROUP = "statistics"  # the group of an archive that holds a group for each analysis
GROUP, GROUPED_BY, UNIT = "group", ("contributor", "feature", "part"), "unit"
CONTACT, CONTACT_STATES = "contact", ("untouched", "touched")
END, ENDS, SENSES = "end", ("least", "largest"), (-1, 1)
CASE = "case"  # a corrected worst case as a realization, with the variables that archives have of realizations
EVENT, REQUIREMENT, TRIAL = "event", "requirement", "trial"
SEAT, HOLDER = "seat", "holder"  # contacts: one that a part may not reach, and those that may hold it short of that
STAGE, STAGES = "stage", ("before", "after")
OF_EFFECT, EFFECTS = "of_effect", ("6 sigma", OUTSIDE)
FIXED_LABELS = {
    STATE: STATES, INTERVAL: ESTIMATE, STATUS_MEANING: STATUS_MEANINGS, AXIS: AXES, BODY_AXIS: AXES,
    CONTACT: CONTACT_STATES, END: ENDS, STAGE: STAGES, OF_EFFECT: EFFECTS,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class AnalysisRecord:
    """The form in which an analysis is returned and archived; `title` is a format of the assembly's name and of attributes.

    Variables `of_stations` are only those of an assembly that is built in stations.
    """

    name: str
    title: str
    variables: tuple[ArchiveVariable, ...]
    of_stations: tuple[ArchiveVariable, ...] = ()

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
    return ArchiveVariable("by_status", (*dims, STATUS_MEANING), "i8", "number of realizations", "1")


_INDEX = (MEASURE, STATE, GROUP, INTERVAL)
CONTRIBUTIONS = AnalysisRecord(
    "contributions",
    "contributions to the measurements of {assembly}",
    (
        ArchiveVariable("first", _INDEX, "f8", "first-order Sobol' index: share of variance by a group alone", "1"),
        ArchiveVariable("total", _INDEX, "f8", "total Sobol' index: share of variance by a group and its interactions", "1"),
        ArchiveVariable("minor", (GROUP,), "i1", "1: estimated together with all other minor groups; 0: by itself", "1"),
        ArchiveVariable(
            "minor_total", (MEASURE, STATE, INTERVAL), "f8", "total Sobol' index of all minor groups together", "1"
        ),
        ArchiveVariable(
            "shapley",
            (MEASURE, STATE, UNIT, INTERVAL),
            "f8",
            "Shapley effect: share of variance, also of what is correlated",
            "1",
        ),
        ArchiveVariable(
            "linear", (MEASURE, GROUP), "f8", "share of variance by the linear sensitivities at the nominal assembly", "1"
        ),
        ArchiveVariable("missed", (MEASURE, STATE, INTERVAL), "f8", "share of variance that the linear prediction misses", "1"),
        _by_status(),
    ),
)
SENSITIVITIES = AnalysisRecord(
    "sensitivities",
    "sensitivities of the measurements of {assembly}",
    (
        ArchiveVariable("nominal", (MEASURE, CONTRIBUTOR), "f8", "derivative of the raw measure at the nominal assembly"),
        ArchiveVariable(
            "leverage", (CONTRIBUTOR,), "f8", "largest displacement of the located part for a unit of its locator", "1"
        ),
        ArchiveVariable("sensitivity", (MEASURE, STATE, CONTRIBUTOR, INTERVAL), "f8", "mean derivative over all realizations"),
        ArchiveVariable(
            "spread", (MEASURE, STATE, CONTRIBUTOR), "f8", "standard deviation of the derivative over realizations"
        ),
        ArchiveVariable(
            "by_contact",
            (MEASURE, CONTACT, CONTRIBUTOR, INTERVAL),
            "f8",
            "mean derivative with contact: where parts stay apart, and where they touch",
        ),
        ArchiveVariable(
            "changing", (CONTRIBUTOR, INTERVAL), "f8", "share of realizations with a kink or a jump within the step", "1"
        ),
        ArchiveVariable("step", (CONTRIBUTOR,), "f8", "step of the differences, up and down"),
        _by_status(),
    ),
)
_EXTREME = (MEASURE, STATE, END)
WORST_CASE = AnalysisRecord(
    "worst_case",
    "worst cases of the measurements of {assembly}",
    (
        ArchiveVariable("worst", _EXTREME, "f8", "worst-case minimum and maximum, found by searches"),
        ArchiveVariable("deviations", (*_EXTREME, CONTRIBUTOR), "f8", "combination of deviations that gives it"),
        ArchiveVariable("bound", _EXTREME, "f8", "linear estimate of the worst case, which large tilts may exceed"),
        ArchiveVariable("random", _EXTREME, "f8", "worst of the random combinations"),
        ArchiveVariable("agreeing", _EXTREME, "i8", "number of searches that ended at the worst case", "1"),
        ArchiveVariable("ends", _EXTREME, "i8", "number of different values that searches ended at", "1"),
        ArchiveVariable("unseen", _EXTREME, "f8", "expected share of starts that lead to ends not seen", "1"),
        replace(_by_status(), long_name="number of realizations simulated"),
        *(
            replace(variable, dims=(CASE, *variable.dims[1:]))
            for variable in (MEASURED, TRANSLATION, ROTATION, GAP_MIN, KKT_RESIDUAL, STATUS)
        ),
    ),
    of_stations=tuple(replace(variable, dims=(CASE, *variable.dims[1:])) for variable in STATION_POSES),
)
TAILS = AnalysisRecord(
    "tails",
    "rare events of {assembly}",
    (
        ArchiveVariable("probability", (EVENT, INTERVAL), "f8", "probability of a rare event", "1"),
        ArchiveVariable("disagreement", (EVENT,), "f8", "factor between two searches for the event; 1: they agree", "1"),
        ArchiveVariable("stop", (EVENT,), "i1", "1: many values were at a limit, and none beyond; 0: not so", "1"),
        ArchiveVariable("simulated", (EVENT,), "i8", "number of realizations simulated", "1"),
        replace(_by_status(EVENT), long_name="number of realizations simulated"),
    ),
)
ALLOCATION = AnalysisRecord(
    "allocation",
    "allocation of tolerances of {assembly}",
    (
        ArchiveVariable("range", (GROUP, STAGE), "f8", "full width of the zones of a group; not a number if they differ"),
        ArchiveVariable("factor", (GROUP,), "f8", "full width after / before", "1"),
        ArchiveVariable("cost", (GROUP, STAGE), "f8", "cost of the ranges", "1"),
        ArchiveVariable(
            "kept", (REQUIREMENT, STAGE, INTERVAL), "f8", "share outside of the limits, or Ppk, in a fresh run", "1"
        ),
        ArchiveVariable("met", (REQUIREMENT,), "i1", "1: kept in the fresh run after; 0: not, by any ranges found", "1"),
        ArchiveVariable("required", (REQUIREMENT,), "f8", "share outside of the limits at most, or Ppk at least", "1"),
        ArchiveVariable("idle", (GROUP,), "i1", "1: no influence on any requirement, so the ranges stay; 0: not so", "1"),
        ArchiveVariable("effect", (MEASURE, OF_EFFECT, GROUP, INTERVAL), "f8", "change if zones were a tenth narrower"),
    ),
)
RELOCATION = AnalysisRecord(
    "relocation",
    "place of {locator} in {assembly}",
    (
        ArchiveVariable("point", (STAGE, AXIS), "f8", "place of the locator, in its part's own frame", "mm"),
        ArchiveVariable("reached", (STAGE, INTERVAL), "f8", "what is to be least, in a fresh run"),
        ArchiveVariable("change", (INTERVAL,), "f8", "6 sigma after / before; or share outside, after minus before", "1"),
        ArchiveVariable("unresolved", (STAGE,), "i8", "number of realizations of the fresh run that were not resolved", "1"),
        ArchiveVariable("tried", (TRIAL, AXIS), "f8", "places tried, in the part's own frame", "mm"),
        ArchiveVariable("tried_value", (TRIAL,), "f8", "what is to be least, at the places tried"),
    ),
)
SEATING = AnalysisRecord(
    "seating",
    "friction at the seats of {assembly}",
    (
        ArchiveVariable(
            "critical", (SEAT,), "f8", "least coefficient of friction that can hold the part short of the seat", "1"
        ),
        ArchiveVariable(
            "reserve",
            (SEAT,),
            "f8",
            "least factor of the stated coefficients at which the part can be held short of the seat",
            "1",
        ),
        ArchiveVariable("share", (SEAT, HOLDER), "f8", "share of the normal forces that then hold the part", "1"),
    ),
)
_RECORDS = CONTRIBUTIONS, SENSITIVITIES, WORST_CASE, TAILS, ALLOCATION, RELOCATION, SEATING
ANALYSES = {record.name: record for record in _RECORDS}
