"""Discretize an assembly of files, and say its faults: read_shapes.py SECONDS FILE ..., where no file may take longer."""

import sys

import tolcontact as tc
from tolcontact.discretization import discretize
from tolcontact.geometry.files import reader

reader.SECONDS = float(sys.argv[1])
a = tc.Assembly("strange")
for name in sys.argv[2:]:
    a.part(name, tc.Mesh(name), fixed=True)
try:
    discretize(a)
except tc.ModelError as error:
    print(error)
