"""The check of drawings: each of these has one mistake, or none, that a senior checker would mark."""

import re

import pytest
import trimesh

import tolcontact as tc
from tests.cases.toleranced import plate_with_holes
from tests.helpers import call
from tests.pmi_records import Annotated
from tests.test_cad import COVER
from tolcontact.discretization import discretize
from tolcontact.plausibility import drawing_remarks

FLAT, SQUARE = tc.Flatness(0.01), tc.Perpendicularity(0.05, "A")
PLACED, BOTH = tc.Profile(0.2, "A|B|C"), tc.Perpendicularity(0.1, "A|B")


def block(*far, side=(SQUARE,), end=(BOTH,), form=(FLAT,)) -> tc.Assembly:
    """A block with datums A, B and C, and tolerances of its far end."""
    a = tc.Assembly("block")
    b = a.part("block", tc.Box(100, 50, 10), fixed=True)
    b.feature("bottom", b.face("-z"), *form, datum="A")
    b.feature("side", b.face("-y"), FLAT, *side, datum="B")
    b.feature("end", b.face("-x"), FLAT, *end, datum="C")
    a.measure("x", b.feature("far", b.face("+x"), *far).point(100, 25, 5), along="x")
    return a


def turned_about() -> tc.Assembly:
    """A block whose datum B is square to A, and comes before A in one system."""
    a = block(PLACED)
    (b,) = a.parts
    b.feature("top", b.face("+z"), tc.Profile(0.2, "B|A"))
    return a


def targeted(*of_side) -> tc.Assembly:
    """A block whose datums touch it at targets."""
    a = tc.Assembly("block")
    b = a.part("block", tc.Box(100, 50, 10), fixed=True)
    faces = {"A": ("-z", ()), "B": ("-y", of_side), "C": ("-x", (tc.Perpendicularity(0.1, "A|B"),))}
    points = {"A": [(5, 5, 0), (95, 5, 0), (50, 45, 0)], "B": [(5, 0, 5), (95, 0, 5)], "C": [(0, 25, 5)]}
    for letter, (side, tolerances) in faces.items():
        feature = b.feature(f"face {letter}", b.face(side), FLAT, *tolerances)
        b.datum_targets(letter, *(feature.point(*point) for point in points[letter]))
    a.measure("x", b.feature("far", b.face("+x"), PLACED).point(100, 25, 5), along="x")
    return a


def on_two_pads(*of_second) -> tc.Assembly:
    """A block with a common datum of two pads."""
    a = tc.Assembly("pads")
    b = a.part("block", tc.Box(100, 50, 10), fixed=True)
    pads = {"A": ((0, 0, -1), (30, 50, 1), ()), "B": ((60, 0, -1), (100, 50, 1), of_second)}
    for letter, (lower, upper, tolerances) in pads.items():
        b.feature(f"pad {letter}", b.face("-z", tc.select.Inside(lower, upper)), FLAT, *tolerances, datum=letter)
    a.measure("z", b.feature("top", b.face("+z"), tc.Profile(0.2, "A-B")).point(50, 25, 10), along="z")
    return a


def drilled(*tolerances, standard="") -> tc.Assembly:
    """A plate with two holes, located on A and B alone, along x nothing locks."""
    _, plate, faces = plate_with_holes(2)
    a = tc.Assembly("drilled", standard=standard)
    part = a.part("plate", plate.geometry, fixed=True)
    for feature, more in zip(plate.features[:2], ((), (SQUARE,)), strict=True):
        part.feature(feature.name, part.face(*feature.faces[0].selections), FLAT, *more, datum=feature.datum)
    holes = part.pattern("H", *(part.face(*face.selections) for face in faces), *tolerances)
    a.measure("x", holes.members[0].axis(1), along="x")
    return a


def pin(standard: str, roundness: float) -> tc.Assembly:
    a = tc.Assembly("pin", standard=standard)
    part = a.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 30, sections=96)), fixed=True)
    barrel = part.face(tc.select.Cylinder(5))
    shank = part.feature("shank", barrel, tc.Size(10, 0, -0.02), tc.Cylindricity(roundness), datum="A")
    part.feature("foot", part.face("-z"), tc.Perpendicularity(0.1, "A"), FLAT, datum="B")
    part.feature("head", part.face("+z"), tc.Profile(0.2, "A|B"))
    a.measure("x", shank.point(5, 0, 0), along="x")
    return a


def box_on_table() -> tc.Assembly:
    a = tc.Assembly("seat")
    table = a.part("table", tc.Box(100, 100, 10), at=(-25, -25, -10), fixed=True)
    box = a.part("box", tc.Box(50, 50, 10))
    a.locate(box, tc.three_two_one(box.face("-z"), box.face("-y"), box.face("-x")), tolerance=0.1)
    a.contact("seat", moving=box.face("-z"), reference=table.feature("top", table.face("+z"), FLAT, datum="A"))
    a.measure("z", box.point(0, 0, 10), along="z")
    return a


def at_its_boundary() -> tc.Assembly:
    """A pin whose shank is datum A(M) of its head: the gauge element is no feature of the drawing."""
    a = tc.Assembly("pin", standard="ASME")
    part = a.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 30, sections=96)), fixed=True)
    shank = part.feature("shank", part.face(tc.select.Cylinder(5)), tc.Size(10, 0, -0.02), tc.Cylindricity(0.03), datum="A")
    part.feature("head", part.face("+z"), tc.Perpendicularity(0.1, "A(M)"), FLAT, datum="B")
    part.feature("foot", part.face("-z"), tc.Profile(0.2, "A|B"))
    a.measure("x", shank.point(5, 0, 0), along="x")
    return a


