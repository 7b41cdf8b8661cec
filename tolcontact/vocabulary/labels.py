"""Labels, statuses and dimensions, and the variables of surfaces and of what is checked against them."""

import enum
import re
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

CONVENTIONS = "CF-1.11"
FORMAT = 1  # of the archive
StateName = Literal["raw", "corrected"]
STATES = get_args(StateName)
RAW, CORRECTED = 0, 1  # their positions
ComponentName = Literal["x", "y", "z", "magnitude"]
COMPONENTS = get_args(ComponentName)
AXES = COMPONENTS[:3]

REALIZATION, STATE, PART, PAIR, MEASURE = "realization", "state", "part", "pair", "measure"
AXIS, BODY_AXIS, POINT, LOCATOR = "axis", "body_axis", "point", "locator"
FACE, CORNER, COMPONENT, BOUND = "face", "corner", "component", "bound"
CONTRIBUTOR, FEATURE_FACE, FREEDOM = "contributor", "feature_face", "freedom"
NUMBER, CHECKED, BY_OBJECTIVE = "number", "checked", "by_objective"
BLOCK_ROWS = 4096  # realizations of a block at most: they are simulated together
PIECE_ROWS = 24 * BLOCK_ROWS  # realizations that are read at once
SOLVER, RUN, STATUS_MEANING, EXTENT = "solver", "run", "status_meaning", "extent"
BOUNDS = ("lower", "upper")
Plan = Literal["monte-carlo", "latin hypercube", "sobol"]  # sampling plans
MONTE_CARLO, LATIN_HYPERCUBE, SOBOL = PLANS = get_args(Plan)
REPLICATE = 256  # realizations that the last two draw together, independent of all others
# Attributes of archives and summaries: the largest depth [mm] in the test for interference, and what is not tested.
INTERFERENCE_DEPTH, NOT_WATCHED = "interference_depth", "not_watched"
STANDARD = "standard"  # attribute of archives and summaries: of the drawings, if a model states it
METHOD_ATTRIBUTES = ("resolution", "objective", "active_set")  # of archives, summaries and analyses
Kept = Literal["measures", "poses", "all"]
KEPT = get_args(Kept)
TITLE_PREFIX = "document_"  # of the attributes of an archive that hold its title block
FieldChoice = Literal["some", "all", "none"]  # or a number
FIELD_CHOICES = get_args(FieldChoice)

_DECLARATION = re.compile(r"(\w+) (\w+)\(([\w, ]*)\)(?: \[(.+)\])?")

UNCHECKED = -1  # instead of the number of a realization that was checked
ROUNDED = 1e-9  # mm: less penetration than this is rounding


class Status(enum.IntEnum):
    """The outcome of a realization. Archives hold these numbers."""

    UNTOUCHED = 0  # no contact point penetrates: the corrected state is the raw state, to the last bit
    RESOLVED = 1  # contact moved parts, and the QP's optimality conditions hold
    NOT_CONVERGED = 2  # they do not hold, or one linear step cannot open all gaps: penetration remains
    NOT_ASSEMBLABLE = 3  # no pose without penetration was found near; the pose is the one of least penetration
    DOUBTFUL = 4  # the conditions hold, but only far from the raw pose: beyond the limits of the method, so not certified


STATUS_MEANINGS = tuple(status.name.lower() for status in Status)
CERTIFIED = (Status.UNTOUCHED, Status.RESOLVED)
UNRESOLVED = (Status.NOT_CONVERGED, Status.NOT_ASSEMBLABLE, Status.DOUBTFUL)


