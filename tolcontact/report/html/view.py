"""What is declared, before any run: parts in their places, faces with the words that choose them, locators, gaps."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from tolcontact.declaration import Assembly, Point
from tolcontact.discretization import ContactPoints, Nominal, seen
from tolcontact.report.html.packed import packed
from tolcontact.report.html.scene import Drawn


def view_of(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> Drawn:
    """The scene; without a `nominal` assembly, which has faults, only the parts whose shapes are sound."""
    drawn: Drawn = {
        "parts": list(_parts(assembly, _faulty(assembly, faults))),
        "locators": [],
        "contacts": [],
        "measures": [],
        "forces": [],
    }
    if nominal is None:
        return drawn
    locators = nominal.locators
    drawn["locators"] = [
        {"name": name, "at": at.tolist(), "along": along.tolist()}
        for name, at, along in zip(locators.labels, locators.points, locators.directions, strict=True)
    ]
    for pair in nominal.pairs:
        points, gaps = _fixed_points(pair)
        drawn["contacts"].append({"name": pair.name, "part": pair.moving, "points": packed(points), "gaps": packed(gaps)})
    for measure in nominal.measures:
        if measure.points:
            at = [_position(nominal, point) for point in measure.points]
            drawn["measures"].append({"name": measure.name, "points": at, "along": measure.along})
    drawn["forces"] = [
        {"name": force.name, "at": _position(nominal, force.at), "along": list(force.vector)} for force in assembly.forces
    ]
    return drawn


def gaps_in_words(nominal: Nominal | None) -> list[dict[str, Any]]:
    """The smallest and the largest gap of each pair of faces, in the nominal assembly."""
    found = []
    for pair in () if nominal is None else nominal.pairs:
        _, gaps = _fixed_points(pair)
        least, most = (f"{gap + 0.0:.4g}" for gap in (gaps.min(), gaps.max()))
        found.append({"name": pair.name, "count": len(gaps), "smallest": least, "largest": most})
    return found


def _fixed_points(pair: ContactPoints) -> tuple[np.ndarray, np.ndarray]:
    """Contact points (point, 3) and gaps (point,) [mm]; the nearest tangent of a hollow wall, which moves, is left out."""
    stays = ~pair.round.points["is_hollow"] if pair.round else np.ones(len(pair.P_m), dtype=bool)
    return pair.P_m[stays], ((pair.P_m - pair.P_r) * pair.n_r).sum(axis=1)[stays]


def _position(nominal: Nominal, point: Point) -> list[float]:
    return [float(x) for x in nominal.position(point)]


def _faulty(assembly: Assembly, faults: Sequence[str]) -> set[str]:
    """Parts that faults name, and those of contact pairs that they name."""
    said = "\n".join(faults)
    pairs = [pair for pair in assembly.pairs if f'"{pair.name}" (' in said]
    of_pairs = {face.part.name for pair in pairs for face in (pair.moving, pair.reference)}
    return of_pairs | {part.name for part in assembly.parts if f'part "{part.name}"' in said}


def _parts(assembly: Assembly, faulty: set[str]) -> Iterator[Drawn]:
    for part in assembly.parts:
        own = seen(part)
        if own is None:
            continue
        yield {
            "name": part.name,
            "faulty": part.name in faulty,
            "vertices": packed(own.vertices),
            "faces": packed(own.faces, "i4"),
            "faceOfTriangle": packed(own.face_of, "i4"),
            "described": [{"said": str(face), "words": words} for face, words in zip(own.described, own.words, strict=True)],
        }
