"""Values that a report computes with the model of a run, which is rebuilt from the archive.

Both functions take the results of a run and compile its model once more: `first_order_variances` for the shares of contributors
where realizations are too few, and `rigid_values` for the part of the variance that elasticity adds.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact.analyses.linear_model import total_derivatives
from tolcontact.archive import method_of_run, model_of
from tolcontact.arrays import Array, Float
from tolcontact.compilation import compile_program
from tolcontact.compilation.other_flexibility import STIFFER, overheld, stiffer
from tolcontact.discretization import discretize
from tolcontact.realizations import finished
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, DEVIATION, MEASURED, RAW
from tolcontact.workflow.models import DEFAULT_SOLVER, method_of

MAX_ROWS = 1000
SOLVER = "graph"


def first_order_variances(results: xr.DataTree) -> np.ndarray:
    """Return the variance (measure, contributor) of each measure of a run by its nominal derivatives; NaN at a kink.

    Contributors have the variance of their own distributions. Raises ModelError or ArchiveError if the model cannot be rebuilt.
    """
    assembly = model_of(results)
    choice = method_of(assembly, None)
    program = compile_program(discretize(assembly, presses=choice.minimizes.presses), DEFAULT_SOLVER, choice)
    variances = np.array([contributor.variance for contributor in program.draws.contributors])
    return total_derivatives(program) ** 2 * variances


class RigidValues(NamedTuple):
    """Values of the first realizations of a run with rigid parts, and a sentence that says how these are placed."""

    measured: Float[Array, "realization measure"]
    words: str


def rigid_values(results: xr.DataTree) -> RigidValues | None:
    """Return the values of the first MAX_ROWS realizations with rigid parts; None if the run did not keep its deviations.

    Elastic parts are STIFFER times as stiff. Rigid parts do not fit more equations than they have freedoms, so where locators
    or welds hold more, values are those without contact: rigid parts fit their locators best.
    Raises ModelError or ArchiveError if the model cannot be rebuilt.
    """
    rows, sample = slice(0, min(finished(results), MAX_ROWS)), results["sample"].to_dataset()
    if DEVIATION.name not in sample:
        return None
    assembly, method = model_of(results), method_of_run(results)
    program = compile_program(discretize(assembly, presses=method.minimizes.presses), SOLVER, method)
    if names := overheld(program):
        words = f"rigid parts without contact, which fit their locators best, since no rigid part fits what {names} hold"
        return RigidValues(results.to_dataset()[MEASURED.name].values[rows, RAW], words)
    block = simulate_block(stiffer(program, STIFFER), sample[DEVIATION.name].values[rows])
    return RigidValues(block.measured[:, CORRECTED], "the same realizations with rigid parts and contact")
