"""The kinds of contact, by the class of their points (see discretization)."""

from collections.abc import Sequence

import numpy as np

from tolcontact.compilation import Program
from tolcontact.contact.bounded_search import BoundedSearch
from tolcontact.contact.fixed_search import FixedSearch
from tolcontact.contact.round_search import RoundSearch
from tolcontact.discretization import ContactPoints, RoundContact

KINDS: dict[type[ContactPoints], type[FixedSearch]] = {ContactPoints: FixedSearch, RoundContact: RoundSearch}


def pair_search(program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> FixedSearch:
    """Return the search of a pair, with the moment tables of its sides (see FixedSearch)."""
    kind = BoundedSearch if index in program.meetings else KINDS[type(program.nominal.pairs[index])]
    return kind(program, index, tables)
