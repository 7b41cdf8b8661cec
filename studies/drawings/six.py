"""Six drawings of public origin, three by ASME and three by ISO, declared from nothing: python -m studies.drawings.six.

Each function declares its drawing, with zones `times` as wide. Faces are chosen by what a person sees: a side, a radius, a box
around a hole. Six minutes or less.
"""

import argparse
import gzip
import inspect
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from scipy.stats import binomtest

import tolcontact as tc
from studies.tables import with_interval, write
from tolcontact.errors import NominalWarning
from tolcontact.vocabulary import Status

NIST = Path(__file__).parents[1] / "benchmarks" / "cad" / "nist_ctc_01_asme1_ap242-e1.stp.gz"
Place = tuple[float, float]


def floating_fasteners(times: float = 1) -> tc.Assembly:
    """ASME Y14.5M, appendix B: fasteners of 6 mm at most in holes of 6.44 mm at least, T = H - F = 0.44 mm in each part."""
    model = tc.Assembly("floating fasteners", standard="ASME")
    tolerances = tc.Size(6.44, 0.1, 0), tc.Position(times * 0.44, "A|B|C", material="M")
    lower, below = plate(model, "lower", 0, 6.44, *tolerances, fixed=True)
    upper, above = plate(model, "upper", 8, 6.44, *tolerances, fixed=False)
    located(model, upper)
    for number, holes in enumerate(zip(above, below, strict=True)):
        tc.fasten(model, f"bolt {number}", tc.Size(6, 0, -0.1), through=holes)
    model.measure("shift", upper.point(0, 0, 8), to=lower.point(0, 0, 8), along="x")
    return model


def fixed_fasteners(times: float = 1) -> tc.Assembly:
    """ASME Y14.5M, appendix B: the same fasteners in threads, T = (H - F) / 2 = 0.22 mm in each part, projected."""
    model = tc.Assembly("fixed fasteners", standard="ASME")
    position = tc.Position(times * 0.22, "A|B|C", material="M")
    _, threads = plate(model, "lower", 0, 5, tc.Position(times * 0.22, "A|B|C", projected=16), fixed=True)
    upper, bores = plate(model, "upper", 8, 6.44, tc.Size(6.44, 0.1, 0), position, fixed=False)
    located(model, upper)
    for number, (bore, thread) in enumerate(zip(bores, threads, strict=True)):
        screw = tc.fasten(model, f"screw {number}", tc.Size(6, 0, -0.1), through=[bore], into=thread, seat=upper.face("+z"))
        model.may_overlap(upper, screw)  # its head is as square as its thread
    model.measure("shift", upper.point(0, 0, 8), along="x")
    return model


def nist_ctc_01(times: float = 1) -> tc.Assembly:
    """NIST, test case CTC 01, ASME Y14.5, from its AP242 file: a slot whose median plane lies within 0.75 mm of its place."""
    path = Path(tempfile.mkdtemp()) / "ctc_01.stp"
    path.write_bytes(gzip.decompress(NIST.read_bytes()))
    model = tc.Assembly("CTC 01", standard="ASME")
    declared = tc.io.features_from_pmi(model.part("part", tc.Mesh(path), fixed=True))
    slot: Any = next(feature for feature in declared.features if feature.name == "slot 38")
    model.measure("slot", slot.point(-107.5, 117.5, -16.67), along="x")
    return model


def eight_holes(times: float = 1) -> tc.Assembly:
    """ISO 1101, position of a median line: 8 holes of 12 mm in two rows, 20 and 15 from C and B, 30 apart, within 0.1."""
    model = tc.Assembly("eight holes", standard="ISO")
    places = [(20 + 30 * column, 15 + 30 * row) for row in range(2) for column in range(4)]
    part = model.part("plate", tc.Mesh(drilled((130, 60, 10), dict.fromkeys(places, 12.0))), fixed=True)
    for letter, side in {"A": "-z", "B": "-y", "C": "-x"}.items():
        part.feature(letter, part.face(side), tc.Flatness(0.01), datum=letter)
    walls = tc.select.Cylinder(inner=True)
    holes = [part.face(walls, tc.select.Inside((x - 9, y - 9, -1), (x + 9, y + 9, 11))) for x, y in places]
    pattern = part.pattern("holes", *holes, tc.Size(12, 0.05, -0.05), tc.Position(times * 0.1, "A|B|C"))
    first, last = pattern.members[0].faces[0], pattern.members[3].faces[0]
    model.measure("distance", tc.AxisDistance(first, last, across=(0, 0, 1)))
    return model


