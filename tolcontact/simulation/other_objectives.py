"""The first realizations of a run under other objectives: by how much its results depend on the choice."""

from dataclasses import replace
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program, compile_program
from tolcontact.errors import ModelError, OptionError
from tolcontact.method import OBJECTIVES
from tolcontact.simulation.block import outcomes
from tolcontact.vocabulary import CORRECTED, ArchiveVariable

ROWS = 128
MIN_REALIZATIONS = 1000  # of a run that is compared: the comparison adds some tenths to its time, or less if it is longer
NOT_SIMULATED = -1  # instead of a status


def compared_objectives(program: Program) -> tuple[str, ...]:
    """Return the objectives that need no force, that of the program first; none without contact, or where forces decide."""
    objective = program.method.minimizes
    if objective.presses or not program.groups:
        return ()
    return objective.name, *(other.name for other in OBJECTIVES.values() if not other.presses and other != objective)


def empty_by_objective(program: Program) -> dict[ArchiveVariable, np.ndarray]:
    """Return the values by objective before any is simulated; nothing if there is nothing to compare."""
    count = len(compared_objectives(program))
    if not count:
        return {}
    return {
        terms.MEASURED_BY_OBJECTIVE: np.full((count, ROWS, len(program.nominal.measures)), np.nan),
        terms.STATUS_BY_OBJECTIVE: np.full((count, ROWS), NOT_SIMULATED, dtype=np.int8),
    }


def by_objective(
    program: Program, measured: np.ndarray, statuses: np.ndarray, blocks: Any, seed: int
) -> dict[ArchiveVariable, np.ndarray]:
    """Return corrected measures and statuses of the first realizations under each objective.

    measured   (ROWS, measure): under the objective of the program; statuses (ROWS,)
    blocks     a function with the arguments of `map_blocks`
    """
    values = empty_by_objective(program)
    measured_by, statuses_by = values[terms.MEASURED_BY_OBJECTIVE], values[terms.STATUS_BY_OBJECTIVE]
    measured_by[0], statuses_by[0] = measured, statuses
    for k, name in enumerate(compared_objectives(program)[1:], start=1):
        try:
            other = compile_program(program.nominal, program.solver.name, program.method.with_choices(objective=name))
        except (ModelError, OptionError):  # compliant contact needs forces, and some solvers have fewer objectives
            continue
        results = list(blocks(outcomes, replace(other, draws=program.draws), samples=ROWS, seed=seed))
        measured_by[k] = np.concatenate([states[:, CORRECTED] for states, _ in results])
        statuses_by[k] = np.concatenate([status for _, status in results])
    return values
