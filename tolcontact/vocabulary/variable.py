"""A variable, with its dimensions, units and description (CF conventions)."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, eq=False)
class ArchiveVariable:
    """A variable of an archive: `kind` is a NumPy type, or str; `units=None` marks labels and texts."""

    name: str
    dims: tuple[str, ...]
    kind: Any
    long_name: str
    units: str | None = None
    attributes: dict[str, Any] = field(default_factory=dict)

    @property
    def all_attributes(self) -> dict[str, Any]:
        units = {} if self.units is None else {"units": self.units}
        return {"long_name": self.long_name, **units, **self.attributes}


def label(name: str, long_name: str) -> ArchiveVariable:
    """The variable of texts that labels a dimension, and is called like it."""
    return ArchiveVariable(name, (name,), str, long_name)
