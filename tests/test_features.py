"""Features: one deviation for all that uses them, closed forms of measures, contacts and locators, archives, datums."""

import io

import numpy as np
import pytest
import trimesh
from rich.console import Console
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests import cases
from tests.cases import Frame, toleranced
from tests.helpers import compiled, nightly, realizations
from tests.population_referee import measured_back
from tests.shapes import shape
from tolcontact.discretization import discretize
from tolcontact.report import summary_text
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.variation import Draws

MOVED = Frame(turn=(0.4, -1.1, 2.0), shift=(1000, -700, 300))
EXACT = tc.Method(resolution="exact")


def drawn(results, label):
    return results["sample"].deviation.sel(contributor=label).values


@pytest.mark.parametrize("frame", [MOVED, *nightly(toleranced.STILL)], ids=["moved", "still"])
def test_points_of_a_plane_move_as_its_offset_and_tilts_say(frame):
    results = realizations(compiled(toleranced.block_with("top", tc.Profile(0.3, "A|B|C"), frame=frame)), samples=500)
    z, a, b = (drawn(results, f"block.top.{name}") for name in ("offset", "tilt x", "tilt y"))
    measured = results.measured.sel(state="raw")
    expected = {"corner": z + a + b, "middle": z, "edge": z + a}
    for name, value in expected.items():
        assert np.abs(measured.sel(measure=name).values - value).max() < 2e-6  # turns, to second order
    assert np.abs(results.measured.sel(state="corrected").values - measured.values).max() == 0


def test_spread_of_a_measure_is_that_of_the_closed_form():
    results = tc.run(compiled(toleranced.block_with("top", tc.Profile(0.3, "A"))), samples=20_000, fields="none")
    summary = tc.summarize(results)["statistic_value"].sel(state="raw", statistic="standard deviation")
    for name, count in {"corner": 3, "edge": 2, "middle": 1}.items():
        estimate, low, high = summary.sel(measure=name).values  # twice the interval: three of them are tested
        low, high = estimate - 2 * (estimate - low), estimate + 2 * (high - estimate)
        assert low < 0.3 / 11.768 * np.sqrt(count) < high, name


def test_a_line_profile_is_that_of_the_surface_and_an_archive_has_it(tmp_path):
    surface = tc.run(compiled(toleranced.block_with("top", tc.Profile(0.3, "A"))), samples=500)
    results = tc.run(compiled(toleranced.block_with("top", tc.LineProfile(0.3, "A"))), samples=500, out=tmp_path / "lines.nc")
    assert np.array_equal(results.measured.values, surface.measured.values)
    offset = results["sample"].sel(contributor="block.top.offset")
    assert float(offset.deviation.std()) == pytest.approx(0.3 / 11.768, rel=0.1)
    assert str(offset.distribution.values) == "line profile 0.3 mm to A; 99.73 % inside"
    assert_same_run(results, tc.run(compiled(tc.io.model_of(results)), samples=500))


def test_opposed_planes_share_their_size_and_their_middle():
    for moves, shares in {"both": (0.5, 0.5), "first": (1, 0), "second": (0, 1)}.items():
        a = tc.Assembly("tab")
        tab = a.part("tab", tc.Box(10, 4, 6), fixed=True)
        tab.feature("foot", tab.face("-z"), datum="A")
        middle = [tc.Symmetry(0.05, "A")] if moves == "both" else []
        tab.feature("width", tab.face("+y"), tab.face("-y"), tc.Size(4, 0.1, moves=moves), *middle)
        for name, face in (("up", "+y"), ("down", "-y")):
            wall = a.part(name, tc.Box(30, 30, 30), at=(-10, 4.5 if name == "up" else -30.5, -10))
            a.locate(wall, tc.three_two_one(wall.face("-z"), wall.face("-y"), wall.face("-x")), tolerance=0)
            a.contact(name, moving=wall.face("-y" if name == "up" else "+y"), reference=tab.face(face), within=20)
        a.measure("x", tab.point(0, 0, 0), along="x")
        program = compiled(a)
        block = simulate_block(program, program.draws(seed=1, start=0, stop=50))
        labels = program.nominal.contributors
        size = block.deviations[:, labels.index("tab.width.size")]
        tilt = block.deviations[:, labels.index("tab.width.tilt z")] if middle else np.zeros(50)
        for pair, (gap, share) in enumerate(zip((0.5, 0.5), shares, strict=True)):
            assert np.abs(block.gap_min[:, 0, pair] - (gap - share * size - np.abs(tilt))).max() < 1e-4


