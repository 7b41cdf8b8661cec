"""What is wrong with a shape."""


class GeometryFault(Exception):
    """One sentence on what is wrong with a shape; collected with the other faults of a model."""


def clipped(words: str, most: int = 400) -> str:
    """Words of a stranger's file as they may stand in a message: on one line, printable, and not too many."""
    line = " ".join("".join(letter if letter.isprintable() else " " for letter in words).split())
    return line if len(line) <= most else f"{line[:most]}..."
