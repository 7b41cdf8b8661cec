"""Labels, statuses and dimensions; and the variables of surfaces and their checks, of summaries, and of comparisons."""

import enum
import re
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

CONVENTIONS = "CF-1.11"
FORMAT = 1  # of the archive
StateName = Literal["raw", "corrected"]
STATES = get_args(StateName)
RAW, CORRECTED = 0, 1  # their positions
ComponentName = Literal["x", "y", "z", "magnitude"]
COMPONENTS = get_args(ComponentName)
AXES = COMPONENTS[:3]

REALIZATION, STATE, PART, PAIR, MEASURE = "realization", "state", "part", "pair", "measure"
AXIS, BODY_AXIS, POINT, LOCATOR = "axis", "body_axis", "point", "locator"
FACE, CORNER, COMPONENT, BOUND = "face", "corner", "component", "bound"
CONTRIBUTOR, FEATURE_FACE, FREEDOM = "contributor", "feature_face", "freedom"
NUMBER, CHECKED, BY_OBJECTIVE = "number", "checked", "by_objective"
BLOCK_ROWS = 4096  # realizations of a block at most: they are simulated together
PIECE_ROWS = 24 * BLOCK_ROWS  # realizations that are read at once
SOLVER, RUN, STATUS_MEANING, EXTENT = "solver", "run", "status_meaning", "extent"
BOUNDS = ("lower", "upper")
Plan = Literal["monte-carlo", "latin hypercube", "sobol"]  # sampling plans
MONTE_CARLO, LATIN_HYPERCUBE, SOBOL = PLANS = get_args(Plan)
REPLICATE = 256  # realizations that the last two draw together, independent of all others
# Attributes of archives and summaries: the largest depth [mm] in the test for interference, and what is not tested.
INTERFERENCE_DEPTH, NOT_WATCHED = "interference_depth", "not_watched"
STANDARD = "standard"  # attribute of archives and summaries: of the drawings, if a model states it
METHOD_ATTRIBUTES = ("resolution", "objective", "active_set")  # of archives, summaries and analyses
Kept = Literal["measures", "poses", "all"]
KEPT = get_args(Kept)
TITLE_PREFIX = "document_"  # of the attributes of an archive that hold its title block
FieldChoice = Literal["some", "all", "none"]  # or a number
FIELD_CHOICES = get_args(FieldChoice)

_DECLARATION = re.compile(r"(\w+) (\w+)\(([\w, ]*)\)(?: \[(.+)\])?")

UNCHECKED = -1  # instead of the number of a realization that was checked
ROUNDED = 1e-9  # mm: less penetration than this is rounding


class Status(enum.IntEnum):
    """The outcome of a realization. Archives hold these numbers."""

    UNTOUCHED = 0  # no contact point penetrates: the corrected state is the raw state, to the last bit
    RESOLVED = 1  # contact moved parts, and the QP's optimality conditions hold
    NOT_CONVERGED = 2  # they do not hold, or one linear step cannot open all gaps: penetration remains
    NOT_ASSEMBLABLE = 3  # no pose without penetration was found near; the pose is the one of least penetration
    DOUBTFUL = 4  # the conditions hold, but only far from the raw pose: beyond the limits of the method, so not certified


STATUS_MEANINGS = tuple(status.name.lower() for status in Status)
CERTIFIED = (Status.UNTOUCHED, Status.RESOLVED)
UNRESOLVED = (Status.NOT_CONVERGED, Status.NOT_ASSEMBLABLE, Status.DOUBTFUL)


