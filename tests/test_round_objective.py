"""What objectives count of round faces: contact pushes a ball or shaft along the normal, and lets nothing roll aside."""

import netCDF4
import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled, nightly, realizations

BALL, FIXED = 5.0, 8.0  # radii, mm
SIX = (("rx", (0, 40, 0), "z"), ("ry", (40, 0, 0), "z"), ("rz", (40, 0, 0), "y"))


def sphere(radius):
    return tc.Mesh(trimesh.creation.icosphere(4, radius))


def held(assembly, part, is_turned, size=1.0):
    """Locate a part at its origin, by six locators if it is turned as well."""
    locators = [tc.Locator(axis, (0, 0, 0), axis, size) for axis in "xyz"]
    turns = [tc.Locator(name, point, axis, size) for name, point, axis in SIX] if is_turned else []
    assembly.locate(part, [*locators, *turns], floating=not is_turned)
    for axis in "xyz":
        assembly.measure(axis, part.point(0, 0, 0), along=axis, absolute=True)


def states(assembly):
    """Raw and corrected values (realization, measure) of realizations, all of which are resolved or untouched."""
    results = realizations(compiled(assembly, solver="daqp"), samples=200)
    assert set(np.unique(results["status"])) <= {int(tc.Status.UNTOUCHED), int(tc.Status.RESOLVED)}
    return (results["measured"].sel(state=state).values for state in ("raw", "corrected"))


@pytest.mark.parametrize(
    ("is_turned", "direction"), [(False, (1, 1, 1)), (True, (-2, 0.3, 1)), *nightly((True, (1, 1, 1)), (False, (-2, 0.3, 1)))]
)
def test_a_ball_is_pushed_off_a_ball_along_the_line_of_centres(is_turned, direction):
    a = tc.Assembly("balls")
    at = (BALL + FIXED) * np.array(direction) / np.linalg.norm(direction)
    fixed, ball = a.part("fixed", sphere(FIXED), fixed=True), a.part("ball", sphere(BALL), at=tuple(at))
    held(a, ball, is_turned)
    a.contact("tops", moving=ball.face(), reference=fixed.face())
    raw, corrected = states(a)
    distance = np.linalg.norm(raw, axis=1, keepdims=True)
    assert (distance < BALL + FIXED).sum() > 60
    assert corrected == pytest.approx(raw * np.maximum((BALL + FIXED) / distance, 1), abs=1e-6)


@pytest.mark.parametrize("resolution", ["exact", "linearized"])
def test_a_spherical_foot_lifts_its_lever_without_turning_it(resolution):
    a = tc.Assembly("lever", method=tc.Method(resolution=resolution))
    floor = a.part("floor", tc.Box(60, 60, 5), at=(-30, -30, -5), fixed=True)
    lever = a.part("lever", sphere(10), at=(0, 0, 10))
    held(a, lever, is_turned=True)
    a.measure("end", lever.point(100, 0, 0), along="z")
    a.contact("foot", moving=lever.face(), reference=floor.face("+z"))
    raw, corrected = states(a)
    lift = np.maximum(10 - raw[:, 2], 0)
    assert (lift > 0).sum() > 60
    expected = raw + np.stack([0 * lift, 0 * lift, lift, lift], axis=1)
    assert corrected == pytest.approx(expected, abs=1e-4 if resolution == "exact" else 2e-3)


def test_an_archive_says_that_centres_count(tmp_path):
    """So a run that was begun when points on faces counted is not resumed."""
    a = tc.Assembly("foot")
    floor, foot = a.part("floor", tc.Box(60, 60, 5), at=(-30, -30, -5), fixed=True), a.part("foot", sphere(10), at=(0, 0, 10))
    held(a, foot, is_turned=False)
    a.contact("foot on floor", moving=foot.face(), reference=floor.face("+z"))
    path = tmp_path / "foot.nc"
    program = compiled(a)
    tc.run(program, samples=20, seed=1, surfaces=0, out=path).close()
    with netCDF4.Dataset(path, "r+") as file:
        assert file.weighting == "all points, as opposite faces by their moments, balls and shafts by their centres"
        file.weighting = "all points, by area"
    with pytest.raises(tc.TolcontactError, match="was run with weighting = all points, by area, now it is"):
        tc.run(program, samples=30, seed=1, surfaces=0, out=path, resume=True)


