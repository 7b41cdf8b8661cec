"""Fasteners in holes: the formulas of fixed and floating fasteners at their limits, and how far assemblies shift."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import tolcontact as tc
from tests.cases import STILL, Frame
from tests.cases.fastened import FOUR, THICKNESS, bolted, grown, held, hole, lying, most_room, placed, plate, shifts
from tests.cases.floating import SEATED
from tests.helpers import compiled, nightly, realizations
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import CORRECTED, RAW, Status

MOVED = Frame(turn=(0.3, -0.7, 1.1), shift=(300, -50, 20))
DRILLED = 2e-6  # [mm] of holes: vertices are in single precision
FITS, FAILS = (Status.UNTOUCHED, Status.RESOLVED), (Status.NOT_ASSEMBLABLE, Status.NOT_CONVERGED)
AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"


def block_of(a: tc.Assembly, *deviations: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Statuses, and least gaps (realization, state, pair) in holes, for deviations of some contributors."""
    program = compiled(a, solver="daqp")
    rows = [[row.get(label, 0.0) for label in program.nominal.contributors] for row in deviations]
    block = simulate_block(program, np.array(rows))
    return block.status, block.gap_min[:, :, : len(a.pairs)]


def apart(by: float, angle: float = 0.0, hole: int = 0, **halves: float) -> dict[str, float]:
    """Deviations by which holes of parts are shifted towards an angle, each by its half of the tolerance times `by`."""
    return {
        f"{part}.H{hole}.shift {axis}": by * half * share
        for part, half in halves.items()
        for axis, share in (("x", np.cos(angle)), ("y", np.sin(angle)))
    }


def run(a: tc.Assembly, samples: int):
    return realizations(compiled(a, solver="daqp"), samples)


def test_one_floating_fastener_passes_up_to_the_formula():
    """H - F = T; beyond it the bolt penetrates both holes alike."""
    a = bolted([(0, 0)], is_cover_fixed=True)
    factors, angles = (0.99, 0.99999, 1.01, 1.2), (0.0, 0.7, 2.5)
    status, gaps = block_of(a, *(apart(by, angle, base=0.5, cover=-0.5) for by in factors for angle in angles))
    fits = np.isin(status, FITS).reshape(len(factors), len(angles))
    assert fits.tolist() == [[True] * 3, [True] * 3, [False] * 3, [False] * 3]
    assert (status[6:] == Status.NOT_ASSEMBLABLE).all()
    depths = -gaps[6:, CORRECTED]
    assert np.abs(depths - np.repeat([0.005, 0.1], 3)[:, None]).max() < DRILLED


@pytest.mark.parametrize(
    ("into", "widths"), [(False, (1.0, 1.0)), (True, (0.3, 0.7)), *nightly((False, (0.6, 1.4)), (True, (1.0, 0.0)))]
)
def test_two_fasteners_go_in_up_to_the_formula(into, widths):
    """H - F = T of floating, T1 + T2 = H - F of fixed fasteners: holes are off outwards in one part, inwards in the other."""
    a = bolted([(-45, 0), (45, 0)], into=into, position=widths)
    factors = (0.99, 0.99999, 1.01, 1.1)
    off = {"base": widths[0] / 2, "cover": -widths[1] / 2}
    off = {part: half for part, half in off.items() if half}
    status, gaps = block_of(a, *(apart(by, hole=0, **off) | apart(-by, hole=1, **off) for by in factors))
    assert np.isin(status, FITS).tolist() == [True, True, False, False]
    assert np.isin(status[2:], FAILS).all()
    sharing = 2 if not into else 1  # holes along a bolt that share the depth
    expected = [(1 - by) * sum(widths) / 2 / sharing for by in factors[2:]]
    assert np.abs(gaps[2:, CORRECTED].min(axis=1) - expected).max() < DRILLED


