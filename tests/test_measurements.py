"""Measurements of faces, and combinations, against closed forms, rigid motions and least distances that are found otherwise."""

import json

import numpy as np
import pytest
import trimesh
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import call
from tolcontact import poses
from tolcontact.declaration.json_model import json_schema
from tolcontact.report.annotations import marks_of, marks_of_nominal

PLANE, ROUND = tc.Box(40, 30, 10), tc.Cylinder()
N = 50


def shaft(radius=3.0, length=30.0):
    return tc.Mesh(trimesh.creation.cylinder(radius, length, sections=48))


def ring(hole=3.2, outer=9.0, height=12.0):
    return tc.Mesh(trimesh.creation.annulus(hole, outer, height, sections=48))


def hole(part, radius=3.2):
    return part.face(tc.Cylinder(inner=True, radius=radius))


def two(first, second, *, at=(0, 0, 0), rotation=(0, 0, 0), first_at=(5, -3, 7), first_rotation=(0.3, -0.2, 0.5)):
    """Two parts that nothing locates; `at` and `rotation` of the second are in the frame of the first."""
    assembly = tc.Assembly("two")
    R = Rotation.from_rotvec(first_rotation)
    turned = (R * Rotation.from_rotvec(rotation)).as_rotvec()
    return (
        assembly,
        assembly.part("first", first, at=first_at, rotation=first_rotation, fixed=True),
        assembly.part("second", second, at=R.apply(at) + first_at, rotation=turned, fixed=True),
    )


def motions(count=N, turn=0.05, shift=0.5, seed=1):
    """Motions R (n, part, 3, 3), t (n, part, 3) of two parts."""
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(rng.normal(0, turn, (2 * count, 3))).as_matrix().reshape(count, 2, 3, 3)
    return R, rng.normal(0, shift, (count, 2, 3))


def observed(assembly, R, t):
    """Measures (n, measure) at poses, without deviations."""
    program = tc.build(assembly, solver="daqp")
    X = poses.pose(R, t).reshape(len(R), -1)
    return program.observe(poses=X, deviations=np.zeros((len(X), len(program.nominal.contributors))))["measured"]


def placed(part, R, t, points, *, is_direction=False):
    """Points (k, 3) or directions of a part's own frame, at poses R (n, 3, 3), t (n, 3): (n, k, 3)."""
    own = Rotation.from_rotvec(part.rotation).as_matrix()
    nominal = np.atleast_2d(points) @ own.T + (0 if is_direction else np.array(part.at))
    return nominal @ R.swapaxes(1, 2) + (0 if is_direction else t[:, None])


def axis_of(part, R, t, length):
    ends = placed(part, R, t, [[0, 0, -length / 2], [0, 0, length / 2]])
    return ends[:, 0], ends[:, 1]


def segments_apart(first, second):
    """The shortest distance (n,) of segments, as a bounded least-squares problem."""
    apart = []
    for a, b, c, d in zip(*first, *second, strict=True):
        nearest = lsq_linear(np.column_stack([b - a, c - d]), c - a, bounds=(0, 1), tol=1e-14)
        apart.append(np.sqrt(2 * nearest.cost))
    return np.array(apart)


def moved_together(R, t, seed=7):
    """The same poses after one motion of everything in each realization."""
    rng = np.random.default_rng(seed)
    Q = Rotation.random(len(R), rng).as_matrix()[:, None]
    return Q @ R, (Q @ t[..., None])[..., 0] + rng.normal(0, 100, (len(R), 1, 3))


def check_invariance(assembly, R, t, tolerance=1e-9):
    np.testing.assert_allclose(observed(assembly, *moved_together(R, t)), observed(assembly, R, t), atol=tolerance)


