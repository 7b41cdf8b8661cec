from .archive import model_of, open_archive
from .cli import command_line, main
from .compilation import Program
from .declaration import (
    Assembly,
    Box,
    Brep,
    ContactPair,
    Cylinder,
    Face,
    Facing,
    Force,
    Inside,
    Largest,
    Locator,
    Measure,
    Mesh,
    Near,
    Part,
    Point,
    Tolerance,
    three_two_one,
)
from .discretization import bodies_in, faces_in, parts_from
from .errors import (
    ArchiveError,
    ContactWarning,
    ModelError,
    OptionError,
    ScriptError,
    TolcontactError,
    UnitsWarning,
)
from .method import Method
from .simulation import simulate_blocks
from .version import __version__
from .vocabulary import Status
from .workflow import build, check, compare, run, summarize

__all__ = [
    "ArchiveError", "Assembly", "Box", "Brep", "ContactPair", "ContactWarning", "Cylinder", "Face", "Facing", "Force",
    "Inside", "Largest", "Locator", "Measure", "Mesh", "Method", "ModelError", "Near", "OptionError", "Part", "Point",
    "Program", "ScriptError", "Status", "TolcontactError", "Tolerance", "UnitsWarning", "__version__", "bodies_in", "build",
    "check", "command_line", "compare", "faces_in", "main", "model_of", "open_archive", "parts_from", "run",
    "simulate_blocks", "summarize", "three_two_one",
]  # fmt: skip
