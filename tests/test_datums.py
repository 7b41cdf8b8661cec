"""Datums of planes that lean touch them outside of the material (ISO 5459), judged by a linear program on displaced corners."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog

import tolcontact as tc
from tests import cases
from tests.helpers import assembly_of, compiled
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.testing import assert_same_run
from tolcontact.variation import Draws, draw

CORNERS = np.array([(x, y, z) for x in (0.0, 60.0) for y in (0.0, 40.0) for z in (0.0, 20.0)])


def plate(association, corner=(0.0, 0.0, 0.0)):
    """A plate whose far face is located from a side that leans against its foot."""
    model = tc.Assembly("plate")
    part = model.part("plate", tc.Box(60, 40, 20), at=corner, fixed=True)
    part.feature("foot", part.face("-z"), datum="A")
    part.feature("side", part.face("-x"), tc.Perpendicularity(0.3, "A"), datum="B", association=association)
    part.feature("end", part.face("-y"), tc.Perpendicularity(0.2, "A|B"), datum="C", association=association)
    far = part.feature("far", part.face("+x"), tc.Position(0.1, "A|B|C"))
    model.measure("far", far.point(60, 20, 10), along="x", tolerance=1)
    return model


def moved_corners(nominal, deviations, name, at):
    """Displaced corners (row, corner, 3) [mm] of a feature's face, at x or y = `at` of the part."""
    feature = next(feature for feature in nominal.features if feature.feature.name == name)
    axis, value = at
    corners = CORNERS[CORNERS[:, axis] == value]
    motions = deviations[:, : feature.coordinates.shape[1]] @ (feature.geometry.twists @ feature.coordinates).T
    return corners + motions[:, None, :3] + np.cross(motions[:, None, 3:], corners - feature.geometry.centre)


def tangent_plane(corners):
    """The plane x = c - s y that has all corners inside, and is nearest to them: c and s."""
    y, x = corners[:, 1], corners[:, 0]
    solution = linprog([-1, y.mean()], A_ub=np.column_stack([np.ones(len(y)), -y]), b_ub=x, bounds=[(None, None)] * 2)
    return solution.x


def outside_share(association, width=0.1):
    """The share of far faces outside of the zone that the tangent of the side places."""
    nominal = discretize(plate(association))
    deviations = draw(nominal, seed=3, start=0, stop=1000)
    side, far = (moved_corners(nominal, deviations, name, (0, at)) for name, at in (("side", 0.0), ("far", 60.0)))
    outside = 0
    for k in range(len(deviations)):
        c, s = tangent_plane(side[k])
        distance = (far[k, :, 0] - c + s * far[k, :, 1]) - 60
        outside += np.abs(distance).max() > width / 2 + 1e-6
    return outside / len(deviations)


def test_what_is_located_from_a_leaning_side_lies_in_its_zone_from_the_tangent_outside_the_material():
    assert outside_share("outside") < 0.01


def test_a_datum_by_least_squares_leaves_many_outside_of_that_zone():
    assert outside_share("least squares") > 0.4


def test_the_shift_of_the_datum_follows_from_the_tilt_and_is_measured_back():
    nominal = discretize(plate("outside", corner=(5.0, -3.0, 2.0)))
    draws = Draws(nominal)
    labels = list(nominal.contributors)
    deviations = draws(seed=5, start=0, stop=200)
    shift = deviations[:, labels.index("plate.far.datum B of A|B|C")]
    assert shift == pytest.approx(np.abs(deviations[:, labels.index("plate.side.tilt z")]))
    assert not [label for label in labels if "datum" in label and "far" not in label]  # others do not follow it
    for association in ("outside", "least squares"):
        inside = measured_back(plate(association), 2000).share
        assert float(inside[-1]) > 0.99
    assert [tolerance for tolerance in draws.varying if "datum" in tolerance] == []


def test_the_association_is_in_the_model_and_its_json(tmp_path):
    model = plate("least squares")
    path = tmp_path / "plate.json"
    tc.io.write_model(model, path)
    again = assembly_of(path)
    assert [feature.association for feature in again.features] == ["outside", "least squares", "least squares", "outside"]
    with pytest.raises(tc.ModelError, match="its association is 'best'; expected one of: outside, least squares"):
        tc.build(plate("best"))


