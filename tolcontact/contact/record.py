"""Numbers that the resolution of contact records for each realization.

Each is declared once, here: states, blocks and archives follow.
"""

from dataclasses import Field, dataclass, field, fields
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.arrays import Array, Float, Int


def number(
    variable: terms.ArchiveVariable, *, start: float = 0, groups: Any = np.maximum, accumulates: bool = False
) -> dict[str, Any]:
    """Return the description of a number of each realization, for its field.

    variable     the archive's variable
    start        its value before the first step
    groups       how the numbers of two groups of parts are joined; 0 is the number of a group that contact does not touch
    accumulates  whether the numbers of several starts are added; else the number of the best start counts
    """
    return {"variable": variable, "start": start, "groups": groups, "accumulates": accumulates}


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Record:
    """The numbers of n realizations.

    kkt_residual   (n,) [mm]: KKT residual, any penetration left undone, and the last step of the exact resolution, or that step
                   in the norm of the objective, if it is smaller
    iterations     (n,): linear steps taken
    starts         (n,): places the steps were started from
    second_answers (n,): QPs that another solver had to answer
    searched       (n,): 1 if contact points were projected again at the corrected poses
    """

    kkt_residual: Float[Array, " n"] = field(metadata=number(terms.KKT_RESIDUAL, start=np.inf))
    iterations: Int[Array, " n"] = field(metadata=number(terms.ITERATIONS, accumulates=True))
    starts: Int[Array, " n"] = field(metadata=number(terms.STARTS, start=1, accumulates=True))
    second_answers: Int[Array, " n"] = field(metadata=number(terms.SECOND_ANSWERS, groups=np.add, accumulates=True))
    searched: Int[Array, " n"] = field(metadata=number(terms.SEARCHED))


NUMBERS: tuple[Field[Any], ...] = fields(Record)


def initial_numbers(count: int) -> dict[str, np.ndarray]:
    """Return the numbers (count,) before the first step, by name."""
    return {entry.name: np.full(count, entry.metadata["start"], entry.metadata["variable"].kind) for entry in NUMBERS}


def untouched_numbers(count: int) -> dict[str, np.ndarray]:
    """Return the numbers (count,) of realizations that contact does not touch, by name: zeros."""
    return {entry.name: np.zeros(count, entry.metadata["variable"].kind) for entry in NUMBERS}


def join_groups(totals: Record, rows: np.ndarray, group: Record) -> None:
    """Write the numbers of one group of parts into some rows of the numbers of all groups."""
    for entry in NUMBERS:
        values = getattr(totals, entry.name)
        values[rows] = entry.metadata["groups"](values[rows], getattr(group, entry.name))


def accumulate_starts(totals: Record, rows: np.ndarray, attempt: Record) -> None:
    """Add up the numbers that accumulate, of another attempt at some rows; both records then hold the sums."""
    for entry in NUMBERS:
        if entry.metadata["accumulates"]:
            values = getattr(totals, entry.name)
            values[rows] += getattr(attempt, entry.name)
            getattr(attempt, entry.name)[:] = values[rows]
