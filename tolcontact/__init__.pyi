from . import plot as plot
from .analyses.allocate import allocate as allocate
from .analyses.contributions import contributions as contributions
from .analyses.relocate import relocate as relocate
from .analyses.seating import seating as seating
from .analyses.sensitivities import sensitivities as sensitivities
from .analyses.tails import tails as tails
from .analyses.worst_case import worst_case as worst_case
from .archive import model_of as model_of
from .cli import command_line as command_line, main as main
from .compilation import Program as Program
from .declaration import (
    Angle as Angle,
    Angularity as Angularity,
    Assembly as Assembly,
    AxisDistance as AxisDistance,
    Box as Box,
    Brep as Brep,
    CircularRunout as CircularRunout,
    Clearance as Clearance,
    Coaxiality as Coaxiality,
    ContactPair as ContactPair,
    Cylinder as Cylinder,
    Cylindricity as Cylindricity,
    DatumTargets as DatumTargets,
    Difference as Difference,
    Face as Face,
    Facing as Facing,
    Feature as Feature,
    Flatness as Flatness,
    Flush as Flush,
    Force as Force,
    Form as Form,
    Gap as Gap,
    Inside as Inside,
    Joint as Joint,
    Largest as Largest,
    LargestGap as LargestGap,
    LineProfile as LineProfile,
    Locator as Locator,
    Maximum as Maximum,
    Mean as Mean,
    MeanGap as MeanGap,
    Measure as Measure,
    Measurement as Measurement,
    Mesh as Mesh,
    Minimum as Minimum,
    Near as Near,
    Parallelism as Parallelism,
    Part as Part,
    Pattern as Pattern,
    Perpendicularity as Perpendicularity,
    Pin as Pin,
    Point as Point,
    Position as Position,
    Profile as Profile,
    Roundness as Roundness,
    Size as Size,
    Station as Station,
    Straightness as Straightness,
    Sum as Sum,
    Symmetry as Symmetry,
    TitleBlock as TitleBlock,
    Tolerance as Tolerance,
    TotalRunout as TotalRunout,
    Variable as Variable,
    degrees as degrees,
    stations as stations,
    three_two_one as three_two_one,
)
from .errors import (
    ArchiveError as ArchiveError,
    ClusterError as ClusterError,
    ContactWarning as ContactWarning,
    ModelError as ModelError,
    NominalWarning as NominalWarning,
    OptionError as OptionError,
    ScriptError as ScriptError,
    TolcontactError as TolcontactError,
)
from .fasteners import fasten as fasten
from .geometry import bodies_in as bodies_in, faces_in as faces_in, parts_from as parts_from
from .method import Method as Method
from .pmi import features_from_pmi as features_from_pmi, read_pmi as read_pmi
from .simulation import simulate_blocks as simulate_blocks
from .version import __version__ as __version__
from .vocabulary import Status as Status
from .workflow import (
    build as build,
    check as check,
    compare as compare,
    compare_runs as compare_runs,
    open_archive as open_archive,
    run as run,
    simulate as simulate,
    study as study,
    summarize as summarize,
    write_model as write_model,
)
