"""The records of a STEP file (ISO 10303-21), by number and entity, and the measures that they state [mm, rad].

Parameters are parsed when they are asked for, in linear time: the patterns are possessive and never backtrack.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from tolcontact.errors import OptionError
from tolcontact.geometry.files.step_text import STATEMENT, StepText, decoded, entity_name

MAX_CONVERSIONS = 4  # an inch is defined in mm: one conversion
_PREFIXES = {
    "exa": 1e18, "peta": 1e15, "tera": 1e12, "giga": 1e9, "mega": 1e6, "kilo": 1e3, "hecto": 1e2, "deca": 10.0, "deci": 0.1,
    "centi": 0.01, "milli": 1e-3, "micro": 1e-6, "nano": 1e-9, "pico": 1e-12, "femto": 1e-15, "atto": 1e-18,
}  # fmt: skip
MAX_NESTING = 64  # lists in lists; files have three or four
_TOKEN = re.compile(
    rb"""\s*+(?:(?P<open>(?:!?[A-Za-z_]\w*+\s*+)?+\()|(?P<close>\))|(?P<comma>,)|(?P<reference>\#\d{1,18}+)|(?P<unset>[$*])
    |(?P<string>'(?:[^']|'')*+')|(?P<word>\.\w++\.)|(?P<number>[-+]?\d++(?:\.\d*+)?+(?:[eE][-+]?\d++)?+)|(?P<binary>"\w*+"))""",
    re.VERBOSE,
)


class Reference(int):
    """The number of a record in a parameter."""


class Word(str):
    """A value of an enumeration as a text in lower case: "free state"."""

    __slots__ = ()


class Typed(NamedTuple):
    """A parameter that states its type, such as LENGTH_MEASURE(0.1)."""

    entity: str
    values: "Parameters"


Value: TypeAlias = "float | str | Reference | Word | Typed | Parameters | None"


class Parameters(tuple[Value, ...]):
    """The parameters of a record, or a list among them. A parameter that is missing, or of another kind, is empty."""

    __slots__ = ()

    def value(self, index: int) -> Value:
        return self[index] if index < len(self) else None

    def text(self, index: int) -> str:
        value = self.value(index)
        return value if isinstance(value, str) and not isinstance(value, Word) else ""

    def reference(self, index: int) -> int:
        """Return the first record number in a parameter, or 0."""
        return next(iter(self.references(index)), 0)

    def references(self, index: int) -> list[int]:
        """Return all record numbers in a parameter, also within lists and types."""
        return [value for value in flat(self.value(index)) if isinstance(value, Reference)]

    def words(self, index: int) -> list[str]:
        """Return the values of enumerations in a parameter, as texts in lower case."""
        return [str(value) for value in flat(self.value(index)) if isinstance(value, Word)]


def flat(value: Value) -> Iterator[Value]:
    """Yield the values in lists and types one by one."""
    if isinstance(value, Typed | Parameters):
        for inner in value.values if isinstance(value, Typed) else value:
            yield from flat(inner)
    else:
        yield value


