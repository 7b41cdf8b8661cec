"""The solver of contact QPs of elastic parts, against a second algorithm (non-negative least squares) and the conditions."""

import numpy as np
import pytest
from scipy import linalg, optimize

from tolcontact.compilation.dual_kernel import INFEASIBLE, SOLVED, solve_dual

ROWS = (1, 9, 38, 81, 153, 500)
TOLERANCE = 1e-11  # mm


def contact(rows, equations=0, count=5, softness=1e-3, seed=0):
    """A plate pressed on `rows` points, some across its edges; its flexibility decays with the distance of points."""
    rng = np.random.default_rng((seed, rows, equations))
    points, normals = np.zeros((rows, 3)), np.tile([0.0, 0, 1], (rows, 1))
    points[:, :2] = rng.uniform(0, 100, (rows, 2))
    normals[rng.random(rows) < 0.1] = [1, 0, 0]
    A = np.column_stack([normals, np.cross(points - 50, normals) / 50]) + 1e-4 * rng.normal(size=(count, rows, 6))
    distances = np.linalg.norm(points[:, None] - points, axis=2)
    root = rng.normal(size=(count, 6, 6))
    H, g = np.eye(6) + 0.1 * root @ root.transpose(0, 2, 1), np.tile([3.0, 0, 50, 5, -20, 0], (count, 1))
    return H, g, A, rng.normal(size=(count, rows)) * 0.05, softness * np.exp(-distances / 40), equations


def solve(problem, guess=None):
    H, g, A, b, C, equations = problem
    count, rows, size = A.shape
    x, reactions, status = np.empty((count, size)), np.empty((count, rows)), np.empty(count, dtype=np.int64)
    guess = np.zeros((count, rows)) if guess is None else guess
    arrays = map(np.ascontiguousarray, (H, g, A, b, C))  # it is compiled for these
    solve_dual(*arrays, equations, guess, TOLERANCE, x, reactions, status)
    return x, reactions, status


def assert_conditions(problem, x, reactions):
    """The optimality conditions, which are sufficient: the problem is convex."""
    H, g, A, b, C, equations = problem
    first = A.shape[1] - equations
    gaps = np.einsum("kij,kj->ki", A, x) + reactions @ C + b
    assert np.einsum("kij,kj->ki", H, x) + g == pytest.approx(np.einsum("kij,ki->kj", A, reactions), rel=1e-9, abs=1e-9)
    own = np.diagonal(A @ np.linalg.solve(H, A.swapaxes(1, 2)) + C, axis1=1, axis2=2)
    rounding = 1e-10 + 1e-15 * (np.abs(reactions) * own).sum()
    assert gaps[:, :first].min(initial=0) > -rounding
    assert reactions[:, :first].min(initial=0) >= 0
    assert np.abs(gaps[:, :first][reactions[:, :first] > 0]).max(initial=0) < rounding
    assert np.abs(gaps[:, first:]).max(initial=0) < rounding


def second_answer(problem, k):
    """Reactions by scipy's NNLS: min |R l + R^-T q|, W = R'R; the reactions of equations are eliminated."""
    H, g, A, b, C, equations = problem
    first = A.shape[1] - equations
    W = A[k] @ np.linalg.solve(H[k], A[k].T) + C
    q = b[k] - A[k] @ np.linalg.solve(H[k], g[k])
    fixed = slice(first, None)
    if equations:
        eliminated = np.linalg.solve(W[fixed, fixed], np.column_stack([W[fixed, :first], q[fixed]]))
        reduced, right = (
            W[:first, :first] - W[:first, fixed] @ eliminated[:, :-1],
            q[:first] - W[:first, fixed] @ eliminated[:, -1],
        )
    else:
        eliminated, reduced, right = np.zeros((0, first + 1)), W, q
    R = np.linalg.cholesky((reduced + reduced.T) / 2).T
    free, _ = optimize.nnls(R, -linalg.solve_triangular(R, right, trans="T"), maxiter=50 * len(right))
    return np.concatenate([free, -eliminated[:, -1] - eliminated[:, :-1] @ free])


@pytest.mark.parametrize("equations", [0, 6])
@pytest.mark.parametrize("softness", [1e-5, 1e-3, 1.0])
@pytest.mark.parametrize("rows", ROWS[1:])
def test_reactions_are_those_of_a_second_algorithm(rows, softness, equations):
    problem = contact(rows, equations, 2 if rows > 200 else 5, softness)
    x, reactions, status = solve(problem)
    assert (status == SOLVED).all()
    assert_conditions(problem, x, reactions)
    for k in range(len(x)):
        expected = second_answer(problem, k)
        assert reactions[k] == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_many_rows_may_be_active():
    """A mat of 400 springs of 1 N/mm, with little else between them."""
    H, g, A, b, C, _ = contact(400, count=2)
    problem = H, 20 * g, A, b, C + np.eye(400), 0
    x, reactions, status = solve(problem)
    assert (status == SOLVED).all()
    assert_conditions(problem, x, reactions)
    assert (reactions > 0).sum(axis=1).min() > 200