def test_worst_cases_shift_the_datum_too():
    model = plate("outside")
    found = tc.analyses.worst_case(model, samples=256)
    # Half of the zone both ways, and half of the side's zone, by which its datum lies farther out.
    for name in ("worst", "bound"):
        assert found[name].sel(measure="far", state="corrected").values == pytest.approx([-0.2, 0.05], abs=1e-6)


@pytest.mark.parametrize(
    "declare",
    [
        lambda model, shift: model.variable("heat", tc.Tolerance(0.1), drives={shift: 1.0}),
        lambda model, shift: model.correlate([shift, "plate.side.tilt z"], 0.5),
        lambda model, shift: model.population({"measured": np.linspace(0, 1, 20)}, {shift: "measured"}),
    ],
    ids=["variable", "correlation", "population"],
)
def test_a_shift_that_follows_from_tilts_has_no_other_cause(declare):
    model = plate("outside")
    declare(model, "plate.far.datum B of A|B|C")
    (fault,) = tc.check(model)
    assert '"plate.far.datum B of A|B|C" follows from the tilts of its datum' in fault


def block_with_top(*tolerances):
    model = tc.Assembly("composite")
    block = model.part("block", tc.Box(100, 50, 10), at=(3, 4, 5), rotation=(0.1, 0.2, 0.3), fixed=True)
    block.feature("foot", block.face("-z"), datum="A")
    block.feature("side", block.face("-y"), datum="B")
    block.feature("end", block.face("-x"), datum="C")
    top = block.feature("top", block.face("+z"), *tolerances)
    model.measure("height", top.point(0, 0, 10), along="z")
    return model


def test_the_lower_segment_of_a_composite_frame_limits_tilts_as_an_orientation_tolerance_does():
    lower = block_with_top(tc.Profile(0.5, "A|B|C"), tc.Profile(0.1, "A><"))
    oriented = block_with_top(tc.Profile(0.5, "A|B|C"), tc.Parallelism(0.1, "A"))
    spreads = [[contributor.spread for contributor in Draws(discretize(model)).contributors] for model in (lower, oriented)]
    assert spreads[0] == pytest.approx(spreads[1], rel=1e-9)
    zones = measured_back(lower, 20_000)
    assert (zones.lower < 0.9973).all() and (zones.upper > 0.9973).all()


@pytest.mark.parametrize(("system", "follows"), [("A|D|C", True), ("A><|D><|C><", False)])
def test_a_datum_that_locks_directions_alone_is_not_followed_to_its_place(system, follows):
    model = tc.Assembly("cover")
    part = model.part("cover", tc.Mesh(cases.MODELS / "cover.step"), fixed=True)
    part.feature("under", part.face("-z"), datum="A")
    part.feature("side", part.face("-y", lambda c, n: c[:, 1] < 1e-3), datum="B")
    part.feature("end", part.face("-x", lambda c, n: c[:, 0] < 1e-3), datum="C")
    part.feature(
        "far", part.face(tc.select.Largest("plane", "+y")), tc.Profile(0.3, "A|B|C"), datum="D", association="least squares"
    )
    hole = part.feature("hole", part.face(tc.select.Brep((19.05, 15.0, 1))), tc.Position(1e-6, system))
    model.measure("hole", hole.axis(1), along="y")
    nominal = discretize(model)
    draws = Draws(nominal)
    hole, deviations = nominal.features[-1], draws(seed=1, start=0, stop=100)
    coordinates = dict(zip(hole.geometry.names, hole.coordinates @ deviations[:, : hole.coordinates.shape[1]].T, strict=True))
    tilt = deviations[:, nominal.contributors.index("cover.far.tilt z")]
    assert tilt.std() > 0.01
    assert coordinates["tilt x"] == pytest.approx(0 * tilt, abs=1e-5)  # the hole is square to A first
    assert (coordinates["shift y"].std() > 0.01) == follows