def test_a_leaning_thread_needs_the_clearance_of_its_projected_zone():
    """H - F = T1 + T2 (1 + 2P / D), with P the thickness of the cover and D the depth of the thread, to first order."""
    first, second, depth = 0.04, 0.02, THICKNESS
    clearance = first + second * (1 + 2 * THICKNESS / depth)
    a = tc.Assembly("leaning")
    base = plate(a, "base", 0, {(0, 0): 8.5}, fixed=True)
    cover = plate(a, "cover", 1, {(0, 0): 10 + clearance})
    thread = hole(base, "H0", (0, 0), tc.Position(second, "A|B|C"))
    bore = hole(cover, "H0", (0, 0), tc.Position(first, "A|B|C", rule="translation"))
    a.locate(cover, held())
    tc.fasten(a, "screw", 10, through=[bore], into=thread, seat=cover.face("+z"))
    a.measure("x", cover.point(0, 0, 0), along="x")
    rows = [{"base.H0.tilt x": by * second / 2, "cover.H0.shift x": -by * first / 2} for by in (0.99, 1.0, 1.02)]
    gaps = block_of(a, *rows)[1][:, RAW, 0]
    ellipse = 5 * (second / depth) ** 2 / 2  # of second order: a leaning shank is wider
    assert np.abs(gaps - np.array([0.01, 0.0, -0.02]) * clearance / 2).max() < 1.1 * ellipse < 0.0005 * clearance


@pytest.mark.slow
@pytest.mark.parametrize(("into", "width"), [(False, 2.0), *nightly((True, 1.0))])
def test_the_share_that_does_not_fit_is_that_of_the_closed_form(into, width):
    """P = exp(-c^2 / (4 s^2)) that axes, each N(0, s^2) in x and y, are off each other by more than the clearances c."""
    room = 0.5 if into else 1.0
    a = bolted([(0, 0)], into=into, position=(width, width), is_cover_fixed=not into)
    if into:
        a = a.replaced(locations=[location for location in a.locations if location.part is not a.parts[1]])
        a.locate(a.parts[1], held())
    results = run(a, samples=1500)
    off = np.linalg.norm(shifts(results, "base", 1) - shifts(results, "cover", 1), axis=2)[:, 0]
    is_tight = results.gap_min.sel(state="raw").min("pair").values < -1e-9 if into else results.status == Status.NOT_ASSEMBLABLE
    assert (np.asarray(is_tight) == (off > room)).all()
    spread = width / 2 / np.sqrt(-2 * np.log(0.0027))
    low, high = binom.interval(0.9999, len(off), np.exp(-(room**2) / (4 * spread**2)))
    assert 30 < low <= int(np.sum(is_tight)) <= high


@pytest.mark.slow
@pytest.mark.parametrize("samples", [20, *nightly(300)])
def test_a_bolt_lets_a_cover_shift_by_both_clearances(samples):
    a = bolted([(0, 0)], method=SEATED, position=(0.3, 0), size=0.1, shank=tc.Size(10, 0.0, -0.1))
    cover = a.parts[1]
    turning = tc.Locator("turn", (40, 0, 0), "y", 0.0)  # one bolt does not keep a cover from turning
    locations = [location for location in a.locations if location.part is not cover]
    a = a.replaced(locations=locations)
    a.locate(cover, [*lying(), turning], floating=True)
    a.force("pull", at=cover.point(0, 0, 0), vector=(3, 4, 0))
    results = run(a, samples=samples)
    assert_resolved(results)
    drawn = results["sample"].deviation
    room = 1.0 + (grown(results, "base", 1) + grown(results, "cover", 1))[:, 0] / 2
    room -= drawn.sel(contributor="bolt 1.shank.size").values
    for k, (axis, share) in enumerate((("x", 0.6), ("y", 0.8))):
        moved = results.measured.sel(state="corrected", measure=axis).values
        # What forces press yields by 0.1 % of travel / size (see seating).
        assert np.abs(moved - shifts(results, "base", 1)[:, 0, k] - share * room).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("into", "room"), [(False, 1.0), *nightly((True, 0.5))])
