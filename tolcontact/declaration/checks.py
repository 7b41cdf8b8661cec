"""Checks of the fields of declarations: what a value must be, and the sentence that says so."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

from tolcontact.declaration.values import Vector, is_finite, is_length

MAX_FRICTION = 10  # above any physical value


class Check(NamedTuple):
    """A condition of a value, and the expected value in words."""

    holds: Callable[[Any], bool]
    expected: str


def one_of(choices: Sequence[str]) -> Check:
    """Return the check of a named choice."""
    return Check(lambda value: value in choices, f"one of: {', '.join(choice or repr(choice) for choice in choices)}")


def whole_number(least: int, most: int) -> Check:
    """Return the check of a whole number in a range."""
    return Check(lambda value: type(value) is int and least <= value <= most, f"a whole number from {least} to {most}")


LENGTH = Check(lambda value: is_length(value) and value > 0, "a length in mm above 0")
LENGTH_OR_0 = Check(lambda value: is_length(value) and value >= 0, "a length in mm, 0 or above")
TRUTH = Check(lambda value: isinstance(value, bool), "True or False")
STIFFNESS = Check(lambda value: is_length(value) and value > 0, "a number in N/mm above 0")
FRICTION = Check(
    lambda value: is_length(value) and 0 <= value <= MAX_FRICTION,
    f"a coefficient of friction from 0 to {MAX_FRICTION}, or None",
)


def field_faults(thing: Any, checks: Mapping[str, Check], prefix: str = "") -> Iterator[str]:
    """Yield a sentence for each field of a declaration that fails its check; None passes where it is the default."""
    optional = {field.name for field in fields(thing) if field.default is None} if is_dataclass(thing) else set(checks)
    for name, check in checks.items():
        value = getattr(thing, name)
        if not (value is None and name in optional) and not check.holds(value):
            yield f"{prefix}{name} is {value!r}; expected {check.expected}"


def direction_faults(name: str, value: Vector | None) -> Iterator[str]:
    """Yield the fault of a direction, or of one that may be left out."""
    if value is not None and not is_finite(value):
        yield f'{name} is neither "+x" to "-z" nor a nonzero vector of three finite numbers'
