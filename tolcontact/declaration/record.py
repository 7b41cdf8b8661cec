"""Records: entries of declared things that follow from the fields of their classes."""

import inspect
import operator
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import cached_property, reduce
from types import MappingProxyType, NoneType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration.codec import CODECS, Codec, Document, EntryError, Items, Place, Plain, Writing, floats, reference
from tolcontact.errors import TolcontactError


@dataclass(frozen=True)
class Field:
    """A field of a class and its keys in an entry: one with its name, or several with parts of its value.

    codecs        by the keys
    split         returns the values of a thing by these keys; keys without a value are left out
    join          returns arguments for the class from the values of an entry, and its place; None if they are read elsewhere
    is_nullable   whether entries may be null
    is_required   whether an entry has to have the keys
    default       in the JSON schema, if it is a plain value
    """

    codecs: Mapping[str, Codec]
    split: Callable[[Any, Any], Document]
    join: Callable[[Document, Place], Document] | None = None
    is_nullable: bool = False
    is_required: bool = False
    default: Any = UNSET


class Record(Codec):
    """Things of one class: an entry has a key for each field, in their order.

    mark      a key that distinguishes these entries from others: it has the first field, or several as a list
    marked    number of these fields
    kind      value of an entry under "kind", and of the class
    fields    names of the fields in the order of the document, if it differs from the order of the class
    keys      keys of fields that have other names in documents
    omitted   names of fields that are left out if they have their default values
    floats    names of fields whose numbers are written as floats
    build     makes a thing of its fields, if the class itself does not
    when      condition of a thing that is written so
    codecs    codecs of fields whose type and check do not determine them
    """

    def __init__(
        self, cls: Any, *, mark: str = "", marked: int = 1, kind: str = "", fields: str = "",
        keys: Mapping[str, str] = MappingProxyType({}), omitted: str = "", floats: str = "", name: str = "",
        build: Callable[..., Any] | None = None, when: Callable[[Any, Any], bool] = lambda thing, writing: True,
        **codecs: Codec | Field,
    ) -> None:  # fmt: skip
        self.cls, self.mark, self.kind, self.build, self.name = cls, mark, kind, build or cls, name or cls.__name__
        self.wire, self.when, self._codecs = reference(self.name), when, codecs
        self.names, self._marked = fields.split() or list(inspect.signature(cls).parameters), marked if mark else 0
        self._keys, self._omitted, self._floats = keys, omitted.split(), floats.split()

    @cached_property
    def fields(self) -> list[Field]:
        """The fields of an entry. Their codecs may refer to each other, so that all have to exist first."""
        marked = [tuple(self.names[: self._marked])] if self.mark else []
        return [self._field(*names) for names in (*marked, *((name,) for name in self.names[self._marked :]))]

    def _field(self, name: str, *others: str) -> Field:
        """Return a field, or several that are a list under one key."""
        annotation = get_type_hints(self.cls, include_extras=True).get(name)
        codec = self._codecs.get(name) or self._codec(name, annotation)
        if isinstance(codec, Field):
            return codec
        key = self.mark if self.mark and name == self.names[0] else self._keys.get(name, name)
        default = getattr(inspect.signature(self.cls).parameters.get(name), "default", inspect.Parameter.empty)
        is_required, is_omitted = default is inspect.Parameter.empty, name in self._omitted
        factory = getattr(getattr(self.cls, "__dataclass_fields__", {}).get(name), "default_factory", MISSING)
        usual = default if factory is MISSING else factory()

        def split(thing: Any, writing: Writing) -> Document:
            value = tuple(getattr(thing, member) for member in (name, *others)) if others else getattr(thing, name)
            is_default = is_omitted and not isinstance(value, np.ndarray) and value == usual
            return {} if is_default else {key: value}

        def join(values: Document, place: Place) -> Document:
            return dict(zip((name, *others), values[key] if others else (values[key],), strict=True)) if values else {}

        codec = Items(codec, 1 + len(others)) if others else codec
        is_nullable = NoneType in get_args(annotation) or default is None
        return Field({key: codec}, split, join, is_nullable, is_required, default)

    def _codec(self, name: str, annotation: Any) -> Codec:
        """Return the codec of a field from its check, or else from its type; None has the entry null."""
        check = getattr(self.cls, "checks", {}).get(name)
        if check is not None and check.wire is not None:
            annotation = check.wire
        elif NoneType in get_args(annotation):
            annotation = reduce(operator.or_, (kind for kind in get_args(annotation) if kind is not NoneType))
        if annotation in CODECS:
            return CODECS[annotation]
        if get_origin(annotation) is tuple and get_args(annotation)[0] in CODECS:
            return Items(CODECS[get_args(annotation)[0]])
        return Plain(annotation, floats) if name in self._floats else Plain(annotation)

    @property
    def inner(self) -> tuple[Codec, ...]:  # type: ignore[override]
        return tuple(codec for field in self.fields for codec in field.codecs.values())

    @cached_property
    def struct(self) -> Any:
        """The type of an entry for msgspec."""
        members: list[Any] = []
        if self.kind:
            members.append(("kind", Annotated[str, Meta(extra_json_schema={"const": self.kind})]))
        for field in self.fields:
            for key, codec in field.codecs.items():
                wire = codec.wire | None if field.is_nullable else codec.wire
                members.append((key, wire) if field.is_required else (key, wire | UnsetType, UNSET))
        return msgspec.defstruct(self.name, members, forbid_unknown_fields=True, kw_only=True)

    def encode(self, value: Any, writing: Writing) -> Document:
        entry: Document = {"kind": self.kind} if self.kind else {}
        for field in self.fields:
            values = field.split(value, writing)
            entry |= {key: None if v is None else field.codecs[key].encode(v, writing) for key, v in values.items()}
        return entry

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        struct = place.converted(entry, self.struct)
        place = replace(place, record=place.record or struct)
        for field in self.fields:
            if field.join is None:
                continue
            entries = {key: item for key in field.codecs if (item := getattr(struct, key)) is not UNSET}
            values = {
                key: None if item is None and field.is_nullable else field.codecs[key].decode(item, place[key])
                for key, item in entries.items()
            }
            arguments |= field.join(values, place)
            place = replace(place, part=arguments.get("part", place.part))
        if "declared_at" in self.names:
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
        word = fault.split(" ", maxsplit=1)[0]
        if word not in self.names:
            return place.error(fault)
        is_marked = word in self.names[: self._marked]
        return place[self.mark if is_marked else self._keys.get(word, word)].error(fault)

    def fits(self, entry: Any) -> bool:
        if self.kind:
            return isinstance(entry, dict) and entry.get("kind") == self.kind
        return isinstance(entry, dict) and (not self.mark or self.mark in entry)

    def holds(self, value: Any, writing: Writing) -> bool:
        return isinstance(value, self.cls) and self.kind in ("", getattr(value, "kind", "")) and self.when(value, writing)

    def definition(self) -> Document:
        schema = next(iter(msgspec.json.schema_components([self.struct], ref_template="#/$defs/{name}")[1].values()))
        for field in self.fields:
            if field.default is None or isinstance(field.default, str | int | float | tuple):
                schema["properties"][next(iter(field.codecs))]["default"] = field.default
        return schema  # type: ignore[no-any-return]
