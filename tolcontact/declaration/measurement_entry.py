"""Entries of points and measurements. A combination has others inside it, or names of measures."""

from dataclasses import fields
from typing import Any

from tolcontact.declaration.codec import CODECS, Choice, DocumentRecord, Items, Optional, Plain
from tolcontact.declaration.face_entry import UNIT_VECTOR
from tolcontact.declaration.measurement import MAX_DEPTH, MEASUREMENTS, Combination
from tolcontact.declaration.part import Point
from tolcontact.declaration.place import Place


class Operands(Items):
    """The measurements of a combination."""

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        if place.path.count(".measurements") > MAX_DEPTH:
            raise place.error(f"its measurements are nested too deeply; expected at most {MAX_DEPTH} combinations")
        return super().decode(entry, place, **arguments)


def _record(cls: Any) -> DocumentRecord:
    """Return the record of a kind of measurement: its faces and points, and directions if it has some."""
    if issubclass(cls, Combination):
        return DocumentRecord(
            cls, "measurements", kind=cls.kind, measurements=Operands(OPERAND), build=lambda measurements: cls(*measurements)
        )
    keys = " ".join(f"{member.name}?" if member.default is None else member.name for member in fields(cls))
    vector = Optional(UNIT_VECTOR)
    return DocumentRecord(cls, keys, kind=cls.kind, across=vector, along=vector, about=vector)


CODECS[Point] = DocumentRecord(Point, "part on? end? position?", mark="part")
KIND = f"a measurement whose kind is one of {', '.join(MEASUREMENTS)}"
OPERAND = Choice("Operand", f"the name of a measurement, or {KIND}")
KINDS = tuple(map(_record, MEASUREMENTS.values()))
OPERAND.codecs = (*KINDS, Plain(str))
MEASURED = Choice("Measured", f"a point, or {KIND}", *KINDS, CODECS[Point])
