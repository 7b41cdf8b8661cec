"""Tolerance analysis of rigid assemblies: Monte-Carlo variation simulation in which contact is resolved.

declare       Assembly, Box, Mesh, Locator, three_two_one, Tolerance
faces         Facing, Inside, Near, Brep
run           run, build, compare, Method
look          summarize, open_archive, model_of
"""

from tolcontact.archive import model_of, open_archive
from tolcontact.assembly import Assembly, Box, Brep, Facing, Inside, Locator, Mesh, Near, Tolerance, three_two_one
from tolcontact.cli import main
from tolcontact.comparing import compare
from tolcontact.errors import TolcontactError
from tolcontact.method import Method
from tolcontact.running import build, run
from tolcontact.statistics import summarize

__all__ = [
    "Assembly",
    "Box",
    "Brep",
    "Facing",
    "Inside",
    "Locator",
    "Mesh",
    "Method",
    "Near",
    "TolcontactError",
    "Tolerance",
    "build",
    "compare",
    "main",
    "model_of",
    "open_archive",
    "run",
    "summarize",
    "three_two_one",
]
