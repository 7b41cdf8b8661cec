"""Declare: what the user says, frozen, without numerics."""

from tolcontact.assembly.assembly import Assembly
from tolcontact.assembly.contact import ContactPair
from tolcontact.assembly.force import Force
from tolcontact.assembly.geometry import Box, Mesh
from tolcontact.assembly.locator import Locator, ThreeTwoOne, three_two_one
from tolcontact.assembly.measure import Measure
from tolcontact.assembly.part import Face, Part, Point
from tolcontact.assembly.selection import Brep, Facing, Inside, Near, Picked, Triangles
from tolcontact.assembly.tolerance import Tolerance

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
    "three_two_one",
]
