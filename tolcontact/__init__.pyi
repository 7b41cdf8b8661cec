from . import plot
from .analyses.allocate import allocate
from .analyses.contributions import contributions
from .analyses.relocate import relocate
from .analyses.sensitivities import sensitivities
from .analyses.tails import tails
from .analyses.worst_case import worst_case
from .archive import model_of
from .cli import command_line, main
from .compilation import Program
from .declaration import (
    Angularity,
    Assembly,
    Box,
    Brep,
    CircularRunout,
    Coaxiality,
    ContactPair,
    Cylinder,
    Face,
    Facing,
    Feature,
    Flatness,
    Force,
    Inside,
    Largest,
    LineProfile,
    Locator,
    Measure,
    Mesh,
    Near,
    Parallelism,
    Part,
    Perpendicularity,
    Point,
    Position,
    Profile,
    Size,
    Symmetry,
    Tolerance,
    TotalRunout,
    Variable,
    three_two_one,
)
from .errors import (
    ArchiveError,
    ClusterError,
    ContactWarning,
    ModelError,
    OptionError,
    ScriptError,
    TolcontactError,
    UnitsWarning,
)
from .geometry import bodies_in, faces_in, parts_from
from .method import Method
from .simulation import simulate_blocks
from .version import __version__
from .vocabulary import Status
from .workflow import (
    build,
    check,
    check_population,
    compare,
    compare_runs,
    open_archive,
    run,
    simulate,
    study,
    summarize,
    write_model,
)

__all__ = [
    "Angularity", "ArchiveError", "Assembly", "Box", "Brep", "CircularRunout", "ClusterError", "Coaxiality", "ContactPair",
    "ContactWarning", "Cylinder", "Face", "Facing", "Feature", "Flatness", "Force", "Inside", "Largest", "LineProfile",
    "Locator", "Measure", "Mesh", "Method", "ModelError", "Near", "OptionError", "Parallelism", "Part", "Perpendicularity",
    "Point", "Position", "Profile", "Program", "ScriptError", "Size", "Status", "Symmetry", "TolcontactError", "Tolerance",
    "TotalRunout", "UnitsWarning", "Variable", "__version__", "allocate", "bodies_in", "build", "check", "check_population",
    "command_line", "compare", "compare_runs", "contributions", "faces_in", "main", "model_of", "open_archive", "parts_from",
    "plot", "relocate", "run", "sensitivities", "simulate", "simulate_blocks", "study", "summarize", "tails", "three_two_one",
    "worst_case", "write_model",
]  # fmt: skip
