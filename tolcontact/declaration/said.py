"""A value in a document from a file of unknown origin, and its place there: taken as what is expected, or refused.

Every refusal is an ArchiveError that states the place; nothing is converted.
"""

from collections.abc import Collection, Iterator
from typing import Any

from tolcontact.declaration.vectors import Vector
from tolcontact.errors import ArchiveError

LARGEST = 1e100  # of any number: its square can still be computed with


class Said:
    """A value of JSON at the place `at` of the document, such as `parts[2].name`."""

    def __init__(self, value: Any, at: str = "") -> None:
        self._value = value
        self._at = at

    def __getitem__(self, word: str) -> "Said":
        """The value that a group has under `word`."""
        if not isinstance(self._value, dict):
            raise self.wrong("named values")
        if word not in self._value:
            raise self.refused(f"it has no {word!r}")
        return Said(self._value[word], f"{self._at}.{word}" if self._at else word)

    def optional(self, word: str) -> Iterator["Said"]:
        """The items of a list that a group may have under `word`; documents of earlier formats have none."""
        return iter(self[word]) if word in self else iter(())

    def __contains__(self, word: str) -> bool:
        return isinstance(self._value, dict) and word in self._value

    def __iter__(self) -> Iterator["Said"]:
        """The items of a list."""
        if not isinstance(self._value, list):
            raise self.wrong("a list")
        return (Said(item, f"{self._at}[{k}]") for k, item in enumerate(self._value))

    def items(self, count: int) -> list["Said"]:
        """The items of a list of that length."""
        items = list(self)
        if len(items) != count:
            raise self.wrong(f"a list of {count}")
        return items

    def pairs(self) -> dict[str, "Said"]:
        """The values of a group, by name."""
        if not isinstance(self._value, dict):
            raise self.wrong("named values")
        return {word: self[word] for word in self._value}

    @property
    def is_none(self) -> bool:
        return self._value is None

    @property
    def is_text(self) -> bool:
        return isinstance(self._value, str)

    @property
    def is_list(self) -> bool:
        return isinstance(self._value, list)

    def text(self) -> str:
        if not isinstance(self._value, str):
            raise self.wrong("a text")
        return self._value

    def one_of(self, choice: Collection[str]) -> str:
        if not (isinstance(self._value, str) and self._value in choice):
            raise self.wrong(f"one of {', '.join(choice)}")
        return self._value

    def number(self) -> float:
        """A finite number; a whole one stays whole."""
        if not (type(self._value) in (int, float) and abs(self._value) <= LARGEST):
            raise self.wrong("a finite number")
        return self._value  # type: ignore[no-any-return]

    def constant(self) -> float:
        """A number, also a float that is not finite: an expression may compare with infinity."""
        return self._value if isinstance(self._value, float) else self.number()

    def index(self, count: int) -> int:
        """A whole number from 0 to `count` - 1."""
        if not (type(self._value) is int and 0 <= self._value < count):
            raise self.wrong(f"a whole number from 0 to {count - 1}")
        return self._value

    def boolean(self) -> bool:
        if not isinstance(self._value, bool):
            raise self.wrong("true or false")
        return self._value

    def vector(self) -> Vector:
        x, y, z = (component.number() for component in self.items(3))
        return (x, y, z)

    def wrong(self, expected: str) -> ArchiveError:
        """The error for a value that is not what is expected."""
        if isinstance(self._value, dict):
            got = "named values"
        elif isinstance(self._value, list):
            got = f"a list of {len(self._value)}"
        elif isinstance(self._value, str):
            got = repr(self._value) if len(self._value) <= 40 else "a text"
        elif isinstance(self._value, int) and abs(self._value) > LARGEST:
            got = "a huge number"  # Python refuses to print whole numbers of more than 4300 digits
        else:
            got = repr(self._value)
        return self.refused(f"expected {expected}, got {got}")

    def refused(self, why: str) -> ArchiveError:
        """The error for a document that is not as tolcontact writes it."""
        place = f"{self._at}: " if self._at else ""
        return ArchiveError(f"the declared model in the archive is damaged: {place}{why}")
