"""What is probably a mistake in the nominal assembly is a warning that names it; what is meant stays silent."""

import math
import re
import warnings
from pathlib import Path

import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import assembly_of, nightly
from tolcontact.plausibility import KINDS

MODELS = sorted((Path(__file__).parents[1] / "models").glob("[!c]*.py")) + [
    Path(__file__).parents[1] / "models" / f"{name}.py" for name in ("cells", "channel", "clutch", "cover")
]
LARGE = ("cover", "welded_sheets")
FEET = [("A1", (2, 2, 0), "z"), ("A2", (48, 2, 0), "z"), ("A3", (25, 23, 0), "z")]
SIDES = [("B1", (2, 0, 5), "y"), ("B2", (48, 0, 5), "y"), ("C1", (0, 12, 5), "x")]


def model(
    *, at=(20.0, 12.5, 10.0), turn=(0, 0, 0), tolerance=0.2, changes=None, point=(50, 0, 10), limits=(-0.5, 0.5)
) -> tc.Assembly:
    """A block on a table, both turned; `changes` replaces locators by name, and `at` is in the frame of the table."""
    a = tc.Assembly("stand")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True, rotation=turn)
    block = a.part("block", tc.Box(50, 25, 10), at=Rotation.from_rotvec(turn).apply(at), rotation=turn)
    locators = {name: tc.Locator(name, point, direction) for name, point, direction in FEET + SIDES}
    a.locate(block, list((locators | (changes or {})).values()), tolerance=tolerance)
    a.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
    up = Rotation.from_rotvec(turn).apply((0, 0, 1))
    a.measure("height", block.point(*point), along=up, limits=limits)
    return a


def warned(assembly) -> list[str]:
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        tc.build(assembly)
    return [str(record.message) for record in records if record.category is tc.NominalWarning]


def kinds(assembly) -> list[str]:
    return [re.match(r"\[(\w+)\]", text)[1] for text in warned(assembly)]


def off(name, point, direction, **options):
    return {name: tc.Locator(name, point, direction, **options)}