def with_pads(targets=((10, 10), (50, 10), (30, 30))):
    """A plate on two pads of its foot, x below and above 30, that deviate by themselves; a top to targets on both of them."""
    a = tc.Assembly("padded")
    part = a.part("plate", tc.Mesh(trimesh.creation.box(bounds=((0, 0, 0), (60, 40, 20))).subdivide().subdivide()))
    part.feature("lid", part.face("+z", lambda c, n: c[:, 1] > 20), datum="L")
    top = part.feature("top", part.face("+z", lambda c, n: c[:, 1] < 20), tc.Profile(1e-9, "A|B|C"))
    sides = [part.feature(letter, part.face(way), datum=letter) for letter, way in (("B", "-y"), ("C", "-x"))]
    pads = [
        part.feature(name, part.face("-z", lambda c, n, s=s: s * (c[:, 0] - 30) > 0), tc.Profile(0.03, "L|B|C"))
        for name, s in (("first", -1), ("second", 1))
    ]
    on = [pads[int(x > 30)] for x, _ in targets]
    part.datum_targets("A", *(pad.point(x, y, 0) for pad, (x, y) in zip(on, targets, strict=True)))
    held = [tc.Locator(f"A{k}", (x, y, 0), "z", 0, on=pad) for k, (pad, (x, y)) in enumerate(zip(on, targets, strict=True))]
    held += [tc.Locator(f"B{k}", (x, 0, 10), "y", 0, on=sides[0]) for k, x in enumerate((10, 50))]
    a.locate(part, [*held, tc.Locator("C", (0, 20, 10), "x", 0, on=sides[1])])
    for name, (x, y) in {"near": (0, 0), "far": (60, 20)}.items():
        a.measure(name, top.point(x, y, 20), along="z")
        a.measure(f"{name}, pad", pads[int(x > 30)].point(x, y, 0), along="z")
    return a


def test_what_refers_to_datum_targets_stands_still_if_the_targets_are_the_locators():
    """The pads move by up to 0.02 mm; the top is where the fixture is, whatever the pads are."""
    results = tc.run(compiled(with_pads()), samples=300)
    measured = results.measured.sel(state="raw")
    assert np.abs(measured.sel(measure=["near", "far"])).max() < 1e-5  # turns, to second order
    assert np.abs(measured.sel(measure=["near, pad", "far, pad"])).max() > 0.005
    assert tc.io.model_of(results).parts[0].targets[0].points[0].position == (10, 10, 0)
    assert_same_run(results, tc.run(compiled(tc.io.model_of(results)), samples=300))


def test_targets_give_the_plane_through_them():
    nominal = discretize(with_pads())
    top = next(feature for feature in nominal.features if feature.feature.name == "top")
    deviations = draw(nominal, seed=3, start=0, stop=50)
    heights = np.array([[10.0, 10, 1], [50, 10, 1], [30, 30, 1]])
    values = []
    for feature, (x, y, _) in zip(("first", "second", "first"), heights, strict=True):
        pad = next(nominal for nominal in nominal.features if nominal.feature.name == feature)
        motions = deviations[:, : pad.coordinates.shape[1]] @ (pad.geometry.twists @ pad.coordinates).T
        values.append(motions[:, 2] + np.cross(motions[:, 3:], np.array([x, y, 0]) - pad.geometry.centre)[:, 2])
    plane = np.linalg.solve(heights, np.array(values))  # z = a x + b y + c of each realization
    motions = deviations[:, : top.coordinates.shape[1]] @ (top.geometry.twists @ top.coordinates).T
    for x, y in ((0, 0), (60, 20)):
        z = motions[:, 2] + np.cross(motions[:, 3:], np.array([x, y, 20]) - top.geometry.centre)[:, 2]
        assert z == pytest.approx(plane[0] * x + plane[1] * y + plane[2], abs=1e-7)
    shares = measured_back(with_pads(), 1000)
    assert shares.upper.min() > 0.9973


@pytest.mark.parametrize(
    "declare, text",
    [
        (lambda p, f: p.datum_targets("A"), 'datum "A"'),
        (lambda p, f: p.datum_targets("A", p.point(0, 0, 0)), "is not on a face of a feature"),
        (
            lambda p, f: p.datum_targets("A", f.point(1, 1, 3)),
            'its target at (1, 1, 3) is not on feature "foot"; move it there',
        ),
        (lambda p, f: p.datum_targets("F", f.point(1, 1, 0)), 'datum "F" is declared 2 times'),
        (lambda p, f: p.datum_targets("first", f.point(1, 1, 0)), "its datum letter is 'first'"),
    ],
)
def test_targets_that_cannot_be_have_one_message(declare, text):
    a = tc.Assembly("block")
    part = a.part("block", tc.Box(10, 10, 10), fixed=True)
    declare(part, part.feature("foot", part.face("-z"), datum="F"))
    a.measure("z", part.point(0, 0, 0), along="z")
    (fault,) = tc.check(a)
    assert text in fault and 'part "block"' in fault
    with pytest.raises(TypeError, match='datum "A": float is no point'):
        part.datum_targets("A", 1.0)
