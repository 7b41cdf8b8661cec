"""Compile the kernels that most tests call into the user's cache: processes that start together would all compile the same."""

import tempfile
import warnings
from pathlib import Path

import tolcontact as tc
from tests import cases
from tests.cases.elastic import welded_sheets
from tests.cases.seats import seat
from tests.helpers import EXACT, SEATED, compiled
from tests.test_properties import SCENES

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    for declare, method in SCENES.values():
        tc.run(declare(), method=method, solver="daqp", samples=4, surfaces=4)
    with tempfile.TemporaryDirectory() as folder:
        for model, method, solver in (
            (cases.stack(), EXACT, "qpoases"),
            (cases.stack(), EXACT, "graph"),
            (cases.tab(), EXACT, "daqp"),  # its realizations are rescued, in vain
            (cases.hinged_ring(3), SEATED, "daqp"),
            (seat(points=40), SEATED, "daqp"),
            (welded_sheets(Path(folder)), None, "qpoases"),
        ):
            tc.run(compiled(model, method=method, solver=solver), samples=4, surfaces=4)