def test_two_bolts_let_a_cover_turn_and_shift(into, room):
    """A couple turns it until both holes have moved by all clearances: 2 (90 / 2) sin(turn / 2); a force shifts it by them."""
    turned, shifted = (bolted([(-45, 0), (45, 0)], into=into, method=SEATED, position=(0, 0)) for _ in range(2))
    for x, y in ((60, 5), (-60, -5)):
        turned.force(f"at {x}", at=turned.parts[1].point(x, 0, 0), vector=(0, y, 0))
    shifted.force("pull", at=shifted.parts[1].point(0, 0, 0), vector=(0, 5, 0))
    angle = 2 * np.arcsin(room / 90)
    for a, expected in ((turned, 60 * np.sin(angle)), (shifted, room)):
        results = run(a, samples=2)
        assert_resolved(results)
        assert np.abs(results.measured.sel(state="corrected", measure="end y") - expected).max() < 5e-6


@pytest.mark.slow
@pytest.mark.parametrize("into", [True, *nightly(False)])
def test_four_fasteners_go_in_if_a_linear_program_finds_a_place_for_the_cover(into):
    """Shift and turn of the cover, to first order, so that each pair of holes is off by no more than its clearances."""
    shank = 10.0 if into else tc.Size(10, 0.0, -0.1)
    a = bolted(FOUR, into=into, position=(1.3, 1.3) if into else (3.0, 3.0), size=0.1, shank=shank)
    results = tc.run(compiled(a, solver="daqp"), samples=80 if into else 40, fields="none", surfaces=0)
    off = shifts(results, "cover", 4) - shifts(results, "base", 4)
    room = 0.5 + grown(results, "cover", 4) / 2
    if not into:
        drawn = results["sample"].deviation
        sizes = np.array([drawn.sel(contributor=f"bolt {k + 1}.shank.size").values for k in range(4)]).T
        room += 0.5 + grown(results, "base", 4) / 2 - sizes
    most = np.array([most_room(*row) for row in zip(off, room, strict=True)])
    status = results.status.values
    sure = np.abs(most) > 3e-4  # of a circle's polygon, and of second order
    assert sure.mean() > 0.97
    assert (np.isin(status, FAILS) == (most < 0))[sure].all()
    assert 0.05 < (most < 0).mean() < 0.95
    assert_gaps_recompute(results)


def stack(frame: Frame = STILL, **options) -> tc.Assembly:
    """A bolt through two plates, one of which is moved by it."""
    return bolted([(-45, 0), (45, 0)], position=(1.9, 1.9), size=0.1, frame=frame, **options)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_bolted_assembly_is_rebuilt_from_its_archive_and_from_json(tmp_path):
    a = stack(shank=tc.Size(10, 0.0, -0.1))
    results = tc.run(a, samples=30, solver="daqp", keep="all")
    assert_gaps_recompute(results)
    again = tc.io.model_of(results)
    assert [str(location) for location in again.locations] == [str(location) for location in a.locations]
    assert_same_run(results, tc.run(again, samples=30, solver="daqp", keep="all"))
    for part in a.parts[:2]:
        part.geometry.source.export(tmp_path / f"{part.name}.ply")
    files = {part.name: tc.Mesh(tmp_path / f"{part.name}.ply", units="mm") for part in a.parts[:2]}
    for part in a.parts[:2]:
        object.__setattr__(part, "geometry", files[part.name])
    tc.io.write_model(a, tmp_path / "bolted.json")
    from_json = tc.run(tmp_path / "bolted.json", samples=30, solver="daqp")
    assert np.abs(from_json.measured - results.measured).max() < 1e-4
    assert "pin 10 x 18.5 mm with a head" in {str(part.geometry) for part in tc.io.model_of(from_json).parts}