WALLS = {
    "plane": (PLANE, ("+z",), (10, 12, 11.5), lambda p: p[..., 2] - 10),
    "cylinder": (shaft(), (ROUND,), (3.5, 1, 2), lambda p: np.hypot(p[..., 0], p[..., 1]) - 3),
    "hole": (ring(), (tc.Cylinder(inner=True),), (1.5, 1, 2), lambda p: 3.2 - np.hypot(p[..., 0], p[..., 1])),
    "sphere": (
        tc.Mesh(trimesh.creation.icosphere(3, 6.0)), (), (5, 4, 2), lambda p: np.linalg.norm(p, axis=-1) - 6,
    ),
    "cone": (
        tc.Mesh(trimesh.creation.cone(5.0, 10.0, sections=64)), (tc.Largest("cone"),), (4, 3, 3),
        lambda p: (2 * np.hypot(p[..., 0], p[..., 1]) - (10 - p[..., 2])) / np.sqrt(5),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", WALLS)
def test_gaps_and_flushes_are_distances_from_whole_surfaces(kind):
    geometry, criteria, station, distance = WALLS[kind]
    assembly, first, second = two(geometry, tc.Box(1, 1, 1), at=station, rotation=(0.4, 0.1, -0.3))
    assembly.measure("gap", tc.Gap(second.point(0, 0, 0), first.face(*criteria)))
    assembly.measure("flush", tc.Flush(second.point(0, 0, 0), first.face(*criteria)))
    R, t = motions()
    place = placed(second, R[:, 1], t[:, 1], [[0, 0, 0]])[:, 0]
    back = np.einsum("nji,nj->ni", R[:, 0], place - t[:, 0])
    own = (back - first.at) @ Rotation.from_rotvec(first.rotation).as_matrix()
    found = observed(assembly, R, t)
    np.testing.assert_allclose(found[:, 0], distance(own), atol=1e-6 if kind in ("cone", "sphere") else 1e-9)
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    check_invariance(assembly, R, t)


def test_a_general_face_is_its_tangent_plane_at_the_nominal_station():
    mesh = trimesh.creation.icosphere(4)
    mesh.apply_scale([9, 6, 4])
    assembly, first, second = two(tc.Mesh(mesh), PLANE, at=(0, 0, 5), first_rotation=(0, 0, 0), first_at=(0, 0, 0))
    assembly.measure("gap", tc.Gap(second.point(0, 0, 0), first.face()))
    R, t = np.broadcast_to(np.eye(3), (2, 2, 3, 3)), np.zeros((2, 2, 3))
    t[1, 1] = (0.5, -0.2, 0.25)
    np.testing.assert_allclose(observed(assembly, R, t)[:, 0], [1, 1.25], atol=1e-3)


def test_stations_are_even_and_keep_their_feature():
    part = tc.Assembly("a").part("part", PLANE)
    side = part.feature("side", part.face("+y"), tc.Profile(0.2))
    seam = tc.stations(side.point(0, 30, 10), side.point(40, 30, 10), 5)
    assert [point.position for point in seam] == [(x, 30, 10) for x in (0, 10, 20, 30, 40)]
    assert {point.on for point in seam} == {side}


def test_a_seam_has_a_least_and_a_largest_gap_and_a_taper():
    assembly, first, second = two(PLANE, PLANE, at=(0, 31, 0))
    gaps = [tc.Gap(point, first.face("+y")) for point in tc.stations(second.point(0, 0, 10), second.point(40, 0, 10), 5)]
    single = [assembly.measure(f"gap {k}", gap) for k, gap in enumerate(gaps)]
    assembly.measure("least", tc.Minimum(*gaps))
    assembly.measure("largest", tc.Maximum(*single))
    assembly.measure("mean", tc.Mean(*(measure.name for measure in single)))
    assembly.measure("sum", tc.Sum(*gaps))
    assembly.measure("taper", tc.Difference("largest", tc.Minimum(*gaps)))
    found = observed(assembly, *motions())
    stations = found[:, :5]
    expected = [stations.min(1), stations.max(1), stations.mean(1), stations.sum(1), np.ptp(stations, 1)]
    np.testing.assert_allclose(found[:, 5:], np.transpose(expected), atol=1e-12)
    assert tc.build(assembly).nominal_measures == pytest.approx([1] * 8 + [5, 0])


@pytest.mark.parametrize("turn", [0.3, 0.0, 1e-10, 1e-7, np.pi / 2])
def test_axes_are_as_far_apart_as_their_nearest_places(turn):
    assembly, first, second = two(shaft(), ring(), at=(20, 4, 9), rotation=(turn, 0, 0))
    faces = first.face(ROUND), hole(second)
    assembly.measure("shortest", tc.AxisDistance(*faces))
    assembly.measure("back", tc.AxisDistance(*reversed(faces)))
    for R, t in (motions(), motions(turn=1e-9), motions(turn=0)):
        expected = segments_apart(axis_of(first, R[:, 0], t[:, 0], 30), axis_of(second, R[:, 1], t[:, 1], 12))
        np.testing.assert_allclose(observed(assembly, R, t), np.column_stack([expected] * 2), atol=1e-6)
        check_invariance(assembly, R, t)


def test_axes_are_measured_in_a_plane_and_along_a_direction():
    assembly, first, second = two(ring(), ring(), at=(20, 4, 9), rotation=(0.1, 0.05, 0))
    n = np.array([0.2, -0.1, 0.9]) / np.linalg.norm([0.2, -0.1, 0.9])
    assembly.measure("across", tc.AxisDistance(hole(first), hole(second), across=n))
    assembly.measure("along", tc.AxisDistance(hole(first), hole(second), along=(3, 0, 4)))
    R, t = motions()
    (a, a_end), (b, b_end) = axis_of(first, R[:, 0], t[:, 0], 12), axis_of(second, R[:, 1], t[:, 1], 12)
    middle, v = (a + a_end) / 2, (b_end - b) / 12
    pierced = b + ((middle - b) @ n / (v @ n))[:, None] * v
    foot = b + ((middle - b) * v).sum(axis=1)[:, None] * v
    np.testing.assert_allclose((pierced - middle) @ n, 0, atol=1e-12)
    expected = np.column_stack([np.linalg.norm(pierced - middle, axis=1), (foot - middle) @ [0.6, 0, 0.8]])
    np.testing.assert_allclose(observed(assembly, R, t), expected, atol=1e-9)


def test_the_axis_of_a_sphere_is_its_centre():
    ball = tc.Mesh(trimesh.creation.icosphere(3, 4.0))
    assembly, first, second = two(ball, ball, at=(12, 5, 3), first_rotation=(0, 0, 0), first_at=(0, 0, 0))
    for options in ({}, {"across": "z"}, {"along": "y"}):
        assembly.measure(f"distance {options}", tc.AxisDistance(first.face(), second.face(), **options))
    R, t = motions(turn=0)
    v = t[:, 1] - t[:, 0] + [12, 5, 3]
    expected = np.column_stack([np.linalg.norm(v, axis=1), np.hypot(v[:, 0], v[:, 1]), v[:, 1]])
    np.testing.assert_allclose(observed(assembly, R, t), expected, atol=1e-6)


def test_small_angles_keep_their_digits():
    """The arc cosine of 1 - 5e-19 is 0, and that of 1 - 5e-17, too."""
    assembly, first, second = two(PLANE, PLANE, at=(0, 0, 10), first_rotation=(0, 0, 0))
    assembly.measure("angle", tc.Angle(first.face("+z"), second.face("-z")))
    assembly.measure("turn", tc.Angle(first.face("+z"), second.face("-z"), about="x"))
    angles = np.array([0, 1e-12, 1e-9, -1e-8, 3e-5, -0.01, 0.3])
    R = np.broadcast_to(np.eye(3), (len(angles), 2, 3, 3)).copy()
    R[:, 1] = Rotation.from_rotvec(angles[:, None] * [1, 0, 0]).as_matrix()
    found = observed(assembly, R, np.zeros((len(angles), 2, 3)))
    np.testing.assert_allclose(found, np.column_stack([np.abs(angles), angles]), rtol=1e-6, atol=1e-18)
    assert {measure.units for measure in assembly.measures} == {"rad"}


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 2, 2.0])
def test_angles_of_planes_and_axes(turn):
    assembly, first, second = two(PLANE, shaft(), at=(60, 0, 0), rotation=(0, turn, 0))
    assembly.measure("angle", tc.Angle(first.face("+z"), second.face(ROUND)))
    assembly.measure("in plane", tc.Angle(first.face("-z"), second.face(ROUND), about=(0, 1, 2)))
    R, t = motions()
    u = placed(first, R[:, 0], t[:, 0], [[0, 0, 1]], is_direction=True)[:, 0]
    v = placed(second, R[:, 1], t[:, 1], [[0, 0, 1]], is_direction=True)[:, 0]
    angle = np.arccos((u * v).sum(axis=1))
    found = observed(assembly, R, t)
    if turn == np.pi / 2:  # then the sense decides; that of an axis is its own
        np.testing.assert_allclose(np.abs(found[:, 0] - np.pi / 2), np.abs(angle - np.pi / 2), atol=1e-9)
    else:
        np.testing.assert_allclose(found[:, 0], angle if turn < np.pi / 2 else np.pi - angle, atol=1e-6)
    n = np.array([0, 1, 2]) / np.sqrt(5)
    flat = [w - (w @ n)[:, None] * n for w in (u, v)]
    azimuths = [np.arctan2(w @ np.cross(n, [1, 0, 0]), w @ [1, 0, 0]) for w in flat]
    difference = (azimuths[1] - azimuths[0] - found[:, 1] + np.pi / 2) % np.pi - np.pi / 2
    np.testing.assert_allclose(difference, 0, atol=1e-9)
    assert np.abs(tc.build(assembly).nominal_measures).max() <= np.pi / 2 + 1e-9


