"""Compile the kernels that most tests call into the user's cache: processes that start together would all compile the same.

Two processes do so in two thirds of the time, if one runs the assemblies `backwards`: each finds compiled what the other has
compiled by then.
"""

import sys
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
    with tempfile.TemporaryDirectory() as folder:
        programs = [
            *((declare, method, "daqp") for declare, method in SCENES.values()),
            (cases.stack, EXACT, "qpoases"),
            (cases.stack, EXACT, "graph"),
            (cases.tab, EXACT, "daqp"),  # its realizations are rescued, in vain
            (lambda: cases.hinged_ring(3), SEATED, "daqp"),
            (lambda: seat(points=40), SEATED, "daqp"),
            (lambda: welded_sheets(Path(folder)), None, "qpoases"),
        ]
        for declare, method, solver in reversed(programs) if "backwards" in sys.argv else programs:
            tc.run(compiled(declare(), method=method, solver=solver), samples=4, surfaces=4)
