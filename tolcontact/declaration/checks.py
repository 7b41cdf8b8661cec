"""Checks of the fields of declarations: what a value must be, the sentence that says so, and the type of its entry in JSON."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

from msgspec import Meta

from tolcontact.declaration.values import Vector, is_finite, is_length
from tolcontact.errors import designation
from tolcontact.readable import Readable

MAX_FRICTION = 10  # above any physical value


def text_type(choices: Iterable[str]) -> Any:
    """Return the type of a text whose choices the JSON schema lists; its class refuses others."""
    return Annotated[str, Meta(extra_json_schema={"enum": list(choices)})]


# The JSON schema states these limits, and classes check them: msgspec 0.22 crashes on limits in a union with a list.
POSITIVE = Annotated[float, Meta(extra_json_schema={"exclusiveMinimum": 0})]
NOT_NEGATIVE = Annotated[float, Meta(extra_json_schema={"minimum": 0})]


class Check(NamedTuple):
    """A condition of a value, the expected value in words, and the type of its entry; None takes the type of the field."""

    holds: Callable[[Any], bool]
    expected: str
    wire: Any = None


def one_of(choices: Iterable[str]) -> Check:
    """Return the check of a named choice."""
    names = list(choices)
    return Check(lambda value: value in names, f"one of: {', '.join(name or repr(name) for name in names)}", text_type(names))


def whole_number(least: int, most: int) -> Check:
    """Return the check of a whole number in a range."""
    wire = Annotated[int, Meta(extra_json_schema={"minimum": least, "maximum": most})]
    return Check(lambda value: type(value) is int and least <= value <= most, f"a whole number from {least} to {most}", wire)


LENGTH = Check(lambda value: is_length(value) and value > 0, "a length in mm above 0", POSITIVE)
LENGTH_OR_0 = Check(lambda value: is_length(value) and value >= 0, "a length in mm, 0 or above", NOT_NEGATIVE)
TRUTH = Check(lambda value: isinstance(value, bool), "True or False")
STIFFNESS = Check(lambda value: is_length(value) and value > 0, "a number in N/mm above 0", POSITIVE)
FRICTION = Check(
    lambda value: is_length(value) and 0 <= value <= MAX_FRICTION,
    f"a coefficient of friction from 0 to {MAX_FRICTION}, or None",
    NOT_NEGATIVE,
)


class Checked(Readable):
    """An object whose fields are checked: `checks` by the names of fields. Sentences begin with the `fault_prefix`."""

    checks: ClassVar[Mapping[str, Check]] = {}
    fault_prefix: ClassVar[str] = ""

    def faults(self) -> Iterator[str]:
        """Yield a sentence for each field that fails its check; None passes where it is the default."""
        optional = {field.name for field in fields(self) if field.default is None} if is_dataclass(self) else set(self.checks)
        for name, check in self.checks.items():
            value = getattr(self, name)
            if not (value is None and name in optional) and not check.holds(value):
                yield f"{self.fault_prefix}{name} is {value!r}; expected {check.expected}"


class Declaration(Checked):
    """A declaration of a model: its kind is the `noun` of messages, and `declared_at` the line of the script."""

    noun: ClassVar[str]
    name: Any
    declared_at: str
    station: str

    @property
    def designation(self) -> str:
        """The kind, the name and the line of the script, as messages name it."""
        return designation(self.noun, self)

    def located_faults(self, faults: Iterator[str] | None = None, owner: str = "") -> Iterator[str]:
        """Yield its faults, or some `faults` of it, after its kind, name and line; `owner` precedes these."""
        return (f"{owner}{self.designation}: {fault}" for fault in (self.faults() if faults is None else faults))


def direction_faults(name: str, value: Vector | None) -> Iterator[str]:
    """Yield the fault of a direction, or of one that may be left out."""
    if value is not None and not is_finite(value):
        yield f'{name} is {value!r}; expected "+x" to "-z", or a nonzero vector of three finite numbers'