def test_slots_widen_against_their_normals():
    a = tc.Assembly("slot")
    walls = [trimesh.creation.box(extents=(10, 2, 6)).apply_translation((0, y, 0)) for y in (-3, 3)]
    part = a.part("slot", tc.Mesh(trimesh.util.concatenate(walls)), fixed=True)
    inner = [part.face(way, lambda c, n, s=s: s * c[:, 1] > 1.9) for way, s in (("-y", 1), ("+y", -1))]
    slot = part.feature("slot", *inner, tc.Size(4, 0.1))
    nominal = discretize(_measured(a, part))
    geometry = nominal.features[0].geometry
    assert geometry.is_inner and geometry.size == pytest.approx(4)
    deviation = nominal.features[0].deviation(0, nominal.parts[0].placement)
    assert deviation.twist[:3, 0] == pytest.approx([0, 0.5, 0]) and slot.name == "slot"


def _measured(a, part):
    a.measure("x", part.point(0, 0, 0), along="x")
    return a


def test_locators_follow_the_faces_that_they_stand_against():
    """Two equal parts, one with 3-2-1 on features, one with locators `on` them: they move as far as the faces come out."""
    a = tc.Assembly("held")
    parts = []
    for k in range(2):
        part = a.part(f"p{k}", tc.Box(50, 30, 10), at=(0, 100 * k, 0))
        part.feature("top", part.face("+z"), datum="A")
        foot = part.feature("foot", part.face("-z"), tc.Profile(0.3, "A"))
        parts.append((part, foot))
    (one, foot), (other, again) = parts
    a.locate(one, tc.three_two_one(foot, one.face("-y"), one.face("-x")), tolerance=0)
    feet = [((0, 0, 0), "z"), ((50, 0, 0), "z"), ((25, 30, 0), "z")]
    rest = [((0, 0, 5), "y"), ((50, 0, 5), "y"), ((0, 15, 5), "x")]
    held = [tc.Locator(f"Z{k}", p, d, 0, on=again) for k, (p, d) in enumerate(feet)]
    a.locate(other, [*held, *(tc.Locator(f"S{k}", p, d, 0) for k, (p, d) in enumerate(rest))])
    for part, _ in parts:
        for name, point in {"middle": (25, 15, 0), "corner": (0, 0, 0)}.items():
            a.measure(f"{part.name} {name}", part.point(*point), along="z")
    a.measure("stays", foot.point(25, 15, 0), along="z")
    results = realizations(compiled(a), samples=300)
    measured = results.measured.sel(state="raw")
    for name in ("p0", "p1"):
        z, x, y = (drawn(results, f"{name}.foot.{freedom}") for freedom in ("offset", "tilt x", "tilt y"))
        assert np.abs(measured.sel(measure=f"{name} middle").values - z).max() < 1e-4
        assert np.abs(measured.sel(measure=f"{name} corner").values - (z - x - y)).max() < 1e-4
    assert np.abs(measured.sel(measure="stays").values).max() < 1e-4  # the face stands where the locators are


def test_supports_follow_their_faces_too():
    a = tc.Assembly("table", method=tc.Method(resolution="exact", objective="seating"))
    table = a.part("table", tc.Box(50, 30, 10))
    table.feature("top", table.face("+z"), datum="A")
    foot = table.feature("foot", table.face("-z"), tc.Profile(0.3, "A"))
    corners = [(0, 0, 0), (50, 0, 0), (0, 30, 0), (50, 30, 0)]
    feet = [tc.Locator(f"Z{k}", p, "z", 0.1, one_sided=True, on=foot) for k, p in enumerate(corners)]
    rest = [((0, 0, 5), "y"), ((50, 0, 5), "y"), ((0, 15, 5), "x")]
    a.locate(table, [*feet, *(tc.Locator(f"S{k}", p, d, 0) for k, (p, d) in enumerate(rest))])
    a.force("weight", at=table.point(20, 15, 5), vector=(0, 0, -9))
    a.measure("foot", foot.point(20, 15, 0), along="z")
    results = tc.run(compiled(a), samples=200)
    assert_resolved(results)
    assert_gaps_recompute(results)