def rectangles_apart(first, second):
    """The least distance (n,) of rectangles (n, corner, 3) that do not meet, given by three corners: middle, ends of edges."""
    apart = []
    for (a, b, c), (d, e, f) in zip(first, second, strict=True):
        nearest = lsq_linear(np.column_stack([b - a, c - a, d - e, d - f]), d - a, bounds=(0, 1), tol=1e-14)
        apart.append(np.sqrt(2 * nearest.cost))
    return np.array(apart)


BLOCKS = {
    "inside": ((15, 10, 11), (10, 8, 5)), "staggered": ((-10, -5, 10.5), (40, 20, 5)), "across": ((20, -15, 11), (8, 60, 5)),
    "around": ((-5, -5, 12), (60, 60, 5)), "on three rims": ((20, 0, 10.5), (20, 30, 5)), "equal": ((0, 0, 11), (40, 30, 5)),
}  # fmt: skip


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("shift", [0.01, 1.0])
def test_the_clearance_of_planes_is_that_of_their_rectangles(name, shift):
    """Also after shifts that change which corners lie over the other block, and which edges cross."""
    at, (x, y, z) = BLOCKS[name]
    assembly, first, second = two(PLANE, tc.Box(x, y, z), at=at)
    assembly.measure("clearance", tc.Clearance(first.face("+z"), second.face("-z")))
    assembly.measure("back", tc.Clearance(second.face("-z"), first.face("+z")))
    R, t = motions(turn=3e-4, shift=shift)
    t = (t * [1, 1, 0.01 / shift]) @ Rotation.from_rotvec(first.rotation).as_matrix().T
    expected = rectangles_apart(
        placed(first, R[:, 0], t[:, 0], [[0, 0, 10], [40, 0, 10], [0, 30, 10]]),
        placed(second, R[:, 1], t[:, 1], [[0, 0, 0], [x, 0, 0], [0, y, 0]]),
    )
    found = observed(assembly, R, t)
    np.testing.assert_allclose(found, np.column_stack([expected] * 2), atol=5e-6)  # distance times tilt squared
    assert np.ptp(found[:, 0]) > 0.03 and (found > 0).all()
    check_invariance(assembly, R, t)


