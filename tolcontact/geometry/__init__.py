"""Geometry: shapes, their surfaces and faces, and the files they come from.

.. include:: ../guide/geometry.md
"""

from tolcontact.geometry.analytic_surfaces import surface_arrays, surfaces_of
from tolcontact.geometry.brep_face import known_surfaces, with_known_surfaces
from tolcontact.geometry.face_groups import FaceInFile, group_lines
from tolcontact.geometry.listing import BodyInFile, PartPreview, bodies_in, faces_in, parts_from, preview

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