@pytest.mark.slow
def test_one_feature_deviates_once_whatever_uses_it():
    """The pair does not say that its faces are features; the archive alone gives the gaps again."""
    a = tc.Assembly("stack")
    lower = a.part("lower", tc.Box(60, 40, 10), fixed=True)
    upper = a.part("upper", tc.Box(60, 40, 10), at=(0, 0, 10))
    lower.feature("under", lower.face("-z"), datum="A")
    top = lower.feature("top", lower.face("+z"), tc.Profile(0.2, "A"))
    upper.feature("over", upper.face("+z"), datum="A")
    foot = upper.feature("foot", upper.face("-z"), tc.Profile(0.1, "A"))
    a.locate(upper, tc.three_two_one(foot, upper.face("-y"), upper.face("-x")), tolerance=0.05)
    a.contact("seat", moving=upper.face("-z"), reference=lower.face("+z"))
    a.measure("gap", top.point(60, 40, 10), to=foot.point(60, 40, 0), along="z")
    a.measure("expression", lambda poses: (poses.position(foot.point(60, 40, 0)) - poses.position(top.point(60, 40, 10)))[2])
    results = tc.run(compiled(a, method=EXACT, solver="daqp"), samples=500)
    assert_resolved(results)
    assert_gaps_recompute(results)
    gap, same = results.measured.values[:, 1].T
    assert np.abs(gap - same).max() < 1e-12 and gap.min() > -1e-4  # corners slide over tilted planes: second order
    assert float(results["surface"].surface_penetration.max()) < 0.05 / 2000
    rebuilt = tc.run(compiled(tc.io.model_of(results), method=EXACT, solver="daqp"), samples=500)
    assert_same_run(results, rebuilt)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [*nightly("qpoases"), "daqp"])
@pytest.mark.parametrize("points", [None, 60])
def test_diameters_vary_as_offsets(points, solver):
    """Of exact round contact and of sampled points: the centre of a ball on a plate is as high as half its diameter."""
    a = tc.Assembly("ball", method=tc.Method(resolution="exact", objective="seating"))
    plate = a.part("plate", tc.Box(60, 60, 5), at=(-30, -30, -5), fixed=True)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(subdivisions=4, radius=10)), at=(0, 0, 10))
    skin = ball.feature("skin", ball.face(), tc.Size(20, 0.05, -0.1))
    sides = [tc.Locator(n, (0, 0, 0), d, 0) for n, d in (("X", "x"), ("Y", "y"))]
    turns = [tc.Locator(n, (0, 0, 5), d, 0) for n, d in (("TX", "x"), ("TY", "y"))]
    a.locate(ball, [*sides, *turns, tc.Locator("TZ", (5, 0, 0), "y", 0)], floating=True)
    a.force("weight", at=ball.point(0, 0, 0), vector=(0, 0, -1))
    reach = {} if points is None else {"points": points, "within": 12}
    a.contact("foot", moving=skin, reference=plate.face("+z"), **reach)
    a.measure("height", ball.point(0, 0, 0), along="z")
    results = tc.run(compiled(a, solver=solver), samples=60)
    assert_resolved(results)
    assert_gaps_recompute(results)
    expected = drawn(results, "ball.skin.size") / 2
    apart = results.measured.sel(state="corrected", measure="height").values - expected
    assert (
        np.abs(apart).max() < 1e-9 if points is None else np.ptp(apart) < 0.05 * np.ptp(expected)
    )  # a point aside grows aside
    assert float(results["surface"].surface_penetration.max()) < (1e-6 if points is None else 0.5)


def test_axes_of_an_archive_are_where_the_position_says():
    results = realizations(compiled(toleranced.ring_with("bore", tc.Position(0.2, "A|B"))), samples=300)
    x = drawn(results, "ring.bore.shift x") + drawn(results, "ring.bore.tilt x")
    assert np.abs(results.measured.sel(state="raw", measure="x").values - x).max() < 1e-6