def test_clearances_of_round_faces_have_closed_forms():
    R, t = motions(turn=2e-3, shift=0.02)
    assembly, first, second = two(ring(), shaft(length=10))
    assembly.measure("pin", tc.Clearance(second.face(ROUND), hole(first)))
    own = [np.einsum("nji,nj->ni", R[:, 0], end - t[:, 0]) for end in axis_of(second, R[:, 1], t[:, 1], 10)]
    frame = Rotation.from_rotvec(first.rotation).as_matrix()
    ends = [(end - first.at) @ frame for end in own]
    x = np.cross(ends[1] - ends[0], [1, 0, 0])
    across = [w / np.linalg.norm(w, axis=1, keepdims=True) for w in (x, np.cross(ends[1] - ends[0], x))]
    azimuths = np.linspace(0, 2 * np.pi, 5000)[:, None, None]
    rims = [end + 3 * (np.cos(azimuths) * across[0] + np.sin(azimuths) * across[1]) for end in ends]
    farthest = np.max([np.hypot(places[..., 0], places[..., 1]).max(axis=0) for places in rims], axis=0)
    found = observed(assembly, R, t)[:, 0]
    np.testing.assert_allclose(found, 3.2 - farthest, atol=2e-6)
    check_invariance(assembly, R, t)

    assembly, first, second = two(PLANE, tc.Mesh(trimesh.creation.icosphere(3, 4.0)), at=(20, 15, 15))
    assembly.measure("ball", tc.Clearance(first.face("+z"), second.face()))
    centre = placed(second, R[:, 1], t[:, 1], [[0, 0, 0]])[:, 0]
    normal = placed(first, R[:, 0], t[:, 0], [[0, 0, 1]], is_direction=True)[:, 0]
    top = placed(first, R[:, 0], t[:, 0], [[0, 0, 10]])[:, 0]
    np.testing.assert_allclose(observed(assembly, R, t)[:, 0], ((centre - top) * normal).sum(axis=1) - 4, atol=1e-6)

    assembly, first, second = two(PLANE, shaft(length=20), at=(20, 15, 14), rotation=(np.pi / 2, 0, 0))
    assembly.measure("shaft", tc.Clearance(second.face(ROUND), first.face("+z")))
    heights = []
    for end in axis_of(second, R[:, 1], t[:, 1], 20):
        v = placed(second, R[:, 1], t[:, 1], [[0, 0, 1]], is_direction=True)[:, 0]
        heights.append(((end - top) * normal).sum(axis=1) - 3 * np.sqrt(1 - (v * normal).sum(axis=1) ** 2))
    np.testing.assert_allclose(observed(assembly, R, t)[:, 0], np.min(heights, axis=0), atol=1e-9)
    check_invariance(assembly, R, t)


