from .archive import model_of, open_archive
from .cli import command_line, main
from .declaration import Assembly, Box, Brep, Facing, Inside, Locator, Mesh, Near, Tolerance, three_two_one
from .errors import TolcontactError
from .method import Method
from .workflow import build, compare, run, summarize

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
    "command_line",
    "compare",
    "main",
    "model_of",
    "open_archive",
    "run",
    "summarize",
    "three_two_one",
]
