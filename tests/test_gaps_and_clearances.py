"""Gaps, flushes and clearances of faces, against closed forms, rigid motions and least distances that are found otherwise."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.measured import (
    PLANE,
    ROUND,
    axis_of,
    check_invariance,
    drilled,
    hole,
    motions,
    observed,
    placed,
    ring,
    seated,
    segments_apart,
    shaft,
    two,
)
from tests.helpers import compiled, nightly, realizations

WALLS = {
    "plane": (PLANE, ("+z",), (10, 12, 11.5), lambda p: p[..., 2] - 10),
    "cylinder": (shaft(), (ROUND,), (3.5, 1, 2), lambda p: np.hypot(p[..., 0], p[..., 1]) - 3),
    "hole": (ring(), (tc.select.Cylinder(inner=True),), (1.5, 1, 2), lambda p: 3.2 - np.hypot(p[..., 0], p[..., 1])),
    "sphere": (
        tc.Mesh(trimesh.creation.icosphere(3, 6.0)), (), (5, 4, 2), lambda p: np.linalg.norm(p, axis=-1) - 6,
    ),
    "cone": (
        tc.Mesh(trimesh.creation.cone(5.0, 10.0, sections=64)), (tc.select.Largest("cone"),), (4, 3, 3),
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
    assert compiled(assembly).nominal_measures == pytest.approx([1] * 8 + [5, 0])


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
@pytest.mark.parametrize("shift", [1.0, *nightly(0.01)])
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
    results = tc.run(compiled(model, solver="daqp"), samples=200, surfaces=0)
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


def test_contact_keeps_clearances_at_their_stop():
    results = tc.run(compiled(seated(), solver="daqp"), samples=400, surfaces=0)
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
    results = realizations(compiled(model, solver="daqp"), samples=400)
    corrected = results["measured"].sel(state="corrected")
    clearance, gap = (corrected.sel(measure=name).values for name in ("clearance", "gap"))
    # Contact does not resolve edges that cross at less than a degree: it may leave some micrometres there.
    assert clearance.min() > -2e-5 and (clearance < -1e-7).mean() < 0.01
    assert (gap < -1e-4).mean() > 0.02