MISTAKES = {
    "overlap of a pair": (
        {"at": (20, 12.5, 5)},
        r'\[overlap\] contact pair "interface" \(test_nominal.*py:\d+\): its faces overlap by 5 mm.* "block" and "table"',
    ),
    "gap of a pair": ({"at": (20, 12.5, 13)}, r'\[gap\] contact pair "interface" .* 3 mm apart .* never touch'),
    "point of a measure": (
        {"point": (500, 0, 10)},
        r'\[point\] measurement "height" .* \(500, 0, 10\) lies 450 mm off part "block"',
    ),
    "point of the assembly": (
        {"at": (70, 25, 10), "changes": off("A2", (118, 27, 10), "z")},
        r'\[point\] part "block" .* locator "A2".*; for this point of the assembly write \(48, 2, 0\)',
    ),
    "support out of the part": (
        {"changes": off("A3", (25, 23, 0), "-z", one_sided=True)},
        r'\[direction\] part "block" .* "A3" points out of the part',
    ),
    "wide zone": ({"tolerance": 30}, r'\[tolerance\] part "block" .* locator "A1": its tolerance of 30 mm .* 50 mm long'),
    "points too close": (
        {"changes": off("A2", (2.25, 2, 0), "z")},
        r"\[tolerance\] .* turn the part by \d+ degrees .* closest ones are 0.25 mm",
    ),
    "limits beside the displacement": (
        {"limits": (19, 21)},
        r'\[limits\] measurement "height" .* 0 is outside .*\(19 to 21 mm\).*absolute=True measures the coordinate',
    ),
    "open limit": ({"limits": (None, -5)}, r"\[limits\] .*\(open to -5 mm\); check the limits"),
    "limits far off": ({"limits": (-90, 90)}, r"\[limits\] .* sigma away from its nominal value 0"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_warning_that_names_it(mistake):
    options, pattern = MISTAKES[mistake]
    (text,) = warned(model(**options))
    assert re.search(pattern, text), text
    assert re.match(r"\[(\w+)\]", text)[1] in KINDS


@pytest.mark.parametrize(("limits", "is_doubtful"), [((89, 91), True), ((tc.degrees(89), tc.degrees(91)), False)])
def test_limits_of_angles_that_are_probably_degrees(limits, is_doubtful):
    assembly = model()
    block, table = (next(part for part in assembly.parts if part.name == name) for name in ("block", "table"))
    assembly.measure("corner", tc.Angle(block.face("+x"), table.face("+z")), limits=limits)
    texts = [text for text in warned(assembly) if '"corner"' in text]
    assert [bool(re.search(r"89 to 91 rad\); they are probably in degrees: .*tc\.degrees", text)) for text in texts] == [
        True
    ] * is_doubtful


def test_a_sound_model_is_silent():
    assert not warned(model())


@pytest.mark.parametrize("turn", [(0, 0, math.pi / 2), (0.3, -1.2, 0.7)])
def test_warnings_do_not_depend_on_the_frame(turn):
    assert not warned(model(turn=turn))
    assert kinds(model(at=(20, 12.5, 5), turn=turn)) == ["overlap"]
    assert kinds(model(at=(20, 12.5, 13), turn=turn)) == ["gap"]


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.4, -1.1, 0.7), (1, 2, 0.3)])
def test_a_point_on_an_edge_is_doubtful_by_the_face_that_moves_it_in_any_frame(turn):
    """Of the faces at a corner, the bottom moves along z alone, and the measure along x depends on the end."""
    a = tc.Assembly("corner")
    block = a.part("block", tc.Box(50, 30, 20), rotation=turn, fixed=True)
    block.feature("top", block.face("+z"), datum="A")
    block.feature("bottom", block.face("-z"), tc.Profile(0.4, "A"))
    end = block.feature("end", block.face("-x"), tc.Profile(0.4, "A"))
    a.measure("x", block.point(0, 0, 0), to=end.point(0, 30, 0), along=tuple(Rotation.from_rotvec(turn).apply((1, 0, 0))))
    (text,) = [text for text in warned(a) if 'measurement "x"' in text]
    assert re.search(r'lies on feature "end" of block, which deviates there by 0\.[12]\d* mm', text)


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -1.2, 0.7)])
@pytest.mark.parametrize(("width", "is_doubtful"), [(2, True), (20, False)])
def test_contact_along_a_line_does_not_hold_a_rotation(turn, width, is_doubtful):
    """The block stands on a ledge under its left edge, which is 50 mm long and, if narrow, holds it like a hinge."""

    def on_a_ledge(objective):
        a = tc.Assembly("ledge", method=tc.Method(objective=objective))
        ledge = a.part("ledge", tc.Box(50, width, 10), fixed=True, rotation=turn)
        block = a.part("block", tc.Box(50, 40, 10), at=Rotation.from_rotvec(turn).apply((0, 0, 10)), rotation=turn)
        a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2), tolerance=0.2)
        a.contact("seat", moving=block.face("-z"), reference=ledge.face("+z"))
        a.measure("height", block.point(50, 40, 10), along=Rotation.from_rotvec(turn).apply((0, 0, 1)), limits=(-2, 2))
        return [text for text in warned(a) if text.startswith("[rotation]")]

    texts = on_a_ledge("all points")
    assert len(texts) == is_doubtful
    assert all(re.search(r'part "block" .* hardly holds its rotation .* "locator stiffness"', text) for text in texts)
    assert not on_a_ledge("locator stiffness")


def test_a_ball_that_touches_at_a_point_is_held_by_its_radius():
    a = tc.Assembly("rest")
    plate = a.part("plate", tc.Box(100, 100, 10), fixed=True)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(3, 10.0)), at=(50, 50, 20))
    places = {"x": ((0, 0, 0), "x"), "y": ((0, 0, 0), "y"), "z": ((0, 0, 0), "z")}
    places |= {"about x": ((0, 10, 0), "z"), "about y": ((10, 0, 0), "z"), "about z": ((10, 0, 0), "y")}
    a.locate(ball, [tc.Locator(name, point, direction, 0.2) for name, (point, direction) in places.items()])
    a.contact("rest", moving=ball.face(), reference=plate.face("+z"))
    a.measure("height", ball.point(0, 0, 10), along="z", limits=(-1, 1))
    assert "rotation" not in kinds(a)


