from .archive import model_of, open_archive
from .cli import command_line, main
from .compilation import Program
from .declaration import (
    Assembly,
    Box,
    Brep,
    ContactPair,
    Face,
    Facing,
    Force,
    Inside,
    Locator,
    Measure,
    Mesh,
    Near,
    Part,
    Point,
    Tolerance,
    three_two_one,
)
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
    "ArchiveError", "Assembly", "Box", "Brep", "ContactPair", "ContactWarning", "Face", "Facing", "Force", "Inside", "Locator",
    "Measure", "Mesh", "Method", "ModelError", "Near", "OptionError", "Part", "Point", "Program", "ScriptError", "Status",
    "TolcontactError", "Tolerance", "UnitsWarning", "__version__", "build", "check", "command_line", "compare", "main",
    "model_of", "open_archive", "run", "simulate_blocks", "summarize", "three_two_one",
]  # fmt: skip
