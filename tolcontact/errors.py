"""Every error that tolcontact raises on purpose, under one base class.

A message states what was expected, what was got (naming the part, locator, pair, option or file) and what to do.
"""

import difflib
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any, Protocol

from tolcontact.texts import shown

MIN_LIKENESS = 0.5  # of a name that another one may have been meant for


class NamedDeclaration(Protocol):
    """A declaration with its name and the line of the script."""

    @property
    def name(self) -> str: ...
    @property
    def declared_at(self) -> str: ...


def nearest_name(name: str, names: Iterable[str]) -> str:
    """Return the end of a message about a name that does not exist: which of some names is the nearest; empty if none is."""
    likeness = {candidate: difflib.SequenceMatcher(None, name, candidate).ratio() for candidate in names}
    nearest = max(likeness, key=lambda candidate: likeness[candidate], default="")
    return f'; the nearest name is "{shown(nearest)}"' if likeness.get(nearest, 0.0) >= MIN_LIKENESS else ""


def designation(kind: str, thing: NamedDeclaration) -> str:
    """Return how a message names a declared thing: its kind, its name and the line of the script."""
    return f'{kind} "{thing.name}"' + (f" ({thing.declared_at})" if thing.declared_at else "")


class TolcontactError(Exception):
    """Base of all errors that a user can cause and fix."""

    def __init__(self, message: str) -> None:
        super().__init__(shown(message))


class GeometryFault(TolcontactError):
    """A sentence on what is wrong with a shape; it is collected with the other faults of a model."""


class ModelError(TolcontactError):
    """A declared model is wrong. `faults` holds every fault found, not the first one only."""

    def __init__(self, model: str, faults: Sequence[str]) -> None:
        self.model = model
        self.faults = tuple(faults)
        count = "1 fault" if len(self.faults) == 1 else f"{len(self.faults)} faults"
        super().__init__("\n".join([f'model "{model}" has {count}:', *(f"  - {fault}" for fault in self.faults)]))

    def __reduce__(self) -> tuple[type, tuple[str, tuple[str, ...]]]:
        return ModelError, (self.model, self.faults)


class Faults(list[str]):
    """The faults of a model: sentences, each after the declaration that has it."""

    def attempt(self, place: str, build: Callable[..., Any], *arguments: Any) -> Any:
        """Return what `build` returns; None, and a fault at `place`, if the geometry does not allow it."""
        try:
            return build(*arguments)
        except GeometryFault as fault:
            self.append(f"{place}: {fault}")
            return None

    def refuse(self, model: str) -> None:
        """Raise ModelError if there are faults."""
        if self:
            raise ModelError(model, self)


class ScriptError(TolcontactError):
    """A model script cannot be read or has no usable `assembly()`."""


class OptionError(TolcontactError):
    """An option of a run (samples, seed, solver, method) has a value that cannot be used."""


def check_choice(option: str, value: object, choices: Collection[str]) -> None:
    """Raise OptionError unless the value of an option is one of its choices."""
    if value not in choices:
        raise OptionError(f"{option} is {value!r}; expected one of: {', '.join(choices)}")


class ArchiveError(TolcontactError):
    """An archive cannot be written, is damaged, or is not an archive of tolcontact."""


class ClusterError(TolcontactError):
    """Workers cannot be used: there are none, they have other versions, or they end."""


class ContactWarning(UserWarning):
    """Contact of a pair cannot be found where its faces end, or lies deeper between its points than tolerances allow."""


class NominalWarning(UserWarning):
    """Something in the nominal assembly is probably a mistake; the message begins with its kind, such as "[overlap]"."""
