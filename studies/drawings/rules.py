"""Rules of the standards that change numbers, each with an example and its answer: python -m studies.drawings.rules.

All answers are worst cases by the zones and limits of the drawing: closed forms, which a search over the zones has to find.
"""

import argparse
import warnings
from pathlib import Path
from typing import Literal, NamedTuple

import trimesh

import tolcontact as tc
from studies.drawings.six import drilled, extremes
from studies.tables import write
from tolcontact.errors import NominalWarning


class Rule(NamedTuple):
    """A rule: where it stands, an example, the answer, its model, and the measure that is asked for."""

    rule: str
    standard: str
    example: str
    answer: str
    model: tc.Assembly
    measure: str


def holes(standard: Literal["ISO", "ASME"], system: str) -> tc.Assembly:
    """Return a plate with a bore 10 (+0.2/0), datum B, and two holes 30 and 60 from it, each 0.1 to a datum system."""
    model = tc.Assembly("holes", standard=standard)
    places = {(20.0, 20.0): 10.0, (50.0, 20.0): 8.0, (80.0, 20.0): 8.0}
    part = model.part("plate", tc.Mesh(drilled((100, 40, 10), places)), fixed=True)
    part.feature("A", part.face("-z"), datum="A")
    part.feature("C", part.face("-y"), datum="C")
    boxes = [tc.select.Inside((x - 9, y - 9, -1), (x + 9, y + 9, 11)) for x, y in places]
    walls = [part.face(tc.select.Cylinder(inner=True), box) for box in boxes]
    datum = part.feature("bore", walls[0], tc.Size(10, 0.2, 0), datum="B")
    first, last = (part.feature(f"H{k}", wall, tc.Position(0.1, system)) for k, wall in enumerate(walls[1:]))
    model.measure("place", datum.axis(0), to=first.axis(0), along="x")
    model.measure("distance", first.axis(0), to=last.axis(0), along="x")
    return model


def leaning_screw(*, is_projected: bool, hole: float) -> tc.Assembly:
    """Return a cover of 16 mm on a thread 20 deep, both within 0.2, and the room of a screw of 10 in the cover's hole."""
    model = tc.Assembly("fixed fastener", standard="ASME")
    base = model.part("base", tc.Mesh(drilled((60, 40, 20), {(30, 20): 8.5})), fixed=True)
    cover = model.part("cover", tc.Mesh(drilled((60, 40, 16), {(30, 20): hole})), at=(0, 0, 20))
    for part in (base, cover):
        for letter, face in {
            "A": part.face("+z" if part is base else "-z"),
            "B": part.face("-y"),
            "C": part.face("-x"),
        }.items():
            part.feature(letter, face, datum=letter)
    wall = tc.select.Cylinder(inner=True)
    thread = base.feature("thread", base.face(wall), tc.Position(0.2, "A|B|C", projected=16 if is_projected else None))
    bore = cover.feature("hole", cover.face(wall), tc.Position(0.2, "A|B|C", rule="translation"))
    model.locate(cover, tc.three_two_one(cover.face("-z"), cover.face("-y"), cover.face("-x"), inset=5), tolerance=0)
    screw = tc.fasten(model, "screw", 10, through=[bore], into=thread, seat=cover.face("+z"))
    model.may_overlap(cover, screw)
    model.measure("room", tc.Clearance(screw.face(tc.select.Cylinder(radius=5)), bore.faces[0]))
    return model


def block(outside: float | None) -> tc.Assembly:
    """Return a block with a profile of 0.4 on its top."""
    model = tc.Assembly("block")
    part = model.part("block", tc.Mesh(trimesh.creation.box(bounds=[(0, 0, 0), (50, 30, 20)])), fixed=True)
    part.feature("A", part.face("-z"), datum="A")
    top = part.feature("top", part.face("+z"), tc.Profile(0.4, "A", outside=outside))
    model.measure("height", top.point(25, 15, 20), along="z")
    return model


RULES = (
    Rule("no modifier", "ASME Y14.5", "hole 0.1 to a bore, 30 from it", "29.95 to 30.05", holes("ASME", "A|B"), "place"),
    Rule(
        "datum at maximum material", "ASME Y14.5", "the same, bore 10 +0.2/0 as B(M)", "29.85 to 30.15",
        holes("ASME", "A|B(M)"), "place",
    ),
    Rule(
        "simultaneous requirement", "ASME Y14.5, by default", "distance of two such holes", "29.9 to 30.1",
        holes("ASME", "A|B(M)|C"), "distance",
    ),
    Rule(
        "separate requirements", "ISO 5458, by default", "the same", "29.7 to 30.3", holes("ISO", "A|B(M)|C"), "distance",
    ),
    Rule("unequal profile", "ISO 1101 UZ, ASME Y14.5 U", "0.4, of it 0.3 outside", "-0.1 to 0.3", block(0.3), "height"),
    Rule("profile", "ISO 1101, ASME Y14.5", "0.4", "-0.2 to 0.2", block(None), "height"),
    Rule(
        "projected zone", "ASME Y14.5, ISO 10578", "least room of a screw 10 in a hole 10.4, both zones 0.2", "0 to 0.2",
        leaning_screw(is_projected=True, hole=10.4), "room",
    ),
    Rule(
        "thread without it", "the formula, H = F + T1 + T2 (1 + 2P / D)", "the same in a hole 10.72", "0 to 0.36",
        leaning_screw(is_projected=False, hole=10.72), "room",
    ),
)  # fmt: skip


def main() -> None:
    """Print the table, and write it into the README."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, help="folder of a README with the table: by default the study's")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", NominalWarning)
    rows: list[list[object]] = [["rule", "standard", "example", "answer, mm", "worst case computed, mm"]]
    rows += [[*rule[:4], extremes(rule.model, rule.measure)] for rule in RULES]
    write(__file__, {"rules": rows}, arguments.to)


if __name__ == "__main__":
    main()
