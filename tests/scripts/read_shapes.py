"""Read shape files and print their faults: read_shapes.py SECONDS FILE ..., where no small file may take longer."""

import sys

import tolcontact as tc
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import ReadingLimits, read_files
from tolcontact.geometry.shapes import shape

meshes = [tc.Mesh(name) for name in sys.argv[2:]]
contents = read_files(meshes, ReadingLimits(seconds=float(sys.argv[1])))
for mesh in meshes:
    try:
        shape(mesh, contents)
    except GeometryFault as fault:
        print(fault)
