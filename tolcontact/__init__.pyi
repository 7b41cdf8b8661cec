from .archive import model_of, open_archive
from .assembly import Assembly, Box, Brep, Facing, Inside, Locator, Mesh, Near, Tolerance, three_two_one
from .cli import command_line, main
from .comparing import compare
from .errors import TolcontactError
from .method import Method
from .running import build, run, summarize

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