@dataclass(frozen=True, eq=False)
class ArchiveVariable:
    """A variable of an archive or a result.

    kind    NumPy type, or str
    units   None for labels, for texts, and where the model determines the units
    """

    name: str
    dims: tuple[str, ...]
    kind: Any
    long_name: str
    units: str | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def all_attributes(self) -> dict[str, Any]:
        """The attributes in a file or dataset: description, units if there are any, and others."""
        units = {} if self.units is None else {"units": self.units}
        return {"long_name": self.long_name, **units, **self.attributes}

    def entry(self, values: Any, **attributes: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        """Return dimensions, values and attributes as xarray.Dataset takes them; `attributes` replace or add to its own."""
        return self.dims, values, {**self.all_attributes, **attributes}


def variable(declaration: str, long_name: str, attributes: dict[str, Any] | None = None) -> ArchiveVariable:
    """Return the variable of a declaration in the notation of ncdump, as in "f8 gap_min(realization, state, pair) [mm]"."""
    kind, name, dims, units = _DECLARATION.fullmatch(declaration).groups()  # type: ignore[union-attr]
    labels = tuple(dims.split(", ")) if dims else ()
    return ArchiveVariable(name, labels, str if kind == "str" else kind, long_name, units, attributes or {})


def label(name: str, long_name: str) -> ArchiveVariable:
    """Return the variable of texts that labels the dimension of its own name."""
    return ArchiveVariable(name, (name,), str, long_name)


# Surfaces.
SurfaceKind = Literal["plane", "cylinder", "cone", "sphere", "torus"]
SURFACE_KINDS = get_args(SurfaceKind)  # in the order of their numbers
KINDS_MEAN = {"flag_values": list(range(len(SURFACE_KINDS))), "flag_meanings": " ".join(SURFACE_KINDS)}


def surface_variables(prefix: str, dim: str, surface: str) -> dict[str, ArchiveVariable]:
    """Return the variables of a surface, by the names of the attributes that they hold."""
    return {
        "kind": variable(f"i1 {prefix}_kind({dim}) [1]", f"kind of {surface}; -1: not known", KINDS_MEAN),
        "origin": variable(
            f"f8 {prefix}_point({dim}, axis) [mm]", f"a point of {surface}, if it is a plane, or its centre; of a cone the apex"
        ),
        "axis": variable(
            f"f8 {prefix}_axis({dim}, axis) [1]", f"unit normal or axis of {surface}; of a cone from the apex inward"
        ),
        "radius": variable(
            f"f8 {prefix}_radius({dim}) [mm]", f"radius of {surface}; of a torus to the centre line of its tube"
        ),
        "minor": variable(f"f8 {prefix}_tube_radius({dim}) [mm]", f"radius of the tube, if {surface} is a torus"),
        "angle": variable(f"f8 {prefix}_angle({dim}) [rad]", f"angle between axis and {surface}, if it is a cone"),
    }


# Clashes: parts without declared contact that lie in each other.
CLASHES = variable(
    "i2 clashes(realization) [1]",
    "number of pairs of parts without declared contact that lie in each other in the corrected state; -1: not tested",
)
CLASH_DEPTH = variable(
    "f8 clash_depth(realization) [mm]",
    "how deep the parts of the deepest of these pairs lie in each other; without such a pair, parts with declared contact "
    "whose answer is doubtful; 0: no parts; NaN: not measured",
)
CLASH_PART = variable(
    "i2 clash_part(realization) [1]", "index along `part` of the first of the two parts that clash_depth is of; -1: no parts"
)
CLASH_OTHER = variable("i2 clash_other(realization) [1]", "index along `part` of the second of these parts; -1: no parts")

# Checks of realizations against the surfaces.
CHECKED_REALIZATION = variable("i8 realization_checked(checked) [1]", "number of a realization that was checked; -1: none")
SURFACE_PENETRATION = variable(
    "f8 surface_penetration(checked, pair) [mm]",
    "largest depth of one face in the other part's body in the corrected state, at points much denser than contact points; "
    "NaN: one-sided locators, which have no faces",
)
BESIDE = variable(
    "f8 beside(checked, pair) [mm]",
    "how far contact points that touch lie outside the rim of the reference face; NaN if that is not known",
)
FALSE_CONTACT = variable(
    "f8 false_contact(checked, pair) [mm]",
    "how deep contact points lay inside in the raw state, where the surfaces themselves were apart; NaN if that is not known",
)
NOTICED_SHARE = 0.01  # of the smallest tolerance range: deeper penetration or false contact of surfaces is reported
CONTACTS = variable(
    "f8 contacts(checked, pair) [1]", "number of contact points that touch in the corrected state; NaN if that is not known"
)
CONTACTS_ENDED = variable(
    "f8 contacts_ended(checked, pair) [1]", "number of these that touch a plane where its face has ended; NaN: not known"
)
AT_RANDOM = variable(
    "i1 at_random(checked) [1]",
    "1: the realization was chosen at random; 0: for the deepest penetration, or the most active points",
)
SURFACE = (
    CHECKED_REALIZATION, SURFACE_PENETRATION, BESIDE, FALSE_CONTACT, CONTACTS, CONTACTS_ENDED, AT_RANDOM,
)  # fmt: skip

# Attributes, and the coordinates that files store.
CORRELATIONS = (
    "correlations"  # attribute of archives and summaries: lines on coefficients of each kind, sides of means and few parts
)
KNOWN_FROM_FEW = "known from few parts, which intervals of measurements include"  # in these lines, before the contributors
FEW_LEFT_OUT = 'known from few parts, which no interval includes without deviations (keep="all")'  # the same in summaries
STORED_COORDINATES = "stored_coordinates"  # attribute of archives and summaries: how exactly files store which parts
STATED_ERROR_SHARE = 1e-4  # of the smallest tolerance range: a larger error of coordinates in files is reported

COORDINATE_SPACING = variable(
    "f8 coordinate_spacing(axis) [mm]", "spacing of the coordinates that the file of the mesh can store"
)
COORDINATE_ERROR = variable(
    "f8 coordinate_error(pair) [mm]",
    "error of coordinates in the files of a pair; its gaps count larger by it, also in gap_min and in reference_point",
)
