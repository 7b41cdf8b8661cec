"""Variables of summaries, and of comparisons of runs and of solvers: what is computed from realizations."""

from dataclasses import replace

from tolcontact.vocabulary.labels import (
    BOUNDS,
    EXTENT,
    MEASURE,
    PAIR,
    PART,
    RUN,
    SOLVER,
    STATE,
    STATUS_MEANING,
    ArchiveVariable,
    label,
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
MIDDLES = ("median", "largest")  # labels of `of_iterations`
MEASURE_LIMITS = (*(f"measure_{bound}" for bound in BOUNDS), "measure_accuracy")  # coordinates: see Limits
MEASURE_STOPS = "measure_stops"  # coordinate: the sides at which corrected values stop, such as "lower"


def units_of(statistic: str, measure: str) -> str:
    """Return the units of a statistic of a measure with some units."""
    if statistic in (*SHARES, *CAPABILITY, SKEWNESS, KURTOSIS):
        return "1"
    return f"{measure}^2" if statistic == VARIANCE else measure


STATISTIC_VALUE = ArchiveVariable(
    "statistic_value", (MEASURE, STATE, STATISTIC, INTERVAL), "f8", "estimate, in the measure's units; shares are of 1"
)
CHANGE = ArchiveVariable(
    "change", (MEASURE, CHANGE_OF, INTERVAL), "f8", "corrected against raw measures, from the same realizations"
)
TOUCHED = ArchiveVariable("touched", (INTERVAL,), "f8", "share of realizations that contact touched", "1")
BY_STATUS = ArchiveVariable("by_status", (STATUS_MEANING,), "i8", "number of realizations", "1")
NOT_ASSEMBLABLE_SHARE = ArchiveVariable(
    "not_assemblable", (INTERVAL,), "f8", "share of realizations without a pose free of penetration", "1"
)
CONFLICTS = ArchiveVariable(
    "conflicts", (PAIR,), "i8", "number of these realizations in which a pair is among those in conflict", "1"
)
CARRIED = ArchiveVariable("carried", (PAIR, INTERVAL), "f8", "share of realizations in which a pair carries", "1")
PAIR_REACTION = ArchiveVariable("reaction", (PAIR, OF_REACTION, INTERVAL), "f8", "mean and percentiles of a pair's reaction")
CARRIED_TOGETHER = ArchiveVariable(
    "together", (COMBINATION, INTERVAL), "f8", "share of realizations in which exactly these pairs carry", "1"
)
STEPS = ArchiveVariable("iterations", (OF_ITERATIONS,), "f8", "linear steps of the realizations that contact touched", "1")
WATCHED = ArchiveVariable("watched", (), "i8", "number of realizations in which all bodies were tested for interference", "1")
CLASH_SHARE = ArchiveVariable(
    "clash_share",
    (INTERVAL,),
    "f8",
    "share of these realizations in which parts without declared contact lie in each other; NaN: none was tested",
    "1",
)
CLASH_COUNT = ArchiveVariable(
    "clash_count", (CLASH,), "i8", "number of realizations in which two parts are those that lie deepest in each other", "1"
)
CLASH_LARGEST_DEPTH = ArchiveVariable(
    "clash_largest_depth", (CLASH,), "f8", "how deep they do at most; NaN: not measured", "mm"
)
CLASH_DECLARED = ArchiveVariable(
    "clash_declared", (CLASH,), "i1", "1: their contact is declared, and these realizations are doubtful", "1"
)
PENETRATION = ArchiveVariable("penetration", (STATE,), "f8", "largest true penetration of any contact point", "mm")
DEEPEST_SURFACE = ArchiveVariable(
    "surface_penetration", (), "f8", "largest depth of a face in the other body, of the realizations that were checked", "mm"
)
FARTHEST_BESIDE = ArchiveVariable(
    "beside", (), "f8", "largest distance of touching contact points outside the face, of the realizations checked", "mm"
)
DEEPEST_FALSE_CONTACT = ArchiveVariable(
    "false_contact",
    (PAIR,),
    "f8",
    "largest depth of contact points in the raw state where the surfaces were apart, of the realizations that were checked",
    "mm",
)
PENETRATING_SHARE = ArchiveVariable(
    "penetrating_share",
    (INTERVAL,),
    "f8",
    "share of realizations in which surfaces penetrate each other by more than 1 % of the smallest tolerance range",
    "1",
)
FALSE_CONTACT_SHARE = ArchiveVariable(
    "false_contact_share",
    (INTERVAL,),
    "f8",
    "share of realizations in which contact of more than that depth was resolved where the surfaces are apart",
    "1",
)
CONTACTS_CHECKED = ArchiveVariable(
    "contacts", (), "f8", "number of touching contact points, of the realizations that were checked", "1"
)
CONTACTS_WITHOUT_FACE = ArchiveVariable(
    "contacts_ended", (), "f8", "number of these that touch a plane where its face has ended; NaN if that is not known", "1"
)
SURFACES_CHECKED = ArchiveVariable(
    "surfaces_checked", (), "i8", "number of realizations that were checked against the surfaces", "1"
)
FIELD_EXTREME = ArchiveVariable(
    "field_extreme", (PART, STATE, EXTREME, INTERVAL), "f8", "least and largest 6 sigma of the displacement magnitude", "mm"
)
REALIZATIONS_IN_FIELDS = ArchiveVariable(
    "field_realizations", (), "i8", "number of realizations that the displacement fields cover", "1"
)
REALIZATIONS_IN_MAGNITUDES = ArchiveVariable(
    "magnitude_realizations", (), "i8", "number of realizations that the magnitudes of the displacement fields cover", "1"
)

COMPARED_LABELS = (
    label(SOLVER, "solver, and what the methods differ in"),
    label(STATUS_MEANING, "meaning of a status"),
    label(EXTENT, "median, or largest, of all realizations"),
)
COMPARED = (
    ArchiveVariable("seconds", (SOLVER,), "f8", "wall time of all realizations, from draws to measures", "s"),
    replace(BY_STATUS, dims=(SOLVER, STATUS_MEANING)),
    ArchiveVariable("kkt_residual", (SOLVER,), "f8", "largest KKT residual of the certified realizations", "mm"),
    ArchiveVariable("penetration", (SOLVER,), "f8", "largest true penetration left", "mm"),
    ArchiveVariable(
        "pose_difference", (SOLVER, EXTENT), "f8", "largest distance between both answers, corners of bounding boxes", "mm"
    ),
    ArchiveVariable("measure_difference", (SOLVER, EXTENT, MEASURE), "f8", "difference of a measure, in its own units"),
    ArchiveVariable("both_resolved", (SOLVER,), "i8", "number of realizations that the differences cover", "1"),
)

SAME_DRAWS, SAME_SEED, OTHER_DRAWS = "same", "same seed", "other"
COMPARED_STATISTICS = (MEAN, SIX_SIGMA, PPK, OUTSIDE)
SHARE_SHIFT = "shift of the share outside"
CHANGES_OF_RUNS = (SHIFT, SPREAD_RATIO, SHARE_SHIFT)
COMPARED_RUNS = (
    replace(STATISTIC_VALUE, name="value", dims=(RUN, STATE, MEASURE, STATISTIC, INTERVAL)),
    ArchiveVariable(
        "change", (RUN, STATE, MEASURE, CHANGE_OF, INTERVAL), "f8", "difference from the first run, or ratio to it"
    ),
    ArchiveVariable("furthest", (RUN, STATE, MEASURE), "f8", "largest difference of a realization from the first run's"),
    replace(BY_STATUS, dims=(RUN, STATUS_MEANING)),
    replace(PENETRATION, dims=(RUN, STATE)),
    ArchiveVariable("draws", (RUN,), str, "draws: same as the first run's, of the same seed, or other ones"),
)
