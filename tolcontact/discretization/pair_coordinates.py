"""Error of the coordinates of a pair of faces, by which its gaps count larger."""

from dataclasses import dataclass
from pathlib import Path

from tolcontact.declaration import Mesh
from tolcontact.discretization.nominal_part import NominalPart
from tolcontact.geometry.coordinate_error import coordinate_error, coordinate_spacing

NOTICED_SHARE = 0.01  # of the error of a pair: a smaller error of one side is not stated


@dataclass(frozen=True)
class PairCoordinates:
    """How files store the coordinates of a pair.

    error     [mm] by which gaps count larger: bodies that fit as drawn fit as stored
    in_words  how exactly which files store coordinates, and what contact allows; empty if all are exact
    """

    error: float = 0.0
    in_words: str = ""


EXACT = PairCoordinates()


def pair_coordinates(moving: NominalPart, reference: NominalPart) -> PairCoordinates:
    """Return how the files of two parts store coordinates."""
    error = coordinate_error(moving.mesh) + coordinate_error(reference.mesh)
    if not error > 0:
        return EXACT
    sources: dict[str, list[str]] = {}
    for part in (moving, reference):
        if coordinate_error(part.mesh) > NOTICED_SHARE * error:
            names = sources.setdefault(f"{coordinate_spacing(part.mesh).max():.2g} mm", [])
            if _source(part) not in names:
                names.append(_source(part))
    (spacing, names), *others = sources.items()
    stored = f"coordinates in {' and '.join(names)} are stored to {spacing}"
    stored += "".join(f", in {' and '.join(names)} to {spacing}" for spacing, names in others)
    return PairCoordinates(error, f"{stored}; contact allows {error:.2g} mm")


def _source(part: NominalPart) -> str:
    geometry = part.part.geometry
    if isinstance(geometry, Mesh) and isinstance(geometry.source, str | Path):
        return Path(geometry.source).name
    return f'part "{part.name}"'