def test_a_feature_follows_the_datums_that_it_refers_to():
    """The top, flush to a tilted side B: it turns with it, and shifts as B goes."""
    side = tc.Perpendicularity(0.5, "A")
    model = toleranced.block_with("far", tc.Position(0.01, "B|A"), B=(side,))
    nominal = discretize(model)
    draws = Draws(nominal)(seed=1, start=0, stop=100)
    labels = list(nominal.contributors)
    far = next(each for each in nominal.features if each.feature.name == "far")
    coordinates = draws[:, : far.coordinates.shape[1]] @ far.coordinates.T
    tilt_of_side = draws[:, labels.index("block.side.tilt z")]
    # B tilts about x (along z): the far face is normal to x, which that turns in itself. Parallel to B itself it follows.
    own = draws[:, [labels.index(f"block.far.{n}") for n in ("tilt y", "tilt z") if f"block.far.{n}" in labels]]
    assert own.shape[1] and np.abs(coordinates).max() < 0.02 < np.abs(tilt_of_side).max()
    again = toleranced.block_with("top", tc.Perpendicularity(1e-6, "B"), B=(side,))
    nominal = discretize(again)
    draws, top = Draws(nominal)(seed=1, start=0, stop=100), nominal.features[-1]
    tilts = (draws[:, : top.coordinates.shape[1]] @ top.coordinates.T)[:, top.geometry.names.index("tilt y")]
    side_tilt = draws[:, list(nominal.contributors).index("block.side.tilt z")]
    # side -y tilts by t over half its height 5 (outward); the top, square to it, by as much over half its width 25.
    assert np.abs(tilts) == pytest.approx(np.abs(side_tilt) * 25 / 5, abs=1e-5)
    assert np.sign(tilts * side_tilt)[0] == np.sign(tilts * side_tilt).mean()
    points = Rotation.from_rotvec((1e-3, 0, 0)).apply([[50, 0, 10], [50, 50, 10], [50, 0, 5.0 + 5], [50, 0, 0]])
    top_slope, side_slope = points[1][2] - points[0][2], points[2][1] - points[3][1]
    assert np.sign(top_slope * -side_slope) == np.sign(tilts * side_tilt)[0]  # outward of the side is -y


@pytest.mark.slow
@pytest.mark.parametrize(
    "hole", [tc.select.Brep((19.05, 15.0, 1)), tc.select.Cylinder(inner=True, radius=4.05)], ids=["B-rep", "kind"]
)
def test_features_of_a_step_file_and_of_its_mesh_agree(hole):
    """The same deviations, whether the file states the cylinder or it is fitted to triangles."""
    cover = shape(tc.Mesh(cases.MODELS / "cover.step"))
    plain = trimesh.Trimesh(cover.vertices, cover.faces, process=False)
    found = []
    for geometry in (tc.Mesh(cases.MODELS / "cover.step"), tc.Mesh(plain)):
        a = tc.Assembly("cover")
        part = a.part("cover", geometry, fixed=True)
        part.feature("under", part.face("-z"), datum="A")
        part.feature("side", part.face("-y", lambda c, n: c[:, 1] < 1e-3), datum="B")
        part.feature("end", part.face("-x", lambda c, n: c[:, 0] < 1e-3), datum="C")
        near = tc.select.Inside((5, 5, -1), (25, 25, 9))
        wall = part.face(
            hole if isinstance(geometry.source, type(cases.MODELS)) else tc.select.Cylinder(inner=True, radius=4.05), near
        )
        own = part.feature("hole", wall, tc.Size(8.1, 0.03), tc.Position(0.2, "A|B|C"))
        a.measure("x", own.axis(1), along="x")
        nominal = discretize(a)
        draws = Draws(nominal)
        feature = nominal.features[-1].geometry
        found.append((feature.centre, feature.axis, feature.half, feature.size, [c.spread for c in draws.contributors]))
    for one, other in zip(*found, strict=True):
        assert one == pytest.approx(other, abs=1e-6)


def test_a_summary_says_that_a_datum_shift_is_not_drawn():
    a = toleranced.ring_with("bore", tc.Position(0.2, "A|B(M)"))
    console = Console(width=200, file=io.StringIO())
    console.print(summary_text(tc.summarize(tc.run(compiled(a), samples=20))))
    said = console.file.getvalue()
    assert "datum shift of ring.bore: not drawn; contact of the datum features determines it" in said


@pytest.mark.slow
@pytest.mark.parametrize("shift", [123.4, *nightly(0.0)])
@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, 0.5, -0.2)])
def test_shapes_of_single_precision_have_the_same_freedoms(shift, turn, tmp_path):
    """STL files hold seven digits: what datums leave open is not told from noise."""
    ring = trimesh.creation.annulus(5, 20, 30, sections=48)
    ring.apply_transform(trimesh.transformations.euler_matrix(*turn))
    ring.apply_translation((shift, -shift / 2, 9.1))
    ring.export(tmp_path / "ring.stl")
    n = trimesh.transformations.euler_matrix(*turn)[:3, 2]
    a = tc.Assembly("ring")
    part = a.part("ring", tc.Mesh(tmp_path / "ring.stl"), fixed=True)
    part.feature("base", part.face(tc.select.Facing(-n)), datum="A")
    part.feature("bore", part.face(tc.select.Cylinder(radius=5)), tc.Perpendicularity(0.2, "A"), datum="B")
    part.feature("rim", part.face(tc.select.Cylinder(radius=20)), tc.Position(0.2, "A|B"))
    a.measure("x", part.features[-1].axis(0), along="x")
    every = Draws(discretize(a)).contributors
    assert [0.2 / each.spread for each in every] == pytest.approx([6.88] * 2 + [7.270 * np.sqrt(2)] * 4, rel=3e-3)
    assert ["tilt" in each.label or "shift" in each.label for each in every] == [True] * 6


