"""What is declared, before any run: parts in their places, faces with the words that choose them, locators, gaps."""

from collections.abc import Iterator, Sequence
from typing import Any

from tolcontact.declaration import Assembly
from tolcontact.discretization import Nominal
from tolcontact.geometry import preview
from tolcontact.report.annotations import Marks, fixed_points, marks_of_nominal
from tolcontact.report.html.packed_array import packed
from tolcontact.report.html.scene import Drawn, drawn_marks


def view_of(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> Drawn:
    """The scene; without a `nominal` assembly, which has faults, only the parts whose shapes are sound."""
    marks = Marks([], [], [], [], []) if nominal is None else marks_of_nominal(nominal)
    return {"parts": list(_parts(assembly, _faulty(assembly, faults))), **drawn_marks(marks)}


def gaps_in_words(nominal: Nominal | None) -> list[dict[str, Any]]:
    """The smallest and the largest gap of each pair of faces, in the nominal assembly."""
    found = []
    for pair in () if nominal is None else nominal.pairs:
        _, gaps = fixed_points(pair)
        least, most = (f"{gap + 0.0:.4g}" for gap in (gaps.min(), gaps.max()))
        found.append({"name": pair.name, "count": len(gaps), "smallest": least, "largest": most})
    return found


def _faulty(assembly: Assembly, faults: Sequence[str]) -> set[str]:
    """Parts that faults name, and those of contact pairs that they name."""
    said = "\n".join(faults)
    pairs = [pair for pair in assembly.pairs if f'"{pair.name}" (' in said]
    of_pairs = {face.part.name for pair in pairs for face in (pair.moving, pair.reference)}
    return of_pairs | {part.name for part in assembly.parts if f'part "{part.name}"' in said}


def _parts(assembly: Assembly, faulty: set[str]) -> Iterator[Drawn]:
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
