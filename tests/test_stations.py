"""Stations: closed forms, hand-over of poses, archives, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import MODELS, stations as cases
from tests.helpers import assembly_of, compiled
from tolcontact.errors import ModelError

LINEARIZED = tc.Method(resolution="linearized")
HALF_NORMAL_MEAN, HALF_NORMAL_VARIANCE = np.sqrt(0.5 / np.pi), (1 - 1 / np.pi) / 2  # of max(0, z), z standard normal


def measured(model, samples=400, seed=1, **options):
    program = compiled(model, solver="daqp", **options)
    values = np.concatenate([block.measured for block in tc.simulate_blocks(program, samples=samples, seed=seed, threads=1)])
    return {measure.name: values[:, :, k] for k, measure in enumerate(program.nominal.measures)}


def rotation(theta):
    """exp([theta]x) (n, 3, 3) by Rodrigues' formula."""
    angle = np.linalg.norm(theta, axis=1)[:, None, None]
    K = np.zeros((len(theta), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -theta[:, 2], theta[:, 1], -theta[:, 0]
    K -= K.transpose(0, 2, 1)
    return np.eye(3) + np.sinc(angle / np.pi) * K + np.sinc(angle / 2 / np.pi) ** 2 / 2 * K @ K


def placed(points, directions, d):
    """R (n, 3, 3) and t (n, 3) of six locators (6, 3) with deviations (n, 6): a small displacement of their centroid."""
    c = points.mean(axis=0)
    q = d @ np.linalg.inv(np.hstack([directions, np.cross(points - c, directions)])).T
    R = rotation(q[:, 3:])
    return R, q[:, :3] + c - R @ c


def test_three_parts_in_two_stations():
    values, count = measured(cases.rail(), samples=40_000), 40_000
    h, s = np.sqrt(2) * cases.SIGMA, cases.SIGMA
    fixture = s**2 * ((1 / 14) ** 2 + (15 / 14) ** 2 + 1)
    step, flush = values["step"][:, 1], values["flush"]
    expected = {
        "step": (step, -HALF_NORMAL_MEAN * h, HALF_NORMAL_VARIANCE * h**2),
        "raw": (flush[:, 0], 0.0, fixture + h**2 / 196),
        "corrected": (flush[:, 1], HALF_NORMAL_MEAN * h / 14, fixture + HALF_NORMAL_VARIANCE * h**2 / 196),
    }
    for name, (sample, mean, variance) in expected.items():
        errors = sample - sample.mean()
        assert abs(sample.mean() - mean) < 4 * np.sqrt(variance / count), name
        spread = np.sqrt(((errors**4).mean() - errors.var() ** 2) / count)
        assert abs(sample.var() - variance) < 4 * spread, name


@pytest.mark.parametrize("width", [0.5, 2.0, 10.0])
def test_poses_are_handed_over_as_a_computation_outside_the_package_composes_them(width):
    program = compiled(cases.three_stations(width, contact=False), solver="daqp")
    block = next(iter(tc.simulate_blocks(program, samples=500, seed=3)))
    nominal, poses = program.nominal, block.poses[:, 0].reshape(500, -1, 12)
    R, t = {}, {}

    def relative(carrier, member):
        """The pose of a member of a joint in the frame of the part that carries it, where they were joined."""
        return R[carrier].transpose(0, 2, 1) @ R[member], np.einsum("nji,nj->ni", R[carrier], t[member] - t[carrier])

    for k, part in enumerate(nominal.parts):
        station, joined_in = part.station, {"weld": "tack", "check": "weld"}.get(part.station)
        if len(part.locators):
            d = block.deviations[:, [nominal.contributors.index(label) for label in part.locators.labels]].copy()
            for locator, owner in enumerate(part.owners):
                p, n = part.locators.points[locator], part.locators.directions[locator]
                R_within, t_within = relative(*(nominal.part_index(nominal.parts[m].part, joined_in) for m in (k, owner)))
                d[:, locator] -= (R_within @ p + t_within - p) @ n
            R[k], t[k] = placed(part.locators.points, part.locators.directions, d)
        else:
            carrier = nominal.part_index(nominal.assembly.parts[0], station)
            source = [nominal.part_index(each, joined_in) for each in (nominal.assembly.parts[0], part.part)]
            R_within, t_within = relative(*source)
            R[k], t[k] = R[carrier] @ R_within, np.einsum("nij,nj->ni", R[carrier], t_within) + t[carrier]
        corners = np.array([[0, 0, 0], [210, 50, 20], [100, 50, 0]])
        expected = corners @ R[k].transpose(0, 2, 1) + t[k][:, None]
        actual = corners @ poses[:, k, :9].reshape(-1, 3, 3).transpose(0, 2, 1) + poses[:, k, None, 9:]
        assert np.abs(actual - expected).max() < 1e-11, part.name


@pytest.mark.parametrize("method", [tc.Method(), LINEARIZED], ids=lambda method: method.resolution)
def test_measures_within_a_joint_are_those_of_the_station_that_joined_it(method):
    values = measured(cases.three_stations(2.0), method=method)
    for first, later in (("tack a to b", "weld a to b"), ("tack a to b", "check a to b"), ("weld b to c", "check b to c")):
        change = np.abs(values[later] - values[first])
        assert change[:, 0].max() < 1e-12
        assert change.max() < (0.1 if method.resolution == "linearized" else 1e-12)  # the published step stretches parts
    moved = np.abs(values["tack a to b"][:, 1] - values["tack a to b"][:, 0]) > 1e-6
    assert 100 < moved.sum() < 400
    assert np.abs(values["check height"] - values["weld height"]).max() > 0.1


def settled(again):
    """A rail whose joint is located again by the locators of its first part, which deviate as they did before."""
    line = tc.Assembly("settled")
    a, b = line.part("a", tc.Box(100, 50, 10)), line.part("b", tc.Box(60, 50, 10), at=(20, 0, 10))
    weld, check = line.station("weld"), line.station("check")
    names = ["A1", "A2", "A3", "B1", "B2", "C1"]
    places = [(5, 5, 0), (5, 45, 0), (95, 25, 0), (5, 0, 5), (95, 0, 5), (0, 25, 5)]
    pins = [tc.Locator(n, a.point(*p), along) for n, p, along in zip(names, places, "zzzyyx", strict=True)]
    weld.locate(a, pins, tolerance=0)
    weld.locate(b, cases.box_scheme(b), tolerance=1)
    weld.contact("lap", moving=b.face("-z"), reference=a.face("+z"))
    joint = weld.join("ab", a, b)
    check.locate(joint if again else a, pins, tolerance=0)
    for name in names:
        drives = {f"weld.a.{name}": 1.0, f"check.ab.{name}": 1.0}
        line.variable(f"cause {name}", 1.0, drives=drives)
    for station in (weld, check):
        station.measure(f"{station.name} corner", b.point(60, 50, 10), along="z")
    return line


def test_two_identical_stations_change_nothing():
    values = measured(settled(again=True))
    assert np.abs(values["check corner"] - values["weld corner"]).max() < 1e-12
    assert np.ptp(values["weld corner"]) > 0.5


def independent(names):
    line = tc.Assembly("independent")
    parts = {name: line.part(name, tc.Box(100, 50, 10), at=(0, 0, 20 * k)) for k, name in enumerate(("left", "right"))}
    base = line.part("base", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
    for name in names:
        station = line.station(f"for {name}")
        station.locate(parts[name], cases.box_scheme(parts[name]), tolerance=1)
        if name == "left":
            station.contact("rest", moving=parts[name].face("-z"), reference=base.face("+z"))
        station.measure(name, parts[name].point(100, 50, 0), along="z")
    return line


def test_the_order_of_independent_stations_does_not_matter():
    forth, back = (measured(independent(names)) for names in (("left", "right"), ("right", "left")))
    assert all((forth[name] == back[name]).all() for name in ("left", "right"))


def test_a_fixture_is_a_part_with_locators_and_features_of_its_own():
    line = tc.Assembly("inspection")
    a, b = line.part("a", tc.Box(100, 20, 10)), line.part("b", tc.Box(100, 20, 10), at=(60, 0, 10))
    table = line.part("table", tc.Box(200, 20, 10), at=(0, 0, -10))
    table.feature("bottom", table.face("-z"), datum="A")
    top = table.feature("top", table.face("+z"), tc.Profile(0.003, "A"))
    weld, check = line.station("weld"), line.station("check")
    for part in (a, b):
        weld.locate(part, cases.supported(part, 10, 90), tolerance=0.006)
    ab = weld.join("ab", a, b)
    check.locate(table, cases.supported(table, 10, 190), tolerance=0.006)
    pins = [tc.Locator(f"A{k}", p, "z") for k, p in enumerate([a.point(10, 5, 0), a.point(10, 15, 0), b.point(90, 10, 0)], 1)]
    check.locate(ab, [*pins, *cases.held(a)], tolerance=0.006, on=top)
    check.measure("end", b.point(90, 10, 10), along="z")
    check.measure("top", top.point(150, 10, 10), along="z")
    program = compiled(line, solver="daqp")
    block = next(iter(tc.simulate_blocks(program, samples=500, seed=1)))
    end, under = block.measured[:, 0].T
    pin = block.deviations[:, program.nominal.contributors.index("check.ab.A3")]
    assert (
        np.abs(end - under - pin).max() < 2e-5 and end.std() > 1.2e-3 and under.std() > 5e-4
    )  # what is left is of second order


def levers(points, x, y):
    """The heights of three points under a plane enter its height at (x, y) by these factors."""
    return np.array([1, x, y]) @ np.linalg.inv([[1, *point] for point in points])


def test_the_rail_has_the_spread_of_its_levers():
    line = assembly_of(MODELS / "rail.py")
    values = measured(line, samples=4000)
    front, rear = [(20, 10), (20, 70), (480, 40)], [(520, 10), (520, 70), (920, 40)]
    pins, bracket = [(20, 10), (20, 70), (840, 40)], [(955, 10), (1035, 10), (995, 70)]

    def step(x):
        return np.concatenate([-levers(front, x, 40), levers(rear, x, 40)])

    held = levers(pins, 940, 40)
    left = step(940) - held[2] * step(840)
    flush = np.sqrt(0.4**2 * (left @ left) + 0.3**2 * (held @ held + levers(bracket, 945, 40) @ levers(bracket, 945, 40)))
    for name, six_sigma in (("step", 0.4 * np.linalg.norm(step(440))), ("flush", flush)):
        assert 6 * values[name][:, 0].std() == pytest.approx(six_sigma, rel=4 / np.sqrt(2 * 4000)), name
    assert values["step"][:, 1].std() < 0.65 * values["step"][:, 0].std()
    assert 0.95 < values["flush"][:, 1].std() / values["flush"][:, 0].std() < 1


def test_a_hood_is_hung_and_inspected_as_its_model_says():
    values = measured(assembly_of(MODELS / "hood.py"), samples=500)
    spread = {name: x.std(axis=0) for name, x in values.items()}
    assert np.abs(values["flush as inspected"] - values["flush as hung"]).max() < 1e-3
    assert 0.53 < spread["flush as hung"][1] / spread["flush as hung"][0] < 0.66
    assert 0.65 < spread["corner as inspected"][1] / spread["corner as hung"][1] < 0.78


def test_linearized_steps_are_handed_over_wherever_the_assembly_stands():
    near, far = (measured(cases.three_stations(1.0, x=x), samples=100, method=LINEARIZED) for x in (0.0, 1000.0))
    for name in ("check a to b", "check b to c", "check height"):
        assert np.abs(near[name] - far[name]).max() < 1e-8, name


def welded(scheme_of, *, turn=(0.0, 0.0, 0.0)):
    """Two blocks side by side, welded, and then located as a joint by a scheme."""
    line = tc.Assembly("welded")
    at = Rotation.from_rotvec(turn).apply([100, 0, 0])
    a = line.part("a", tc.Box(100, 50, 20), rotation=turn)
    b = line.part("b", tc.Box(100, 50, 20), at=at, rotation=turn)
    weld = line.station("weld")
    for part in (a, b):
        weld.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5), tolerance=0.2)
    ab = weld.join("ab", a, b)
    check = line.station("check")
    check.locate(ab, scheme_of(a, b), tolerance=0.3)
    check.measure("corner", b.point(100, 50, 20), along="z")
    check.measure("side", a.point(100, 50, 20), along="y")
    return line


def on_faces(a, b):
    return tc.three_two_one(b.face("-z"), a.face("-y"), b.face("+x"), inset=5)


def on_points(a, b):
    """The same points by hand: A on b beside the secondary face, B on a, C in the middle of the end of b."""
    points = [(5, 5), (95, 5), (50, 45)]
    scheme = [tc.Locator(f"A{k}", b.point(x, y, 0), "z") for k, (x, y) in enumerate(points, start=1)]
    scheme += [tc.Locator(f"B{k}", a.point(x, 0, 10), "y") for k, x in enumerate((5, 95), start=1)]
    return [*scheme, tc.Locator("C1", b.point(100, 25, 10), "-x")]


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -0.2, 0.5)])
def test_a_joint_is_located_by_three_faces_of_its_parts(turn):
    programs = [compiled(welded(scheme, turn=turn)) for scheme in (on_faces, on_points)]
    locators = [program.nominal.locators for program in programs]
    order = [np.lexsort(np.round(each.points[12:], 6).T) for each in locators]
    points, directions = ([getattr(each, name)[12:][rows] for each, rows in zip(locators, order, strict=True)]
                          for name in ("points", "directions"))  # fmt: skip
    assert points[0] == pytest.approx(points[1], abs=1e-9) and directions[0] == pytest.approx(directions[1], abs=1e-12)


def test_faces_of_other_parts_do_not_locate_a_joint():
    def with_stranger(a, b):
        return tc.three_two_one(a.face("-z"), b.face("-y"), tc.Assembly("other").part("c", tc.Box(1, 1, 1)).face("-x"))

    with pytest.raises(ModelError, match=r'face c -x is of part "c"; the parts of the joint are: a, b'):
        tc.build(welded(with_stranger))


def test_a_pair_within_a_joint_is_to_be_declared_before_it_is_joined():
    line = welded(on_points)
    a, b = line.parts
    line.stations[1].contact("seam", moving=b.face("-x"), reference=a.face("+x"))
    (fault,) = tc.check(line)
    assert fault.endswith(
        'both parts belong to joint "ab", which keeps them as station "weld" left them; declare the pair in station "weld", '
        "or leave it out"
    )
