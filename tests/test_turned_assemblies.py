"""An assembly that is turned has the same results: points and weights are those of a face, not of a frame."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.blocks import combs
from tests.helpers import nightly, simulate
from tolcontact.discretization import discretize

THICKNESS = 4.0
SAMPLES = 40
SIDES = 96  # of the polygons that stand for circles
TURNS = [Rotation.from_rotvec(turn) for turn in ((0.3, -1.1, 0.7), (np.pi / 2, 0, 0), (2.0, 0.4, -1.3))]
SHIFT = np.array((31.0, -17.0, 90.0))  # mm
POINTS = [(8, 5, 0), (-9, 6, 0), (0, -9, 0), (8, 0, 2), (-8, 0, 2), (0, 3, 2)]
DIRECTIONS = [(0, 0, 1)] * 3 + [(0, 1, 0)] * 2 + [(1, 0, 0)]


def circle(radius):
    """The corners (SIDES, 2) of a regular polygon."""
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def polygon_moments(corners):
    """Area, centre (2,) and second moments (2, 2) about it of a polygon (corner, 2), by Green's theorem along its edges."""
    (x, y), (u, v) = corners.T, np.roll(corners, -1, axis=0).T
    cross = x * v - u * y
    area, first = cross.sum() / 2, np.array([((x + u) * cross).sum(), ((y + v) * cross).sum()]) / 6
    xx, yy = ((x * x + x * u + u * u) * cross).sum() / 12, ((y * y + y * v + v * v) * cross).sum() / 12
    xy = ((x * v + 2 * x * y + 2 * u * v + u * y) * cross).sum() / 24
    return area, first / area, np.array([(xx, xy), (xy, yy)]) / area - np.outer(first, first) / area**2


RECTANGLE = np.array([(-25, -12.5), (25, -12.5), (25, 12.5), (-25, 12.5)])
TRIANGLE = np.array([(-20.0, -14), (25, -14), (3, 22)])
ELL = np.array([(-15.0, -10), (25, -10), (25, 0), (-3, 0), (-3, 20), (-15, 20)])
OUTLINES = {
    "rectangle": [RECTANGLE],
    "square": [np.array([(-20.0, -20), (20, -20), (20, 20), (-20, 20)])],
    "triangle": [TRIANGLE],
    "L": [ELL],
    "disc": [circle(20)],
    "ring": [circle(20), circle(10)],
}


def plate(name):
    """A plate of an outline, its lower face at z = 0."""
    outer, *holes = OUTLINES[name]
    if name == "L":
        faces = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    elif holes:
        k = np.arange(SIDES)
        faces = np.r_[np.c_[k, (k + 1) % SIDES, k + SIDES], np.c_[(k + 1) % SIDES, (k + 1) % SIDES + SIDES, k + SIDES]]
    else:
        faces = [(0, k, k + 1) for k in range(1, len(outer) - 1)]
    return trimesh.creation.extrude_triangulation(np.vstack([outer, *holes]), np.asarray(faces), THICKNESS)


def plates(name, turn=None, overhang=False, **choice):
    """A plate on a larger one, all of it turned and shifted: meshes, locators, directions."""
    R, t = (Rotation.identity(), np.zeros(3)) if turn is None else (turn, SHIFT)
    x = 2.0 if overhang else -60.0
    lower, upper = trimesh.creation.box(bounds=[(x, -50, -5), (x + 120, 50, 0)]), plate(name)
    for mesh in (lower, upper):
        mesh.vertices = R.apply(mesh.vertices) + t
    a = tc.Assembly(name)
    base, top = a.part("base", tc.Mesh(lower), fixed=True), a.part("plate", tc.Mesh(upper))
    six = zip("ABCDEF", R.apply(POINTS) + t, R.apply(DIRECTIONS), strict=True)
    a.locate(top, [tc.Locator(label, tuple(p), tuple(n)) for label, p, n in six], tolerance=1)
    down, up = (tc.select.Facing(tuple(R.apply((0, 0, z)))) for z in (-1, 1))
    a.contact("seat", moving=top.face(down), reference=base.face(up), **choice)
    a.measure("height", top.point(*(R.apply((8, 5, 0)) + t)), along=tuple(R.apply((0, 0, 1))), tolerance=1)
    return a