@pytest.mark.parametrize("rows", [38, 153])
def test_a_guess_changes_nothing_but_the_way(rows):
    problem = contact(rows, count=4)
    x, reactions, _ = solve(problem)
    rng = np.random.default_rng(7)
    for guess in (reactions, np.roll(reactions, 1, axis=0), np.ones(reactions.shape), rng.normal(size=reactions.shape)):
        again, others, status = solve(problem, guess)
        assert (status == SOLVED).all()
        assert others == pytest.approx(reactions, abs=1e-7 * reactions.max())
        assert again == pytest.approx(x, abs=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_dependent_rows_have_some_answer(seed):
    """Rows twice, flexibilities of low rank or none, gaps that are equal: reactions are not unique, the pose is."""
    rng = np.random.default_rng(seed)
    H, g, A, b, C, _ = contact(12, count=6, seed=seed)
    twice = np.r_[0:12, 0:12, rng.integers(0, 12, 16)]
    C = np.zeros((40, 40)) if seed % 2 else C[np.ix_(twice, twice)]
    problem = H, g, A[:, twice], np.where(seed % 3 == 0, 0.0, b[:, twice]), C, 0
    x, reactions, status = solve(problem, rng.normal(size=(6, 40)))
    assert (status == SOLVED).all()
    assert_conditions(problem, x, reactions)
    single = solve((H, g, A, problem[3][:, :12], C[:12, :12], 0))
    assert x == pytest.approx(single[0], abs=1e-8)


@pytest.mark.parametrize("seed", range(10))
def test_a_problem_without_a_solution_is_told_from_one_with(seed):
    """Rigid rows that enclose the part with a gap or a clash, as a linear program finds."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(10, 6))
    A = np.concatenate([directions, -directions])[None].repeat(8, 0)
    b = rng.normal(size=(8, 20)) * 0.1 + np.linspace(-0.05, 0.2, 8)[:, None]
    problem = np.tile(np.eye(6), (8, 1, 1)), rng.normal(size=(8, 6)), A, b, np.zeros((20, 20)), 0
    x, reactions, status = solve(problem)
    possible = [optimize.linprog(np.zeros(6), -A[k], b[k], bounds=(None, None)).status == 0 for k in range(8)]
    assert np.array_equal(status == SOLVED, possible)
    assert (status[~np.array(possible)] == INFEASIBLE).all()
    solved = status == SOLVED
    assert_conditions((*(part[solved] for part in problem[:4]), problem[4], 0), x[solved], reactions[solved])


def test_contradicting_equations_are_infeasible_and_repeated_ones_are_not():
    H, g, A, b, _, _ = contact(12, count=2)
    for shift, expected in ((0.0, SOLVED), (1e-3, INFEASIBLE)):
        repeated, gaps = A[:, [0, 1, 0]], b[:, [0, 1, 0]] + [0, 0, shift]
        _, _, status = solve((H, g, repeated, gaps - [0, 0, 2 * shift], np.zeros((3, 3)), 2))
        assert (status == SOLVED).all()  # the first one only holds one way
        _, _, status = solve((H, g, repeated, gaps, np.zeros((3, 3)), 3))
        assert (status == expected).all()
    H, g, A, b, C, _ = contact(12, count=2)
    x, reactions, status = solve((H, g, A, b, C, 9))  # more equations than movers have freedoms: elastic parts bend
    assert (status == SOLVED).all()
    assert_conditions((H, g, A, b, C, 9), x, reactions)


def test_one_soft_spring_spoils_nothing():
    """A locator of 1e-3 N/mm among rows a million times stiffer."""
    H, g, A, b, C, _ = contact(60)
    C[3, 3] += 1e3
    problem = H, g, A, b, C, 0
    x, reactions, status = solve(problem)
    assert (status == SOLVED).all()
    assert_conditions(problem, x, reactions)


def test_two_movers_and_rows_of_other_scales():
    H, g, A, b, C, _ = contact(50)
    both = np.concatenate([A, -A[:, ::-1]], axis=2)
    size = 10.0 ** np.random.default_rng(2).uniform(-2, 2, 12)
    problem = (
        np.stack([linalg.block_diag(h, 2 * h) for h in H]) * size[:, None] * size,
        np.tile(g, 2) * size,
        both * size,
        b,
        C,
        0,
    )
    x, reactions, status = solve(problem)
    assert (status == SOLVED).all()
    assert_conditions(problem, x, reactions)


def test_problems_do_not_depend_on_their_neighbours():
    problem = contact(81, 3, 6)
    x, reactions, _ = solve(problem)
    for k in range(6):
        alone = solve((*(part[k : k + 1] for part in problem[:4]), *problem[4:]))
        assert np.array_equal(alone[0][0], x[k])
        assert np.array_equal(alone[1][0], reactions[k])
