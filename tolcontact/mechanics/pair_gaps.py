"""The gaps of each kind of contact: a class of points (see discretization) has a class of gaps, in a file of its own."""

from collections.abc import Callable
from typing import Any

from tolcontact.discretization import ContactPoints, RoundContact
from tolcontact.mechanics.gap import FixedGaps
from tolcontact.mechanics.round_gap import RoundGaps

KINDS: dict[type[ContactPoints], Callable[[Any], FixedGaps]] = {ContactPoints: FixedGaps, RoundContact: RoundGaps}


def pair_gaps(pair: ContactPoints) -> FixedGaps:
    """Return the equations of a pair's kind of contact."""
    return KINDS[type(pair)](pair)
