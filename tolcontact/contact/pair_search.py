"""The search of a pair: at fixed points, at every pose, or none."""

from collections.abc import Sequence

import numpy as np

from tolcontact.compilation import Program
from tolcontact.contact.bounded_search import BoundedSearch
from tolcontact.contact.fixed_search import FixedSearch
from tolcontact.contact.standing_search import StandingSearch


def pair_search(program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> FixedSearch:
    """Return the search of a pair, with the moment tables of its sides (see FixedSearch)."""
    if index in program.meetings:
        return BoundedSearch(program, index, tables)
    return (FixedSearch if program.nominal.pairs[index].samples_faces else StandingSearch)(program, index, tables)
