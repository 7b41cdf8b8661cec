"""Labels, statuses and dimensions that archives, summaries and comparisons share; and the variables that they label."""

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

_DECLARATION = re.compile(r"(\w+) (\w+)\(([\w, ]*)\)")

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


def variable(
    declaration: str, long_name: str, units: str | None = None, attributes: dict[str, Any] | None = None
) -> ArchiveVariable:
    """Return the variable of a declaration in the notation of ncdump, as in "f8 measured(realization, state, measure)"."""
    kind, name, dims = _DECLARATION.fullmatch(declaration).groups()  # type: ignore[union-attr]
    return ArchiveVariable(
        name, tuple(dims.split(", ")) if dims else (), str if kind == "str" else kind, long_name, units, attributes or {}
    )


def label(name: str, long_name: str) -> ArchiveVariable:
    """Return the variable of texts that labels the dimension of its own name."""
    return ArchiveVariable(name, (name,), str, long_name)
