"""The least distance of any two faces or bodies by their triangles, against bounded least squares and closed forms."""

import warnings

import numpy as np
import pytest
import trimesh
from scipy.optimize import lsq_linear

import tolcontact as tc
from tests.cases.measured import check_invariance, motions, observed, placed, shaft, two
from tests.helpers import compiled, nightly

SIZES = np.array([40.0, 30.0, 10.0]), np.array([12.0, 8.0, 6.0])
PLACES = {  # of the second box relative to the first one: an edge over an edge, a corner over a face, a face beside a face
    "edges": ((37, 24, 13), (0.6, 0.5, 0.4)),
    "corner": ((12, 9, 17), (0.7, 0.6, 0.2)),
    "faces": ((42, 5, 2), (0, 0, 0)),
}


def boxes_apart(first, second, R, t):
    """The distance (n,) of two boxes: of their points, as bounded least squares over the places in both."""
    apart = []
    for k in range(len(R)):
        frames = [placed(part, R[k : k + 1, n], t[k : k + 1, n], np.vstack([np.zeros(3), np.eye(3)]))[0]
                  for n, part in enumerate((first, second))]  # fmt: skip
        (o, *x), (p, *y) = frames
        matrix = np.column_stack([*(np.array(x) - o), *(p - np.array(y))])
        bounds = np.zeros(6), np.concatenate(SIZES)
        apart.append(np.sqrt(2 * lsq_linear(matrix, p - o, bounds=bounds, tol=1e-15).cost))
    return np.array(apart)


@pytest.mark.parametrize("place", ["corner", *nightly("edges", "faces")])
def test_bodies_are_as_far_apart_as_their_nearest_points(place):
    at, rotation = PLACES[place]
    assembly, first, second = two(tc.Box(*SIZES[0]), tc.Box(*SIZES[1]), at=at, rotation=rotation)
    assembly.measure("clearance", tc.Clearance(first.face(), second.face()))
    R, t = motions(turn=5e-3, shift=0.05)
    values = observed(assembly, R, t)[:, 0]
    assert values.min() > 0.1 and np.ptp(values) > 0.1
    np.testing.assert_allclose(values, boxes_apart(first, second, R, t), atol=1e-6)
    check_invariance(assembly, R, t)


def test_the_clearance_is_never_too_large_after_motions_beyond_what_was_looked_at():
    assembly, first, second = two(tc.Box(*SIZES[0]), tc.Box(*SIZES[1]), at=(37, 24, 13), rotation=(0.6, 0.5, 0.4))
    assembly.measure("clearance", tc.Clearance(first.face(), second.face()))
    R, t = motions(turn=0.3, shift=2.0, count=80)
    values, expected = observed(assembly, R, t)[:, 0], boxes_apart(first, second, R, t)
    assert (values <= expected + 1e-6).all() and (values < expected - 0.1).any()


def test_overlaps_are_as_deep_as_a_tip_in_a_face_and_as_two_ridges_that_cross():
    tip = tc.Mesh(trimesh.convex.convex_hull([[0, 0, 0], [2, 2, 4], [-2, 2, 4], [-2, -2, 4], [2, -2, 4]]))
    ridge = tc.Mesh(trimesh.convex.convex_hull([[x, y, z] for x in (-9, 9) for y, z in ((0, 0), (3, -3), (-3, -3))]))
    still = {"first_at": (0, 0, 0), "first_rotation": (0, 0, 0)}
    pairs = (
        two(tc.Box(*SIZES[0]), tip, at=(20, 15, 10.3), **still),
        two(ridge, ridge, at=(0, 0, 0.3), rotation=(np.pi, 0, 0), **still),
        two(ridge, ridge, at=(0.5, 0.2, 0.3), rotation=np.pi / np.sqrt(2) * np.array([1.0, 1.0, 0.0]), **still),
    )
    heights = np.array([0.3, 0.1, 0.0, -0.05, -0.3])
    R, t = np.tile(np.eye(3), (5, 2, 1, 1)), np.zeros((5, 2, 3))
    t[:, 1, 2] = heights - 0.3
    for (assembly, first, second), tolerance in zip(pairs, (1e-9, None, 1e-9), strict=True):
        assembly.measure("clearance", tc.Clearance(first.face(), second.face()))
        values = observed(assembly, R, t)[:, 0]
        if tolerance is None:  # parallel edges have no common normal, and no corner over a facet
            np.testing.assert_allclose(values[:3], heights[:3], atol=1e-9)
        else:
            np.testing.assert_allclose(values, heights, atol=tolerance)


def test_whole_shafts_end_where_their_ends_do():
    """Their round faces alone are two outer cylinders, but their ends are nearer."""
    still = {"first_at": (0, 0, 0), "first_rotation": (0, 0, 0)}
    R, t = np.tile(np.eye(3), (3, 2, 1, 1)), np.zeros((3, 2, 3))
    for axis, nearest, chords in ((2, 10.0, 0.0), (0, 3.0, 7 * (1 - np.cos(np.pi / 48)))):
        assembly, first, second = two(
            shaft(4.0), shaft(3.0), at=(nearest + (30 if axis == 2 else 7)) * np.eye(3)[axis], **still
        )
        assembly.measure("clearance", tc.Clearance(first.face(), second.face()))
        t[:, 1, axis] = steps = np.array([0.0, -0.1, -0.2])
        values = observed(assembly, R, t)[:, 0]
        assert (values >= nearest + steps - 1e-9).all() and (values <= nearest + steps + chords + 1e-9).all()
        t[:] = 0


