"""Effects of tolerances on measures: the changes if the zones of a group were slightly narrower."""

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.changed_rows import NEGLIGIBLE
from tolcontact.analyses.requirement import MIN_DECISIVE
from tolcontact.analyses.scaled_trials import STEP, ScaledTrials
from tolcontact.compilation import Program
from tolcontact.statistics.intervals import mean

BATCHES = 32  # of realizations, for the intervals of effects
# Realizations for the effect of a group: at least this number; at most samples / 4, and 4 samples / groups.
MIN_EFFECT_SAMPLES, EFFECT_SHARE = 512, 4


def effect_samples(samples: int, groups: int) -> int:
    """Return the number of realizations, out of `samples`, for the effect of each group."""
    count = min(samples // EFFECT_SHARE, EFFECT_SHARE * samples // max(groups, 1))
    return min(max(count, MIN_EFFECT_SAMPLES), samples)


def narrowing_effects(trials: ScaledTrials, program: Program) -> np.ndarray:
    """Return changes (measure, of_effect, group, interval) if a group's zones were a tenth narrower.

    Intervals come from means over batches of the same draws. A group that changes none of the first batches has no effect.
    """
    limits = [program.limits(number) for number in range(len(program.nominal.measures))]
    ones = np.ones(len(trials))
    rows = np.arange(effect_samples(trials.samples, len(trials)))
    factors, first = list(ones - STEP * np.eye(len(trials))), rows[:MIN_DECISIVE]
    present, *firsts = trials.corrected_rows([ones, *factors], [rows, *[first] * len(trials)])
    negligible = NEGLIGIBLE * present.std(axis=0)
    groups = [k for k, x in enumerate(firsts) if (np.abs(x - present[: len(first)]).max(axis=0) > negligible).any()]
    others = trials.corrected_rows([factors[k] for k in groups], [rows[len(first) :]] * len(groups))
    effects = np.zeros((len(limits), len(terms.EFFECTS), len(trials), len(terms.ESTIMATE)))
    for group, other in zip(groups, others, strict=True):
        narrowed = np.concatenate([firsts[group], other])
        for measure, limits_of_measure in enumerate(limits):
            batches = [np.array_split(values[:, measure], BATCHES) for values in (narrowed, present)]
            spreads = [np.array([6 * x.std(ddof=1) for x in values]) for values in batches]
            shares = [np.array([limits_of_measure.outside(x).mean() for x in values]) for values in batches]
            effects[measure, 0, group] = mean(spreads[0] - spreads[1])
            effects[measure, 1, group] = mean(shares[0] - shares[1])
    return effects
