"""Places in a document, and the errors that state them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec

from tolcontact.tables import MAX_NUMBER

MAX_MESSAGE = 300
MAX_DEPTH = 20  # of values in a document
PLAIN_TYPES = {
    "int": "a whole number", "float": "a number", "str": "a text", "bool": "true or false", "array": "a list",
    "object": "named values", "null": "null",
}  # fmt: skip


class EntryError(Exception):
    """An entry of a document that a codec cannot read; the message begins with the place of the entry."""


@dataclass(frozen=True)
class Sources:
    """The data for reading a document.

    meshes   meshes by part
    folder   folder of the shape files; None for a document that may not name files
    file     name of the document's file
    parts    parts read before, by name
    inputs   largest number of inputs of an expression
    """

    meshes: Mapping[str, Any]
    folder: Path | None = None
    file: str = ""
    parts: dict[str, Any] = field(default_factory=dict)
    inputs: int = 0


@dataclass(frozen=True)
class Place:
    """A place in a document, such as `parts[2].name`.

    part     the part whose features an entry there may name
    record   the entry in a list of the document that it belongs to
    """

    sources: Sources
    path: str = ""
    part: Any = None
    record: Any = None

    def __getitem__(self, key: str | int) -> "Place":
        if isinstance(key, int):
            return replace(self, path=f"{self.path}[{key}]")
        if self.path.count(".") > MAX_DEPTH:
            raise self.error("its values are nested too deeply")
        return replace(self, path=f"{self.path}.{key}" if self.path else key)

    @property
    def line(self) -> str:
        """The text in place of a script line."""
        return f"{self.sources.file}: {self.path.rpartition('.')[2]}" if self.sources.file else ""

    def error(self, reason: str) -> EntryError:
        """Return the error for an entry that has a fault."""
        reason = reason if len(reason) <= MAX_MESSAGE else f"{reason[:MAX_MESSAGE]}..."
        return EntryError(f"{self.path}: {reason}" if self.path else reason)

    def mismatch(self, expected: str, value: Any) -> EntryError:
        """Return the error for an unexpected value."""
        if isinstance(value, Mapping):
            actual = "named values"
        elif isinstance(value, list | tuple):
            actual = f"a list of {len(value)}"
        elif isinstance(value, str):
            actual = repr(value) if len(value) <= 40 else "a text"
        elif isinstance(value, int) and abs(value) > MAX_NUMBER:
            actual = "a huge number"  # Python refuses to print whole numbers of more than 4300 digits
        else:
            actual = repr(value)
        return self.error(f"expected {expected}, got {actual}")

    def converted(self, value: Any, wire: Any) -> Any:
        """Return the value converted to the type `wire`. Raises EntryError if it has another structure."""
        try:
            return msgspec.convert(value, wire)
        except msgspec.ValidationError as error:
            reason, _, path = str(error).partition(" - at `$")
            path = self.path + path.removesuffix("`") if path else self.path
            raise replace(self, path=path.removeprefix("." * (not self.path))).error(_in_words(reason)) from error
        except UnicodeEncodeError as error:
            raise self.error("it has a text with half a character; expected Unicode") from error

    def checked(self, thing: Any) -> Any:
        """Return a declared thing. Raises EntryError if it has faults."""
        for fault in thing.faults() if hasattr(thing, "faults") else ():
            raise self.error(fault)
        return thing


def _in_words(reason: str) -> str:
    """Return a message of msgspec in the words of this package."""
    if reason.startswith("Object missing required field"):
        return "it has no " + reason.rpartition("field ")[2].replace("`", "'")
    if reason.startswith("Object contains unknown field"):
        return "unknown name " + reason.partition("field ")[2].replace("`", "'") + "; leave it out"

    def plain(match: re.Match[str]) -> str:
        names = match[1].split(" | ")
        return " or ".join(PLAIN_TYPES.get(name, name) for name in names if name != "int" or "float" not in names)

    return re.sub("`([^`]*)`", plain, reason[:1].lower() + reason[1:])