@pytest.mark.parametrize("rotation", [(0, 0, 0), (np.pi / 2, 0, 0), (0.3, 0.2, 0)])
def test_the_clearance_of_two_shafts_is_the_distance_of_their_axes_less_their_radii(rotation):
    assembly, first, second = two(shaft(), shaft(2.0, 20.0), at=(9, 0, 2), rotation=rotation)
    assembly.measure("clearance", tc.Clearance(first.face(ROUND), second.face(ROUND)))
    R, t = motions()
    expected = segments_apart(axis_of(first, R[:, 0], t[:, 0], 30), axis_of(second, R[:, 1], t[:, 1], 20)) - 5
    np.testing.assert_allclose(observed(assembly, R, t)[:, 0], expected, atol=1e-6)
    check_invariance(assembly, R, t)


def drilled():
    """A plate with two holes that its drawing tolerances, and a lid on it that is located by them."""
    model = tc.Assembly("plate")
    rings = [model.part(name, ring(), at=at) for name, at in (("left", (0, 0, 0)), ("right", (30, 0, 0)))]
    for part in rings:
        lower = part.feature("A", part.face("-z"), datum="A")
        rim = part.feature("B", part.face(tc.Cylinder(radius=9.0)), datum="B")
        part.feature("H", hole(part), tc.Size(6.4, 0.1), tc.Position(0.2, "A|B"))
        part.feature("top", part.face("+z"), tc.Profile(0.3, "A"))
        scheme = [tc.Locator(f"A{k}", (x, y, -6), "z", 0.1) for k, (x, y) in enumerate([(8, 0), (-8, 0), (0, 8)])]
        scheme += [tc.Locator(f"B{k}", (x, 0, -6), "y", 0.1) for k, x in enumerate((8, -8))] + [
            tc.Locator("C", (0, 0, -6), "x", 0.1)
        ]
        model.locate(part, scheme)
        assert lower.datum and rim.datum
    return model, *rings


def test_features_carry_their_deviations_into_measurements():
    """From the archive alone: poses, and how the faces deviate with the contributors."""
    model, left, right = drilled()
    holes = [next(f for f in part.features if f.name == "H") for part in (left, right)]
    tops = [next(f for f in part.features if f.name == "top") for part in (left, right)]
    pin = model.part("pin", shaft(), at=(0, 0, 0), fixed=True)
    model.measure("across", tc.AxisDistance(*holes, across="z"))
    model.measure("inclined", tc.Angle(tops[0], holes[1]))
    model.measure("flush", tc.Flush(tops[0].point(0, 8, 6), tops[1]))
    model.measure("play", tc.Clearance(pin.face(ROUND), holes[0]))
    results = tc.run(model, samples=200, solver="daqp", surfaces=0)
    d = results["sample"]["deviation"].values
    contact = results["contact"].to_dataset()
    twists = dict(zip(contact["feature_of_face"].values, contact["face_twist"].values, strict=True))
    centres = dict(zip(contact["feature_of_face"].values, contact["face_centre"].values, strict=True))
    heights = dict(zip(contact["feature_of_face"].values, contact["face_height"].values, strict=True))

    def at(part, feature, points, *, is_direction=False):
        """Places (n, k, 3) of nominal points of a feature."""
        twist, c = d @ twists[f"{part}.{feature}"].T, centres[f"{part}.{feature}"]
        turn = Rotation.from_rotvec(twist[:, 3:]).as_matrix().swapaxes(1, 2)
        local = np.array(points) @ turn if is_direction else (points - c) @ turn + c + twist[:, None, :3]
        R, t = (results[name].sel(part=part, state="raw").values for name in ("rotation", "translation"))
        return local @ R.swapaxes(1, 2) + (0 if is_direction else t[:, None])

    axes = [at(name, "H", np.array([[x, 0, -6], [x, 0, 6]])) for name, x in (("left", 0), ("right", 30))]
    middle, v = axes[0].mean(axis=1), axes[1][:, 1] - axes[1][:, 0]
    pierced = axes[1][:, 0] + ((middle - axes[1][:, 0])[:, 2] / v[:, 2])[:, None] * v
    across = np.linalg.norm(pierced - middle, axis=1)
    normals = [at(name, "top", [[0, 0, 1]], is_direction=True)[:, 0] for name in ("left", "right")]
    axis = v / np.linalg.norm(v, axis=1, keepdims=True)
    inclined = np.arctan2(np.linalg.norm(np.cross(normals[0], axis), axis=1), (normals[0] * axis).sum(axis=1))
    station, plane = at("left", "top", np.array([[0, 8, 6]]))[:, 0], at("right", "top", np.array([[30, 0, 6]]))[:, 0]
    flush = ((station - plane) * normals[1]).sum(axis=1)
    off_axis = np.linalg.norm(axes[0][:, :, :2], axis=2).max(axis=1)
    play = 0.2 - d @ heights["left.H"] - off_axis
    measured = results["measured"].sel(state="raw").values
    for found, expected, tolerance in zip(measured.T, (across, inclined, flush, play), (1e-9, 1e-9, 1e-9, 1e-3), strict=True):
        np.testing.assert_allclose(found, expected, atol=tolerance)
        assert np.std(found) > 10 * tolerance
    # The size of the hole is felt: without it the play would vary by other numbers.
    assert np.abs(measured[:, 3] - (0.2 - off_axis)).max() > 0.01


