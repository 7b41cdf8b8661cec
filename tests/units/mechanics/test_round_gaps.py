"""Gaps of balls and shafts beside walls: against another way to compute them, and their derivatives against differences."""

import itertools

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.certificates.judge import as_archived
from tests.cases import round_contact as round_cases
from tolcontact import vocabulary as terms
from tolcontact.discretization import RoundContact, RoundPoint, RoundPoints, discretize
from tolcontact.geometry.analytic_surfaces import ANALYTIC_SURFACES, Cone, Cylinder, Plane
from tolcontact.mechanics import ENTRIES
from tolcontact.mechanics.round_gap import round_gaps

NONE = np.zeros(3)
AS_IT_IS, NO_MOVES = np.eye(ENTRIES), np.zeros((ENTRIES, 0))  # X_RM itself as z, and no z at all


def evaluation(points, freedoms=0):
    """Round gaps as a Function of X_RM, heights, reactions and by_z."""
    shapes = {"X_RM": (ENTRIES, 1), "heights": (2, 1), "reactions": (len(points), 1), "by_z": (ENTRIES, freedoms)}
    inputs = [ca.SX.sym(name, *shape) for name, shape in shapes.items()]
    return ca.Function("round_gaps", inputs, list(round_gaps(points, *inputs)))


def check_gaps(points, rng, turn):
    """Gaps computed another way, and their derivatives by differences, at some poses."""
    evaluate, count = evaluation(points, ENTRIES), len(points)
    again = as_archived(points)
    step, heights = 1e-6, np.random.default_rng(2)
    for _ in range(3):
        R, t = Rotation.from_rotvec(rng.normal(scale=turn, size=3)).as_matrix(), rng.normal(scale=0.2, size=3)
        X, grown, reactions = np.concatenate([R.ravel(), t]), heights.normal(scale=0.01, size=2), rng.uniform(size=count)
        gaps, slopes, bends, curvature, hollow_curvature, _ = (each.full() for each in evaluate(X, grown, reactions, AS_IT_IS))
        archived = np.array([point.gaps(R, t, *grown) for point in again])
        # A fixed tangent of a hollow wall is the nearest one where the two are in one direction.
        replaced = (gaps.ravel()[:, None] == gaps.ravel()).sum(axis=1) > 1
        assert np.abs(gaps.ravel() - archived)[~replaced].max(initial=0) < 1e-11
        assert (gaps.ravel() < archived + 1e-11).all() and abs(gaps.min() - archived.min()) < 1e-11
        moved = [
            [[part.full() for part in evaluate(X + sign * step * e, grown, reactions, AS_IT_IS)] for sign in (1, -1)]
            for e in AS_IT_IS
        ]
        rates = np.hstack([(up[0] - down[0]) / (2 * step) for up, down in moved])
        turns = np.column_stack([(up[1] - down[1]).T @ reactions / (2 * step) for up, down in moved])
        by_z = rng.normal(size=(ENTRIES, 3))
        by_three = [each.full() for each in evaluation(points, 3)(X, grown, reactions, by_z)]
        assert np.abs(rates - slopes).max() < 1e-6 * max(1, np.abs(slopes).max())
        assert np.abs(slopes.T @ reactions - bends.ravel()).max() < 1e-9 * max(1, np.abs(bends).max())
        assert np.abs(turns - curvature + hollow_curvature).max() < 1e-6 * max(1, np.abs(curvature - hollow_curvature).max())
        for found, expected in zip(by_three[3:5], (curvature, hollow_curvature), strict=True):
            assert np.abs(found - by_z.T @ expected @ by_z).max() < 1e-9 * max(1, np.abs(found).max())
        assert np.abs(by_three[1] - slopes @ by_z).max() < 1e-9 * max(1, np.abs(slopes).max())
        assert np.linalg.eigvalsh(hollow_curvature).min() > -1e-9 * max(1, np.abs(hollow_curvature).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", round_cases.EVERY)
def test_gaps_of_round_faces_are_those_of_another_way_and_their_derivatives_theirs(name):
    rng = np.random.default_rng(5)
    for pair in discretize(round_cases.EVERY[name]()).pairs:
        if isinstance(pair, RoundContact):
            check_gaps(pair.round, rng, turn=3e-3)


def unit(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def test_a_ball_beside_walls_of_every_kind():
    """Gaps another way, and derivatives by differences; of hollow walls from as far away as a ball that touches them is."""
    rng, points = np.random.default_rng(3), []
    for kind, is_hollow, on_moving in itertools.product(terms.SURFACE_KINDS, (False, True), (False, True)):
        if kind in ("plane", "torus") and is_hollow:
            continue
        w = unit(rng)
        x = np.cross(w, unit(rng))
        x /= np.linalg.norm(x)
        sizes = {"cone": {"angle": 0.6}, "plane": {}, "torus": {"radius": 20.0, "minor": 5.0}}.get(kind, {"radius": 20.0})
        wall = ANALYTIC_SURFACES[kind](rng.normal(size=3), w, **sizes)
        beside = 30 * x + 3 * w if not is_hollow else 6 * x + 20 * w if kind == "cone" else 19 * x + 3 * w
        points.append(RoundPoint(wall, is_hollow, wall.origin + beside, NONE, NONE, 2.0, on_moving, x, np.pi))
    check_gaps(RoundPoints.of(points), rng, turn=3e-2)


def test_a_wall_beside_a_hollow_has_gaps_of_its_own():
    """One that is tangent to the hollow, and before another ball; and one that is no plane, before the same ball."""
    hollow = Cylinder(np.zeros(3), np.array([0, 0, 1.0]), radius=20.0)
    tangent = Plane(np.array([20.0, 0, 0]), np.array([-1.0, 0, 0]))
    beside = Cylinder(np.array([32.0, 0, 0]), np.array([-1.0, 0, 0]), radius=5.0)  # along x: its end is not seen
    ball, other, x = np.array([18.0, 0, 0]), np.array([10.0, 0, 0]), np.array([1.0, 0, 0])
    points = RoundPoints.of(
        [
            RoundPoint(hollow, True, ball, NONE, NONE, 2.0, True, x, np.pi),
            RoundPoint(tangent, False, other, NONE, NONE, 2.0, True, x, np.pi),
            RoundPoint(beside, False, np.array([18.0, 9, 0]), NONE, NONE, 2.0, True, x, np.pi),
        ]
    )
    gaps = evaluation(points)(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), np.zeros(2), np.zeros(3), NO_MOVES)[0]
    assert gaps.full().ravel() == pytest.approx([0, 8, 2], abs=1e-9)


def test_a_tangent_at_one_end_of_a_shaft_is_not_that_of_the_other_end():
    axis, x = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    hollow, tangent = Cylinder(np.zeros(3), axis, radius=20.0), Plane(np.array([20.0, 0, 0]), -x)
    ends = [np.array([1.0, 0, height]) for height in (0.0, 0.1)]
    points = [
        RoundPoint(hollow, True, ends[0], axis, NONE, 18.0, True, x, np.pi),
        *(RoundPoint(tangent, False, end, axis, NONE, 18.0, True, x, np.pi) for end in ends),
    ]
    leaning = np.concatenate([Rotation.from_rotvec([0, 0.01, 0]).as_matrix().ravel(), np.zeros(3)])
    together = evaluation(RoundPoints.of(points))(leaning, np.zeros(2), np.zeros(3), NO_MOVES)[0].full().ravel()
    alone = [float(evaluation(RoundPoints.of([point]))(leaning, np.zeros(2), 0, NO_MOVES)[0]) for point in points]
    assert together == pytest.approx([alone[0], alone[0], alone[2]], abs=1e-12)
    assert alone[0] - alone[2] == pytest.approx(0.1 * np.sin(0.01), abs=1e-12)


def test_a_ball_in_a_hollow_that_is_open_is_free_to_leave():
    """Gaps beyond the end of the wall are those of its last tangent planes; and there is no wall where it is open."""
    rng, points, out = np.random.default_rng(4), [], []
    for kind, angle in itertools.product(("cylinder", "cone", "sphere"), (0.3, 1.5, 3.0)):
        w = unit(rng)
        x = np.cross(w, unit(rng))
        x /= np.linalg.norm(x)
        wall = ANALYTIC_SURFACES[kind](np.zeros(3), w, **({"angle": 0.6} if kind == "cone" else {"radius": 20.0}))
        aside = np.cos(angle) * x + np.sin(angle) * np.cross(w, x)
        beside = 6 * aside + 20 * w if kind == "cone" else 18.5 * aside
        points.append(RoundPoint(wall, True, beside, NONE, NONE, 2.0, True, x, 1.0))
        out.append(-100 * x)
    check_gaps(RoundPoints.of(points), rng, turn=3e-2)
    shaft, x = Cylinder(np.zeros(3), np.array([0, 0, 1.0]), radius=5.05), np.array([1.0, 0, 0])
    ends = [
        RoundPoint(shaft, True, np.array([-1.0, aside, 5.0]), shaft.axis, cut, 5.0, True, x, 1.0)
        for aside, cut in itertools.product((-0.5, 0.7), (NONE, shaft.axis))
    ]
    check_gaps(RoundPoints.of(ends), rng, turn=3e-3)
    for k, far in enumerate(out):
        evaluate = evaluation(RoundPoints.of([points[k]]))
        assert float(evaluate(np.concatenate([np.eye(3).ravel(), far]), np.zeros(2), 0, NO_MOVES)[0]) > 40


def test_curvature_on_an_axis_is_that_of_some_room_beside_it():
    """In the middle of a hollow all directions are as near; what curvature counts there is that of a thousandth of the ball."""
    axis, x = np.array([0, 0, 1.0]), np.array([1.0, 0, 0])
    for wall, centre, expected in (
        (Cone(np.zeros(3), axis, angle=0.6), np.array([0, 0, 20.0]), np.cos(0.6)),
        (Cylinder(np.zeros(3), axis, radius=2.0), np.zeros(3), 1.0),  # as large as the ball: it has no room at all
    ):
        evaluate = evaluation(RoundPoints.of([RoundPoint(wall, True, centre, NONE, NONE, 2.0, True, x, np.pi)]), ENTRIES)
        at_rest = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
        *_, curvature, hollow_curvature, _ = (each.full() for each in evaluate(at_rest, np.zeros(2), [1], AS_IT_IS))
        assert np.isfinite(curvature).all()
        assert np.abs(hollow_curvature)[9:, 9:].max() == pytest.approx(expected / (1e-3 * 2.0), rel=1e-6)
