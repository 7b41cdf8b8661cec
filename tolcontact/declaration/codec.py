"""Codecs: they write values into documents of plain values (dicts, lists, numbers, texts), and read them.

A record (see `tolcontact.declaration.record`) follows from a class: the names, types, defaults and checks of its fields are in
that class alone. msgspec checks the structure of an entry and describes it as JSON schema; `faults()` of the class checks its
values. Nothing is converted, and nothing in a document is run.
"""

import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta

from tolcontact.tables import MAX_NUMBER

Document = dict[str, Any]
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
class Writing:
    """The data for writing a document.

    triangles   the indices of the triangles of a face
    tapes       the steps of the users' own expressions, by measure
    folder      the folder of a JSON model; None for an archive
    """

    triangles: Callable[[Any], list[int]]
    tapes: Mapping[str, tuple[tuple[Any, ...], ...]]
    folder: Path | None = None


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
        elif isinstance(value, str) and len(value) > 40:
            actual = "a text"
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


class Codec:
    """The writing and reading of values of a class.

    wire    type of the entries, for msgspec
    name    of its definition in the JSON schema; empty without one
    inner   codecs of parts of the entries
    """

    wire: Any = Any
    name = ""
    inner: "tuple[Codec, ...]" = ()

    def encode(self, value: Any, writing: Writing) -> Any:
        """Return the entry of a value."""
        raise NotImplementedError

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        """Return the value of an entry. Raises EntryError if it has none."""
        raise NotImplementedError

    def fits(self, entry: Any) -> bool:
        """Return True for an entry that has the outline of this kind."""
        raise NotImplementedError

    def holds(self, value: Any, writing: Writing) -> bool:
        """Return True for a value that this codec writes."""
        raise NotImplementedError

    def definition(self) -> Document:
        """Return the JSON schema of an entry; other schemas refer to it by the name."""
        raise NotImplementedError


def reference(name: str) -> Any:
    """Return the type of entries whose JSON schema has a definition with a name."""
    return Annotated[Any, Meta(extra_json_schema={"$ref": f"#/$defs/{name}"})]


class Plain(Codec):
    """Numbers, texts and truth values, and tuples and mappings of them. Whole numbers stay whole.

    write        returns the entry of a value; by default the value itself
    read         returns the value of a valid entry; by default the entry itself
    when         condition of a value that is written so
    are_finite   whether the numbers have to be finite
    """

    def __init__(
        self, annotation: Any, write: Callable[[Any, Any], Any] = lambda value, writing: value,
        read: Callable[[Any, Place], Any] = lambda value, place: value,
        when: Callable[[Any, Any], bool] = lambda value, writing: True, are_finite: bool = True,
    ) -> None:  # fmt: skip
        self.wire, self.write, self.read, self.when, self.are_finite = _wire(annotation), write, read, when, are_finite

    def encode(self, value: Any, writing: Writing) -> Any:
        return _without_numpy(self.write(value, writing))

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        value = place.converted(entry, self.wire)
        if self.are_finite:
            _check_numbers(value, place)
        return self.read(value, place)

    def fits(self, entry: Any) -> bool:
        return not isinstance(entry, dict | list)

    def holds(self, value: Any, writing: Writing) -> bool:
        return self.when(value, writing)


def _without_numpy(value: Any) -> Any:
    """Return an entry whose numbers are Python's own, as JSON takes them."""
    if isinstance(value, tuple | list):
        return [_without_numpy(item) for item in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _check_numbers(value: Any, place: Place) -> None:
    if isinstance(value, int | float) and not abs(value) <= MAX_NUMBER:
        raise place.mismatch(f"a number up to {MAX_NUMBER:g}", value)
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list | tuple) else ()
    for key, item in items:
        _check_numbers(item, place[key])


def _wire(annotation: Any) -> Any:
    """Return the type of msgspec for an annotation: a float may be whole, a sequence is a list."""
    arguments = get_args(annotation)
    if annotation is float:
        return int | float
    if get_origin(annotation) is Annotated:
        return Annotated[(_wire(arguments[0]), *arguments[1:])]  # type: ignore[return-value]
    if get_origin(annotation) in (Union, UnionType):
        return reduce(operator.or_, map(_wire, arguments))
    if get_origin(annotation) in (tuple, list):
        return get_origin(annotation)[tuple(item if item is ... else _wire(item) for item in arguments)]
    if isinstance(get_origin(annotation), type) and issubclass(get_origin(annotation), Mapping):
        return dict[str, _wire(arguments[1])]  # type: ignore[misc]
    return annotation


class Items(Codec):
    """Lists of things of one kind; `count` is their length, or 0 for any length."""

    def __init__(self, codec: Codec, count: int = 0) -> None:
        self.codec, self.inner = codec, (codec,)
        self.wire = tuple[(codec.wire,) * count] if count else list[codec.wire]  # type: ignore[misc, name-defined]

    def encode(self, value: Any, writing: Writing) -> Any:
        return [self.codec.encode(item, writing) for item in value]

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        entries = place.converted(entry, list[Any])
        return tuple(self.codec.decode(item, place[k], **arguments) for k, item in enumerate(entries))

    def fits(self, entry: Any) -> bool:
        return isinstance(entry, list)

    def holds(self, value: Any, writing: Writing) -> bool:
        return isinstance(value, tuple)


class Choice(Codec):
    """One of several kinds; the first fitting codec reads an entry."""

    def __init__(self, name: str, expected: str, *codecs: Codec) -> None:
        self.name, self.wire, self.expected, self.inner = name, reference(name), expected, codecs

    def encode(self, value: Any, writing: Writing) -> Any:
        return next(codec for codec in self.inner if codec.holds(value, writing)).encode(value, writing)

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        for codec in self.inner:
            if codec.fits(entry):
                return codec.decode(entry, place, **arguments)
        raise place.mismatch(self.expected, entry)

    def definition(self) -> Document:
        return {"anyOf": [msgspec.json.schema(codec.wire) for codec in self.inner]}


CODECS: dict[Any, Codec] = {}  # of declared classes and unions, for the fields of records; `entries` has all of them


def floats(value: Any, writing: Writing) -> Any:
    """Return a number as a float; also in tuples and mappings. Scripts may have integers, or NumPy numbers."""
    if isinstance(value, Mapping):
        return {key: float(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [None if item is None else float(item) for item in value]
    return float(value)


def named_codecs(*codecs: Codec) -> dict[str, Codec]:
    """Return all codecs with names in these codecs, by name."""
    named: dict[str, Codec] = {}
    waiting = list(codecs)
    while waiting:
        codec = waiting.pop()
        if codec.name not in named:
            waiting += codec.inner
            named |= {codec.name: codec} if codec.name else {}
    return named


def definitions(*codecs: Codec) -> dict[str, Any]:
    """Return the JSON schemas of all entries with names that codecs refer to."""
    return {name: _simplified(codec.definition()) for name, codec in sorted(named_codecs(*codecs).items())}


def _simplified(schema: Any) -> Any:
    """Return a schema with "number" in place of "integer or number"."""
    if isinstance(schema, list | tuple):
        items = [_simplified(item) for item in schema]
        return [item for item in items if item != {"type": "integer"}] if {"type": "number"} in items else items
    if not isinstance(schema, dict):
        return schema
    schema = {key: _simplified(value) for key, value in schema.items()}
    alternatives = schema.get("anyOf", ())
    return {**alternatives[0], **{k: v for k, v in schema.items() if k != "anyOf"}} if len(alternatives) == 1 else schema
