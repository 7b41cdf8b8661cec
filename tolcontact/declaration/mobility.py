"""Which parts contact may move."""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.part import Part


def is_free(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if contact may move the part.

    Without a declared choice a part is free if it is a moving side, floats, or has one-sided locators, or `springs` (see
    `has_supports`).
    """
    body = assembly.body_of(part)
    if any(member.fixed is not None for member in body):
        return any(member.fixed is False for member in body)
    location = assembly.location_of(part)
    floats = location is not None and location.floating
    return floats or any(pair.moving.part in body for pair in assembly.pairs) or has_supports(assembly, part, springs=springs)


def has_supports(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if a locator of the part is one-sided, or has a stiffness, if `springs` that give way to forces count."""
    location = assembly.location_of(part)
    scheme = location.scheme if location is not None and isinstance(location.scheme, tuple) else ()
    return any(locator.one_sided or (springs and locator.stiffness is not None) for locator in scheme)


def movers(assembly: Assembly, part: Part, *, springs: bool) -> tuple[Part, ...]:
    """Return the free parts whose corrections move `part`: the parts that it is located on, then the part itself.

    A part of a joint is moved by the first part of the joint. Locators that are `springs` count as supports.
    """
    chain = dict.fromkeys(assembly.support_chain(part))
    return tuple(link for link in reversed(chain) if _moves(assembly, link, springs=springs))


def _moves(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if the first part of a body is free, and something in the model holds it or pushes it."""
    body = assembly.body_of(part)
    touches = has_supports(assembly, part, springs=springs) or any(
        side.part in body for pair in assembly.pairs for side in (pair.moving, pair.reference)
    )
    return touches and is_free(assembly, part, springs=springs)
