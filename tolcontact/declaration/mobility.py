"""Which parts contact may move."""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.part import Part


def is_free(assembly: Assembly, part: Part) -> bool:
    """Return True if contact may move the part.

    Without a declared choice a part is free if it is a moving side, floats, or has one-sided locators.
    """
    if part.fixed is not None:
        return not part.fixed
    location = assembly.location_of(part)
    floats = location is not None and location.floating
    return floats or any(pair.moving.part is part for pair in assembly.pairs) or has_supports(assembly, part)


def has_supports(assembly: Assembly, part: Part) -> bool:
    """Return True if a locator of the part is one-sided."""
    location = assembly.location_of(part)
    return location is not None and isinstance(location.scheme, tuple) and any(pin.one_sided for pin in location.scheme)


def movers(assembly: Assembly, part: Part) -> tuple[Part, ...]:
    """Return the free parts whose corrections move `part`: the parts that it is located on, then the part itself."""
    location = assembly.location_of(part)
    supports = movers(assembly, location.parent) if location and location.parent else ()
    touches = any(part in (pair.moving.part, pair.reference.part) for pair in assembly.pairs) or has_supports(assembly, part)
    return (*supports, part) if touches and is_free(assembly, part) else supports
