"""Run two blocks into an archive, and say after each block how many realizations are finished.

run_blocks.py ARCHIVE SAMPLES [--keep KEPT] [--step]; with --step it goes on when a line is read.
"""

import argparse
import sys

import tolcontact as tc
from tests import cases
from tests.helpers import compiled

parser = argparse.ArgumentParser()
parser.add_argument("archive")
parser.add_argument("samples", type=int)
parser.add_argument("--keep", default="all")
parser.add_argument("--step", action="store_true")
options = parser.parse_args()


def tell(rows):
    print(rows, flush=True)
    if options.step:
        sys.stdin.readline()


program = compiled(cases.one_dimensional(2))
tc.run(program, samples=options.samples, seed=3, out=options.archive, keep=options.keep, progress=tell).close()
