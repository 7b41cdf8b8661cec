"""Who may move: parts that contact displaces, and those that rest on them."""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.part import Part


def is_free(assembly: Assembly, part: Part) -> bool:
    """Whether contact may move the part: as declared, else whether it is a moving side, floats or has one-sided locators."""
    if part.fixed is not None:
        return not part.fixed
    location = assembly.location_of(part)
    floats = location is not None and location.floating
    return floats or any(pair.moving.part is part for pair in assembly.pairs) or has_supports(assembly, part)


def has_supports(assembly: Assembly, part: Part) -> bool:
    """Whether some locators of the part are one-sided."""
    location = assembly.location_of(part)
    return location is not None and isinstance(location.scheme, tuple) and any(own.one_sided for own in location.scheme)


def movers(assembly: Assembly, part: Part) -> tuple[Part, ...]:
    """The free parts whose corrections move `part`: those that it is located on, and itself last."""
    location = assembly.location_of(part)
    below = movers(assembly, location.on) if location and location.on else ()
    touches = any(part in (pair.moving.part, pair.reference.part) for pair in assembly.pairs) or has_supports(assembly, part)
    return (*below, part) if touches and is_free(assembly, part) else below
