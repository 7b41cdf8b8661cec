"""Declare: what the user says, frozen, without numerics."""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import ContactPair
from tolcontact.declaration.force import Force
from tolcontact.declaration.freedom import has_supports, is_free, movers
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import Locator, ThreeTwoOne, three_two_one
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Part, Point
from tolcontact.declaration.selection import Brep, Facing, Inside, Near, Picked, Triangles
from tolcontact.declaration.tolerance import Tolerance

__all__ = [
    "Assembly",
    "Box",
    "Brep",
    "ContactPair",
    "Face",
    "Facing",
    "Force",
    "Inside",
    "Locator",
    "Measure",
    "Mesh",
    "Near",
    "Part",
    "Picked",
    "Point",
    "ThreeTwoOne",
    "Tolerance",
    "Triangles",
    "has_supports",
    "is_free",
    "movers",
    "three_two_one",
]