def test_a_fastener_expands_into_plain_declarations():
    a = stack(method=SEATED, pushed=(0, 0, -3))
    bolt = a.parts[2]
    assert str(bolt) == "part bolt 1: pin 10 x 18.5 mm with a head at (-45, 0, 16)"
    assert [str(pair) for pair in a.pairs[:2]] == [
        "contact bolt 1 in cover: cover inner cylinders inside (-53, -8, -1) to (-37, 8, 9) (moving) against bolt 1 outer "
        "cylinders of radius 5 mm (reference), points by geometry",
        "contact bolt 1 in base: bolt 1 outer cylinders of radius 5 mm (moving) against base inner cylinders inside "
        "(-53, -8, -1) to (-37, 8, 9) (reference), points by geometry",
    ]
    assert str(a.locations[1]) == "location of bolt 1 on bolt 1 seat of cover: 6 locators, floating"
    assert a.locations[2].on is a.locations[1].on  # the same plane
    assert str(a.forces[0]) == "force bolt 1 push: (0, 0, -3) N at bolt 1 (0, 0, -9.25)"
    screwed = bolted([(0, 0)], into=True)
    assert str(screwed.locations[1]) == "location of bolt 1 on H0 of base: 6 locators"
    assert [pair.name for pair in screwed.pairs] == ["bolt 1 in cover"]
    assert tc.check(a) == () and tc.check(screwed) == ()


@pytest.mark.parametrize("head", [True, False])
def test_a_part_that_stands_in_its_holes_can_be_a_fastener(head):
    a = tc.Assembly("dowels")
    base = plate(a, "base", 0, {(-45, 0): 10, (45, 0): 10}, fixed=True)
    cover = plate(a, "cover", 1, {(-45, 0): 10.2, (45, 0): 10.2})
    a.locate(cover, held(), tolerance=0)
    for k, x in enumerate((-45, 45)):
        pressed = hole(base, f"H{k}", (x, 0), tc.Position(0.1, "A|B|C", rule="translation"))
        dowel = a.part(f"dowel {k}", tc.Pin(10, 15, head=head), at=(x, 0, 16))
        if k:
            dowel.feature("shank", dowel.face(tc.select.Cylinder(radius=5)), tc.Size(10, 0.01))
        shank = dowel if k else dowel.face(tc.select.Cylinder(radius=5))
        assert tc.fasten(a, f"dowel {k}", shank, through=[hole(cover, f"H{k}", (x, 0))], into=pressed) is dowel
        for axis in "xy":
            a.measure(f"{axis}{k}", pressed.axis(1), to=dowel.point(0, 0, -8), along=axis)
    results = run(a, samples=20)
    assert_resolved(results)
    assert np.abs(results.measured - results.measured[0, 0]).max() < 1e-9  # a dowel goes where its hole is
    assert (results.gap_min.sel(state="raw").min("realization") < -0.001).sum() == 0
    assert results["sample"].deviation.sel(contributor="dowel 1.shank.size").std() > 0


@pytest.mark.slow
def test_halves_of_holes_in_a_step_file_are_one_hole():
    """The bolt of the file stands in holes of its own size; one of 9 mm leaves the bracket 0.5 mm."""
    a = tc.Assembly("as1", method=tc.Method(objective="all points"))
    parts = tc.io.parts_from(a, AS1, ["plate_1", "l-bracket_1", "bolt_1"])
    bracket, base = parts["l-bracket_1"], parts["plate_1"]
    corner = [tc.Locator(f"L{k}", p, n, 0.0) for k, (p, n) in enumerate([((0, 0, 0), d) for d in "xyz"])]
    turns = [
        tc.Locator("T1", (50, 0, 0), "y", 0.0),
        tc.Locator("T2", (50, 0, 0), "z", 0.0),
        tc.Locator("T3", (0, 50, 0), "z", 0.0),
    ]
    a.locate(base, [*corner, *turns])
    a.locate(bracket, [*corner, *turns], tolerance=0)
    whole = {"through": [bracket.face(tc.select.Brep(13, whole=True))], "into": base.face(tc.select.Brep(14, whole=True))}
    bolt = tc.fasten(a, "bolt", parts["bolt_1"], **whole)
    assert "10 mm" not in str(bolt)
    tc.fasten(a, "other bolt", 9, through=[bracket.face(tc.select.Brep(9))], into=base.face(tc.select.Brep(6, 7)))
    a.measure("x", bracket.point(0, 0, 0), along="x")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", tc.NominalWarning)
        program = tc.build(a, solver="daqp")
    message, *others = [str(item.message) for item in caught if str(item.message).startswith("[face]")]
    assert "other bolt in l-bracket_1" in message and "tc.select.Brep(9, whole=True)" in message and not others
    assert len(program.nominal.pairs[0].P_m) == 12
    gaps = simulate_block(program, np.zeros((1, len(program.nominal.contributors)))).gap_min[0, RAW]
    assert np.abs(gaps - [0.0, 0.5]).max() < 1e-6