def shaft_in_two_bearings(times: float = 1) -> tc.Assembly:
    """ISO 1101, coaxiality: the middle of a stepped shaft lies within 0.08 about the common axis of its journals, A-B."""
    model = tc.Assembly("shaft", standard="ISO")
    profile = [(0, 0), (10, 0), (10, 30), (16, 30), (16, 70), (9, 70), (9, 100), (0, 100)]
    part = model.part("shaft", tc.Mesh(trimesh.creation.revolve(np.array(profile), sections=96)), fixed=True)
    for letter, radius in {"A": 10, "B": 9}.items():
        part.feature(letter, part.face(tc.select.Cylinder(radius=radius)), tc.Size(2 * radius, 0, -0.02), datum=letter)
    middle = part.feature("middle", part.face(tc.select.Cylinder(radius=16)), tc.Coaxiality(times * 0.08, "A-B"))
    model.measure("x", middle.point(0, 0, 50), along="x")
    return model


def pin_and_hole(times: float = 1) -> tc.Assembly:
    """ISO 2692, annex A: a pin of 35 (0/-0.1) and a hole of 35.2 (+0.1/0), both square to A within 0.1 at maximum material."""
    model = tc.Assembly("pin and hole", standard="ISO")
    square = tc.Perpendicularity(times * 0.1, "A", material="M")
    profile = np.array([(0, 0), (40, 0), (40, 10), (17.5, 10), (17.5, 40), (0, 40)])
    base = model.part("base", tc.Mesh(trimesh.creation.revolve(profile, sections=96)), fixed=True)
    under = base.feature("A", base.face("+z", tc.select.Inside((-41, -41, 9), (41, 41, 11))), datum="A")
    pin = base.feature("pin", base.face(tc.select.Cylinder(radius=17.5)), tc.Size(35, 0, -0.1), square)
    ring = model.part("ring", tc.Mesh(trimesh.creation.annulus(17.6, 40, 30, sections=96)), at=(0, 0, 25))
    seat = ring.feature("A", ring.face("-z"), datum="A")
    hole = ring.feature("hole", ring.face(tc.select.Cylinder(inner=True)), tc.Size(35.2, 0.1, 0), square)
    feet = [tc.Locator(f"Z{k}", (30 * x, 30 * y, -15), "z", 0) for k, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1)])]
    model.locate(ring, [*feet, tc.Locator("turn", (30, 0, 0), "y", 0)], floating=True)
    model.contact("fit", moving=hole, reference=pin)
    model.contact("seat", moving=seat, reference=under)
    model.force("weight", at=ring.point(0, 0, 0), vector=(0, 0, -10))
    model.measure("opening", tc.LargestGap(seat.faces[0], under.faces[0]))
    return model


class Drawing(NamedTuple):
    """A drawing: its model, by a factor of its zones; what is asked, expected, and left out; a measure with extremes."""

    model: Callable[[float], tc.Assembly]
    asked: str
    expected: str
    measure: str = ""
    left_out: str = "nothing"


TOGETHER = "% that do not go together; with zones four times as wide"
DRAWINGS = (
    Drawing(floating_fasteners, TOGETHER, "0; more", left_out="the other holes of the pattern"),
    Drawing(fixed_fasteners, TOGETHER, "0; more", left_out="the form of the thread, the other holes"),
    Drawing(
        nist_ctc_01, "worst places of a point of the slot, mm", "-0.375 to 0.375", "slot",
        "five dimensions: angles, distances, sizes without limits",
    ),
    Drawing(eight_holes, "least and largest distance of two holes, mm", "89.9 to 90.1", "distance"),
    Drawing(shaft_in_two_bearings, "worst places of the axis in the middle, mm", "-0.04 to 0.04", "x"),
    Drawing(pin_and_hole, TOGETHER, "0; more"),
)  # fmt: skip


