from .assembly import Assembly as Assembly
from .contact_pair import (
    ContactPair as ContactPair,
    Force as Force,
    Joint as Joint,
    Overlap as Overlap,
)
from .declarations import Station as Station
from .dependence import (
    Correlation as Correlation,
    Variable as Variable,
)
from .feature_tolerance import GeometricTolerance as GeometricTolerance
from .geometry import (
    UNITS as UNITS,
    Box as Box,
    Elastic as Elastic,
    Geometry as Geometry,
    Mesh as Mesh,
    Pin as Pin,
)
from .locator import (
    Location as Location,
    Locator as Locator,
    ThreeTwoOne as ThreeTwoOne,
    three_two_one as three_two_one,
)
from .measure import (
    Measure as Measure,
    stations as stations,
)
from .measurement import (
    Angle as Angle,
    AxisDistance as AxisDistance,
    Chain as Chain,
    Clearance as Clearance,
    Combination as Combination,
    Difference as Difference,
    Flush as Flush,
    Gap as Gap,
    LargestGap as LargestGap,
    Maximum as Maximum,
    Mean as Mean,
    MeanGap as MeanGap,
    Measurement as Measurement,
    Minimum as Minimum,
    Sum as Sum,
)
from .part import (
    DatumTargets as DatumTargets,
    Face as Face,
    Feature as Feature,
    Part as Part,
    Pattern as Pattern,
    Point as Point,
)
from .population import Population as Population
from .selection import (
    Brep as Brep,
    Cylinder as Cylinder,
    Facing as Facing,
    Inside as Inside,
    Largest as Largest,
    Near as Near,
    Picked as Picked,
    Triangles as Triangles,
)
from .size import (
    Form as Form,
    Size as Size,
)
from .stack import Stack as Stack
from .title_block import TitleBlock as TitleBlock
from .tolerance import Tolerance as Tolerance
from .toleranced import OUTSIDE as OUTSIDE
from .values import degrees as degrees
