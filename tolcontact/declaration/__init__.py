"""Declare: parts, how they are located, which faces may touch, and what is measured.

.. include:: ../guide/declaration.md
"""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.declarations import Station
from tolcontact.declaration.dependence import Correlation, Variable
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.geometry import UNITS, Box, Elastic, Geometry, Mesh, Pin
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne, three_two_one
from tolcontact.declaration.measure import Measure, stations
from tolcontact.declaration.measurement import (
    Angle,
    AxisDistance,
    Chain,
    Clearance,
    Combination,
    Difference,
    Flush,
    Gap,
    LargestGap,
    Maximum,
    Mean,
    MeanGap,
    Measurement,
    Minimum,
    Sum,
)
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.population import Population
from tolcontact.declaration.selection import Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Triangles
from tolcontact.declaration.size import Form, Size
from tolcontact.declaration.stack import Stack
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.toleranced import OUTSIDE
from tolcontact.declaration.values import degrees

__all__ = [
    "OUTSIDE", "UNITS", "Angle", "Assembly", "AxisDistance", "Box", "Brep", "Chain", "Clearance", "Combination",
    "ContactPair", "Correlation", "Cylinder", "DatumTargets", "Difference", "Elastic", "Face", "Facing", "Feature", "Flush",
    "Force", "Form", "Gap", "GeometricTolerance", "Geometry", "Inside", "Joint", "Largest", "LargestGap", "Location",
    "Locator", "Maximum", "Mean", "MeanGap", "Measure", "Measurement", "Mesh", "Minimum", "Near", "Overlap", "Part",
    "Pattern", "Picked", "Pin", "Point", "Population", "Size", "Stack", "Station", "Sum", "ThreeTwoOne", "TitleBlock",
    "Tolerance", "Triangles", "Variable", "degrees", "stations", "three_two_one",
]  # fmt: skip