def drilled(size: tuple[float, float, float], holes: Mapping[Place, float]) -> trimesh.Trimesh:
    """Return a plate with a corner at the origin, with holes of given diameters at places (x, y)."""
    slab = trimesh.creation.box(bounds=[(0, 0, 0), size])
    drills = [trimesh.creation.cylinder(diameter / 2, 4 * size[2], sections=96) for diameter in holes.values()]
    for drill, (x, y) in zip(drills, holes, strict=True):
        drill.apply_translation((x, y, 0))
    return trimesh.boolean.difference([slab, *drills], engine="manifold")


def plate(model: tc.Assembly, name: str, z: float, diameter: float, *tolerances: Any, fixed: bool) -> tuple[Any, Any]:
    """Return a plate of 60 x 40 x 8 mm with datums A, B and C, and its two holes."""
    places = [(15.0, 20.0), (45.0, 20.0)]
    part = model.part(name, tc.Mesh(drilled((60, 40, 8), dict.fromkeys(places, diameter))), at=(0, 0, z), fixed=fixed)
    part.feature("A", part.face("-z"), datum="A")
    part.feature("B", part.face("-y"), datum="B")
    part.feature("C", part.face("-x"), datum="C")
    walls = tc.select.Cylinder(inner=True)
    holes = [part.face(walls, tc.select.Inside((x - 9, y - 9, -1), (x + 9, y + 9, 9))) for x, y in places]
    return part, part.pattern("holes", *holes, *tolerances).members


def located(model: tc.Assembly, upper: Any) -> None:
    """Locate a plate on its datums, from which its bolts may move it, and on the plate below."""
    scheme = tc.three_two_one(upper.face("-z"), upper.face("-y"), upper.face("-x"), inset=5)
    model.locate(upper, scheme, tolerance=0)
    model.contact("seat", moving=upper.face("-z"), reference=model.parts[0].face("+z"))


def failing(model: tc.Assembly, samples: int) -> str:
    """Return the percentage of realizations that cannot be assembled, with its interval."""
    with tc.run(model, samples=samples, fields="none", surfaces=0) as results:
        status = results.to_dataset()["status"].values
    count = int((status == Status.NOT_ASSEMBLABLE).sum())
    lost = int(np.isin(status, [Status.NOT_CONVERGED, Status.DOUBTFUL]).sum())
    interval = binomtest(count, len(status)).proportion_ci()
    text = with_interval(*(100 * share for share in (count / len(status), interval.low, interval.high)))
    return f"{text}, {lost} not resolved" if lost else text


def extremes(model: tc.Assembly, measure: str) -> str:
    """Return the worst values of a measure."""
    worst = tc.analyses.worst_case(model)["worst"].sel(measure=measure, state="corrected")
    return " to ".join(f"{float(worst.sel(end=end)):.4f}" for end in ("least", "largest"))


def main() -> None:
    """Print the table, and write it into the README."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=2000, help="realizations of each assembly")
    parser.add_argument("--to", type=Path, help="folder of a README with the table: by default the study's")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", NominalWarning)
    rows: list[list[object]] = [["drawing", "lines", "s", "asked", "expected", "computed", "left out"]]
    for make, asked, expected, measure, left_out in DRAWINGS:
        began = time.process_time()
        computed = (
            extremes(make(1), measure) if measure else "; ".join(failing(make(times), arguments.samples) for times in (1, 4))
        )
        lines = len(inspect.getsource(make).splitlines()) - 3  # without its name, docstring and result
        name, seconds = make.__name__.replace("_", " "), f"{time.process_time() - began:.1f}"
        rows.append([name, lines, seconds, asked, expected, computed, left_out])
    write(__file__, {"drawings": rows}, arguments.to)


if __name__ == "__main__":
    main()