def test_a_shaft_does_not_move_along_a_floor_beside_a_wall_that_it_does_not_touch():
    cylinder = trimesh.creation.cylinder(BALL, 40, sections=64)
    cylinder.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    a = tc.Assembly("trough")
    floor, wall = (
        a.part("floor", tc.Box(60, 80, 5), at=(-10, -40, -5), fixed=True),
        a.part("wall", tc.Box(5, 80, 30), at=(-5, -40, 0), fixed=True),
    )
    shaft = a.part("shaft", tc.Mesh(cylinder), at=(BALL, 0, BALL))
    ends = (("near", -20), ("far", 20))
    locators = [tc.Locator(f"{axis} {end}", (0, y, 0), axis, 0.6) for axis in "zx" for end, y in ends]
    a.locate(shaft, [*locators, tc.Locator("y", (0, 0, 0), "y", 0)], floating=True)
    for name, part, side in (("floor", floor, "+z"), ("wall", wall, "+x")):
        a.contact(name, moving=shaft.face(tc.select.Cylinder()), reference=part.face(side))
    for end, y in ends:
        for axis in "xz":
            a.measure(f"{axis} {end}", shaft.point(0, y, 0), along=axis)
    raw, corrected = states(a)
    assert corrected == pytest.approx(np.maximum(raw, 0), abs=2e-4)  # shafts that lean are lower by the second order of that


def test_a_plate_on_a_fixed_ball_moves_as_the_objective_says():
    """The plate counts by its point of contact, as a sphere as large as the ball; the answer is that of another solver."""
    a = tc.Assembly("plate on ball")
    ball, plate = a.part("ball", sphere(BALL), fixed=True), a.part("plate", tc.Box(80, 80, 4), at=(-40, -40, BALL))
    a.locate(plate, [tc.Locator(f"z{k}", (x, y, 0), "z", 0.4) for k, (x, y) in enumerate([(0, 0), (80, 0), (0, 80)])] + [
        tc.Locator("x", (40, 40, 0), "x", 2.0), tc.Locator("y1", (0, 40, 0), "y", 2.0), tc.Locator("y2", (80, 40, 0), "y", 2.0)
    ])  # fmt: skip
    a.contact("top", moving=plate.face("-z"), reference=ball.face())
    a.measure("height", plate.point(40, 40, 0), along="z")
    results = realizations(compiled(a, solver="daqp"), samples=40, seed=1)
    poses = results["translation"].sel(part="plate"), results["rotation"].sel(part="plate")
    resolved = np.flatnonzero(results["status"] == tc.Status.RESOLVED)
    contact, corners = np.array([0, 0, BALL]), BALL * np.vstack([np.eye(3), -np.eye(3)])
    for k in resolved[:6]:
        (t_raw, R_raw), (t, R) = ([value.sel(state=state).values[k] for value in poses] for state in ("raw", "corrected"))

        def pose(v, t_raw=t_raw, R_raw=R_raw):
            return t_raw + v[:3], Rotation.from_rotvec(v[3:]).as_matrix() @ R_raw

        def moved(v, t_raw=t_raw, R_raw=R_raw, pose=pose):
            t, R = pose(v)
            return (((contact + corners) @ (R - R_raw).T + t - t_raw) ** 2).sum()

        def gap(v, pose=pose):
            t, R = pose(v)
            return float(R[:, 2] @ (R @ contact + t)) - BALL

        best = minimize(moved, np.zeros(6), constraints={"type": "ineq", "fun": gap}, method="SLSQP", options={"ftol": 1e-15})
        found = np.concatenate([t - t_raw, Rotation.from_matrix(R @ R_raw.T).as_rotvec()])
        assert gap(found) == pytest.approx(0, abs=1e-8) and moved(found) == pytest.approx(best.fun, rel=1e-5)
