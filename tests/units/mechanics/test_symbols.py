"""Expressions against hand-written NumPy, finite differences and SciPy."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests import cases
from tolcontact.discretization import discretize
from tolcontact.mechanics.correction import Mobility, increments, linear, published, rigid
from tolcontact.mechanics.displacement import displacement_energy, moment_table
from tolcontact.mechanics.gap import gap_matrix
from tolcontact.mechanics.measures import record, replay
from tolcontact.mechanics.pose import Pose, rotation

RNG = np.random.default_rng(7)


def random_pose(size=0.3):
    R = Rotation.from_rotvec(RNG.normal(size=3) * size).as_matrix()
    return R, RNG.normal(size=3)


@pytest.mark.parametrize("size", [0, 1e-12, 1e-6, 0.1, 3.0])
def test_rotation_is_the_exponential_map(size):
    theta = ca.SX.sym("theta", 3)
    function = ca.Function("R", [theta], [rotation(theta), ca.jacobian(ca.vec(rotation(theta)), theta)])
    value = np.array([0.48, -0.6, 0.64]) * size
    R, derivative = (result.full() for result in function(value))
    assert np.abs(R - Rotation.from_rotvec(value).as_matrix()).max() < 1e-15
    assert np.isfinite(derivative).all()


def test_gap_matrix_is_the_papers_formula():
    pair = discretize(cases.stack()).pairs[0]
    (R_m, t_m), (R_r, t_r) = random_pose(), random_pose()
    n = pair.n_r @ R_r.T
    direct = (((pair.P_m @ R_m.T + t_m) - (pair.P_r @ R_r.T + t_r)) * n).sum(axis=1)
    X_RM = np.concatenate([(R_r.T @ R_m).ravel(), R_r.T @ (t_m - t_r), [1]])
    assert np.abs(X_RM @ gap_matrix(pair) - direct).max() < 1e-12


def test_energy_from_moments_is_the_sum_over_points():
    points, centre = RNG.normal(size=(40, 3)) * 20, np.array([3.0, -1, 2])
    R, t = random_pose()
    z = ca.SX.sym("z", 6)
    part, raw = Mobility((0,), centre, False), Pose(ca.SX(R), ca.SX(t))
    moves = increments(z, 10.0, [raw.apply(ca.DM(centre))])
    energy = displacement_energy(ca.SX(moment_table(points, centre).sum(axis=1)), centre, raw, linear(part, raw, moves))
    step = RNG.normal(size=6)
    x = points @ R.T + t
    u = step[:3] + np.cross(step[3:] / 10, x - (R @ centre + t))
    assert float(ca.evalf(ca.substitute(energy, z, step))) == pytest.approx((u**2).sum() / 2, rel=1e-13)


@pytest.mark.parametrize("update, is_reference", [(published, False), (published, True), (rigid, False), (linear, True)])
def test_corrected_pose_moves_points_by_the_increment_to_first_order(update, is_reference):
    R, t = random_pose()
    centre, point = np.array([10.0, 5, -3]), RNG.normal(size=3) * 10
    z = ca.SX.sym("z", 6)
    raw = Pose(ca.SX(R), ca.SX(t))
    part = Mobility((0,), centre, is_reference)
    moves = increments(z, 5.0, [raw.apply(ca.DM(centre))])
    moved = ca.Function("x", [z], [update(part, raw, moves).apply(ca.DM(point)), update(part, raw, moves).R])
    step = RNG.normal(size=6) * 1e-4
    x = R @ point + t
    expected = x + step[:3] + np.cross(step[3:] / 5, x - (R @ centre + t))
    now, turned = (result.full() for result in moved(step))
    proper = update is rigid or (update is published and is_reference)
    assert np.abs(now.ravel() - expected).max() < (1e-7 if proper else 1e-14)
    # The paper's update (12) stretches by order |w|^2, exp([w]x) does not.
    stretch = np.abs(turned.T @ turned - np.eye(3)).max()
    assert stretch < 1e-15 if proper else 1e-10 < stretch < 1e-7


def placed(assembly, deviations):
    program = tc.build(assembly)
    poses = program.place(deviations=np.atleast_2d(deviations))
    return program, poses["poses"].reshape(len(np.atleast_2d(deviations)), -1, 12)


def test_raw_pose_puts_locators_where_their_deviations_say():
    """n_i'(R p_i + t - p_i) = d_i, to second order in the angles."""
    deviations = RNG.normal(size=12) * 1e-4
    program, poses = placed(cases.ra1(), deviations)
    for index, part in enumerate(program.nominal.parts):
        R, t = poses[0, index, :9].reshape(3, 3), poses[0, index, 9:]
        moved = ((part.locators.points @ R.T + t - part.locators.points) * part.locators.directions).sum(axis=1)
        assert np.abs(moved - deviations[6 * index : 6 * index + 6]).max() < 1e-8
        assert np.abs(R.T @ R - np.eye(3)).max() < 1e-15


