"""Verdicts on measurements: whether the 95 % interval of the share out of specification is small enough."""

import math
from typing import NamedTuple

import numpy as np

from tolcontact.statistics import intervals

ALLOWED_SHARE = 0.0027  # share of a normal distribution beyond three standard deviations: Ppk 1 on both sides
MEETS, FAILS, UNDECIDED = "meets", "does not meet", "undecided"
GROWTH = 1.25  # of the number of realizations between two trials
MAX_REALIZATIONS = 1e8  # more are not proposed
VERDICT_RULE = (
    f'"{MEETS}": the 95 % interval of the share out of specification, with contact, lies at or below {ALLOWED_SHARE:.2%}; '
    f'"{FAILS}": it lies above; "{UNDECIDED}": it contains {ALLOWED_SHARE:.2%}'.replace("%", " %")
).replace("95  %", "95 %")


class Verdict(NamedTuple):
    """The verdict on a measurement.

    word   one of MEETS, FAILS, UNDECIDED
    more   number of additional realizations that would probably decide; 0 if it is decided, infinite if too many
    """

    word: str
    more: float = 0.0


def verdict(share: np.ndarray, realizations: int) -> Verdict | None:
    """Return the verdict on a share (estimate, lower, upper) out of specification; None for a share that is not a number."""
    estimate, lower, upper = (float(value) for value in share)
    if not all(map(math.isfinite, (estimate, lower, upper))):
        return None
    word = _word(lower, upper)
    return Verdict(word, _more(estimate, realizations) if word == UNDECIDED else 0.0)


def _word(lower: float, upper: float) -> str:
    return MEETS if upper <= ALLOWED_SHARE else FAILS if lower > ALLOWED_SHARE else UNDECIDED


def _more(estimate: float, realizations: int) -> float:
    """Return the number of additional independent realizations that would decide if the estimate did not change."""
    count = float(realizations)
    while count < MAX_REALIZATIONS:
        count *= GROWTH
        if _word(*intervals.proportion_of(estimate * count, count)[1:]) != UNDECIDED:
            return math.ceil(count - realizations)
    return math.inf
