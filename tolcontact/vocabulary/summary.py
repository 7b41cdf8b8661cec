"""What a summary holds: its dimensions, and their labels."""

INTERVAL, STATISTIC, CHANGE_OF, EXTREME, OF_ITERATIONS = "interval", "statistic", "change_of", "extreme", "of_iterations"
ESTIMATE = ("estimate", "lower", "upper")  # labels of `interval`: 95 %
PERCENTILES = (0.135, 5, 50, 95, 99.865)
STATISTICS = ("mean", "standard deviation", "6 sigma", "variance", *(f"{percent:g} %" for percent in PERCENTILES))
SKEWNESS, KURTOSIS = "skewness", "kurtosis"
BELOW, ABOVE, OUTSIDE = "below limit", "above limit", "outside limits"
PPM = "ppm"  # a short word for the share outside of the limits
PP, PPK, PP_NORMAL, PPK_NORMAL = "Pp", "Ppk", "Pp as normal", "Ppk as normal"
SHARES, CAPABILITY = (BELOW, ABOVE, OUTSIDE), (PP, PPK, PP_NORMAL, PPK_NORMAL)
EVERY_STATISTIC = (*STATISTICS, SKEWNESS, KURTOSIS, *SHARES, *CAPABILITY)
SHIFT, SPREAD_RATIO, VARIANCE_RATIO = "shift of the mean", "ratio of 6 sigma", "ratio of variance"
CHANGES = (SHIFT, SPREAD_RATIO, VARIANCE_RATIO)
EXTREMES = ("least", "largest")
REACTION_PERCENTILES = (5, 50, 95)
OF_REACTION, COMBINATION = "of_reaction", "combination"
REACTION_STATISTICS = ("mean", *(f"{percent} %" for percent in REACTION_PERCENTILES))  # labels of `of_reaction`
MIDDLES = ("median", "largest")  # labels of `of_iterations`