def test_a_thin_shaft_may_spin():
    a = tc.Assembly("trough")
    floor = a.part("floor", tc.Box(60, 200, 5), at=(-30, 0, -5), fixed=True)
    shaft = a.part("shaft", tc.Pin(4, 200), at=(0, 0, 2), rotation=(-math.pi / 2, 0, 0))
    ends = [tc.Locator(f"{axis} {y}", (0, 0, y), axis, 0.2) for axis in "xy" for y in (5, 195)]
    a.locate(shaft, [*ends, tc.Locator("z", (0, 0, 0), "z", 0)], floating=True)
    a.contact("rest", moving=shaft.face(tc.select.Cylinder()), reference=floor.face("+z"))
    a.measure("height", shaft.point(0, 0, 0), along="z", limits=(-1, 1))
    assert "rotation" not in kinds(a)


def test_joined_parts_hold_each_other_where_each_touches_along_a_line():
    line = tc.Assembly("bridge")
    rails = [line.part(f"rail {k}", tc.Box(2, 40, 10), at=(x, 0, -10), fixed=True) for k, x in enumerate((0, 98))]
    halves = [line.part(f"half {k}", tc.Box(50, 40, 10), at=(x, 0, 0)) for k, x in enumerate((0, 50))]
    weld = line.station("weld")
    for half in halves:
        scheme = tc.three_two_one(half.face("-z"), half.face("-y"), half.face("-x"), inset=5)
        weld.locate(half, scheme, tolerance=0.2)
    bridge = weld.join("bridge", *halves)
    put = line.station("put")
    scheme = tc.three_two_one(halves[0].face("-z"), halves[0].face("-y"), halves[0].face("-x"), inset=5)
    put.locate(bridge, scheme, tolerance=0.2)
    for rail, half in zip(rails, halves, strict=True):
        put.contact(f"seat of {half.name}", moving=half.face("-z"), reference=rail.face("+z"))
    put.measure("height", halves[1].point(50, 40, 10), along="z", limits=(-2, 2))
    assert "rotation" not in kinds(line)


@pytest.mark.parametrize("depth", [0.05, *nightly(0.0, 0.1)])
def test_an_overlap_within_the_tolerances_is_silent(depth):
    # The gap of a corner outside of the triangle of the feet has sigma 0.2 / 6 times about 1.5.
    assert not warned(model(at=(20, 12.5, 10 - depth)))


def test_a_clearance_that_tolerances_may_close_is_silent():
    assert not warned(model(at=(20, 12.5, 10.3)))


def test_other_contact_may_close_a_wide_gap():
    """The block is pushed down by 4 mm onto a table that is 3 mm below it."""
    a = model(at=(20, 12.5, 13))
    lid = a.part("lid", tc.Box(50, 25, 10), at=(20, 12.5, 19), fixed=True)
    block = a.parts[1]
    a.contact("lid", moving=block.face("+z"), reference=lid.face("-z"))
    assert kinds(a) == ["overlap"]  # of the lid: the block, 4 mm inside of it, reaches the table


def test_forces_close_gaps():
    a = model(at=(20, 12.5, 13))
    a.force("weight", at=a.parts[1].point(25, 12, 5), vector=(0, 0, -1))
    for objective, expected in (("all points", ["gap", "force"]), ("seating", [])):
        pressed = a.replaced()
        pressed.method = tc.Method(objective=objective)
        assert kinds(pressed) == expected


@pytest.mark.parametrize(("rotation", "is_doubtful"), [((0, 0, 90), True), ((0, 0, 5), True), ((0, 0, 1.5 * math.pi), False)])
def test_rotations_that_are_probably_degrees(rotation, is_doubtful):
    a = model()
    a.part("lamp", tc.Box(5, 5, 5), at=(0, 0, 90), rotation=rotation, fixed=True)
    texts = warned(a)
    assert bool(texts) == is_doubtful
    assert all("[angle]" in text and "tc.degrees({:g}, {:g}, {:g})".format(*rotation) in text for text in texts)


@pytest.mark.parametrize(("directions", "is_doubtful"), [(("x", "y", "-y"), False), (("y", "-x", "x"), True)])
def test_directions_of_the_assembly_on_a_turned_part(directions, is_doubtful):
    a = tc.Assembly("turned")
    block = a.part("block", tc.Box(50, 25, 10), rotation=(0, 0, math.pi / 2))  # its x is the assembly's y
    points = [("B1", (0, 5, 5)), ("B2", (25, 0, 5)), ("C1", (10, 25, 5))]
    sides = [(*point, direction) for point, direction in zip(points, directions, strict=True)]
    a.locate(block, [tc.Locator(*locator) for locator in FEET + sides], tolerance=0.2)
    a.measure("height", block.point(0, 0, 0), along="z")
    texts = warned(a)
    assert len(texts) == is_doubtful
    for text in texts:
        assert re.match(r'\[direction\] part "block" .*\(0, 1, 0\) of locator "B1"', text)
        assert "for this direction of the assembly write (1, 0, 0)" in text