def test_a_cone_of_triangles_has_two_tilts_and_a_depth():
    a = tc.Assembly("cone")
    part = a.part("cone", tc.Mesh(trimesh.creation.cone(10, 15, sections=64)), fixed=True)
    part.feature("base", part.face("-z"), datum="A")
    wall = part.feature("wall", part.face(lambda c, n: n[:, 2] > -0.5), tc.Perpendicularity(0.2, "A"), tc.Profile(0.5, "A"))
    a.measure("top", wall.axis(1), along="z")
    labels = [each.label for each in Draws(discretize(a)).contributors]
    assert labels == ["cone.wall.tilt x", "cone.wall.tilt y", "cone.wall.along"]
    assert discretize(a).position(wall.axis(1)) == pytest.approx([0, 0, 15], abs=1e-3)
    assert measured_back(a, 4000).lower.min() < 0.9973


def test_the_spread_does_not_depend_on_how_a_shape_is_turned_in_its_part():
    for turn in (0.0, 0.2, np.pi / 4):
        box = trimesh.creation.box(extents=(100, 50, 10))
        box.apply_transform(trimesh.transformations.rotation_matrix(turn, (0, 0, 1)))
        a = tc.Assembly("turned")
        part = a.part("block", tc.Mesh(box), fixed=True)
        part.feature("under", part.face("-z"), datum="A")
        part.feature("top", part.face("+z"), tc.Profile(0.3, "A"))
        a.measure("x", part.point(0, 0, 0), along="x")
        assert [0.3 / each.spread for each in Draws(discretize(a)).contributors] == pytest.approx([11.77] * 3, rel=1e-3)


@pytest.mark.slow
def test_regions_of_one_face_are_features_of_their_own():
    a = tc.Assembly("regions")
    base = a.part("base", tc.Box(100, 40, 10), fixed=True)
    base.feature("under", base.face("-z"), datum="A")
    left, right = (tc.select.Inside((x, -1, 9), (x + 40, 41, 11)) for x in (0, 60))
    base.feature("left", base.face("+z", left), tc.Profile(1.0, "A"))
    for name, x in (("on left", 5), ("on right", 65)):
        block = a.part(name, tc.Box(30, 30, 10), at=(x, 5, 10))
        a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0)
        a.contact(name, moving=block.face("-z"), reference=base.face("+z", left if x < 50 else right))
        a.measure(name, block.point(0, 0, 0), along="z")
    moved = realizations(compiled(a, solver="daqp", method=EXACT), samples=100).measured.sel(state="corrected").values
    assert np.abs(moved[:, 0]).max() > 0.1 and np.abs(moved[:, 1]).max() == 0
    base.feature("right", base.face("+z", right), tc.Profile(0.5, "A"))
    assert not tc.check(a)


def test_points_and_locators_of_a_pair_of_planes_are_on_their_own_face():
    a = tc.Assembly("tab")
    tab = a.part("tab", tc.Box(20, 10, 8))
    width = tab.feature("width", tab.face("+y"), tab.face("-y"), tc.Size(10, 0.1))
    rest = [((0, 0, 0), "z"), ((20, 0, 0), "z"), ((0, 10, 0), "z"), ((0, 5, 4), "x")]
    sides = [tc.Locator(f"Y{k}", p, "y", 0, on=width) for k, p in enumerate([(0, 0, 4), (20, 0, 4)])]
    a.locate(tab, [*(tc.Locator(f"R{k}", p, d, 0) for k, (p, d) in enumerate(rest)), *sides])
    a.measure("width", width.point(10, 0, 4), to=width.point(10, 10, 4), along="y")
    a.measure("low", width.point(10, 0, 4), along="y")
    results = realizations(compiled(a), samples=100)
    size, measured = drawn(results, "tab.width.size"), results.measured.sel(state="raw")
    assert np.abs(measured.sel(measure="width") - 10 - size).max() < 1e-9  # from low to high
    assert np.abs(measured.sel(measure="low")).max() < 1e-9  # it stands against its locators
