"""Measures with units, in mm and rad."""

import math
from typing import NamedTuple

from tolcontact.pmi.part21 import Parameters, Records, Typed, flat

MAX_CONVERSIONS = 4  # an inch is defined in mm: one conversion
_PREFIXES = {
    "exa": 1e18, "peta": 1e15, "tera": 1e12, "giga": 1e9, "mega": 1e6, "kilo": 1e3, "hecto": 1e2, "deca": 10.0, "deci": 0.1,
    "centi": 0.01, "milli": 1e-3, "micro": 1e-6, "nano": 1e-9, "pico": 1e-12, "femto": 1e-15, "atto": 1e-18,
}  # fmt: skip


class Quantity(NamedTuple):
    """A `value` in its `unit`: "mm" or "rad"."""

    value: float
    unit: str


def quantity(records: Records, number: int) -> Quantity | None:
    """Return the measure that a record states; None if it states no finite length or angle."""
    return _quantity(records, number, MAX_CONVERSIONS)


def length(records: Records, number: int) -> float | None:
    """Return the length [mm] that a record states, or None."""
    measure = quantity(records, number)
    return measure.value if measure and measure.unit == "mm" else None


def length_unit(records: Records, context: int) -> float | None:
    """Return the unit [mm] of lengths in the context of a representation; None if it states none."""
    assigned = records.parameters(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT")
    units = (_unit(records, number, MAX_CONVERSIONS) for number in assigned.references(0))
    return next((unit.value for unit in units if unit is not None and unit.unit == "mm"), None)


def _quantity(records: Records, number: int, conversions: int) -> Quantity | None:
    for entity, parameters in records.entities(number).items():
        if entity.endswith(("MEASURE_WITH_UNIT", "MEASURE_REPRESENTATION_ITEM")) and parameters:
            return _measure(records, parameters, conversions)
    return None


def _measure(records: Records, parameters: Parameters, conversions: int) -> Quantity | None:
    """Return a measure from its parameters: a number, with or without its type, and its unit, after a name if it has any."""
    for index, value in enumerate(parameters):
        for number in flat(value) if isinstance(value, Typed | float) else ():
            unit = _unit(records, parameters.reference(index + 1), conversions)
            if isinstance(number, float) and unit is not None and math.isfinite(number * unit.value):
                return Quantity(number * unit.value, unit.unit)
    return None


def _unit(records: Records, number: int, conversions: int) -> Quantity | None:
    """Return a unit of length or of angle in mm or rad; None for any other, and for one that is defined by itself."""
    instance = records.entities(number)
    if "CONVERSION_BASED_UNIT" in instance and conversions:
        return _quantity(records, instance["CONVERSION_BASED_UNIT"].reference(1), conversions - 1)
    words = [word for index in range(3) for word in instance.get("SI_UNIT", Parameters()).words(index)]
    scale = next((_PREFIXES[word] for word in words if word in _PREFIXES), 1.0)
    if "metre" in words:
        return Quantity(scale / _PREFIXES["milli"], "mm")
    return Quantity(scale, "rad") if "radian" in words else None
