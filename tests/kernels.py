"""Compile the kernels that most tests call into the user's cache: processes that start together would all compile the same."""

import tempfile
import warnings
from pathlib import Path

import tolcontact as tc
from tests import cases
from tests.cases.elastic import welded_sheets
from tests.helpers import SEATED
from tests.test_properties import AT_NIGHT, SCENES

if __name__ == "__main__":
    warnings.simplefilter("ignore", tc.NominalWarning)
    with tempfile.TemporaryDirectory() as folder:
        for declare, method, solver in (
            *((declare, method, "daqp") for declare, method in (SCENES | AT_NIGHT).values()),
            *((cases.stack, None, solver) for solver in ("qpoases", "graph")),
            (lambda: cases.hinged_ring(3), SEATED, "daqp"),
            (lambda: welded_sheets(Path(folder)), None, "qpoases"),
        ):
            tc.run(declare(), method=method, solver=solver, samples=4, surfaces=4)
