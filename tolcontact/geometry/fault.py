"""What is wrong with a shape, and whose."""

from tolcontact.declaration import ContactPair, Feature, Part


class GeometryFault(Exception):
    """One sentence on what is wrong with a shape; collected with the other faults of a model."""


def clipped(words: str, most: int = 400) -> str:
    """Words of a file as they may appear in a message: on one line, printable, and not too many."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in words).split())
    return line if len(line) <= most else f"{line[:most]}..."


def where(kind: str, thing: Part | ContactPair | Feature) -> str:
    """How a message names a declared thing: kind, name, and the line of the script."""
    return f'{kind} "{thing.name}" ({thing.declared_at})'
