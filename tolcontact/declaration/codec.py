"""Codecs: they write values into documents of plain values (dicts, lists, numbers, texts), and read them.

A `DocumentRecord` follows from a class: the names, the types and the defaults of its fields stand in that class alone. msgspec
checks the structure of an entry and describes it as JSON schema; `faults()` of the class checks its values. Nothing is
converted, and nothing in a document is run. References between declared things are codecs of `tolcontact.declaration.document`.
"""

import inspect
import operator
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration.place import MAX_NUMBER, EntryError, Place
from tolcontact.errors import TolcontactError


class Codec:
    """The writing and reading of the values of a class. `wire` is the type of their entries for msgspec."""

    wire: Any = Any
    cls: Any = object

    def encode(self, value: Any, writing: Any) -> Any:
        """Return the entry of a value."""
        raise NotImplementedError

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        """Return the value of an entry. Raises EntryError if it has none."""
        raise NotImplementedError

    def fits(self, entry: Any) -> bool:
        """Return True for an entry that has the outline of this kind."""
        return True

    def holds(self, value: Any) -> bool:
        """Return True for a value of this kind."""
        return isinstance(value, self.cls)


class Plain(Codec):
    """Numbers, texts and truth values, and tuples and mappings of them. Numbers are finite; whole ones stay whole.

    write   returns the entry of a value; by default the value itself
    read    returns the value of a valid entry; by default the entry itself
    """

    def __init__(
        self,
        annotation: Any,
        write: Callable[[Any, Any], Any] = lambda value, writing: value,
        read: Callable[[Any, Place], Any] = lambda value, place: value,
    ) -> None:
        self.wire, self.write, self.read = _wire(annotation), write, read

    def encode(self, value: Any, writing: Any) -> Any:
        return self.write(value, writing)

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        value = place.converted(entry, self.wire)
        _check_numbers(value, place)
        return self.read(value, place)

    def fits(self, entry: Any) -> bool:
        return not isinstance(entry, dict | list)


def _check_numbers(value: Any, place: Place) -> None:
    if isinstance(value, int | float) and not abs(value) <= MAX_NUMBER:
        raise place.mismatch("a finite number", value)
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
    if get_origin(annotation) in (Union, types.UnionType):
        return reduce(operator.or_, map(_wire, arguments))
    if get_origin(annotation) in (tuple, list):
        return get_origin(annotation)[tuple(item if item is ... else _wire(item) for item in arguments)]
    if isinstance(get_origin(annotation), type) and issubclass(get_origin(annotation), Mapping):
        return dict[str, _wire(arguments[1])]  # type: ignore[misc]
    return annotation


class Items(Codec):
    """Lists of things of one kind; `count` is their length, or 0 for any length."""

    cls = tuple

    def __init__(self, codec: Codec, count: int = 0) -> None:
        self.codec, self.count, self.wire = codec, count, list[codec.wire]  # type: ignore[name-defined]

    def encode(self, value: Any, writing: Any) -> Any:
        return [self.codec.encode(item, writing) for item in value]

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        entries = place.converted(entry, list[Any])
        if self.count and len(entries) != self.count:
            raise place.mismatch(f"a list of {self.count}", entries)
        return tuple(self.codec.decode(item, place[k], **arguments) for k, item in enumerate(entries))

    def fits(self, entry: Any) -> bool:
        return isinstance(entry, list)


class Named(Codec):
    """Codecs whose entries have a definition in the JSON schema."""

    registry: "dict[str, Named]" = {}  # noqa: RUF012 filled by all instances
    struct: Any

    def __init__(self, name: str) -> None:
        self.registry[name] = self
        self.name, self.wire = name, Annotated[Any, Meta(extra_json_schema={"$ref": f"#/$defs/{name}"})]

    def definition(self) -> dict[str, Any]:
        """Return the JSON schema of an entry."""
        schemas = msgspec.json.schema_components([self.struct], ref_template="#/$defs/{name}")[1]
        return next(schema for schema in schemas.values())


class Choice(Named):
    """One of several kinds; the first fitting codec reads an entry."""

    def __init__(self, name: str, expected: str, *codecs: Codec) -> None:
        super().__init__(name)
        self.expected, self.codecs = expected, codecs

    def encode(self, value: Any, writing: Any) -> Any:
        return next(codec for codec in self.codecs if codec.holds(value)).encode(value, writing)

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        for codec in self.codecs:
            if codec.fits(entry):
                return codec.decode(entry, place, **arguments)
        raise place.mismatch(self.expected, entry)

    def definition(self) -> dict[str, Any]:
        return {"anyOf": [msgspec.json.schema(codec.wire) for codec in self.codecs]}


@dataclass(frozen=True)
class Inline:
    """A field whose value is spread over several keys of its record.

    keys     types of the keys, for msgspec
    encode   returns the entries of a thing under these keys
    decode   returns the value of the field from these entries; UNSET leaves it to the class
    """

    keys: Mapping[str, Any]
    encode: Callable[[Any, Any], dict[str, Any]]
    decode: Callable[[Mapping[str, Any], Place], Any]


@dataclass(frozen=True)
class Field:
    """The place of a field, or of several as a list, in the entry of a record."""

    key: str
    names: tuple[str, ...]
    codec: Any  # a Codec, or Inline
    default: Any  # inspect.Parameter.empty if there is none
    is_omitted: bool  # if it has its default value

    def value(self, thing: Any) -> Any:
        """Return the value of a thing in this field."""
        return getattr(thing, self.names[0]) if len(self.names) == 1 else tuple(getattr(thing, name) for name in self.names)