SIZED = tc.Size(8, 0.1), tc.Position(0.2, "A|B")
DRAWINGS = {
    "complete": (block(PLACED), None),
    "square datum": (block(PLACED, side=()), 'feature "side" .*no tolerance limits tilt z to the datums before B.*tc.Perpend'),
    "third datum": (block(PLACED, end=()), 'feature "end" .*limits tilt y, tilt z to the datums before C'),
    "third datum half": (block(PLACED, end=(SQUARE,)), 'feature "end" .*limits tilt y to the datums before C'),
    "each datum first once": (turned_about(), None),
    "location": (block(tc.Perpendicularity(0.2, "A|B|C")), 'feature "far" .*limits offset: .*add tc.Position or tc.Profile'),
    "rough seat": (block(PLACED, form=()), 'part "block": datum A: no tolerance of form'),
    "form that is stated alone": (block(PLACED, form=(tc.Flatness(0.01, form=None),)), None),
    "forgotten": (block(tc.Flatness(0.1), tc.Profile(0.3, "A|B|C"), side=(SQUARE,)), None),
    "targets": (targeted(SQUARE), None),
    "targets, square datum": (targeted(), 'feature "face B" .*limits tilt z to the datums before B'),
    "common datum": (on_two_pads(), 'feature "pad B" .*limits offset, tilt x, tilt y to the datums before B'),
    "common datum, square": (on_two_pads(tc.Profile(0.1, "A")), None),
    "lower segment alone": (drilled(tc.Size(8, 0.1), tc.Position(0.1, "A><|B><")), "common shift x, .*add tc.Position or"),
    "open": (drilled(*SIZED), "H.*no tolerance limits common shift x"),
    "open, separate": (drilled(*SIZED, standard="ISO"), "H.*no tolerance limits shift x, shift x"),
    "exact, with a profile": (drilled(tc.Profile(0.2, "A|B")), "H.*exactly 8 mm, although its profile limits the size, too"),
    "exact holes": (drilled(tc.Position(0.2, "A|B")), "H.*it is a cylinder of exactly 8 mm, without limits of size.*tc.Size.8"),
    "moot form": (pin("ASME", 0.03), r'"shank".*no finer than the size .\+0 -0.02., whose envelope limits'),
    "moot form of a datum with play": (
        at_its_boundary(),
        r'"shank".*no finer than the size .\+0 -0.02., whose envelope limits',
    ),
    "independent form": (pin("ISO", 0.03), None),
    "finer form": (pin("ASME", 0.01), None),
    "modifier of a plane": (
        block(tc.Profile(0.2, "A|B(M)|C")),
        r'"far".*datum B has no size, so a material modifier',
    ),
    "perfect face": (box_on_table(), r"no tolerance touches the faces in contact of box \(seat\)"),
}


@pytest.mark.parametrize(("model", "found"), DRAWINGS.values(), ids=DRAWINGS)
def test_what_a_drawing_leaves_open_is_named(model, found):
    sentences = list(drawing_remarks(discretize(model)))
    assert bool(sentences) == bool(found), sentences
    assert found is None or sum(bool(re.search(found, sentence)) for sentence in sentences) == 1, sentences


def test_drawings_are_checked_before_anything_is_located_or_measured(tmp_path):
    """A STEP file and the script that it makes: the same remarks, with equal ones of several features in one line."""
    file = Annotated(COVER.read_text())
    file.datum("A", 5)
    for face in (3, 4):
        file.size(file.aspect(face), 6, (-0.05, 0.05), "radius")
    file.write(tmp_path / "cover.stp")
    (tmp_path / "part.py").write_text(call(tmp_path, "pmi", "cover.stp", "--script").stdout)
    read, written = (call(tmp_path, "check", name, "--drawing") for name in ("cover.stp", "part.py"))
    remarks = [line for line in read.stdout.splitlines() if line.startswith("drawing:")]
    assert 'features "cylinder 3", "cylinder 4": no geometric tolerance limits its place in the part' in remarks[0]
    assert [re.sub(r" \(part.py:\d+\)", "", line) for line in written.stdout.splitlines()] == remarks
    assert read.returncode == 0 and written.returncode == 2 and "it measures nothing" in written.stderr
    assert "with the option --drawing alone" in call(tmp_path, "check", "cover.stp").stderr
    (tmp_path / "plain.stp").write_text(COVER.read_text())
    assert '"plain.stp" is not an AP242 file' in call(tmp_path, "check", "plain.stp", "--drawing").stderr


def test_the_command_prints_it_when_it_is_asked(tmp_path):
    lines = [
        "import tolcontact as tc", "def assembly():", "    a = tc.Assembly('a')",
        "    b = a.part('b', tc.Box(9, 9, 9), fixed=True)",
        "    a.measure('x', b.feature('f', b.face('+x'), tc.Flatness(0.1)).point(9, 4, 4), along='x')", "    return a",
    ]  # fmt: skip
    (tmp_path / "m.py").write_text("\n".join(lines))
    silent, asked = (call(tmp_path, "check", "m.py", *more).stdout for more in ([], ["--drawing"]))
    assert "drawing:" not in silent
    assert 'drawing: part "b": feature "f"' in asked and "no tolerance limits" in asked