@pytest.mark.parametrize(
    ("tolerance", "values", "is_doubtful"),
    [(0.2, [0.05, -0.03, 0.08], False), (0.2, [50, -30, 80], True), (0, [50, -30, 80], True), (0, [0.05, -0.03, 0.08], False)],
)
def test_measured_parts_that_are_probably_in_micrometres(tolerance, values, is_doubtful, tmp_path):
    a = model(tolerance=tolerance)
    (tmp_path / "feet.csv").write_text("\n".join(["block.B1", *map(str, values)]))
    a.population(tmp_path / "feet.csv")
    expected = r'population "feet.csv" \(test_nom.*\): row 1 is a deviation of 50 mm; block.B1 .* micrometres: .*units="um"'
    assert [bool(re.search(expected, fault)) for fault in tc.check(a)] == [True] * is_doubtful


def test_bodies_that_are_no_pair():
    a = model()
    a.part("stop", tc.Box(20, 20, 20), at=(98, 20, 0), fixed=True)
    (text,) = warned(a)
    assert re.match(r'\[overlap\] part "table" .* overlaps part "stop" by about 2 mm near \(99, .* no contact pair', text)
    a = model()
    a.part("stop", tc.Box(20, 20, 20), at=(100, 20, 0), fixed=True)  # it touches
    assert not warned(a)


def test_a_pin_in_a_hole_of_its_size_is_no_overlap():
    """Triangles of the pin lie inside the plate's; the overlap is thinner than the faces are exact."""
    a = tc.Assembly("fit")
    a.part("plate", tc.Mesh(trimesh.creation.annulus(5, 20, 10, sections=24)), fixed=True)
    pin = trimesh.creation.cylinder(5, 20, sections=36)
    a.part("pin", tc.Mesh(pin), fixed=True)
    a.measure("nothing", a.parts[0].point(20, 0, 0), along="z")
    assert kinds(a) == ["effect"]
    sunk = a.replaced(parts=[a.parts[0]], measures=[])
    sunk.part("pin", tc.Mesh(pin), at=(4, 0, 0), fixed=True)
    sunk.measure("nothing", sunk.parts[0].point(20, 0, 0), along="z")
    assert kinds(sunk) == ["overlap", "effect"]


def test_many_bodies_in_one_place_are_one_warning():
    a = tc.Assembly("stack")
    for number in range(11):
        box = a.part(f"box {number}", tc.Box(10, 10, 10 + number))
        a.locate(box, tc.three_two_one(box.face("-z"), box.face("-y"), box.face("-x"), inset=2), tolerance=0.2)
    a.measure("height", box.point(0, 0, 0), along="z")
    (text,) = warned(a)
    assert re.match(r"\[overlap\] 11 parts .* overlap in 55 places .*; 11 of them lie at the origin: .*at=\(x, y, z\)", text)


def test_a_pair_of_the_same_faces_is_declared_twice():
    a = model()
    table, block = a.parts
    for name, faces in {"again": (block, table), "exchanged": (table, block)}.items():
        moving, reference = (part.face("-z" if part is block else "+z") for part in faces)
        a.contact(name, moving=moving, reference=reference)
    again, exchanged = (text for text in warned(a) if text.startswith("[twice]"))
    assert re.match(r'\[twice\] contact pair "again" .* declared twice: "interface" has its faces; leave', again)
    assert re.match(r'\[twice\] contact pair "exchanged" .*"interface" has its faces, with the sides exchanged', exchanged)


