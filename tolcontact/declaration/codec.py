"""Codecs: they write values into documents of plain values (dicts, lists, numbers, texts), and read them.

A record (see `tolcontact.declaration.record`) follows from a class: the names, types, defaults and checks of its fields are in
that class alone. msgspec checks the structure of an entry and describes it as JSON schema; `faults()` of the class checks its
values. Nothing is converted, and nothing in a document is run.
"""

import operator
from collections.abc import Callable, Mapping
from functools import reduce
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta

from tolcontact.declaration.place import Place
from tolcontact.tables import MAX_NUMBER

Document = dict[str, Any]


class Codec:
    """The writing and reading of values of a class.

    wire    type of the entries, for msgspec
    name    of its definition in the JSON schema; empty without one
    inner   codecs of parts of the entries
    """

    wire: Any = Any
    name = ""
    inner: "tuple[Codec, ...]" = ()

    def encode(self, value: Any, writing: Any) -> Any:
        """Return the entry of a value."""
        raise NotImplementedError

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        """Return the value of an entry. Raises EntryError if it has none."""
        raise NotImplementedError

    def fits(self, entry: Any) -> bool:
        """Return True for an entry that has the outline of this kind."""
        return True

    def holds(self, value: Any, writing: Any) -> bool:
        """Return True for a value that this codec writes."""
        return True

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
        self,
        annotation: Any,
        write: Callable[[Any, Any], Any] = lambda value, writing: value,
        read: Callable[[Any, Place], Any] = lambda value, place: value,
        when: Callable[[Any], bool] = lambda value: True,
        are_finite: bool = True,
    ) -> None:
        self.wire, self.write, self.read, self.when, self.are_finite = _wire(annotation), write, read, when, are_finite

    def encode(self, value: Any, writing: Any) -> Any:
        return _without_numpy(self.write(value, writing))

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        value = place.converted(entry, self.wire)
        if self.are_finite:
            _check_numbers(value, place)
        return self.read(value, place)

    def fits(self, entry: Any) -> bool:
        return not isinstance(entry, dict | list)

    def holds(self, value: Any, writing: Any) -> bool:
        return self.when(value)


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

    def encode(self, value: Any, writing: Any) -> Any:
        return [self.codec.encode(item, writing) for item in value]

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        entries = place.converted(entry, list[Any])
        return tuple(self.codec.decode(item, place[k], **arguments) for k, item in enumerate(entries))

    def fits(self, entry: Any) -> bool:
        return isinstance(entry, list)

    def holds(self, value: Any, writing: Any) -> bool:
        return isinstance(value, tuple)


class Choice(Codec):
    """One of several kinds; the first fitting codec reads an entry."""

    def __init__(self, name: str, expected: str, *codecs: Codec) -> None:
        self.name, self.wire, self.expected, self.inner = name, reference(name), expected, codecs

    def encode(self, value: Any, writing: Any) -> Any:
        return next(codec for codec in self.inner if codec.holds(value, writing)).encode(value, writing)

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        for codec in self.inner:
            if codec.fits(entry):
                return codec.decode(entry, place, **arguments)
        raise place.mismatch(self.expected, entry)

    def definition(self) -> Document:
        return {"anyOf": [msgspec.json.schema(codec.wire) for codec in self.inner]}


CODECS: dict[Any, Codec] = {}  # of declared classes and unions, for the fields of records; `entries` has all of them


def floats(value: Any, writing: Any) -> Any:
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
