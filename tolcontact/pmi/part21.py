"""The records of a STEP file (ISO 10303-21), by number and entity. Parameters are parsed when they are asked for.

Time and memory are linear in the size of any text: the patterns are possessive and never backtrack.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from tolcontact.errors import OptionError
from tolcontact.geometry.files.step_text import STATEMENT, StepText, decoded, entity_name

MAX_NESTING = 64  # lists in lists; files have three or four
_TOKEN = re.compile(
    rb"""\s*+(?:(?P<open>(?:!?[A-Za-z_]\w*+\s*+)?+\()|(?P<close>\))|(?P<comma>,)|(?P<reference>\#\d{1,18}+)|(?P<unset>[$*])
    |(?P<string>'(?:[^']|'')*+')|(?P<word>\.\w++\.)|(?P<number>[-+]?\d++(?:\.\d*+)?+(?:[eE][-+]?\d++)?+)|(?P<binary>"\w*+"))""",
    re.VERBOSE,
)


class Reference(int):
    """The number of a record, to which a parameter refers."""


class Word(str):
    """A value of an enumeration, without its dots."""

    __slots__ = ()

    @property
    def text(self) -> str:
        """The value as a text in lower case: "free state"."""
        return self.lower().replace("_", " ")


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
        """Return the number of the first record to which a parameter refers, or 0."""
        return next(iter(self.references(index)), 0)

    def references(self, index: int) -> list[int]:
        """Return the numbers of all records to which a parameter refers, also within lists and types."""
        return [value for value in flat(self.value(index)) if isinstance(value, Reference)]

    def words(self, index: int) -> list[str]:
        """Return the values of enumerations in a parameter, as texts in lower case."""
        return [value.text for value in flat(self.value(index)) if isinstance(value, Word)]


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
        """Return the names of all entities in the file, but those of most shapes."""
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
            return Word(token[1:-1].decode("latin-1"))
        case "number":
            return float(token)
    return None