@dataclass(frozen=True, eq=False)
class ArchiveVariable:
    """A variable of an archive or a result.

    kind    NumPy type, or str
    units   None for labels, for texts, and where the model determines the units
    """

    name: str
    dims: tuple[str, ...]
    kind: Any
    long_name: str
    units: str | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def all_attributes(self) -> dict[str, Any]:
        """The attributes in a file or dataset: description, units if there are any, and others."""
        units = {} if self.units is None else {"units": self.units}
        return {"long_name": self.long_name, **units, **self.attributes}

    def entry(self, values: Any, **attributes: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        """Return dimensions, values and attributes as xarray.Dataset takes them; `attributes` replace or add to its own."""
        return self.dims, values, {**self.all_attributes, **attributes}


def variable(declaration: str, long_name: str, attributes: dict[str, Any] | None = None) -> ArchiveVariable:
    """Return the variable of a declaration in the notation of ncdump, as in "f8 gap_min(realization, state, pair) [mm]"."""
    kind, name, dims, units = _DECLARATION.fullmatch(declaration).groups()  # type: ignore[union-attr]
    labels = tuple(dims.split(", ")) if dims else ()
    return ArchiveVariable(name, labels, str if kind == "str" else kind, long_name, units, attributes or {})


def label(name: str, long_name: str) -> ArchiveVariable:
    """Return the variable of texts that labels the dimension of its own name."""
    return ArchiveVariable(name, (name,), str, long_name)


SurfaceKind = Literal["plane", "cylinder", "cone", "sphere", "torus"]
SURFACE_KINDS = get_args(SurfaceKind)  # in the order of their numbers
KINDS_MEAN = {"flag_values": list(range(len(SURFACE_KINDS))), "flag_meanings": " ".join(SURFACE_KINDS)}


def surface_variables(prefix: str, dim: str, surface: str) -> dict[str, ArchiveVariable]:
    """Return the variables of a surface, by the names of the attributes that they hold."""
    return {
        "kind": variable(f"i1 {prefix}_kind({dim}) [1]", f"kind of {surface}; -1: not known", KINDS_MEAN),
        "origin": variable(
            f"f8 {prefix}_point({dim}, axis) [mm]", f"a point of {surface}, if it is a plane, or its centre; of a cone the apex"
        ),
        "axis": variable(
            f"f8 {prefix}_axis({dim}, axis) [1]", f"unit normal or axis of {surface}; of a cone from the apex inward"
        ),
        "radius": variable(
            f"f8 {prefix}_radius({dim}) [mm]", f"radius of {surface}; of a torus to the centre line of its tube"
        ),
        "minor": variable(f"f8 {prefix}_tube_radius({dim}) [mm]", f"radius of the tube, if {surface} is a torus"),
        "angle": variable(f"f8 {prefix}_angle({dim}) [rad]", f"angle between axis and {surface}, if it is a cone"),
    }


CLASHES = variable(
    "i2 clashes(realization) [1]",
    "number of pairs of parts without declared contact that lie in each other in the corrected state; -1: not tested",
)
CLASH_DEPTH = variable(
    "f8 clash_depth(realization) [mm]",
    "how deep the parts of the deepest of these pairs lie in each other; without such a pair, parts with declared contact "
    "whose answer is doubtful; 0: no parts; NaN: not measured",
)
CLASH_PART = variable(
    "i2 clash_part(realization) [1]", "index along `part` of the first of the two parts that clash_depth is of; -1: no parts"
)
CLASH_OTHER = variable("i2 clash_other(realization) [1]", "index along `part` of the second of these parts; -1: no parts")


CHECKED_REALIZATION = variable("i8 realization_checked(checked) [1]", "number of a realization that was checked; -1: none")
SURFACE_PENETRATION = variable(
    "f8 surface_penetration(checked, pair) [mm]",
    "largest depth of one face in the other part's body in the corrected state, at points much denser than contact points; "
    "NaN: one-sided locators, which have no faces",
)
BESIDE = variable(
    "f8 beside(checked, pair) [mm]",
    "how far contact points that touch lie outside the rim of the reference face; NaN if that is not known",
)
FALSE_CONTACT = variable(
    "f8 false_contact(checked, pair) [mm]",
    "how deep contact points lay inside in the raw state, where the surfaces themselves were apart; NaN if that is not known",
)
NOTICED_SHARE = 0.01  # of the smallest tolerance range: deeper penetration or false contact of surfaces is reported
CONTACTS = variable(
    "f8 contacts(checked, pair) [1]", "number of contact points that touch in the corrected state; NaN if that is not known"
)
CONTACTS_ENDED = variable(
    "f8 contacts_ended(checked, pair) [1]", "number of these that touch a plane where its face has ended; NaN: not known"
)
AT_RANDOM = variable(
    "i1 at_random(checked) [1]",
    "1: the realization was chosen at random; 0: for the deepest penetration, or the most active points",
)
SURFACE = (
    CHECKED_REALIZATION, SURFACE_PENETRATION, BESIDE, FALSE_CONTACT, CONTACTS, CONTACTS_ENDED, AT_RANDOM,
)  # fmt: skip


CORRELATIONS = (
    "correlations"  # attribute of archives and summaries: lines on coefficients of each kind, sides of means and few parts
)
STORED_COORDINATES = "stored_coordinates"  # attribute of archives and summaries: how exactly files store which parts
STATED_ERROR_SHARE = 1e-4  # of the smallest tolerance range: a larger error of coordinates in files is reported

COORDINATE_SPACING = variable(
    "f8 coordinate_spacing(axis) [mm]", "spacing of the coordinates that the file of the mesh can store"
)
COORDINATE_ERROR = variable(
    "f8 coordinate_error(pair) [mm]",
    "error of coordinates in the files of a pair; its gaps count larger by it, also in gap_min and in reference_point",
)


INTERVAL, STATISTIC, CHANGE_OF, EXTREME, OF_ITERATIONS = "interval", "statistic", "change_of", "extreme", "of_iterations"
ESTIMATE = ("estimate", "lower", "upper")  # labels of `interval`: 95 %
PERCENTILES = (0.135, 5, 50, 95, 99.865)
MEAN, STANDARD_DEVIATION, SIX_SIGMA, VARIANCE = "mean", "standard deviation", "6 sigma", "variance"
SKEWNESS, KURTOSIS = "skewness", "kurtosis"
BELOW, ABOVE, OUTSIDE = "below limit", "above limit", "outside limits"
PPM = "ppm"  # a short word for the share outside of the limits
PP, PPK, PP_NORMAL, PPK_NORMAL = "Pp", "Ppk", "Pp as normal", "Ppk as normal"
SHARES, CAPABILITY = (BELOW, ABOVE, OUTSIDE), (PP, PPK, PP_NORMAL, PPK_NORMAL)
SHIFT, SPREAD_RATIO, VARIANCE_RATIO = "shift of the mean", "ratio of 6 sigma", "ratio of variance"
CHANGES = (SHIFT, SPREAD_RATIO, VARIANCE_RATIO)
EXTREMES = ("least", "largest")
REACTION_PERCENTILES = (5, 50, 95)
OF_REACTION, COMBINATION = "of_reaction", "combination"
REACTION_STATISTICS = (MEAN, *(f"{percent} %" for percent in REACTION_PERCENTILES))  # labels of `of_reaction`
CLASH = "clash"  # two parts that lie in each other, as "part / part"
OF_OFFSET, OFFSET_PERCENTILES = "of_offset", {"median": 50, "99 %": 99}
MIDDLES = ("median", "largest")  # labels of `of_iterations`
MEASURE_LIMITS = (*(f"measure_{bound}" for bound in BOUNDS), "measure_accuracy")  # coordinates: see Limits
NOT_A_NUMBER = "measure_not_a_number"  # coordinate: the number of realizations whose value with contact is not a number
REQUIRED = "measure_required"  # coordinate: number of realizations from which moments would have an interval; 0 if they have
MEASURE_STOPS = "measure_stops"  # coordinate: the sides at which corrected values stop, such as "lower"


def units_of(statistic: str, measure: str) -> str:
    """Return the units of a statistic of a measure with some units."""
    if statistic in (*SHARES, *CAPABILITY, SKEWNESS, KURTOSIS):
        return "1"
    return f"{measure}^2" if statistic == VARIANCE else measure


STATISTIC_VALUE = variable(
    "f8 statistic_value(measure, state, statistic, interval)", "estimate, in the measure's units; shares are of 1"
)
CHANGE = variable("f8 change(measure, change_of, interval)", "corrected against raw measures, from the same realizations")
TOUCHED = variable("f8 touched(interval) [1]", "share of realizations that contact touched")
BY_STATUS = variable("i8 by_status(status_meaning) [1]", "number of realizations")
NOT_ASSEMBLABLE_SHARE = variable("f8 not_assemblable(interval) [1]", "share of realizations without a pose free of penetration")
CONFLICTS = variable("i8 conflicts(pair) [1]", "number of these realizations with a pair in conflict")
CARRIED = variable("f8 carried(pair, interval) [1]", "share of realizations with a pair in contact")
PAIR_REACTION = variable("f8 reaction(pair, of_reaction, interval)", "mean and percentiles of a pair's reaction")
CARRIED_TOGETHER = variable(
    "f8 together(combination, interval) [1]", "share of realizations with exactly these pairs in contact"
)
STEPS = variable("f8 iterations(of_iterations) [1]", "linear steps of the realizations that contact touched")
WATCHED = variable("i8 watched() [1]", "number of realizations whose bodies were all tested for interference")
CLASH_SHARE = variable(
    "f8 clash_share(interval) [1]",
    "share of these realizations with interference of parts without declared contact; NaN: none was tested",
)
CLASH_COUNT = variable("i8 clash_count(clash) [1]", "number of realizations whose deepest interference is between two parts")
CLASH_LARGEST_DEPTH = variable("f8 clash_largest_depth(clash) [mm]", "their largest depth of interference; NaN: not measured")
CLASH_DECLARED = variable("i1 clash_declared(clash) [1]", "1: their contact is declared, and these realizations are doubtful")
OFFSET = variable(
    "f8 locator_offset(part, of_offset, interval) [mm]",
    "how far contact moved a part off its rigid two-sided locators; NaN: it has none, or cannot move",
)
OFFSET_BEYOND = variable("f8 offset_beyond(part, interval) [1]", "share of realizations with more than these locators vary")
OFFSET_UNEXPLAINED = variable(
    "f8 offset_unexplained(part, interval) [1]",
    "share of realizations that are certified with more than these locators vary and parts penetrated without contact",
)
BY_OTHER_OBJECTIVE = variable(
    "f8 change_by_objective(by_objective, measure, change_of, interval)",
    "corrected measures under another objective against the objective of the run, from the same realizations",
)
COMPARED_BY_OBJECTIVE = variable(
    "i8 compared_by_objective(by_objective) [1]", "number of these realizations: certified under both objectives"
)
PENETRATION = variable("f8 penetration(state) [mm]", "largest true penetration of any contact point")
DEEPEST_SURFACE = variable(
    "f8 surface_penetration() [mm]", "largest depth of a face in the other body, of the realizations that were checked"
)
FARTHEST_BESIDE = variable(
    "f8 beside() [mm]", "largest distance of touching contact points outside the face, of the realizations checked"
)
DEEPEST_FALSE_CONTACT = variable(
    "f8 false_contact(pair) [mm]",
    "largest depth of contact points in the raw state where the surfaces were apart, of the realizations that were checked",
)
PENETRATING_SHARE = variable(
    "f8 penetrating_share(interval) [1]",
    "share of realizations with penetration of surfaces by more than 1 % of the smallest tolerance range",
)
FALSE_CONTACT_SHARE = variable(
    "f8 false_contact_share(interval) [1]",
    "share of realizations with resolved contact of more than that depth where the surfaces are apart",
)
CONTACTS_CHECKED = variable("f8 contacts() [1]", "number of touching contact points, of the realizations that were checked")
CONTACTS_WITHOUT_FACE = variable(
    "f8 contacts_ended() [1]", "number of these that touch a plane where its face has ended; NaN if that is not known"
)
SURFACES_CHECKED = variable("i8 surfaces_checked() [1]", "number of realizations that were checked against the surfaces")
FIELD_EXTREME = variable(
    "f8 field_extreme(part, state, extreme, interval) [mm]", "least and largest 6 sigma of the displacement magnitude"
)
REALIZATIONS_IN_FIELDS = variable("i8 field_realizations() [1]", "number of realizations that the displacement fields cover")
REALIZATIONS_IN_MAGNITUDES = variable(
    "i8 magnitude_realizations() [1]", "number of realizations that the magnitudes of the displacement fields cover"
)

COMPARED_LABELS = (
    label(SOLVER, "solver, and what the methods differ in"),
    label(STATUS_MEANING, "meaning of a status"),
    label(EXTENT, "median, or largest, of all realizations"),
)
COMPARED = (
    variable("f8 seconds(solver) [s]", "wall time of all realizations, from draws to measures"),
    replace(BY_STATUS, dims=(SOLVER, STATUS_MEANING)),
    variable("f8 kkt_residual(solver) [mm]", "largest KKT residual of the certified realizations"),
    variable("f8 penetration(solver) [mm]", "largest true penetration left"),
    variable("f8 pose_difference(solver, extent) [mm]", "largest distance between both answers, corners of bounding boxes"),
    variable("f8 measure_difference(solver, extent, measure)", "difference of a measure, in its own units"),
    variable("i8 both_resolved(solver) [1]", "number of realizations that the differences cover"),
)

SAME_DRAWS, SAME_SEED, OTHER_DRAWS = "same", "same seed", "other"
COMPARED_STATISTICS = (MEAN, SIX_SIGMA, PPK, OUTSIDE)
SHARE_SHIFT = "shift of the share outside"
CHANGES_OF_RUNS = (SHIFT, SPREAD_RATIO, SHARE_SHIFT)
COMPARED_RUNS = (
    replace(STATISTIC_VALUE, name="value", dims=(RUN, STATE, MEASURE, STATISTIC, INTERVAL)),
    variable("f8 change(run, state, measure, change_of, interval)", "difference from the first run, or ratio to it"),
    variable("f8 furthest(run, state, measure)", "largest difference of a realization from the first run's"),
    replace(BY_STATUS, dims=(RUN, STATUS_MEANING)),
    replace(PENETRATION, dims=(RUN, STATE)),
    variable("str draws(run)", "draws: same as the first run's, of the same seed, or other ones"),
)
