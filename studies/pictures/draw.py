"""The pictures of the guide: schemes of concepts, and the drawings of the tutorials.

python studies/pictures/draw.py FOLDER, which is tolcontact/guide/pictures
"""

import itertools
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from studies.benchmarks.drawing import svg

GROUND = '<rect width="100%" height="100%" fill="white"/>'


def polygon(points: Iterable[tuple[float, float]], label: str = "") -> str:
    return "polygon " + " ".join(f"{value:.2f}" for point in points for value in point) + f" {label}"


def turned(box: tuple[float, float, float, float], degrees: float, label: str = "") -> str:
    """Return a box (x, y, width, height) that is rotated about its lower left corner."""
    x, y, width, height = box
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return polygon([(x + c * u - s * v, y + s * u + c * v) for u, v in corners], label)


def curve(points: Iterable[tuple[float, float]]) -> list[str]:
    """Return the lines of a curve."""
    return [f"line {a[0]:.2f} {a[1]:.2f} {b[0]:.2f} {b[1]:.2f}" for a, b in itertools.pairwise(points)]


def bumps(x: float) -> float:
    return 0.9 * np.sin(x / 9.0) + 0.5 * np.sin(x / 3.7 + 1)


def frame(x: float, y: float, *cells: str) -> list[str]:
    """Return a feature control frame, with its lower left corner at (x, y)."""
    shapes = []
    for cell in cells:
        width = 7.0 + 2.6 * len(cell)
        shapes += [f"box {x:.1f} {y:.1f} {width:.1f} 8", f"text {x + width / 2:.1f} {y + 1.6:.1f} {cell}"]
        x += width
    return shapes


