"""How warnings name declarations that have no name of their own."""

from tolcontact.declaration import Assembly, Part


def location_designation(assembly: Assembly, part: Part) -> str:
    """Return how a warning names the location of a part: the part, and the line of the script that locates it."""
    location = assembly.location_of(part)
    return f'part "{part.name}" ({location.declared_at if location else part.declared_at})'