def seated(**options):
    """A block on a table with a clearance that contact keeps."""
    model = tc.Assembly("seated", **options)
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    model.measure("clearance", tc.Clearance(block.face("-z"), table.face("+z")), limits=(0, None))
    seam = tc.stations(block.point(50, 0, 0), block.point(50, 25, 0), 3)
    gaps = [model.measure(f"gap {k}", tc.Gap(point, table.face("+z"))) for k, point in enumerate(seam)]
    model.measure("least", tc.Minimum(*gaps, "clearance"))
    model.measure("turn", tc.Angle(block.face("-z"), table.face("+z"), about="y"), tolerance=0.05)
    model.measure("tilt", tc.Angle(block.face("-z"), table.face("+z")))
    return model


def test_contact_keeps_clearances_at_their_stop():
    results = tc.run(seated(), samples=400, solver="daqp", surfaces=0)
    raw, corrected = (results["measured"].sel(state=state, measure="clearance").values for state in ("raw", "corrected"))
    assert (raw < -0.1).mean() > 0.5 and corrected.min() > -1e-7
    np.testing.assert_allclose(raw, results["gap_min"].sel(state="raw").values[:, 0], atol=1e-9)
    summary = tc.summarize(results)
    shares = summary["statistic_value"].sel(measure="clearance", statistic="outside limits", interval="estimate")
    assert float(shares.sel(state="raw")) == pytest.approx((raw < 0).mean()) and float(shares.sel(state="corrected")) == 0
    assert (results["measured"].sel(measure="least") <= results["measured"].sel(measure="clearance")).all()


def test_a_clearance_does_not_count_what_hangs_over_a_rim():
    """The corners of this block are nominally over the table's rim, beyond which it sinks after a shift."""
    model = tc.Assembly("rim")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    model.measure("clearance", tc.Clearance(block.face("-z"), table.face("+z")), limits=(0, None))
    model.measure("gap", tc.Gap(block.point(50, 0, 0), table.face("+z")))
    results = tc.run(model, samples=400, solver="daqp", surfaces=0)
    corrected = results["measured"].sel(state="corrected")
    clearance, gap = (corrected.sel(measure=name).values for name in ("clearance", "gap"))
    # Contact does not resolve edges that cross at less than a degree: it may leave some micrometres there.
    assert clearance.min() > -2e-5 and (clearance < -1e-7).mean() < 0.01
    assert (gap < -1e-4).mean() > 0.02


def test_what_an_error_of_gaps_does_to_measures_is_stated():
    results = tc.run(seated(), samples=10, solver="daqp", surfaces=0)
    accuracy = dict(zip(results["measure"].values, results["measure_accuracy"].values, strict=True))
    assert accuracy["least"] == pytest.approx(max(accuracy[f"gap {k}"] for k in (0, 2)), rel=0.6)
    assert 1e-8 <= accuracy["clearance"] <= 5e-8 and accuracy["turn"] == pytest.approx(1e-8)


def test_measures_at_a_kink_have_no_linear_model():
    """A minimum of equal gaps and an angle from 0 have none; a gap and a signed angle have."""
    program = tc.build(seated(), solver="daqp")
    nominal = tc.sensitivities(program, samples=4).nominal
    kinked = {name for name in nominal["measure"].values if np.isnan(nominal.sel(measure=name)).any()}
    assert kinked == {"clearance", "least", "tilt"}
    assert np.isfinite(nominal.sel(measure=["gap 0", "turn"])).all()
    model = seated()
    few = model.replaced(measures=[measure for measure in model.measures if measure.name in ("clearance", "turn")])
    bound = tc.worst_case(few, samples=16, solver="daqp").bound
    assert np.isinf(bound.sel(measure="clearance")).all() and np.isfinite(bound.sel(measure="turn", state="raw")).all()
    linear = tc.contributions(program, samples=64).linear
    assert np.isnan(linear.sel(measure="tilt")).all() and float(linear.sel(measure="turn").sum()) == pytest.approx(1)


def test_a_minimum_away_from_its_kink_has_derivatives():
    model = tc.Assembly("steps")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10.5))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.1)
    upper, lower = (tc.Gap(block.point(0, 0, z), table.face("+z")) for z in (10, 0))
    model.measure("lower", lower)
    model.measure("least", tc.Minimum(upper, lower))
    nominal = tc.sensitivities(model, samples=4).nominal.values
    np.testing.assert_array_equal(nominal[0], nominal[1])
    assert np.abs(nominal).max() > 0.5