FACE = np.linspace(0, 100, 60)
PICTURES: dict[str, list[str]] = {
    "scheme": [
        "box 0 0 100 60 part, seen from above", "circle 12 12 2.5", "circle 88 12 2.5", "circle 50 48 2.5",
        "text 12 16 A1", "text 88 16 A2", "text 50 40 A3", "force 25 -16 25 0 B1", "force 75 -16 75 0 B2",
        "force -18 30 0 30 C1", "text 50 66 three points below, two at a side, one at an end",
    ],
    "zone": [
        "line 0 0 100 0", "line 0 16 100 16", "arrow 106 0 106 16", "text 111 7 t",
        polygon([(0, 5), (100, 11), (100, -14), (0, -14)]), "text 50 -8 part", "text 50 19 tolerance zone",
        "line 0 8 100 8", "text 22 9 nominal face", "text 78 11 offset and tilts",
    ],
    "gap": [
        "box 0 0 100 24 reference part", turned((22, 40, 60, 22), -14, "moving part"), "circle 80.2 25.5 1.2",
        "arrow 80.2 24 80.2 25.5", "force 30 24 30 36", "text 35 31 n", "text 89 29 gap g",
        "circle 22 40 1.2", "arrow 22 24 22 40", "text 16 31 g > 0",
    ],
    "ends": [
        "box 0 0 34 14", polygon([(17, 14), (34, 32), (0, 32)]), "text 17 -8 corner on facet",
        polygon([(52, 0), (86, 0), (69, 16)]), "box 52 16 34 14", "text 69 -8 facet on corner",
        polygon([(104, 0), (138, 0), (138, 8), (104, 16)]), polygon([(112, 12.2), (148, 30), (112, 34)]),
        "text 122 -8 edge across edge",
    ],
    "stations": [
        "box 0 14 60 10 front", "box 48 24 60 10 rear", "force 8 0 8 14", "force 40 0 40 14", "force 100 8 100 24",
        "text 52 44 1: placed in a fixture, joined", "box 140 14 60 10", "box 188 24 60 10",
        "force 148 0 148 14", "force 238 8 238 24", "text 196 44 2: placed on other points",
    ],
    "datum": [
        *curve([(x, 8 + 3 * bumps(x)) for x in FACE]), "line 0 8.6 100 8.6", "text 50 -8 below the curve: the material",
        "line 0 12.3 100 12.3", "text 22 14 datum: outside the material", "text 52 0 least-squares plane", "force 80 4 80 8.4",
    ],
    "bonus": [
        "circle 0 0 20 least hole", "circle 0 0 3", "text 0 -28 zone t", "circle 62 0 24 larger hole", "circle 62 0 7",
        "text 62 -32 zone t + bonus",
    ],
    "clash": [
        "box 0 0 70 20 base", turned((14, 19, 42, 12), -9, "block"), "text 35 -9 without contact",
        "box 100 0 70 20 base", "box 114 20 42 12 block", "text 135 -9 with contact",
    ],
    "stack": [
        "line -4 0 150 0", "box 0 0 40 30 spacer 40", "box 40 0 60 30 block 60", "box 130 0 8 44", "box -8 0 8 44",
        "arrow 0 38 130 38 opening 130.4", "arrow 100 12 130 12 gap", "text 20 -10 +-0.05", "text 70 -10 +-0.08",
        "text 134 -10 +-0.15",
    ],
    "pins": [
        "box 0 0 120 80", "circle 20 40 6", "line 96 34 104 34", "line 96 46 104 46", "circle 96 40 6", "circle 104 40 6",
        "arrow 20 16 100 16 80", "text 20 54 diameter 8.1 +0.05", "text 96 54 slot 8.1 +0.05",
        *frame(4, 64, "POS", "0.1 M", "A B C"),
        "text -6 40 C", "text 60 -8 B",
    ],
    "bracket": [
        "box 14 0 62 28 bracket", "circle 0 14 14", "circle 90 14 14", "circle 0 14 5.5", "circle 90 14 5.5", "circle 0 14.5 5",
        "circle 90 14.5 5", "force 55 -2 55 -22 weight", "arrow 0 36 90 36 90", "text 0 -8 M10 in 11", "text 90 -8 M10 in 11",
        *frame(20, 44, "POS", "0.9", "A B C"),
    ],
    "cover": [
        "box 0 0 120 80", "circle 15 15 4", "circle 105 65 4", "arrow 0 -8 120 -8 120", "arrow 128 0 128 80 80",
        "text 34 13 8.1 +0.03", "text 92 56 slot 8.1",
        *frame(22, 22, "POS", "0.2 M", "A B C"), *frame(30, 66, "PROF", "0.4", "A B C"),
        "text -6 40 C", "text 40 4 B", "text 60 40 A: underside",
    ],
    "door": [
        "box -16 0 12 80 body", "box 104 0 12 80 body", "box 0 0 100 80 door", "arrow -4 90 0 90 gap",
        "arrow 100 90 104 90 gap",
        "circle 8 8 3", "circle 92 8 3", "circle 8 72 3", "circle 92 72 3", "text 50 12 four bump stops behind",
        "text 8 60 hinge",
        "text 8 24 hinge", "text 92 44 striker",
    ],
    "rail": [
        "box 0 14 100 12 front", "box 88 26 100 12 rear", "box 191 26 24 12 bracket", "force 8 0 8 14", "force 80 0 80 14",
        "force 110 10 110 26", "force 180 10 180 26", "arrow 189 46 191 46 flush",
    ],
    "beam": [
        "box 0 14 180 8 rail", "box 4 0 12 14", "box 84 0 12 11", "box 164 0 12 14", "force 10 40 10 23 bolt",
        "force 90 40 90 23", "force 170 40 170 23", "arrow 100 11 100 14 low",
    ],
    "seal": [
        *curve([(x, 21.5 + bumps(x)) for x in FACE]), "box 0 -6 100 24 base, seat flat within 0.02",
        polygon([*((x, 22 + bumps(x)) for x in FACE), (100, 40), (0, 40)]), "text 50 32 lid, underside flat within 0.05",
        "force 20 54 20 40 F", "force 80 54 80 40 F", "arrow 106 18 106 22 gap",
    ],
    "measured": [
        "box 0 0 90 24 shaft block", "circle 20 12 5", "circle 70 12 5", "arrow 20 34 70 34 50",
        "text 45 -8 CMM: distance of the bores of twelve parts", *frame(26, 44, "POS", "0.1", "A B"),
    ],
}  # fmt: skip


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, shapes in PICTURES.items():
        text = svg(tuple(shapes)).replace("</defs>", "</defs>" + GROUND)
        (folder / f"{name}.svg").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
