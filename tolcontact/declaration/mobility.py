"""Which parts contact may move."""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.part import Part


def is_free(assembly: Assembly, part: Part) -> bool:
    """Return True if contact may move the part.

    Without a declared choice a part is free if it is a moving side, floats, or has one-sided locators.
    """
    body = assembly.body_of(part)
    if any(member.fixed is not None for member in body):
        return any(member.fixed is False for member in body)
    location = assembly.location_of(part)
    floats = location is not None and location.floating
    return floats or any(pair.moving.part in body for pair in assembly.pairs) or has_supports(assembly, part)


def has_supports(assembly: Assembly, part: Part) -> bool:
    """Return True if a locator of the part is one-sided."""
    location = assembly.location_of(part)
    return location is not None and isinstance(location.scheme, tuple) and any(pin.one_sided for pin in location.scheme)


def movers(assembly: Assembly, part: Part) -> tuple[Part, ...]:
    """Return the free parts whose corrections move `part`: the parts that it is located on, then the part itself.

    A part of a joint is moved by the first part of the joint.
    """
    body = assembly.body_of(part)
    part = body[0]
    location = assembly.location_of(part)
    supports = movers(assembly, location.parent) if location and location.parent else ()
    touches = has_supports(assembly, part) or any(
        side.part in body for pair in assembly.pairs for side in (pair.moving, pair.reference)
    )
    return (*supports, part) if touches and is_free(assembly, part) else supports
