"""Run where nothing can be printed."""

import sys

import tolcontact as tc
from tests import cases

sys.stdout = sys.stderr = None
tc.run(cases.ra1(points=9), samples=20)
