"""Sizes add up: stacks of parts against the sum of their deviations, however they are declared; what has no effect is told."""

import re
import warnings

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import STILL, Frame
from tests.helpers import compiled, nightly, realizations
from tolcontact.testing import assert_gaps_recompute

TURNED = Frame(turn=(0.5, -0.7, 1.1), shift=(100, -50, 7))
ROUNDING = 1e-9  # mm: parts shift alone, so that sums are exact
FEET = [(5, 5, 0), (5, 20, 0), (45, 12, 0)]
SIDES = [tc.Locator("B1", (5, 0, 5), "y"), tc.Locator("B2", (45, 0, 5), "y"), tc.Locator("C1", (0, 12, 5), "x")]
WAYS = {
    "size": {}, "size, upper face first": {"is_upper_first": True}, "lower face alone": {"moves": "first"},
    "upper face alone": {"moves": "second"}, "upper face, first": {"moves": "first", "is_upper_first": True},
}  # fmt: skip
PROFILES = ("profile of the upper face", "profile of the lower face")


def faces_of_thickness(part, way):
    """Declare how the thickness of a part varies, and return the features of its lower and of its upper face."""
    lower, upper = part.face("-z"), part.face("+z")
    if way in WAYS:
        moves, is_upper_first = WAYS[way].get("moves", "both"), WAYS[way].get("is_upper_first", False)
        faces = (upper, lower) if is_upper_first else (lower, upper)
        return (part.feature("w", *faces, tc.Size(10, 0.05, -0.02, moves=moves)),) * 2
    profile = tc.Profile(0.1, "A", rule="translation")
    varies = [way == name for name in PROFILES]
    return tuple(
        part.feature(name, face, *[profile] * moves, datum=None if moves else "A")
        for name, face, moves in (("over", upper, varies[0]), ("under", lower, varies[1]))
    )[::-1]


def stack(ways, *, frame=STILL, link="faces"):
    """A stack of spacers, beside a yoke that holds them between its ends; its height is a size, too."""
    by_contact = link == "contact"
    a = tc.Assembly("stack", method=tc.Method(objective="seating") if by_contact else None)
    yoke = a.part("yoke", tc.Box(100, 50, 10 * len(ways)), **frame.place(0, 0, 0), fixed=True)
    height = yoke.feature("height", yoke.face("+z"), yoke.face("-z"), tc.Size(10 * len(ways), 0.15))
    below, floor = height, None
    for k, way in enumerate(ways):
        part = a.part(f"s{k}", tc.Box(50, 25, 10), **frame.place(120, 12.5, 10 * k))
        lower, upper = faces_of_thickness(part, way)
        feet = [tc.Locator(f"A{number}", p, "z", on=lower) for number, p in enumerate(FEET)]
        if link == "faces":
            feet = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2)
        if by_contact and k:
            a.locate(part, SIDES, tolerance=0, floating=True)
            a.contact(f"{k}", moving=part.face("-z"), reference=floor)
            a.force(f"weight {k}", at=part.point(25, 12, 10), vector=np.multiply(-10, frame.along(0, 0, 1)))
        else:
            a.locate(part, feet if link == "faces" else [*feet, *SIDES], tolerance=0, on=below)
        below, floor = upper, part.face("+z")
    up = frame.along(0, 0, 1)
    a.measure("rest", below.point(20, 10, 10), to=height.point(90, 40, 10 * len(ways)), along=up, absolute=False)
    return a


def effects(a):
    """What is said of tolerances that have no effect."""
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        tc.build(a)
    return [str(record.message) for record in records if str(record.message).startswith("[effect]")]