def nominal_warnings(a: tc.Assembly) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tc.build(a)
    return [str(warning.message) for warning in caught if issubclass(warning.category, tc.NominalWarning)]


@pytest.mark.parametrize("frame", [MOVED, *nightly(STILL)], ids=["moved", "still"])
def test_a_screw_may_be_thicker_than_its_thread_and_nowhere_else(frame):
    a = bolted([(-45.0, 0.0), (45.0, 0.0)], into=True, frame=frame)
    assert nominal_warnings(a) == []
    a.part("block", tc.Box(4, 4, 4), **frame.place(-47, -2, 2 * THICKNESS - 4), fixed=True)  # in a screw
    (text,) = nominal_warnings(a)
    assert re.match(r'\[overlap\] part "b.*it overlaps part "b.* by about', text)


@pytest.mark.parametrize(
    "turn", [(0, 1.57079632679, 1e-13), *nightly(((0, 0, 0),), ((0, 0, 1.57079632679),), ((1.57079632679, 0, 0),))]
)
def test_locators_of_a_fastener_are_not_taken_for_mistakes(turn):
    """Nor do they depend on rounding in the axis of its hole."""
    frame = Frame(turn=turn, shift=(300, -50, 20))
    a = tc.Assembly("floating")
    parts = {
        "base": plate(a, "base", 0, {(0, 0): 11.0}, frame, fixed=True),
        "cover": plate(a, "cover", 1, {(0, 0): 11.2}, frame),
    }
    a.locate(parts["cover"], held())
    holes = [hole(parts[name], "H", (0, 0), placed(0.4)) for name in ("cover", "base")]
    bolt = tc.fasten(a, "bolt", 10, through=holes, seat=parts["cover"].face("+z"))
    a.measure("x", bolt.point(0, 0, 0), along=frame.along(1, 0, 0))
    assert nominal_warnings(a) == []


