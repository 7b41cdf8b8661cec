"""How warnings name declarations that have no name of their own."""

from tolcontact.declaration import Assembly, Part


def location_designation(assembly: Assembly, part: Part, station: str = "") -> str:
    """Return how a warning names the location of a part: the part, and the line of the script that locates it in a station."""
    location = next((entry for entry in assembly.locations if entry.part is part and entry.station == station), None)
    return f'part "{part.name}" ({location.declared_at if location else part.declared_at})'
