"""The view of a declared assembly: parts in place, faces with their selectors, locators, contact points, gaps."""

from collections.abc import Iterator, Sequence
from typing import Any

from tolcontact.declaration import Assembly
from tolcontact.discretization import Nominal
from tolcontact.geometry import preview
from tolcontact.report.annotations import Marks, fixed_points, marks_of_nominal
from tolcontact.report.html.packed_array import packed
from tolcontact.report.html.scene import Scene, packed_marks


def view_of(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> Scene:
    """Return the scene. Without a `nominal` assembly, for a model with faults, it has only parts with sound shapes."""
    marks = Marks([], [], [], [], []) if nominal is None else marks_of_nominal(nominal)
    return {"parts": list(_parts(assembly, _faulty(assembly, faults))), **packed_marks(marks)}


def gap_rows(nominal: Nominal | None) -> list[dict[str, Any]]:
    """Return the smallest and the largest gap of each pair of faces in the nominal assembly."""
    rows = []
    for pair in () if nominal is None else nominal.pairs:
        _, gaps = fixed_points(pair)
        smallest, largest = (f"{gap + 0.0:.4g}" for gap in (gaps.min(), gaps.max()))
        rows.append({"name": pair.name, "count": len(gaps), "smallest": smallest, "largest": largest})
    return rows


def _faulty(assembly: Assembly, faults: Sequence[str]) -> set[str]:
    """Return the parts that faults name, and the parts of contact pairs that faults name."""
    text = "\n".join(faults)
    pairs = [pair for pair in assembly.pairs if f'"{pair.name}" (' in text]
    of_pairs = {face.part.name for pair in pairs for face in (pair.moving, pair.reference)}
    return of_pairs | {part.name for part in assembly.parts if f'part "{part.name}"' in text}


def _parts(assembly: Assembly, faulty: set[str]) -> Iterator[Scene]:
    for part in assembly.parts:
        own = preview(part)
        if own is None:
            continue
        yield {
            "name": part.name,
            "faulty": part.name in faulty,
            "placement": [*own.rotation.ravel().tolist(), *part.at],
            "vertices": packed(own.vertices),
            "faces": packed(own.faces, "i4"),
            "faceOfTriangle": packed(own.face_of, "i4"),
            "described": [
                {"said": str(face), "words": words} for face, words in zip(own.descriptions, own.snippets, strict=True)
            ],
        }