def seat(*arguments, **choice):
    (pair,) = discretize(plates(*arguments, **choice)).pairs
    return pair


def moments(points, weights):
    """Centre and second moments of weighted points (point, k)."""
    centre = weights @ points / weights.sum()
    return centre, (points - centre).T @ ((points - centre) * weights[:, None]) / weights.sum()


@pytest.mark.parametrize("points", [None, *nightly(40, 1000)])
@pytest.mark.parametrize("name", OUTLINES)
def test_weighted_points_have_the_area_centre_and_second_moments_of_the_face(name, points):
    pair = seat(name, points=points)
    outer, *holes = [polygon_moments(corners) for corners in OUTLINES[name]]
    area = outer[0] - sum(hole[0] for hole in holes)
    second = (outer[2] * outer[0] - sum(hole[2] * hole[0] for hole in holes)) / area
    if name in ("rectangle", "square"):
        np.testing.assert_allclose(second, np.diag(np.ptp(OUTLINES[name][0], axis=0) ** 2 / 12), atol=1e-12)
    elif name in ("disc", "ring"):  # circles, but for their polygons
        square = 20**2 if name == "disc" else 20**2 + 10**2
        np.testing.assert_allclose(second, np.eye(2) * square / 4, atol=square * 2 * np.pi**2 / (3 * SIDES**2))
    centre, weighted = moments(pair.P_m[:, :2], pair.weights)
    size = np.sqrt(np.trace(second))
    assert pair.weights.sum() == pytest.approx(len(pair.P_m), rel=1e-9) and pair.weights.min() > 0
    assert np.abs(centre - outer[1]).max() < 1e-9 * size and np.abs(weighted - second).max() < 1e-9 * size**2


@pytest.mark.parametrize("points", [None, 1000])
def test_they_have_those_of_the_region_where_the_other_face_ends(points):
    pair = seat("rectangle", overhang=True, points=points)
    centre, weighted = moments(pair.P_m[:, :2], pair.weights)
    np.testing.assert_allclose(centre, (13.5, 0), atol=1e-9)
    np.testing.assert_allclose(weighted, np.diag([23**2 / 12, 25**2 / 12]), atol=1e-7)


def test_points_that_cannot_have_second_moments_have_the_centre():
    corners = seat("triangle", points=3)
    np.testing.assert_allclose(moments(corners.P_m, corners.weights)[0][:2], polygon_moments(TRIANGLE)[1], atol=1e-9)
    (one,) = seat("triangle", points=1).weights
    assert one == pytest.approx(1)


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("overhang", [True, *nightly(False)])
def test_turned_faces_keep_their_points_and_weights(name, overhang):
    pair = seat(name, overhang=overhang)
    for turn in TURNS:
        turned = seat(name, turn, overhang)
        np.testing.assert_allclose(turn.inv().apply(turned.P_m - SHIFT), pair.P_m, atol=1e-12)
        np.testing.assert_allclose(turned.weights, pair.weights, atol=1e-11)


@pytest.mark.parametrize(
    ("name", "overhang", "resolution"),
    [
        ("L", False, "exact"),
        ("ring", True, "linearized"),
        *nightly(*(("ring", True, "exact"), ("L", False, "linearized"))),
        *nightly(*((*plate, way) for plate in (("rectangle", True), ("disc", False)) for way in ("exact", "linearized"))),
    ],
)
def test_realizations_of_turned_assemblies_are_the_same(name, overhang, resolution):
    method = tc.Method(resolution=resolution)
    _, run = simulate(plates(name, overhang=overhang), samples=SAMPLES, solver="daqp", method=method)
    poses = run["poses"][:, 1, 1]
    for turn in TURNS:
        _, turned = simulate(plates(name, turn, overhang), samples=SAMPLES, solver="daqp", method=method)
        Q, R = turn.as_matrix(), turned["poses"][:, 1, 1, :9].reshape(-1, 3, 3)
        R_back = Q.T @ R @ Q
        t_back = (turned["poses"][:, 1, 1, 9:] + R @ SHIFT - SHIFT) @ Q
        assert np.abs(R_back.reshape(-1, 9) - poses[:, :9]).max() * 25 < 1e-9
        assert np.abs(t_back - poses[:, 9:]).max() < 1e-9
        assert np.abs(turned["measured"] - run["measured"]).max() < 1e-9
        assert (turned["status"] == run["status"]).all()


