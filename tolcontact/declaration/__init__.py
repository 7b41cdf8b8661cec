"""Declare: parts, how they are located, which faces may touch, and what is measured.

.. include:: ../guide/declaration.md
"""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.dependence import Correlation, Variable
from tolcontact.declaration.elastic import Elastic
from tolcontact.declaration.feature_tolerance import (
    Angularity,
    CircularRunout,
    Coaxiality,
    Cylindricity,
    Flatness,
    GeometricTolerance,
    LineProfile,
    Parallelism,
    Perpendicularity,
    Position,
    Profile,
    Roundness,
    Straightness,
    Symmetry,
    TotalRunout,
)
from tolcontact.declaration.geometry import UNITS, Box, Geometry, Mesh, Pin
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne, three_two_one
from tolcontact.declaration.measure import Measure
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
from tolcontact.declaration.part import OUTSIDE, DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.population import Population
from tolcontact.declaration.seam import stations
from tolcontact.declaration.selection import Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Triangles
from tolcontact.declaration.sequence import Station
from tolcontact.declaration.size import Form, Size
from tolcontact.declaration.stack import Stack
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import degrees

__all__ = [
    "OUTSIDE", "UNITS", "Angle", "Angularity", "Assembly", "AxisDistance", "Box", "Brep", "Chain", "CircularRunout",
    "Clearance", "Coaxiality", "Combination", "ContactPair", "Correlation", "Cylinder", "Cylindricity", "DatumTargets",
    "Difference", "Elastic", "Face", "Facing", "Feature", "Flatness", "Flush", "Force", "Form", "Gap", "GeometricTolerance",
    "Geometry", "Inside", "Joint", "Largest", "LargestGap", "LineProfile", "Location", "Locator", "Maximum", "Mean",
    "MeanGap", "Measure", "Measurement", "Mesh", "Minimum", "Near", "Overlap", "Parallelism", "Part", "Pattern",
    "Perpendicularity", "Picked", "Pin", "Point", "Population", "Position", "Profile", "Roundness", "Size", "Stack",
    "Station", "Straightness", "Sum", "Symmetry", "ThreeTwoOne", "TitleBlock", "Tolerance", "TotalRunout", "Triangles",
    "Variable", "degrees", "stations", "three_two_one",
]  # fmt: skip
