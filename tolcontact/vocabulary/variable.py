"""A variable, with its dimensions, units and description (CF conventions)."""

from dataclasses import dataclass, field
from typing import Any


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


def label(name: str, long_name: str) -> ArchiveVariable:
    """Return the variable of texts that labels the dimension of its own name."""
    return ArchiveVariable(name, (name,), str, long_name)