def test_exact_answers_do_not_depend_on_the_number_of_points():
    """All points count as the face does, so that any number comes to the same least motion."""
    runs = [simulate(plates("L", points=points), samples=100, solver="daqp")[1] for points in (40, 200, 1000)]
    heights = [run["measured"][:, 1, 0] for run in runs]
    assert max(np.abs(height - heights[-1]).max() for height in heights) < 1e-7


def pressed(upper, lower, turn=None, *, faces=((), ()), **choice):
    """A body on another one, both meshes, turned and shifted; faces by selectors, whole surfaces by default."""
    R, t = (Rotation.identity(), np.zeros(3)) if turn is None else (turn, SHIFT)
    bodies = [trimesh.Trimesh(R.apply(np.array(mesh.vertices)) + t, mesh.faces, process=False) for mesh in (lower, upper)]
    a = tc.Assembly("pressed")
    base, top = a.part("base", tc.Mesh(bodies[0]), fixed=True), a.part("top", tc.Mesh(bodies[1]))
    low, high = np.array(upper.bounds)
    points = np.array([(0.1, 0.1, 0), (0.9, 0.1, 0), (0.5, 0.9, 0), (0.1, 0, 0.5), (0.9, 0, 0.5), (0, 0.5, 0.5)])
    places = zip("ABCDEF", R.apply(low + points * (high - low)) + t, R.apply(DIRECTIONS), strict=True)
    a.locate(top, [tc.Locator(label, tuple(p), tuple(n)) for label, p, n in places], tolerance=0.3)
    a.contact("contact", moving=top.face(*faces[0]), reference=base.face(*faces[1]), **choice)
    a.measure("height", top.point(*(R.apply(high) + t)), along=tuple(R.apply((0, 0, 1))), tolerance=1)
    return a


def heights_of(*arguments, samples=30, **choice):
    _, run = simulate(pressed(*arguments, **choice), samples=samples, solver="daqp", method=tc.Method())
    assert (run["status"] == 1).any()
    return run["measured"][:, 1, 0], run["status"]


def test_a_box_on_a_table_is_the_same_by_faces_and_as_a_whole():
    """The walls of the box are not opposite to the table, however many points lie on them."""
    boxes = [trimesh.creation.box(bounds=bounds) for bounds in ([[30, 15, 0], [70, 45, 10]], [[0, 0, -10], [100, 60, 0]])]
    sides = (tc.select.Facing((0, 0, -1)),), (tc.select.Facing((0, 0, 1)),)
    expected, status = heights_of(*boxes, faces=sides)
    for choice in ({}, {"points": 50}, {"within": 1.0}, {"turn": TURNS[0]}):
        heights, others = heights_of(*boxes, **choice)
        assert np.array_equal(others, status) and np.abs(heights - expected).max() < 1e-8


@pytest.mark.nightly
def test_a_comb_in_a_comb_is_the_same_in_any_frame_with_any_points():
    expected, status = heights_of(*combs(), points=60, samples=6)
    for choice in ({"turn": TURNS[0], "points": 60}, {"points": 100}):
        heights, others = heights_of(*combs(), samples=6, **choice)
        assert np.array_equal(others, status) and np.abs(heights - expected).max() < 1e-7


def test_two_pairs_count_by_their_areas_whatever_their_points():
    """A plate on a large and a small pad: as many points on the small one would double its weight."""

    def plate(points):
        a = tc.Assembly("pads")
        top = a.part("top", tc.Box(60, 20, 4), at=(0, 0, 10))
        a.locate(top, tc.three_two_one(top.face("-z"), top.face("-y"), top.face("-x"), inset=3), tolerance=0.5)
        for (name, x, width), count in zip((("large", 0, 30), ("small", 50, 10)), points, strict=True):
            pad = a.part(name, tc.Box(width, 20, 10), at=(x, 0, 0), fixed=True)
            a.contact(name, moving=top.face("-z"), reference=pad.face("+z"), points=count)
        a.measure("height", top.point(60, 20, 0), along="z", tolerance=1)
        return a

    method = tc.Method()
    few, many = (simulate(plate(points), samples=40, solver="daqp", method=method)[1] for points in ((30, 30), (30, 300)))
    assert np.abs(few["measured"] - many["measured"]).max() < 1e-8