def test_what_does_not_vary_is_named():
    a = model()
    a.measure("table", a.parts[0].point(0, 0, 10), along="z")
    (text,) = warned(a)
    assert re.match(r'\[effect\] measurement "table" .* does not vary: .* contact does not move "table"', text)
    still = model(tolerance=0)
    still.measure("table", still.parts[0].point(0, 0, 10), along="z")
    (text,) = warned(still)
    assert re.match(r"\[effect\] nothing varies, since all tolerances are 0", text)
    stack = tc.Stack("plates")
    for name, sense in (("left", 1), ("right", -1)):
        stack.link(name, 10, 0.1, sensitivity=sense)
    stack.population({name: [0.01, -0.01, 0.02] for name in ("left", "right")})
    stack.gap("cancelled")
    stack.gap("weightless", {"left": 0.0})
    stack.gap("varied", {"left": 1.0})
    (text,) = warned(stack)
    assert re.match(r'\[effect\] measurement "cancelled" .* does not vary, nor do 1 more measurements: what it depends', text)
    a = model(changes=off("B1", (2, 0, 5), "y", tolerance=0.0))
    a.correlate(["block.B1", "block.B2"], 0.5)
    (text,) = warned(a)
    assert re.match(r'\[effect\] correlation "block.B1, block.B2" .*: "block.B1" does not vary, so it has no effect', text)


def test_a_measure_that_contact_alone_changes_varies():
    """The table varies, and lifts the block, whose own locators do not vary."""
    a = tc.Assembly("lift")
    table = a.part("table", tc.Box(100, 50, 10))
    block = a.part("block", tc.Box(50, 25, 10), at=(20, 12.5, 10))
    for part, tolerance in ((table, 0.2), (block, 0.0)):
        scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2)
        a.locate(part, scheme, tolerance=tolerance)
    a.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("height", block.point(50, 0, 10), along="z", limits=(-0.5, 0.5))
    assert not warned(a)


def test_feet_close_together_displace_the_corners():
    feet = {"A1": (24, 12, 0), "A2": (25, 12, 0), "A3": (24.5, 13, 0)}
    changes = {name: tc.Locator(name, point, "z", 0.01) for name, point in feet.items()}
    (text,) = [text for text in warned(model(changes=changes)) if text.startswith("[tolerance]")]
    # A corner 26 mm right and 0.5 x 12 mm off: A1 and A2 tilt by 1/1 about y, and A3 by 1/1 about x.
    assert re.search(r'1 mm at locator "A2" is 32\.\d mm at a corner of the part; .* \(the closest ones are 1 mm apart\)', text)


def test_limits_narrower_than_what_varies_are_in_other_units():
    (text,) = warned(model(limits=(-0.0005, 0.0005)))
    assert re.search(r"\[limits\] .* are 0\.0\d+ sigma wide; check their units", text)


def test_coordinates_far_from_the_origin_are_coarse(tmp_path):
    """A binary STL has single precision: 1 km from the origin the next number is 1/16 mm away."""
    for shift, expected in ((0.0, []), (1e6, ["0.062"])):
        block = trimesh.creation.box((50, 25, 10))
        block.apply_translation((25 + shift, 12.5, 5))
        block.export(tmp_path / "block.stl")
        a = tc.Assembly("far")
        part = a.part("block", tc.Mesh(tmp_path / "block.stl"), at=(-shift, 0, 0))
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2), tolerance=0.01)
        a.measure("height", part.point(25 + shift, 12, 10), along="z")
        said = [re.search(r"\[coarse\] .* stores coordinates (\S+) mm apart", text) for text in warned(a)]
        assert [match[1] for match in said if match] == expected


def test_a_warning_is_silenced_by_its_name():
    a = model(at=(20, 12.5, 5), point=(500, 0, 10))
    assert kinds(a) == ["point", "overlap"]
    with warnings.catch_warnings(record=True) as records:
        warnings.filterwarnings("ignore", r'\[overlap\] contact pair "interface"', tc.NominalWarning)
        tc.build(a)
    assert [str(record.message)[:7] for record in records] == ["[point]"]


def test_a_run_and_its_continuation_warn_once_each(tmp_path):
    a, path = model(at=(20, 12.5, 5)), tmp_path / "run.nc"
    for samples, options in ((10, {}), (20, {"resume": True})):
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always", tc.NominalWarning)
            tc.run(a, samples=samples, out=path, **options).close()
        assert sum(record.category is tc.NominalWarning for record in records) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [path for path in MODELS if path.stem not in LARGE] + nightly(*(path for path in MODELS if path.stem in LARGE)),
    ids=lambda path: path.stem,
)
def test_the_models_are_silent(path):
    assert not warned(assembly_of(path))
