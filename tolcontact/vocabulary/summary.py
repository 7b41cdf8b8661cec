"""Variables of summaries of runs, and of comparisons of solvers and of runs."""

from dataclasses import replace

from tolcontact.vocabulary.labels import BOUNDS, EXTENT, MEASURE, RUN, SOLVER, STATE, STATUS_MEANING, label, variable

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
OPEN_BY_PARTS = "measure_open_by_parts"  # coordinate: 1 if few parts leave more open than realizations do; 0 if not
PARTS_LEFT_OUT = "few_parts_left_out"  # attribute: 1 if few parts are behind some contributors, and intervals do not include it
FEW_ROWS = "measure_few_rows"  # coordinate: 1 if measured rows are so few that only the mean and shares have an interval
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

# The comparison of solvers.
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

# The comparison of runs.
SAME_DRAWS, SAME_SEED, OTHER_DRAWS = "same", "same seed", "other"
COMPARED_STATISTICS = (MEAN, SIX_SIGMA, PPK, OUTSIDE)
FEW_PARTS, NO_FEW_PARTS, OPEN_INCLUDED, OPEN_LEFT_OUT = "few_parts", "none", "included", "left out"  # coordinate, its values
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
