"""Texts of strangers on a terminal: what would steer it, or turn the reading direction, is shown instead."""

import unicodedata

_KEPT = "\n\t"
_TURNING = "\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\u200e\u200f\u2028\u2029"


def printable(text: str) -> str:
    """The text with control characters, marks of direction and lone surrogates as escapes: `\\x1b`."""
    return "".join(letter if letter in _KEPT or not _steers(letter) else _escaped(letter) for letter in text)


def _steers(letter: str) -> bool:
    return unicodedata.category(letter) in ("Cc", "Cs") or letter in _TURNING


def _escaped(letter: str) -> str:
    return ascii(letter)[1:-1]