def test_a_ring_of_triangles_is_as_far_from_a_wall_as_its_tube():
    torus = tc.Mesh(trimesh.creation.torus(10, 2, major_sections=48, minor_sections=24))
    assembly, first, second = two(tc.Box(*SIZES[0]), torus, at=(20, 15, 12.5))
    assembly.measure("clearance", tc.Clearance(first.face("+z"), second.face()))
    R, t = motions(turn=2e-3, shift=0.02)
    centre = placed(second, R[:, 1], t[:, 1], [[0, 0, 0]])[:, 0]
    axis, normal = (
        placed(part, R[:, k], t[:, k], [[0, 0, 1]], is_direction=True)[:, 0] for k, part in ((1, second), (0, first))
    )
    top = placed(first, R[:, 0], t[:, 0], [[0, 0, 10]])[:, 0]
    tilt = np.sqrt(1 - ((axis * normal).sum(axis=1)) ** 2)
    expected = ((centre - top) * normal).sum(axis=1) - 10 * tilt - 2
    facet = 10 * (1 - np.cos(np.pi / 48)) * 0.02 + 2 * (1 - np.cos(np.pi / 24))  # how far triangles are inside of the tube
    values = observed(assembly, R, t)[:, 0]
    assert (values >= expected - 1e-9).all() and (values <= expected + facet).all()


def test_a_face_that_grows_comes_nearer():
    assembly, first, second = two(tc.Box(*SIZES[0]), tc.Mesh(trimesh.creation.cylinder(3, 20, sections=48)), at=(48, 40, 5),
                                  first_at=(0, 0, 0), first_rotation=(0, 0, 0))  # fmt: skip
    wall = second.feature("wall", second.face(tc.select.Cylinder()), tc.Size(6, 0.4))
    assembly.measure("clearance", tc.Clearance(first.face(), wall))
    program = compiled(assembly, solver="daqp")
    X = np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), (2, 2)).reshape(2, -1)
    small, large = program.observe(poses=X, deviations=np.array([[0.0], [0.1]]))["measured"][:, 0]
    assert small == pytest.approx(np.hypot(8, 10) - 3, abs=0.01) and small - large == pytest.approx(0.05, abs=1e-9)


def test_motions_beyond_the_triangles_looked_at_are_a_warning():
    mesh = trimesh.creation.icosphere(3)
    mesh.apply_scale([9, 6, 4])
    for tolerance, count in ((0.05, 0), (3.0, 1)):
        model = tc.Assembly("ellipsoids")
        base, lid = model.part("base", tc.Mesh(mesh), fixed=True), model.part("lid", tc.Mesh(mesh), at=(0, 0, 8.5))
        feet = [tc.Locator(f"A{k}", (x, y, 0), "z") for k, (x, y) in enumerate([(5, 0), (-5, 4), (-5, -4)])]
        sides = [tc.Locator("B1", (5, 0, 0), "y"), tc.Locator("B2", (-5, 0, 0), "y"), tc.Locator("C", (0, 0, 0), "x")]
        model.locate(lid, feet + sides, tolerance=tolerance)
        model.measure("clearance", tc.Clearance(lid.face(), base.face()))
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always", tc.NominalWarning)
            tc.build(model, solver="daqp")
        texts = [str(record.message) for record in records if "[reach]" in str(record.message)]
        assert len(texts) == count and all("its faces move by more than" in text for text in texts)


def test_too_many_triangles_near_each_other_are_refused():
    outer = trimesh.creation.icosphere(5)
    outer.apply_scale([9, 6, 4])
    inner = trimesh.creation.icosphere(5)
    inner.apply_scale([8.9, 5.9, 3.9])
    assembly, first, second = two(tc.Mesh(outer), tc.Mesh(inner))
    assembly.measure("clearance", tc.Clearance(first.face(), second.face()))
    with pytest.raises(tc.ModelError, match=r"cannot be measured: .*choose smaller faces.*tc\.Gap"):
        tc.build(assembly, solver="daqp")


def test_a_clearance_of_parts_follows_from_the_poses_of_an_archive(tmp_path):
    model = tc.Assembly("stand")
    base, lid = model.part("base", tc.Box(*SIZES[0]), fixed=True), model.part("lid", tc.Box(*SIZES[1]), at=(10, 8, 12))
    model.locate(lid, tc.three_two_one(lid.face("-z"), lid.face("-y"), lid.face("-x"), inset=1), tolerance=0.3)
    model.measure("clearance", tc.Clearance(lid.face(), base.face()))
    results = tc.run(compiled(model, solver="daqp"), samples=200, surfaces=0, out=tmp_path / "run.nc")
    R, t = (results[name].sel(state="raw", part="lid").values for name in ("rotation", "translation"))
    feet = np.array([(10 + x, 8 + y, 12) for x in (0, SIZES[1][0]) for y in (0, SIZES[1][1])])
    heights = (feet @ R.swapaxes(1, 2) + t[:, None])[..., 2].min(axis=1) - SIZES[0][2]
    values = results["measured"].sel(state="raw", measure="clearance").values
    np.testing.assert_allclose(values, heights, atol=1e-9)
    again = tc.run(compiled(tc.io.model_of(results), solver="daqp"), samples=200, surfaces=0)
    np.testing.assert_array_equal(again["measured"], results["measured"])