def test_measurements_keep_in_archives_and_json(tmp_path):
    model, left, right = drilled()
    model.measure("distance", tc.AxisDistance(hole(left), hole(right), across="z"), tolerance=0.3)
    model.measure("turn", tc.Angle(hole(left), right.face("+z"), about="y"))
    model.measure("flush", tc.Flush(left.point(0, 8, 6), right.face("+z")))
    model.measure("x", tc.AxisDistance(hole(left), hole(right), along="x"))
    model.measure("rims", tc.Clearance(left.face(tc.Cylinder(radius=9.0)), right.face(tc.Cylinder(radius=9.0))))
    model.measure("least", tc.Minimum("distance", tc.Mean(tc.Gap(left.point(0, 8, 6), right.face("+z")), "x"), "rims"))
    results = tc.run(model, samples=20, solver="daqp", surfaces=0, out=tmp_path / "run.nc")
    rebuilt = tc.model_of(results)
    assert [measure.of.names for measure in rebuilt.measures] == [measure.of.names for measure in model.measures]
    again = tc.run(rebuilt, samples=20, solver="daqp", surfaces=0)
    np.testing.assert_array_equal(again["measured"], results["measured"])
    kinds = ["distance of axes", "angle", "flush", "distance of axes", "clearance", "minimum"]
    assert results["measure_quantity"].values.tolist() == kinds
    assert results["measure_units"].values.tolist() == ["mm", "rad", "mm", "mm", "mm", "mm"]
    boxes = seated()
    tc.write_model(boxes, tmp_path / "model.json")
    entries = json.loads((tmp_path / "model.json").read_text())["measures"]
    assert entries[0]["of"]["kind"] == "clearance" and entries[-3]["of"]["measurements"][-1] == "clearance"
    found = tc.run(tmp_path / "model.json", samples=20, solver="daqp", surfaces=0)
    np.testing.assert_array_equal(found["measured"], tc.run(boxes, samples=20, solver="daqp", surfaces=0)["measured"])
    assert {"gap", "angle", "minimum"} <= {
        entry["properties"]["kind"]["const"]
        for entry in json_schema()["$defs"].values()
        if "kind" in entry.get("properties", {})
    }


def test_lines_show_what_is_measured(tmp_path):
    model, left, right = drilled()
    point = model.measure("point", left.point(1, 2, 3), along="z")
    model.measure("distance", tc.AxisDistance(hole(left), hole(right), across="z"))
    model.measure("gap", tc.Gap(left.point(0, 8, 6), right.face("+z")))
    model.measure("least", tc.Minimum(point, "gap"))
    results = tc.run(model, samples=5, solver="daqp", surfaces=0, out=tmp_path / "run.nc")
    marks = {mark["name"]: mark for mark in marks_of(results).measures}
    nominal = {mark["name"]: mark for mark in marks_of_nominal(tc.build(model).nominal).measures}
    assert all(marks[name]["lines"] == nominal[name]["lines"] and marks[name]["at"] == nominal[name]["at"] for name in marks)
    assert list(marks) == list(nominal)
    assert np.allclose(marks["distance"]["lines"][2], [[0, 0, 0], [30, 0, 0]]) and marks["point"]["points"] == [[1, 2, 3]]
    assert np.allclose(marks["gap"]["lines"], [[[0, 8, 6], [0, 8, 6]]])
    assert marks["least"]["points"] == [[1, 2, 3], [0, 8, 6]]


def faults_of(build):
    with pytest.raises((tc.ModelError, TypeError, ValueError)) as refused:
        assembly = tc.Assembly("bad")
        table = assembly.part("table", tc.Box(100, 50, 10), fixed=True)
        pin = assembly.part("pin", shaft(), at=(20, 20, 30), fixed=True)
        assembly.measure("earlier", table.point(0, 0, 0), along="z")
        build(assembly.measure, table, pin)
        tc.build(assembly)
    return str(refused.value)


def nested(depth, measurement):
    return tc.Sum(nested(depth - 1, measurement), measurement) if depth else measurement


