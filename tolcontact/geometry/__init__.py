"""Geometry: shapes, their surfaces and faces, and the files they come from. A chapter of the guide.

The shape of a part is a box, or triangles from a mesh or a STEP file. Its faces are smooth pieces of the triangles, or the
faces that the STEP file names. All coordinates are in the frame of the part, in mm. `preview` lists the faces of a part before
anything is computed.

>>> import trimesh
>>> import tolcontact as tc
>>> from tolcontact.geometry import preview
>>> pin = tc.Assembly("fixture").part("pin", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=24)))
>>> for face in preview(pin).descriptions:
...     print(face)
1. plane, along (0, 0, -1), 77.65 mm2, at (...)
2. cylinder, radius 5 mm, axis through (...), along (0, 0, 1), fitted within ... mm, 626.5 mm2, at (...)
3. plane, along (0, 0, 1), 77.65 mm2, at (...)

## Meshes

`tc.Mesh(source, units=...)` states the units of the source: "um", "mm", "cm", "m", "in" or "ft". Without `units`, a STEP file
states its own units, a GLB file is in m, a Trimesh is in its `mesh.units` if they are set, and all other sources are in mm.

Meshes may be open, or contain several bodies. A surface with an undefined outside is rejected: neighbouring triangles oriented
inconsistently, a body turned inside out, coincident triangles that point opposite ways. A part may have a million triangles
and reach 10 km from its origin. On curved faces normals are interpolated between the corners of the triangles. Triangles that
meet at more than 30 degrees form an edge.

## Coordinates in files

A binary STL, a GLB or a PLY file with `float` coordinates stores them in single precision: to 4e-6 mm at 50 mm from the origin
of the file, but to 2.4e-4 mm at 3 m. An ASCII file stores them as exactly as it prints them: to the last digit of its largest
coordinates. Numbers of fewer than six digits count as exact, unless most of them have the same number of digits, or of
decimals, and that is at least four, or five with a single decimal. A vertex is off by up to half the spacing along each axis.
Contact allows for this error: gaps between two bodies are increased by the errors of both, so bodies that fit without
clearance as drawn also fit as stored. Where contact is searched at every pose, faces that are flat except for rounding are made
flat, and are offset into the material by the error of their file. The interference check offsets its bodies in the same way. A
ball or a shaft in a hollow wall is fitted to many vertices, so it needs no allowance.

`tolcontact check`, the summary of a run and the attribute `stored_coordinates` of its archive name the parts and the error, if
it is above 1e-4 of the smallest tolerance range. STEP files, boxes, pins and meshes in memory have no such error; give the file
instead of a mesh that was read from it.

## Round faces

The surface of a face is known exactly where a STEP file states a plane, cylinder, cone, sphere or torus. In other meshes a
cylinder, cone or sphere is fitted to the vertices of each smooth piece. The fit is accepted if every vertex lies within 1 um
of it and the piece has at least five facets that turn by at most 30 degrees each. Contact points, their projections and
normals then lie on the fitted surface instead of the triangles. A prism with many sides is therefore treated as a cylinder;
`tolcontact check` states how far inside the cylinder its triangles lie. Other curved faces are only as round as their
triangles.

## STEP files

STEP files need the package cadquery-ocp-novtk: `pip install '.[step]'`. Its licence is Apache-2.0; it contains the CAD kernel
Open CASCADE Technology, whose licence is LGPL 2.1 with an exception. Faces are triangulated to within 2 um, or 5e-6 of the
extent of a file larger than 0.4 m, and 0.1 rad. `tc.Mesh(file, chord=0.1)` asks for 0.1 mm instead; contact on surfaces that
the file states does not depend on this chord. If there would be more than a million triangles, or triangulation takes too long,
faces are triangulated 30 times as coarsely and to 0.5 rad, with a warning.

The triangles keep the boundary representation, which `tc.Brep`, `tc.Cylinder` and `tc.Largest` use. Where the file states
a surface, vertices are moved onto it in double precision, as closely as the surfaces that meet at a vertex agree. Vertices of
a body that are closer than 1e-5 mm at 100 mm, 1e-4 mm at 1 m, are one.

An assembly contains several bodies. `tolcontact bodies FILE.stp` and `tc.bodies_in` list them; `tc.Mesh(file, body=...)` is one
of them in the frame of its product; `tc.parts_from(model, file)` declares all of them, or only the named ones, as parts in
their positions, and `tc.parts_from(model, file, fixed=["plate"])` fixes the plate there. `tolcontact faces FILE.stp --body
NAME` and `tc.faces_in` list the faces of a body with their numbers, kinds, directions, radii and areas, and with their names
if the file has any; `tc.Brep("...")` chooses a face by its name. Faces of one surface that touch, such as the halves of a
hole, are listed with each other's numbers; `tc.Brep(6, whole=True)` chooses all of them by any of their numbers. A face that
the file states several times in one place has one number, and is listed as such.
Lines at the end of the list name slots (two parallel planes and two round ends) and patterns (holes of one radius with parallel
axes), which `tc.Brep(6, whole="slot")` and `tc.Brep(6, whole="pattern")` choose by any of their faces. The holes of a pattern
with tolerances are chosen one by one, as in `part.pattern("H", *(part.face(tc.Brep(n, whole=True)) for n in (6, 8, 10)), ...)`.
Areas and boxes refer to the true faces, not to triangles. A B-spline surface within 0.1 um of a plane, cylinder, cone or
sphere is treated as that surface. Where a file states no simple surface, one is fitted to the vertices to within 1 um, and its
residual is listed. STEP files that refer to other files are rejected.

## Untrusted files

A separate process reads shape files, with a limit on time (30 s, and 20 s for each MB) and on memory (6 GiB). A damaged file
therefore leads to a single message, which names the file and says what to do.
"""

from tolcontact.geometry.analytic_surfaces import surface_arrays, surfaces_of
from tolcontact.geometry.face_groups import group_lines
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.part_preview import PartPreview, preview
from tolcontact.geometry.step_listing import BodyInFile, bodies_in, faces_in, parts_from
from tolcontact.geometry.surface_recognition import known_surfaces, with_known_surfaces

__all__ = [
    "BodyInFile",
    "FaceInFile",
    "PartPreview",
    "bodies_in",
    "faces_in",
    "group_lines",
    "known_surfaces",
    "parts_from",
    "preview",
    "surface_arrays",
    "surfaces_of",
    "with_known_surfaces",
]