def test_a_part_follows_the_part_that_it_is_located_on():
    a = tc.Assembly("tower")
    foot = a.part("foot", tc.Box(20, 20, 10), fixed=True)
    head = a.part("head", tc.Box(20, 20, 10), at=(0, 0, 10), fixed=True)
    for part, on in ((foot, None), (head, foot)):
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2), tolerance=1, on=on)
    a.measure("top", head.point(0, 0, 10), along="z")
    foot_moves, head_moves = RNG.normal(size=6), RNG.normal(size=6)
    _, poses = placed(a, [np.concatenate([foot_moves, head_moves]), np.concatenate([np.zeros(6), head_moves])])
    R, t = poses[..., :9].reshape(2, 2, 3, 3), poses[..., 9:]
    alone_R, alone_t = R[1, 1], t[1, 1]  # the head on a foot that stays
    assert np.abs(R[0, 1] - R[0, 0] @ alone_R).max() < 1e-15
    assert np.abs(t[0, 1] - (R[0, 0] @ alone_t + t[0, 0])).max() < 1e-14


def test_measures_and_a_users_own_expression():
    def angle(poses):
        R = poses.rotation(top)
        return ca.atan2(R[2, 1], R[2, 2])

    def span(poses):
        return ca.norm_2(poses.position(top.point(0, 0, 0)) - poses.position(base.point(0, 0, 0)))

    a = cases.ra1()
    base, top = a.parts
    a.measure("tilt", angle, units="rad", tolerance=0.1)
    a.measure("span", span)
    a.measure("step", base.point(100, 0, 10), to=top.point(50, 0, 0), along="z")
    program = tc.build(a)
    assert program.nominal_measures == pytest.approx([0, 0, np.linalg.norm([50, 12.5, 10]), 0])
    deviations = RNG.normal(size=(5, 12))
    poses = program.place(deviations=deviations)
    values = program.observe(poses=poses["poses"], deviations=deviations)
    for row, pose in zip(values["measured"], poses["poses"].reshape(5, 2, 12), strict=True):
        (R_b, t_b), (R_t, t_t) = ((p[:9].reshape(3, 3), p[9:]) for p in pose)
        corner = R_t @ [100, 12.5, 20] + t_t
        lower, foot = R_t @ [100, 12.5, 10] + t_t, R_b @ [100, 0, 10] + t_b
        apart = np.linalg.norm(R_t @ [50, 12.5, 10] + t_t - t_b)
        expected = [corner[2] - 20, np.arctan2(R_t[2, 1], R_t[2, 2]), apart, lower[2] - foot[2]]
        assert row == pytest.approx(expected, abs=1e-12)


def test_an_expression_that_fails_is_a_fault_of_the_model():
    a = cases.ra1()
    lid = tc.Assembly("other").part("lid", tc.Box(1, 1, 1))
    a.measure("stranger", lambda poses: poses.translation(lid)[0])
    a.measure("vector", lambda poses: poses.translation(a.parts[0]))
    with pytest.raises(tc.TolcontactError, match=r'"stranger".*unknown part "lid"(.|\n)*"vector".*shape \(3, 1\)'):
        tc.build(a)


def test_a_tape_gives_back_the_expression():
    entries = ca.SX.sym("poses", 24)
    poses = [Pose(ca.reshape(v[:9], 3, 3).T, v[9:]) for v in ca.vertsplit(entries, 12)]
    deviations = ca.SX.sym("deviations", 2)
    expressions = [
        ca.if_else(entries[3] > 0, ca.sqrt(ca.sumsqr(entries[:5])), ca.fmax(entries[9], 2) ** entries[1]),
        ca.atan2(ca.sin(entries[4]), 1 + ca.exp(-entries[7])) - ca.fabs(entries[20]) / 3 + entries[23] ** 2,
        entries[5],
        entries[5] * deviations[1],
        ca.SX(4.5),
    ]
    values = RNG.uniform(0.1, 1, size=24)
    for expression in expressions:
        back = replay(record(expression, ca.vertcat(entries, deviations)), poses, deviations)
        both = ca.Function("both", [entries, deviations], [expression, back])(values, [0.5, 2.0])
        assert float(both[0]) == float(both[1])