class Records:
    """The records of the STEP file `title` with this `content`.

    schema   name of the schema and its object identifier, as the file states them
    """

    def __init__(self, content: bytes, title: str) -> None:
        self._text = StepText(content)
        self.schema = self._text.schema
        self._title = title
        self._parsed: dict[int, Mapping[str, Parameters]] = {}
        if not self._text.is_complete:
            raise OptionError(
                f'"{title}" is cut off, or a text in it is not closed: it does not end with END-ISO-10303-21; export it again'
            )

    def __len__(self) -> int:
        return len(self._text.bodies)

    def names(self) -> Iterable[str]:
        """Return the names of all entities in the file, without most shapes."""
        return self._text.numbers.keys()

    def numbers(self, *entities: str) -> list[int]:
        """Return the numbers of all records of these entities, in ascending order."""
        numbers = {number for entity in entities for number in self._text.numbers.get(entity, ())}
        return sorted(number for number in numbers if self.has(number, *entities))

    def has(self, number: int, *entities: str) -> bool:
        """Return whether a record is of one of these entities."""
        if number in self._text.entities:
            return self._text.entities[number] in entities
        return not self.entities(number).keys().isdisjoint(entities)

    def entities(self, number: int) -> Mapping[str, Parameters]:
        """Return the entities of a record with their parameters: several for a complex instance, none if it is missing.

        Raises OptionError if it is damaged.
        """
        if number not in self._parsed:
            body = self._text.bodies.get(number, b"")
            values = _parse(body)
            if values is None:
                raise OptionError(
                    f'"{self._title}": record #{number} is damaged, or has lists nested more than {MAX_NESTING} deep; '
                    "export the file again"
                )
            instances = values[0] if values and isinstance(values[0], Parameters) else values
            self._parsed[number] = {item.entity: item.values for item in instances if isinstance(item, Typed)}
        return self._parsed[number]

    def parameters(self, number: int, *entities: str) -> Parameters:
        """Return the parameters of a record as the first of `entities` that it is and that has any; else none."""
        instance = self.entities(number)
        return next((instance[entity] for entity in entities if instance.get(entity)), Parameters())

    def each(self, *entities: str) -> Iterator[tuple[int, Parameters]]:
        """Yield the numbers of all records of these entities, in ascending order, with their parameters."""
        for number in self.numbers(*entities):
            yield number, self.parameters(number, *entities)

    def shapes(self, *numbers: int) -> dict[int, Parameters]:
        """Return the parameters of records of shapes, by their numbers. All of the file is searched, once for each call."""
        found, wanted = dict[int, Parameters](), frozenset(numbers)
        for match in STATEMENT.finditer(self._text.content) if numbers else ():
            number, entity, body, _ = match.groups()
            if number is not None and entity is not None and int(number) in wanted:
                values = _parse(body)
                found[int(number)] = next((value for value in values or () if isinstance(value, Parameters)), Parameters())
        return found


def _parse(text: bytes) -> Parameters | None:
    """Return the values in a text; None if it is damaged. Commas may be missing, as in a complex instance."""
    stack: list[tuple[str, list[Value]]] = [("", [])]
    position, end = 0, len(text.rstrip())
    while position < end:
        token = _TOKEN.match(text, position)
        if token is None or len(stack) > MAX_NESTING:
            return None
        position = token.end()
        match token.lastgroup:
            case "open":
                stack.append((entity_name(token["open"][:-1].strip()), []))
            case "close":
                name, values = stack.pop()
                if not stack:
                    return None
                stack[-1][1].append(Typed(name, Parameters(values)) if name else Parameters(values))
            case "comma":
                pass
            case kind:
                stack[-1][1].append(_value(str(kind), token[str(kind)]))
    return Parameters(stack[0][1]) if len(stack) == 1 else None


def _value(kind: str, token: bytes) -> Value:
    match kind:
        case "reference":
            return Reference(token[1:])
        case "string":
            return decoded(token[1:-1].replace(b"\r", b"").replace(b"\n", b""))
        case "word":
            return Word(token[1:-1].decode("latin-1").lower().replace("_", " "))
        case "number":
            return float(token)
    return None


class Quantity(NamedTuple):
    """A `value` in its `unit`: "mm" or "rad"."""

    value: float
    unit: str


def length(records: Records, number: int) -> float | None:
    """Return the length [mm] that a record states, or None."""
    measure = quantity(records, number)
    return measure.value if measure and measure.unit == "mm" else None


def length_unit(records: Records, context: int) -> float | None:
    """Return the unit [mm] of lengths in the context of a representation; None if it states none."""
    assigned = records.parameters(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT")
    units = (_unit(records, number) for number in assigned.references(0))
    return next((unit.value for unit in units if unit is not None and unit.unit == "mm"), None)


def quantity(records: Records, number: int, conversions: int = MAX_CONVERSIONS) -> Quantity | None:
    """Return the measure that a record states; None if it states no finite length or angle."""
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


def _unit(records: Records, number: int, conversions: int = MAX_CONVERSIONS) -> Quantity | None:
    """Return a unit of length or of angle in mm or rad; None for any other, and for a circular definition."""
    instance = records.entities(number)
    if "CONVERSION_BASED_UNIT" in instance and conversions:
        return quantity(records, instance["CONVERSION_BASED_UNIT"].reference(1), conversions - 1)
    words = [word for index in range(3) for word in instance.get("SI_UNIT", Parameters()).words(index)]
    scale = next((_PREFIXES[word] for word in words if word in _PREFIXES), 1.0)
    if "metre" in words:
        return Quantity(scale / _PREFIXES["milli"], "mm")
    return Quantity(scale, "rad") if "radian" in words else None
