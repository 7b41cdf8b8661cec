"""Checks of the names of declarations."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from tolcontact.errors import STEERING

_KEY = re.compile(r"\w(?:[^/]*[^/\s])?")


def text_faults(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield the faults of names that are only shown."""
    for name in dict.fromkeys(names):
        if not is_line(name):
            yield f"{kind} {name!r}: a name must be text without control characters (the archive uses it)"


def key_faults(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield the faults of names that identify things in the archive."""
    for name in dict.fromkeys(names):
        if not (is_line(name) and _KEY.fullmatch(name)):
            yield (
                f"{kind} {name!r}: a name must be text that starts with a letter, digit or underscore, contains "
                'no "/" and no control character, and does not end in a space (the archive uses it)'
            )
    yield from repetitions(kind, names)


def repetitions(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield a fault for each name that occurs more than once. Names are compared in the Unicode form NFC."""
    composed = Counter(unicodedata.normalize("NFC", name) for name in names if isinstance(name, str))
    for name, count in composed.items():
        if count > 1:
            yield f'{kind} "{name}" is declared {count} times; names must differ'


def is_line(text: Any) -> bool:
    """Return True for a text of one line without characters that control a terminal."""
    return isinstance(text, str) and not (STEERING.search(text) or "\t" in text or "\n" in text)
