"""Placing: exact poses obey the equations of sliding faces, and best fits have the least sum of squares."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import stations as cases
from tests.helpers import compiled
from tolcontact.errors import ModelError

POINTS = [(5, 5, 0, "z"), (95, 8, 0, "z"), (50, 45, 0, "z"), (10, 0, 5, "y"), (90, 0, 5, "y"), (0, 25, 5, "x")]
MORE = [(5, 45, 0, "z"), (95, 45, 0, "z"), (50, 0, 2, "y"), (0, 40, 3, "x")]


def plate(width, placing, points):
    model = tc.Assembly("plate")
    part = model.part("plate", tc.Box(100, 50, 10), at=(20, 30, 5), rotation=(0.1, -0.2, 0.3))
    locators = [tc.Locator(f"L{k}", p, along) for k, (*p, along) in enumerate(points)]
    model.locate(part, locators, tolerance=width, placing=placing)
    model.measure("corner", part.point(100, 50, 10), along="z")
    return model


def drawn(model, samples=200):
    program = compiled(model, solver="daqp")
    block = next(iter(tc.simulate_blocks(program, samples=samples, seed=1)))
    return program, block.deviations, block.poses[:, 0]


def heights(poses, points, directions, d):
    """Heights (n, locator) of the tips of locators over the faces, which go through the points with these normals."""
    R, t = poses[:, :9].reshape(-1, 3, 3), poses[:, 9:]
    faces = np.einsum("nij,kj->nki", R, points) + t[:, None]
    return (np.einsum("nij,kj->nki", R, directions) * (points + d[..., None] * directions - faces)).sum(axis=2)


@pytest.mark.parametrize("width", [0.5, 2.0, 10.0])
def test_faces_slide_over_locators_that_stand_still(width):
    errors = {}
    for placing in ("first order", "exact"):
        program, d, poses = drawn(plate(width, placing, POINTS))
        locators = program.nominal.parts[0].locators
        errors[placing] = np.abs(heights(poses[:, 0], locators.points, locators.directions, d)).max()
    assert errors["exact"] < 1e-10 and errors["first order"] > 1e-4 * width**2


def test_a_best_fit_has_the_least_sum_of_squares():
    program, d, poses = drawn(plate(4.0, "best fit", POINTS + MORE), samples=20)
    locators = program.nominal.parts[0].locators

    def errors(q, row):
        X = np.concatenate([Rotation.from_rotvec(q[:3]).as_matrix().ravel(), q[3:]])[None]
        return heights(X, locators.points, locators.directions, d[row, None])[0]

    for row in range(20):
        X = poses[row, 0]
        q = np.concatenate([Rotation.from_matrix(X[:9].reshape(3, 3)).as_rotvec(), X[9:]])
        best = least_squares(errors, q, args=(row,), xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(best.x[3:] - q[3:]).max() < 1e-6 and np.abs(best.x[:3] - q[:3]).max() < 1e-8
        assert (errors(q, row) ** 2).sum() <= 2 * best.cost + 1e-12


@pytest.mark.parametrize("width", [0.5, 2.0, 10.0])
def test_a_joint_is_placed_exactly_by_faces_of_all_its_parts(width):
    model = cases.three_stations(width, contact=False, placing="exact")
    program, deviations, poses = drawn(model)
    nominal = program.nominal
    for k, part in enumerate(nominal.parts):
        if len(part.locators):
            d = deviations[:, [nominal.contributors.index(label) for label in part.locators.labels]]
            for number, owner in enumerate(part.owners or (k,) * 6):
                row = slice(number, number + 1)
                found = heights(poses[:, owner], part.locators.points[row], part.locators.directions[row], d[:, row])
                assert np.abs(found).max() < 1e-10, part.locators.labels[number]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"placing": "best"}, "placing is 'best'; expected one of: first order, exact, best fit"),
        ({"placing": "exact", "floating": True}, 'placing="exact" needs locators that hold both ways'),
    ],
)
def test_placing_is_checked(change, message):
    model = tc.Assembly("plate")
    part = model.part("plate", tc.Box(100, 50, 10))
    model.locate(part, [tc.Locator(f"L{k}", p, along) for k, (*p, along) in enumerate(POINTS)], tolerance=1, **change)
    model.measure("corner", part.point(100, 50, 10), along="z")
    with pytest.raises(ModelError, match=message.replace("(", r"\(")):
        tc.build(model)


def test_an_inspection_reports_deviations_from_the_best_fit_of_a_joint():
    """One part stands off the other by a step; points along both are fitted by a line, and the step remains beside it."""
    line = tc.Assembly("inspection")
    a, b = line.part("a", tc.Box(100, 20, 10)), line.part("b", tc.Box(100, 20, 10), at=(100, 0, 0))
    weld, check = line.station("weld"), line.station("check")
    weld.locate(a, cases.supported(a, 10, 90), tolerance=0)
    weld.locate(b, cases.supported(b, 10, 90), tolerance=0)
    line.variable("step", 0.06, drives={f"weld.b.A{k}": 1.0 for k in (1, 2, 3)})
    ab = weld.join("ab", a, b)
    places = [(part, x, y) for part in (a, b) for x in (10, 50, 90) for y in (5, 15)]
    points = [tc.Locator(f"P{k}", part.point(x, y, 0), "z") for k, (part, x, y) in enumerate(places)]
    check.locate(ab, [*points, *cases.held(a)], tolerance=0, placing="best fit")
    check.measure("end of a", a.point(0, 10, 0), along="z")
    check.measure("end of b", b.point(100, 10, 0), along="z")
    program = compiled(line, solver="daqp")
    block = next(iter(tc.simulate_blocks(program, samples=50, seed=1)))
    x = np.array([px + (100 if part is b else 0) for part, px, _ in places])
    off = np.array([float(part is b) for part, _, _ in places])
    slope, height = np.polyfit(x, off, 1)
    step = block.deviations[:, program.nominal.contributors.index("step")]
    expected = np.column_stack([-height * step, (1 - height - 200 * slope) * step])
    assert np.abs(block.measured[:, 0] - expected).max() < 2e-6 and step.std() > 0.005


def ridden_plate(placing, objective, points=POINTS, fixed=None, **choices):
    """A plate that contact may move, under a rider: one that a force presses onto it, or a `fixed` one."""
    model = tc.Assembly("ridden plate", method=tc.Method(objective=objective))
    part = model.part("plate", tc.Box(100, 50, 10), fixed=False)
    locators = [tc.Locator(f"L{k}", p, along, **choices) for k, (*p, along) in enumerate(points)]
    model.locate(part, locators, tolerance=2, placing=placing)
    rider = model.part("rider", tc.Box(20, 20, 10), at=(40, 15, 10), fixed=fixed)
    sides = {"B1": ((0, 0, 5), "y"), "B2": ((20, 0, 5), "y"), "C": ((0, 10, 5), "x")}
    if not fixed:
        model.locate(rider, [tc.Locator(name, p, along, 0.1) for name, (p, along) in sides.items()], floating=True)
    model.contact("ride", moving=rider.face("-z"), reference=part.face("+z"))
    if not fixed:
        model.force("weight", at=rider.point(10, 10, 0), vector=(0, 0, -5))
    model.measure("corner", part.point(100, 50, 10), along="z")
    return model


@pytest.mark.parametrize("placing", ["exact", "best fit"])
def test_forces_leave_a_part_where_its_locators_have_placed_it(placing):
    program = compiled(ridden_plate(placing, "seating"), solver="daqp")
    block = next(iter(tc.simulate_blocks(program, samples=50, seed=1)))
    assert (block.status == tc.Status.RESOLVED).all()
    assert np.abs(block.measured[:, 1] - block.measured[:, 0]).max() < 1e-9


def test_springs_and_many_locators_are_not_placed_under_forces():
    for choices in ({"stiffness": 100.0}, {"points": POINTS + MORE}):
        with pytest.raises(ModelError, match=r"at most six, without a stiffness; leave placing out, or declare"):
            tc.build(ridden_plate("best fit", "seating", **choices))


def test_springs_of_locators_count_from_where_these_have_placed_a_part():
    """Contact pushes the plate off its place: both placings give it the same push, to first order."""
    moves = {}
    for placing in ("first order", "exact"):
        program = compiled(ridden_plate(placing, "locator stiffness", fixed=True), solver="daqp")
        block = next(iter(tc.simulate_blocks(program, samples=50, seed=1)))
        moves[placing] = block.measured[:, 1] - block.measured[:, 0]
    assert np.abs(moves["exact"]).max() > 0.05
    assert moves["exact"] == pytest.approx(moves["first order"], abs=0.02)
