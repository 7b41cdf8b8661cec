from . import (
    analyses as analyses,
    declaration as declaration,
    errors as errors,
    io as io,
    plot as plot,
    select as select,
    testing as testing,
)
from .cli import main as main
from .compilation import Program as Program
from .declaration import (
    Angle as Angle,
    Assembly as Assembly,
    AxisDistance as AxisDistance,
    Box as Box,
    Chain as Chain,
    Clearance as Clearance,
    DatumTargets as DatumTargets,
    Difference as Difference,
    Flush as Flush,
    Form as Form,
    Gap as Gap,
    LargestGap as LargestGap,
    Locator as Locator,
    Maximum as Maximum,
    Mean as Mean,
    MeanGap as MeanGap,
    Mesh as Mesh,
    Minimum as Minimum,
    Part as Part,
    Pin as Pin,
    Size as Size,
    Stack as Stack,
    Sum as Sum,
    TitleBlock as TitleBlock,
    Tolerance as Tolerance,
    Variable as Variable,
    degrees as degrees,
    stations as stations,
    three_two_one as three_two_one,
)
from .declaration.feature_tolerance import (
    Angularity as Angularity,
    CircularRunout as CircularRunout,
    Coaxiality as Coaxiality,
    Cylindricity as Cylindricity,
    Flatness as Flatness,
    LineProfile as LineProfile,
    Parallelism as Parallelism,
    Perpendicularity as Perpendicularity,
    Position as Position,
    Profile as Profile,
    Roundness as Roundness,
    Straightness as Straightness,
    Symmetry as Symmetry,
    TotalRunout as TotalRunout,
)
from .errors import (
    ModelError as ModelError,
    NominalWarning as NominalWarning,
    OptionError as OptionError,
    TolcontactError as TolcontactError,
)
from .fasteners import fasten as fasten
from .method import Method as Method
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
    summarize as summarize,
)
