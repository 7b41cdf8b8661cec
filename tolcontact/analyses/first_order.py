"""The variance that each contributor causes to first order, without contact: for runs with too few realizations for shares."""

import numpy as np
import xarray as xr

from tolcontact.analyses.linear_model import total_derivatives
from tolcontact.archive import model_of
from tolcontact.compilation import compile_program
from tolcontact.discretization import discretize
from tolcontact.workflow.models import DEFAULT_SOLVER, method_of


def first_order_variances(results: xr.DataTree) -> np.ndarray:
    """Return the variance (measure, contributor) of each measure of a run by its nominal derivatives; NaN at a kink.

    Contributors have the variance of their own distributions. Raises ModelError or ArchiveError if the model cannot be rebuilt.
    """
    assembly = model_of(results)
    choice = method_of(assembly, None)
    program = compile_program(discretize(assembly, presses=choice.minimizes.presses), DEFAULT_SOLVER, choice)
    variances = np.array([contributor.variance for contributor in program.draws.contributors])
    return total_derivatives(program) ** 2 * variances