def assert_rest_is_the_sum(a, accuracy=ROUNDING):
    """The free height is what the yoke leaves, realization by realization."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", r"\[effect\]", tc.NominalWarning)
        results = tc.run(a, samples=8, surfaces=0, fields="none", keep="all")
    drawn = results["sample"].deviation
    labels = [label for label in map(str, drawn.contributor.values) if label.endswith((".size", ".offset"))]
    assert labels[0] == "yoke.height.size" and len(labels) == len(a.parts)
    signs = np.array([1, *[-1] * (len(labels) - 1)])
    rest = drawn.sel(contributor=labels).values @ signs
    assert rest.std() > 0.01
    assert np.abs(results.measured.sel(state="corrected", measure="rest").values - rest).max() < accuracy


@pytest.mark.parametrize(
    ("link", "frame"),
    [("faces", TURNED), ("points", STILL), *nightly(("faces", STILL), ("points", TURNED))],
    ids=["faces, turned", "points, still", "faces, still", "points, turned"],
)
def test_a_stack_is_as_high_as_its_parts_are_thick(link, frame):
    assert_rest_is_the_sum(stack([*WAYS, PROFILES[0]], frame=frame, link=link))


@pytest.mark.parametrize("seed", [1, 2, *nightly(*range(3, 40))])
def test_a_stack_of_any_parts_is_as_high_as_these_are_thick(seed):
    rng = np.random.default_rng(seed)
    ways = [str(way) for way in rng.choice([*WAYS, *PROFILES], rng.integers(1, 7))]
    assert_rest_is_the_sum(stack(ways, frame=Frame(turn=rng.normal(size=3)), link=rng.choice(["faces", "points"])))


def test_both_faces_of_a_part_may_have_profiles():
    """Discs with a step, to which the profiles of both faces refer: each is as thick as both deviations outward say."""
    a, below = tc.Assembly("discs"), None
    shape = tc.Mesh(trimesh.creation.revolve([(0, 0), (40, 0), (40, 5), (30, 5), (30, 10), (0, 10)], sections=12))
    for k in range(3):
        disc = a.part(f"s{k}", shape, at=(0, 0, 10 * k))
        disc.feature("step", disc.face("+z", tc.select.Inside((-50, -50, 4), (50, 50, 6))), datum="A")
        profile = tc.Profile(0.1, "A", rule="translation")
        under = disc.feature("under", disc.face("-z"), profile)
        over = disc.feature("over", disc.face("+z", tc.select.Inside((-50, -50, 9), (50, 50, 11))), profile)
        feet = [
            tc.Locator(f"A{number}", under.point(*p), "z") for number, p in enumerate([(20, 0, 0), (-9, 9, 0), (-9, -9, 0)])
        ]
        a.locate(disc, [*feet, *SIDES], tolerance=0, on=below)
        below = over
    a.measure("height", over.point(0, 5, 10), along="z")
    assert effects(a) == []
    results = realizations(compiled(a), samples=8)
    labels = [f"s{k}.{face}.offset" for k in range(3) for face in ("under", "over")]
    heights = results["sample"].deviation.sel(contributor=labels).values.sum(axis=1)
    assert np.abs(results.measured.sel(state="raw", measure="height").values - heights).max() < ROUNDING


@pytest.mark.parametrize("moves", ["both", "first", "second"])
def test_measured_sizes_add_up(moves):
    a, names = tc.Assembly("measured"), [f"thickness {k}" for k in range(3)]
    for k, name in enumerate(names):
        part = a.part(f"s{k}", tc.Box(50, 25, 10), at=(0, 0, 10 * k), fixed=True)
        w = part.feature("w", part.face("-z"), part.face("+z"), tc.Size(10, 0.05, moves=moves))
        a.measure(name, w.point(5, 5, 0), to=w.point(40, 5, 10), along="z", absolute=False)
    a.measure("sum", tc.Sum(*names))
    results = realizations(compiled(a), samples=8)
    sizes = results["sample"].deviation.values.sum(axis=1)
    assert np.abs(results.measured.sel(state="raw", measure="sum").values - sizes).max() < ROUNDING


def test_supports_follow_the_face_that_they_stand_on_and_an_archive_says_so():
    a = tc.Assembly("supported", method=tc.Method(objective="seating"))
    base, block = a.part("base", tc.Box(50, 25, 10), fixed=True), a.part("block", tc.Box(50, 25, 10), at=(0, 0, 10))
    w = base.feature("w", base.face("+z"), base.face("-z"), tc.Size(10, 0.05))
    feet = [tc.Locator(f"A{k}", p, "z", one_sided=True) for k, p in enumerate(FEET)]
    a.locate(block, [*feet, *SIDES], tolerance=0, on=w)
    a.force("weight", at=block.point(20, 12, 5), vector=(0, 0, -10))
    a.measure("height", block.point(20, 12, 5), along="z")
    results = tc.run(compiled(a), samples=8, surfaces=0, fields="none", keep="all")
    heights = results["sample"].deviation.sel(contributor="base.w.size").values / 2
    assert np.abs(results.measured.sel(state="corrected", measure="height").values - heights).max() < 1e-7
    assert_gaps_recompute(results)


@pytest.mark.parametrize("frame", [STILL, *nightly(TURNED)], ids=lambda frame: "still" if frame is STILL else "turned")
def test_contact_adds_sizes_as_locators_do(frame):
    assert_rest_is_the_sum(stack(["size", "lower face alone", PROFILES[0]], frame=frame, link="contact"), 1e-7)


def on_a_round_face(inner, height, own=False):
    """A bar that two locators hold in z, at this height over the axis of a shaft or of a bore, whose diameter varies.

    own   whether the bar has the round face: locators of the ground hold it by this face
    """
    a = tc.Assembly("round")
    shape = tc.Mesh(trimesh.creation.annulus(10, 20, 60)) if inner else tc.Pin(20, 60)
    round_part = a.part("round", shape, at=(0, 0, 0), rotation=tc.degrees(0, 90, 0), fixed=not own or None)
    barrel = round_part.feature("barrel", round_part.face(tc.select.Cylinder(radius=10)), tc.Size(20, 0.1))
    bar = round_part if own else a.part("bar", tc.Box(10, 10, 40))
    ends = [(x, 0.0, height) for x in ((-25, 25) if inner else (-50, -5))]
    sides = [(-30, 5, 5), (-10, 5, 5), (-10, 5, 35)]
    own_frame = Rotation.from_rotvec(bar.rotation).inv()
    held = [
        tc.Locator(f"A{k}", own_frame.apply(p), own_frame.apply((0, 0, 1)), on=barrel if own else None)
        for k, p in enumerate(ends)
    ]
    held += [tc.Locator(f"B{k}", own_frame.apply(p), own_frame.apply((0, 1, 0))) for k, p in enumerate(sides)]
    held += [tc.Locator("C", own_frame.apply((0, 5, 5)), own_frame.apply((1, 0, 0)))]
    a.locate(bar, held, tolerance=0, **({} if own else {"on": barrel}))
    a.measure("height", bar.point(*own_frame.apply((-20, 0, 5))), along="z")
    results = realizations(compiled(a), samples=8)
    heights = results.measured.sel(state="raw", measure="height").values
    size = results["sample"].deviation.sel(contributor="round.barrel.size").values
    assert size.std() > 0.01
    return np.linalg.lstsq(size[:, None], heights, rcond=None)[0][0]


@pytest.mark.parametrize(
    ("inner", "height", "own", "share"),
    [
        (False, 10, False, 0.5), (False, 0, False, 0), (True, -10, False, -0.5), (True, 0, False, 0),
        (False, -10, True, 0.5), (False, 0, True, 0), (True, 10, True, -0.5), (True, 0, True, 0),
    ],
)  # fmt: skip
def test_a_round_face_moves_what_stands_on_it_and_its_axis_does_not(inner, height, own, share):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tc.NominalWarning)
        assert on_a_round_face(inner, height, own) == pytest.approx(share, abs=1e-6)


def block_on_a_block(*, on="feature", locators="faces", measured="feature", moves="both"):
    """A block on another one, both with a thickness of +-0.05, and the measured height of the upper face."""
    a = tc.Assembly("two")
    base = a.part("base", tc.Box(50, 25, 10), fixed=True)
    w = base.feature("w", base.face("+z"), base.face("-z"), tc.Size(10, 0.05))
    block = a.part("block", tc.Box(50, 25, 10), at=(0, 0, 10))
    v = block.feature("v", block.face("+z"), block.face("-z"), tc.Size(10, 0.05, moves=moves))
    held = [*(tc.Locator(f"A{k}", p, "z", on=v if locators == "on" else None) for k, p in enumerate(FEET)), *SIDES]
    if locators == "faces":
        held = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2)
    a.locate(block, held, tolerance=0, on={"feature": w, "part": base, "ground": None}[on])
    point = {"feature": v.point, "part": block.point}[measured](25, 12, 10)
    if on == "ground":
        a.contact("seat", moving=block.face("-z"), reference=w.faces[0])
    a.measure("height", point, along="z")
    return a


SILENT = [
    {}, {"moves": "first"}, {"moves": "second"}, {"locators": "on"}, {"locators": "points", "moves": "first"},
    {"measured": "part", "moves": "second"}, {"on": "ground", "locators": "points"},
]  # fmt: skip
TOLD = [
    ({"on": "part"}, r'part "block" .* locator "A1" lies on feature "w" of base, .* 0\.02\d+ mm .*; locate the part with on=w'),
    ({"locators": "points"}, r'part "block" .* locator "A0" lies on feature "v" of block, .*; give the locator on=v'),
    ({"measured": "part"}, r'measurement "height" .* its point \(25, 12, 10\) .* lies on feature "v" .* v\.point\(25'),
    ({"measured": "part", "moves": "first"}, r'its point .* lies on feature "v" of block, which deviates there by'),
    ({"measured": "part", "moves": "first"}, r'part "block": feature "v" .*: its tolerances have no effect on any measurement'),
]  # fmt: skip


@pytest.mark.parametrize("declared", SILENT, ids=str)
def test_a_stack_that_adds_up_is_silent(declared):
    assert effects(block_on_a_block(**declared)) == []


@pytest.mark.parametrize(("declared", "sentence"), TOLD, ids=str)
def test_a_declaration_by_which_a_tolerance_has_no_effect_is_told(declared, sentence):
    assert any(re.search(sentence, text) for text in effects(block_on_a_block(**declared)))


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.4, -0.9, 0.2)])
def test_planes_far_apart_tilt_about_their_own_middles(rotation):
    """In the middle of its faces a long tab has its size, and nothing there slides along the faces."""
    a = tc.Assembly("tab")
    tab = a.part("tab", tc.Box(80, 40, 10), rotation=rotation, fixed=True)
    tab.feature("A", tab.face("-z"), datum="A")
    length = tab.feature("length", tab.face("-x"), tab.face("+x"), tc.Size(80, 0.1, -0.1), tc.Perpendicularity(0.2, "A"))
    R = Rotation.from_rotvec(rotation).as_matrix()
    ends = [length.point(x, 20, 5) for x in (0, 80)]
    a.measure("size", ends[0], to=ends[1], along=tuple(R[:, 0]), absolute=False)
    a.measure("slide", ends[1], along=tuple(R[:, 2]))
    a.measure("tilt", length.point(80, 20, 5), to=length.point(80, 20, 10), along=tuple(R[:, 0]), absolute=False)
    run = tc.run(compiled(a, solver="daqp"), samples=200, surfaces=0, fields="none")
    size, slide, tilt = run.measured.sel(state="corrected").values.T
    drawn = run["sample"].deviation.sel(contributor="tab.length.size").values
    assert size == pytest.approx(drawn, abs=1e-12) and np.ptp(drawn) > 0.1
    assert slide == pytest.approx(0.0, abs=1e-12)
    assert 0.1 < np.ptp(tilt) < 0.25  # of points 5 mm apart, in a zone of 0.2 over 10 mm