BAD = {
    "unknown measure": (lambda m, a, b: m("x", tc.Minimum("earlier", "later")), 'unknown measure "later"; those declared'),
    "a cycle": (
        lambda m, a, b: (m("x", tc.Minimum("earlier", "y")), m("y", tc.Maximum("x", "earlier"))),
        'measure "x" (test_measurements.py:',
    ),
    "itself": (lambda m, a, b: m("x", tc.Sum("x", "earlier")), 'unknown measure "x"'),
    "one measurement": (lambda m, a, b: m("x", tc.Minimum("earlier")), "expected two or more"),
    "three": (lambda m, a, b: m("x", tc.Difference(*["earlier"] * 3)), "expected two"),
    "unlike units": (
        lambda m, a, b: m("x", tc.Sum("earlier", tc.Angle(a.face("+z"), b.face(ROUND)))), "mm and rad; expected the same units",
    ),
    "other units": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND)), units="deg"), "in rad; leave units out"),
    "one part": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), a.face("+x"))), 'within part "table"'),
    "no axis": (lambda m, a, b: m("x", tc.AxisDistance(a.face("+z"), b.face(ROUND))), "table +z is a plane, which has no axis"),
    "parallel plane": (
        lambda m, a, b: m("x", tc.AxisDistance(b.face(ROUND), a.feature("s", a.face("+z")), across="x")), "has no axis",
    ),
    "parallel about": (
        lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND), about="z")), "is parallel to the direction that",
    ),
    "no direction": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND), about=(0, 0, 0))), "about is neither"),
    "both": (
        lambda m, a, b: m("x", tc.AxisDistance(b.face(ROUND), b.face(ROUND), along="x", across="z")), "give one of them",
    ),
    "no face": (lambda m, a, b: m("x", tc.Clearance(a.face("+z"), b.point(0, 0, 0))), "second is a Point; expected part.face"),
    "no station": (lambda m, a, b: m("x", tc.Gap(a.face("+z"), b.face(ROUND))), "station is a Face; expected part.point"),
    "no measurement": (lambda m, a, b: m("x", tc.Minimum("earlier", 3)), "int is no measurement"),
    "nested": (lambda m, a, b: m("x", nested(9, tc.Gap(a.point(0, 0, 0), b.face(ROUND)))), "nested more than 8 deep"),
    "no triangles": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face("+x"))), "no triangle"),
    "everywhere": (lambda m, a, b: m("x", tc.Angle(a.face(), b.face(ROUND))), "more than one surface"),
    "beside": (
        lambda m, a, b: m("x", tc.Clearance(a.face("+x"), b.face("-z"))), "do not face each other",
    ),
    "nowhere": (
        lambda m, a, b: m("x", tc.Clearance(a.face("+z", tc.Inside((60, 30, 0), (100, 50, 20))), b.face("-z"))),
        "lie nowhere over each other",
    ),
    "along": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face(ROUND)), along="z"), "leave out to and along"),
    "absolute": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face(ROUND)), absolute=True), "leave it out"),
    "two parts": (lambda m, a, b: tc.stations(a.point(0, 0, 0), b.point(0, 0, 0), 3), "not points of one part"),
    "one station": (lambda m, a, b: tc.stations(a.point(0, 0, 0), a.point(1, 0, 0), 1), "a whole number from 2"),
    "a stranger": (
        lambda m, a, b: m("x", tc.Gap(tc.Assembly("o").part("other", PLANE).point(0, 0, 0), a.face("+z"))),
        'unknown part "other"',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_each_bad_measurement_gets_one_message(case):
    build, expected = BAD[case]
    message = faults_of(build)
    assert expected in message
    assert message.count("\n") <= 1 + (case == "a cycle")


def test_a_plane_that_no_axis_pierces_is_refused():
    assembly, first, second = two(ring(), ring(), at=(30, 0, 0), first_rotation=(0, 0, 0))
    assembly.measure("x", tc.AxisDistance(hole(first), hole(second), across="x"))
    with pytest.raises(tc.ModelError, match="parallel to the plane that is to cut it; choose another direction across"):
        tc.build(assembly)


def refused(folder):
    """What `check` says of a model, in one line."""
    done = call(folder, "check", "model.json")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    return " ".join((done.stdout + done.stderr).split())


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"kind": "gape", "face": 1}, "a point, or a measurement whose kind is one of gap, flush, clearance"),
        ({"kind": "gap", "station": {"part": "table", "position": [0, 0, 0]}}, "it has no 'face'"),
        ({"kind": "minimum", "measurements": ["later", "gap 0"]}, 'unknown measure "later"'),
        ({"kind": "minimum", "measurements": [{"kind": "point"}, "gap 0"]}, "the name of a measure, or a measurement"),
        ({"kind": "angle", "first": {"part": "table"}, "second": {"part": "nobody"}}, "the name of a part"),
    ],
)
def test_entries_of_strangers_are_refused(tmp_path, entry, expected):
    tc.write_model(seated(), tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text())
    document["measures"][1]["of"] = entry
    (tmp_path / "model.json").write_text(json.dumps(document))
    assert expected in refused(tmp_path)


def test_deep_nesting_is_refused(tmp_path):
    tc.write_model(seated(), tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text())
    for _ in range(100):
        document["measures"][-1]["of"] = {"kind": "sum", "measurements": [document["measures"][-1]["of"], "turn"]}
    (tmp_path / "model.json").write_text(json.dumps(document))
    assert "nested too deeply" in refused(tmp_path)