FAULTS = {
    "a bolt that is too thick": ({"fastener": 12}, "through[0] has a diameter of 11 mm, and the fastener 12 mm"),
    "no diameter": ({"fastener": 0}, "its diameter is 0; expected a length in mm above 0"),
    "no size": ({"fastener": tc.Size(10, -1)}, "lower"),
    "a face that is not round": ({"into": "top"}, "into: face base +z is plane; expected one cylinder"),
    "holes that are not in line": ({"into": "far"}, "through[0]: its axis is 20 mm off that of the fastener"),
    "no hole": ({"through": []}, "through is empty; give the holes that it passes through"),
    "one hole": ({"into": None}, "it passes through one part, and goes into none"),
    "a part twice": ({"through": ["upper", "upper far"]}, 'through[0] and through[1] are of one part, "cover"'),
    "a hole of another model": ({"through": ["alien"]}, 'through[0] is on part "alien", which "model" does not have'),
    "the outside of a cylinder": ({"through": ["rod"]}, "is the outside of a cylinder; expected the wall of a hole"),
    "a bolt that is away": ({"fastener": "rod part"}, 'no outer cylinder of part "rod" stands in the first hole'),
    "its own hole": ({"fastener": "upper"}, 'through[0] and the fastener are of one part, "cover"'),
    "a seat elsewhere": ({"seat": "top"}, 'seat is on part "base", which it does not pass through'),
    "a seat on the side": ({"seat": "side"}, "is not square to the axis of the holes; expected the plane under the head"),
    "a round seat": ({"seat": "upper"}, "seat: face cover inner cylinders"),
    "a push that nothing uses": (
        {"into": None, "through": ["upper", "lower"], "pushed": (0, 0, 1)},
        'only the objective "seating" uses',
    ),
    "a push without effect": ({"pushed": (0, 0, 1)}, "pushed has no effect on a fastener that the hole in into holds"),
    "a push of nothing": (
        {"into": None, "through": ["upper", "lower"], "pushed": "down"},
        "pushed is 'down'; expected a force",
    ),
    "a seat of a part that a hole holds": (
        {"fastener": "rod part", "seat": "upper seat"},
        "seat has no effect on a part that stands in a hole",
    ),
}


@pytest.mark.parametrize("mistake", FAULTS)
def test_a_fastener_that_does_not_fit_is_refused_in_one_sentence(mistake):
    options, expected = FAULTS[mistake]
    a, other = tc.Assembly("model", method=tc.Method()), tc.Assembly("other model")
    base = plate(a, "base", 0, {(0, 0): 8.5, (20, 0): 11}, fixed=True)
    cover = plate(a, "cover", 1, {(0, 0): 11, (20, 0): 11})
    rod = a.part("rod", tc.Pin(10, 20), at=(0, 100, 0))
    faces = {
        "lower": hole(base, "lower", (0, 0)), "far": hole(base, "far", (20, 0)), "top": base.face("+z"),
        "upper": hole(cover, "upper", (0, 0)), "upper far": hole(cover, "upper far", (20, 0)),
        "upper seat": cover.face("+z"), "side": cover.face("+y"),
        "rod": rod.face(tc.select.Cylinder()), "rod part": rod,
        "alien": other.part("alien", tc.Pin(1, 1)).face(tc.select.Cylinder()),
    }  # fmt: skip
    arguments = {"fastener": 10, "through": ["upper"], "into": "lower", "seat": None, "pushed": None} | options
    through = [faces[name] for name in arguments.pop("through")]
    fastener, into, seat = (faces.get(arguments[key], arguments[key]) for key in ("fastener", "into", "seat"))
    before = [len(things) for things in (a.parts, a.pairs, a.locations, a.features)]
    with pytest.raises(tc.ModelError) as error:
        tc.fasten(a, "bolt", fastener, through=through, into=into, seat=seat, pushed=arguments["pushed"])
    (fault,) = error.value.faults
    assert fault.startswith('fastener "bolt" (test_fasteners.py:') and expected in fault
    assert [len(things) for things in (a.parts, a.pairs, a.locations, a.features)] == before


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"fastener": "M10"}, "fastener is a str; expected a diameter"),
        ({"fastener": True}, "fastener is a bool"),
        ({"through": 5}, "through is a int; expected a list of holes"),
        ({"through": [5]}, r"through\[0\] is a int; expected the wall of a hole"),
        ({"into": "base"}, "into is a str"),
        ({"seat": 1}, "seat is a int; expected the plane under the head"),
    ],
)
def test_arguments_of_a_wrong_type_are_refused(options, expected):
    with pytest.raises(TypeError, match=f'fasten "bolt": {expected}'):
        tc.fasten(tc.Assembly("model"), "bolt", **({"fastener": 10, "through": []} | options))


def test_a_fastener_belongs_to_an_assembly_or_a_station():
    with pytest.raises(TypeError, match='fasten "bolt": the first argument is a str; expected an assembly, or one of its'):
        tc.fasten("model", "bolt", 10, through=[])
