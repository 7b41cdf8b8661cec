"""Patterns: closed forms of spreads, counts of members inside, datums by several features, and all uses of members."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from scipy.stats import binom

import tolcontact as tc
from tests.cases import Frame
from tests.cases.toleranced import HOLES, plate_with_holes
from tests.helpers import assembly_of, compiled, nightly
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.variation import Draws

MOVED = Frame(turn=(0.4, -1.1, 2.0), shift=(1000, -700, 300))
TURN = Rotation.from_rotvec((0.4, -1.1, 2.0)).as_matrix()


def plate(*tolerances, count=2, **options):
    a, part, faces = plate_with_holes(count, **options)
    holes = part.pattern("H", *faces, *tolerances)
    for k, hole in enumerate(holes.members):
        a.measure(f"x{k}", hole.axis(1), along="x")
    return a


def spreads(model):
    return {freedom.label: freedom.spread for freedom in Draws(discretize(model)).contributors if freedom.geometric is not None}


def axis_ends(model, samples):
    """Deviations of the ends of the axes as drawn, (hole, end, realization, axis) [mm], of a plate in its place."""
    nominal = discretize(model)
    deviations = Draws(nominal)(seed=2, start=0, stop=samples)
    ends = []
    for feature in (feature for feature in nominal.features if feature.feature.name.startswith("H")):
        sx, sy, tx, ty = (deviations[:, : feature.coordinates.shape[1]] @ feature.coordinates.T).T
        ends.append([np.stack([sx - tx, sy - ty], axis=1), np.stack([sx + tx, sy + ty], axis=1)])
    return np.array(ends)


def is_99_73(inside, count):
    low, high = binom.interval(0.9999, count, 0.9973002)
    error = 1e-4 * count
    return low - error <= inside <= high + error  # the rule's own error: 1e-4


def test_a_pattern_of_one_frame_deviates_as_features_by_themselves():
    for tolerance in (tc.Position(0.5, "A|B|C"), tc.Position(0.5, "A|B|C", rule="6 sigma at the extremes")):
        a, part, faces = plate_with_holes(3)
        for k, face in enumerate(faces, start=1):
            part.feature(f"H {k}", face, tolerance)
        a.measure("x", part.point(0, 0, 0), along="x")
        assert spreads(a) == spreads(plate(tolerance, count=3))


def test_the_lower_frame_gives_the_distance_and_the_upper_frame_the_place():
    """Without tilts: one component for the distance of two holes. Half of its change is in the zone: 6 sigma = 0.1."""
    for upper in (0.5, 1.5):
        model = plate(tc.Position(upper, "A|B|C", rule="translation"), tc.Position(0.1, rule="translation"))
        x = axis_ends(model, 20_000)[:, 0, :, 0]
        assert spreads(model)["plate.H.relative 1"] == pytest.approx(np.sqrt(2) * 0.1 / 6, rel=1e-6)
        assert (x[1] - x[0]).std() == pytest.approx(2 * 0.1 / 6, rel=0.02)


@pytest.mark.parametrize(("count", "datums"), [(2, ""), (4, "A"), *nightly((2, "A"), (4, ""))])
def test_of_the_members_99_73_percent_are_inside_the_zones_of_both_frames(count, datums):
    samples = 200_000 // count
    ends = axis_ends(plate(tc.Position(0.5, "A|B|C"), tc.Position(0.1, datums), count=count), samples)
    shifts, tilts = ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / 2
    inside = (np.linalg.norm(ends, axis=-1).max(axis=1) <= 0.25).sum(axis=1)
    assert is_99_73(inside.sum() / count, samples)
    # The lower frame floats: the least squares of a shift and a turn about z, and of two tilts if it has no datum.
    places = np.array(HOLES[:count])
    turn = np.column_stack([-places[:, 1], places[:, 0]])
    motions = np.stack([np.tile((1.0, 0.0), (count, 1)), np.tile((0.0, 1.0), (count, 1)), turn]).reshape(3, -1)
    values = shifts.transpose(1, 0, 2).reshape(samples, -1)
    place = values - values @ np.linalg.pinv(motions) @ motions
    place = place.reshape(samples, count, 2).transpose(1, 0, 2)
    leaning = tilts - tilts.mean(axis=0) if not datums else tilts
    rest = np.linalg.norm(np.stack([place + leaning, place - leaning]), axis=-1).max(axis=0)
    assert is_99_73((rest <= 0.05).sum() / count, samples)
    assert len(spreads(plate(tc.Position(0.1, datums), count=count))) == {
        ("A", 2): 5, ("A", 4): 13, ("", 2): 3, ("", 4): 11,
    }[datums, count]  # fmt: skip


def test_patterns_are_the_same_in_any_frame():
    tolerances = tc.Position(0.5, "A|B|C"), tc.Position(0.1, "A")
    still, moved = spreads(plate(*tolerances, count=4)), spreads(plate(*tolerances, count=4, frame=MOVED))
    assert list(still) == list(moved) and list(still.values()) == pytest.approx(list(moved.values()), rel=1e-9)
    turned = list(spreads(plate(*tolerances, count=4, turn=TURN)).values())
    assert turned == pytest.approx(list(still.values()), rel=1e-4)  # of another direction of the axes: shapes are fitted
    population = measured_back(plate(*tolerances, count=4, turn=TURN), 5000)
    assert (population.upper > 0.9973).all()
    assert (population.lower < 0.9973).all()


def test_a_population_is_measured_back():
    model = plate(tc.Size(8, 0.1), tc.Position(0.5, "A|B|C"), tc.Position(0.1, "A"), count=2)
    population = measured_back(model, 10_000, seed=4)
    assert population.features == ["plate.H"] * 3
    inside = (population.share * 10_000).round()
    low, high = binom.interval(0.9999, 10_000, 0.9973)
    assert (low <= inside).all() and (inside <= high).all() and (population.stated_share == 0.9973).all()


def test_the_frame_of_two_holes_turns_as_their_places_say():
    a, part, faces = plate_with_holes(3)
    part.pattern("P", *faces[:2], tc.Position(0.5, "A|B|C"), datum="D")
    hole = part.feature("Q", faces[2], tc.Position(0.01, "A|D"))
    a.measure("x", hole.axis(1), along="x")
    nominal = discretize(a)
    labels, (third,) = nominal.contributors, [f for f in nominal.features if f.feature.name == "Q"]
    deviations = np.zeros(len(labels))
    e1, e2, along = 0.03, -0.05, 0.02
    for label, value in (("plate.P 1.shift y", e1), ("plate.P 2.shift y", e2), ("plate.P 1.shift x", along)):
        deviations[labels.index(label)] = value
    turn = (e2 - e1) / 60  # of holes at x = -30 and 30
    x, y, *tilts = third.coordinates @ deviations[: third.coordinates.shape[1]]
    assert (x, y) == pytest.approx((along / 2 - turn * 20, (e1 + e2) / 2), abs=1e-12)
    assert tilts == pytest.approx([0, 0], abs=1e-15)


def test_a_bonus_goes_by_the_size_of_each_member():
    model = plate(tc.Size(8, 0.1, 0), tc.Position(0.2, "A|B|C", material="M"))
    deviations = Draws(discretize(model))(seed=1, start=0, stop=1000)
    plain = Draws(discretize(plate(tc.Size(8, 0.1, 0), tc.Position(0.2, "A|B|C"))))(seed=1, start=0, stop=1000)
    for first, size in ((0, 8), (4, 9)):
        factor = 1 + np.maximum(deviations[:, size], 0) / 0.2
        assert deviations[:, first : first + 4] == pytest.approx(plain[:, first : first + 4] * factor[:, None], rel=1e-12)
    nested = plate(tc.Size(8, 0.1, 0), tc.Position(0.4, "A|B|C", material="M"), tc.Position(0.2, "A"))
    labels = list(discretize(nested).contributors)
    first, last = labels.index("plate.H.common shift x"), labels.index("plate.H.common turn z")
    deviations = Draws(discretize(nested))(seed=1, start=0, stop=1000)
    plain = plate(tc.Size(8, 0.1, 0), tc.Position(0.4, "A|B|C"), tc.Position(0.2, "A"))
    plain = Draws(discretize(plain))(seed=1, start=0, stop=1000)
    factor = 1 + np.maximum(deviations[:, -2:], 0).min(axis=1) / 0.4  # what moves both has the bonus of the smaller one
    columns = slice(first, last + 1)
    assert deviations[:, columns] == pytest.approx(plain[:, columns] * factor[:, None], rel=1e-12)


def test_the_worst_case_of_a_distance_is_the_zone_of_the_lower_frame():
    """The upper zone is largest, 0.45, with the largest holes."""
    a, part, faces = plate_with_holes(2)
    tolerances = tc.Size(8, 0.05, 0), tc.Position(0.4, "A|B|C", material="M"), tc.Position(0.1, "A")
    left, right = part.pattern("H", *faces, *tolerances).members
    a.measure("distance", right.axis(1), to=left.axis(1), along="x", absolute=False)
    a.measure("place", left.axis(1), along="x")
    worst = tc.analyses.worst_case(a, samples=64)["worst"].sel(state="corrected")
    assert np.abs(worst.sel(measure="distance")).values == pytest.approx([0.1, 0.1], abs=1e-6)
    assert np.abs(worst.sel(measure="place")).values == pytest.approx([0.225, 0.225], abs=1e-6)


def test_members_may_be_pairs_of_planes():
    a = tc.Assembly("comb")
    boxes = [trimesh.creation.box(extents=(10, 4, 6)).apply_translation((0, y, 0)) for y in (-10, 0, 10)]
    part = a.part("comb", tc.Mesh(trimesh.util.concatenate(boxes)), fixed=True)
    part.feature("foot", part.face("-z"), datum="A")
    pairs = [tuple(part.face(way, lambda c, n, y=y: abs(c[:, 1] - y) < 3) for way in ("+y", "-y")) for y in (-10, 0, 10)]
    teeth = part.pattern("T", *pairs, tc.Size(4, 0.1), tc.Position(0.2))
    for k, tooth in enumerate(teeth.members):
        a.measure(f"y{k}", tooth.point(0, 10 * k - 8, 0), along="y")
    labels = list(spreads(a))
    assert labels and all(label.startswith("comb.T.") for label in labels)  # place to each other alone
    drawn = Draws(discretize(a))
    offsets = drawn(seed=1, start=0, stop=500)
    nominal = drawn.contributors
    assert [contributor.label for contributor in nominal][-3:] == [f"comb.T {k}.size" for k in (1, 2, 3)]
    assert offsets.shape == (500, len(labels) + 3)


def test_unlike_cylinders_are_one_datum():
    """A shaft with two seats: the axis through both middles is the datum; a collar follows it."""
    a = tc.Assembly("shaft")
    radii = {-20: 5, 0: 7, 20: 4}
    bodies = [trimesh.creation.cylinder(r, 10, sections=64).apply_translation((0, 0, z)) for z, r in radii.items()]
    part = a.part("shaft", tc.Mesh(trimesh.util.concatenate(bodies)), fixed=True)
    barrels = [part.face(lambda c, n, z=z: (abs(n[:, 2]) < 0.5) & (abs(c[:, 2] - z) < 6)) for z in radii]
    part.feature("end", part.face("-z", lambda c, n: c[:, 2] < -24), datum="E")
    reference = part.feature("reference", barrels[2], datum="F")
    seat = part.feature("seat", barrels[0], tc.Position(0.1, "E|F"))
    seats = part.pattern("seats", seat, reference, datum="A")
    collar = part.feature("collar", barrels[1], tc.Coaxiality(0.01, "A"))
    a.measure("x", collar.axis(1), along="x")
    nominal = discretize(a)
    middle = next(feature for feature in nominal.features if feature.feature is collar)
    deviations = np.zeros(len(nominal.contributors))
    deviations[nominal.contributors.index("shaft.seat.shift x")] = 0.04
    x, _, tilt, _ = middle.coordinates @ deviations[: middle.coordinates.shape[1]]
    # The line that the ends of both axes (z = -25, -15, 15, 25) are nearest to: 0.04, 0.04, 0, 0 give a slope of -3.2 / 1700.
    assert x == pytest.approx(0.02, abs=1e-9) and tilt == pytest.approx(-0.04 * 40 / 1700 * 5, abs=1e-9)
    assert str(seats) == "pattern seats of shaft (datum A): 2 members" and [f.name for f in part.features].count("seat") == 1


@pytest.mark.slow
def test_members_are_used_as_features_in_models_archives_and_json(tmp_path):
    """Two pins of a plate in two holes of another: contact, locators, points, an archive, a JSON model."""
    a, part, faces = plate_with_holes(2)
    holes = part.pattern("H", *faces, tc.Size(8, 0.05), tc.Position(0.2, "A|B|C"), tc.Position(0.05, "A"), datum="D")
    pins = [trimesh.creation.cylinder(3.9, 20, sections=48).apply_translation((x, 0, 0)) for x in (-30, 30)]
    plug = a.part("plug", tc.Mesh(trimesh.util.concatenate(pins)), at=(5, -7, 3))
    fits = plug.pattern("P", *[plug.face(lambda c, n, x=x: (abs(n[:, 2]) < 0.5) & (x * c[:, 0] > 0)) for x in (-1, 1)],
        tc.Size(7.8, 0.02), tc.Position(0.1))  # fmt: skip
    held = [((-30, 0, 0), "z"), ((30, 0, 0), "z"), ((30, 3, 0), "z"), ((-30, 0, 0), "y"), ((30, 0, 0), "y"), ((30, 0, 0), "x")]
    a.locate(plug, [tc.Locator(f"L{k}", p, d, 0.02) for k, (p, d) in enumerate(held)])
    for k in range(2):
        a.contact(f"fit {k}", moving=fits.members[k], reference=holes.members[k], within=2)
    a.measure("distance", holes.members[1].axis(1), to=holes.members[0].axis(1), along="x", tolerance=0.2)
    results = tc.run(compiled(a, solver="daqp", method={"resolution": "exact"}), samples=200, out=tmp_path / "plug.nc")
    assert_resolved(results)
    assert_gaps_recompute(results)
    assert_same_run(
        results, tc.run(compiled(tc.io.model_of(results), solver="daqp", method={"resolution": "exact"}), samples=200)
    )
    shares = tc.analyses.contributions(a, samples=64, by="feature")
    assert {"plate.H", "plate.H 1"} & {name for text in shares["group"].values for name in str(text).split(" + ")}
    for name in ("plate", "plug"):
        moved = next(p for p in a.parts if p.name == name)
        file = tmp_path / f"{name}.stl"
        moved.geometry.source.export(file)
        object.__setattr__(moved.geometry, "source", file)
    tc.io.write_model(a, tmp_path / "plug.json")
    again = assembly_of(tmp_path / "plug.json")
    tc.io.write_model(again, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_text() == (tmp_path / "plug.json").read_text()
    assert discretize(again).contributors == discretize(a).contributors


BAD = {
    "one member": (lambda p, f: p.pattern("H", f[0], tc.Position(0.1, "A")), "it has 1 member(s); expected two or more"),
    "no use": (lambda p, f: p.pattern("H", *f), "it has neither tolerances nor a datum letter"),
    "unlike": (
        lambda p, f: p.pattern(
            "H", f[0], p.face("+z", tc.select.Inside((-50, -30, 4.9), (50, 30, 5.1))), tc.Position(0.1, "A")
        ),
        "its member 1 is a cylinder of 8 mm, inner, and member 2 is a plane",
    ),
    "the same face": (lambda p, f: p.pattern("H", f[0], f[0], tc.Position(0.1, "A")), 'it shares a face with feature "H 1"'),
    "coaxiality without datums": (lambda p, f: p.pattern("H", *f, tc.Coaxiality(0.1)), "coaxiality: it needs datums"),
    "borrowed and toleranced": (
        lambda p, f: p.pattern("H", p.feature("one", f[0]), f[1], tc.Position(0.1)), 'its member "one" is a feature with toler'
    ),
    "a feature of another part": (
        lambda p, f: p.pattern("H", tc.Assembly("o").part("o", tc.Box(1, 1, 1)).feature("x", f[0]), f[1], datum="D"),
        'its member "x" is no feature of part "plate"',
    ),
    "a name twice": (
        lambda p, f: (p.feature("H 1", p.face("+x")), p.pattern("H", *f, datum="D")), 'feature "H 1" is declared 2 times'
    ),
    "a letter twice": (lambda p, f: p.pattern("H", *f, datum="A"), 'datum "A" is declared 2 times'),
    "another size": (lambda p, f: p.pattern("H", *f, tc.Size(9, 0.1)), "its size is 8 mm as shaped, and 9 mm"),
    "its own datum": (lambda p, f: p.pattern("H", *f, tc.Position(0.1, "A|D"), datum="D"), "refer to each other in a circle"),
    "wider within": (
        lambda p, f: p.pattern("H", *f, tc.Position(0.1, "A|B|C"), tc.Position(0.2, "A")), "position 0.1 is narrower than"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_patterns_that_cannot_be_have_one_message(name):
    declare, text = BAD[name]
    a, part, faces = plate_with_holes(2)
    declare(part, faces)
    a.measure("x", part.point(0, 0, 0), along="x")
    (fault,) = tc.check(a)
    assert text in fault and 'part "plate"' in fault


def test_a_number_is_no_member():
    _, part, faces = plate_with_holes(2)
    with pytest.raises(TypeError, match='pattern "H": float is neither a member nor a tolerance'):
        part.pattern("H", *faces, 0.1)