class DocumentRecord(Named):
    """Things of one class: an entry has a key for each field, or for those in `keys`.

    keys     in the order of the document: "name", "key=field", "key=field+field" for a list of several fields; "name?" is
             left out if it has its default value
    kind     value of an entry under "kind"
    mark     key that distinguishes these entries from others
    build    makes a thing of its fields, if the class itself does not
    codecs   codecs of fields whose type does not determine them
    """

    def __init__(
        self,
        cls: Any,
        keys: str,
        *,
        kind: str = "",
        mark: str = "",
        name: str = "",
        build: Callable[..., Any] | None = None,
        **codecs: Codec | Inline,
    ) -> None:
        super().__init__(name or cls.__name__)
        self.cls, self.kind, self.mark, self.build = cls, kind, mark, build or cls
        parameters, hints = inspect.signature(cls).parameters, get_type_hints(cls, include_extras=True)
        self.fields = []
        for token in keys.split():
            key, _, joined = token.removesuffix("?").partition("=")
            names = tuple((joined or key).split("+"))
            codec = codecs.get(key) or _codec_of(*(hints[name] for name in names))
            default = parameters[names[0]].default if names[0] in parameters else inspect.Parameter.empty
            self.fields.append(Field(key, names, codec, default, token.endswith("?")))
        self.struct = msgspec.defstruct(self.name, list(self._struct_fields()), forbid_unknown_fields=True, kw_only=True)

    def _struct_fields(self) -> Iterator[tuple[str, Any] | tuple[str, Any, Any]]:
        if self.kind:
            yield "kind", Annotated[str, Meta(extra_json_schema={"const": self.kind})]
        for member in self.fields:
            if isinstance(member.codec, Inline):
                yield from ((key, wire | UnsetType, UNSET) for key, wire in member.codec.keys.items())
            elif member.default is inspect.Parameter.empty:
                yield member.key, member.codec.wire
            else:
                yield member.key, member.codec.wire | UnsetType, UNSET

    def encode(self, value: Any, writing: Any) -> Any:
        entry = {"kind": self.kind} if self.kind else {}
        for member in self.fields:
            if isinstance(member.codec, Inline):
                entry |= member.codec.encode(value, writing)
            elif not (member.is_omitted and member.value(value) == member.default):
                entry[member.key] = member.codec.encode(member.value(value), writing)
        return entry

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        struct = place.converted(entry, self.struct)
        place = replace(place, record=struct)
        for member in self.fields:
            if isinstance(member.codec, Inline):
                entries = {key: item for key in member.codec.keys if (item := getattr(struct, key)) is not UNSET}
                value = member.codec.decode(entries, place)
            else:
                item = getattr(struct, member.key)
                value = UNSET if item is UNSET else member.codec.decode(item, place[member.key])
            if value is not UNSET:
                arguments |= zip(member.names, [value] if len(member.names) == 1 else value, strict=True)
            if member.names[0] == "part" and "part" in arguments:
                place = replace(place, part=arguments["part"])
            if member.key == "declared_at":
                arguments.setdefault("declared_at", place.line)
        try:
            thing = self.build(**arguments)
        except (TypeError, ValueError, TolcontactError) as error:
            raise self._fault(str(error), place) from error
        for fault in thing.faults() if hasattr(thing, "faults") else ():
            raise self._fault(fault, place)
        return thing

    def _fault(self, fault: str, place: Place) -> EntryError:
        """Return the error for a fault of a thing; its first word may be a field, which then is its place."""
        keys = [member.key for member in self.fields if fault.split(" ", maxsplit=1)[0] in member.names]
        return (place[keys[0]] if keys else place).error(fault)

    def fits(self, entry: Any) -> bool:
        if self.kind:
            return isinstance(entry, dict) and entry.get("kind") == self.kind
        return isinstance(entry, dict) and (not self.mark or self.mark in entry)

    def definition(self) -> dict[str, Any]:
        schema = super().definition()
        for member in self.fields:
            if member.default is None or isinstance(member.default, str | int | float | tuple):
                schema["properties"].get(member.key, {})["default"] = member.default
        return schema


class Optional(Codec):
    """Things that may be missing: their entry is then null."""

    def __init__(self, codec: Codec) -> None:
        self.codec, self.wire = codec, codec.wire | None

    def encode(self, value: Any, writing: Any) -> Any:
        return None if value is None else self.codec.encode(value, writing)

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        return None if entry is None else self.codec.decode(entry, place, **arguments)


CODECS: dict[Any, Codec] = {}  # of declared classes, by class


def _codec_of(*annotations: Any) -> Codec:
    """Return the codec of a field from its type; of several fields that of their list."""
    if len(annotations) > 1:
        codec = CODECS.get(annotations[0])
        return Items(codec, len(annotations)) if codec else Plain(tuple[annotations])  # type: ignore[valid-type]
    annotation, arguments = annotations[0], get_args(annotations[0])
    if annotation in CODECS:
        return CODECS[annotation]
    declared = [CODECS[argument] for argument in arguments if argument in CODECS]
    if not declared:
        return Plain(annotation)
    return Items(declared[0]) if get_origin(annotation) is tuple else Optional(declared[0])


def definitions() -> dict[str, Any]:
    """Return the JSON schemas of all named entries."""
    return {name: _simplified(codec.definition()) for name, codec in sorted(Named.registry.items())}


def _simplified(schema: Any) -> Any:
    """Return a schema in which "integer or number" is "number"."""
    if isinstance(schema, list | tuple):
        items = [_simplified(item) for item in schema]
        return [item for item in items if item != {"type": "integer"}] if {"type": "number"} in items else items
    if not isinstance(schema, dict):
        return schema
    schema = {key: _simplified(value) for key, value in schema.items()}
    alternatives = schema.get("anyOf", ())
    return {**alternatives[0], **{k: v for k, v in schema.items() if k != "anyOf"}} if len(alternatives) == 1 else schema
