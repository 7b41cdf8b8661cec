"""What the test of bodies leaves out changes no answer: distant facets, edges and components, and pairs of distant bodies."""

import itertools

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled
from tests.units.interference.test_free_regions import INSETS, poses
from tolcontact.interference.neighbours import Neighbours
from tolcontact.interference.solid import solid


def body(*meshes):
    return solid(trimesh.util.concatenate(meshes))


def box(low, high):
    return trimesh.creation.box(bounds=[low, high])


def ball(radius, centre):
    mesh = trimesh.creation.icosphere(2, radius)
    return trimesh.Trimesh(np.array(mesh.vertices) + centre, mesh.faces)


PAIRS = {
    "balls": (body(ball(1.0, (0, 0, 0))), body(ball(1.5, (2.55, 0.1, -0.1)))),
    "a ball over a hollow": (
        body(ball(0.5, (0, 0, 0.55)), ball(0.2, (0.6, 0.6, 0.3))),
        body(box((-2, -2, -1), (2, 2, 0)), box((1.0, -2, 0), (2, 2, 1))),
    ),
    "a small ball within or beside a large one": (body(ball(0.3, (0, 0, 0))), body(ball(1.0, (1.0, 0, 0)))),
}


@pytest.mark.parametrize("name", PAIRS)
def test_neither_the_reach_nor_the_motion_of_bodies_changes_an_answer(name):
    """The nominal bodies tell which edges, facets and components may meet after a motion; poses go beyond it, too."""
    A, B = PAIRS[name]
    rng = np.random.default_rng(5)
    X = np.concatenate([poses(400, spread, tilt, rng) for spread, tilt in ((0.05, 0.02), (0.3, 0.2), (1.0, 1.0))])
    X[:, 9:] += rng.normal(0, 0.1, (len(X), 3))
    answers = [Neighbours(A, B, INSETS, reach, min_triangles=np.inf).interfere(X) for reach in (1e-3, 0.2, 50.0)]
    assert 0.1 < answers[0].mean() < 0.9
    assert np.array_equal(answers[0], answers[1]) and np.array_equal(answers[1], answers[2])


def test_a_ball_interferes_with_another_one_wherever_its_middle_is():
    """Within, it crosses no surface: of its vertices, those that nothing nominally comes near tell where it is."""
    A, B = PAIRS["a small ball within or beside a large one"]
    rng = np.random.default_rng(6)
    X = np.concatenate([np.tile(np.eye(3).ravel(), (2000, 1)), rng.normal(0, 0.6, (2000, 3))], axis=1)
    distance = np.linalg.norm(X[:, 9:] - [1.0, 0, 0], axis=1)
    is_sure = np.abs(distance - 1.3) > 0.03  # more than the triangles cut off
    assert ((distance < 0.65) & is_sure).sum() > 100
    assert np.array_equal(Neighbours(A, B, INSETS, 0.2).interfere(X)[is_sure], distance[is_sure] < 1.3)


def cubes(tolerance, width):
    """Cubes in space, 0 to 0.35 mm apart, that collide by the tolerance of locators, or the profile of some faces."""
    a = tc.Assembly("cubes")
    rng = np.random.default_rng(2)
    for i, j, k in itertools.product(range(2), repeat=3):
        at = np.array((i, j, k)) * 10.15 + rng.uniform(0, 0.2, 3)
        part = a.part(f"cube {i}{j}{k}", tc.Box(10, 10, 10), at=tuple(at))
        if i:  # only faces of contact pairs deviate
            part.feature("back", part.face("+x"), datum="A")
            side = part.feature("side", part.face("-x"), tc.Profile(width, "A"))
            a.contact(f"pair {j}{k}", moving=side, reference=a.parts[2 * j + k].face("+x"), points=4)
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("+x"), inset=1), tolerance=tolerance)
        a.measure(f"x{i}{j}{k}", part.point(0, 0, 0), along="x")
    return a


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("tolerance", "width", "least"), [(0.5, 0.3, 12), (0.01, 1.5, 3)])
def test_pairs_of_bodies_that_are_not_looked_at_do_not_interfere(tolerance, width, least):
    program = compiled(cubes(tolerance, width), solver="daqp")
    deviations = program.draws(seed=3, start=0, stop=200)
    at = program.place(deviations=deviations)["poses"].reshape(len(deviations), -1, 12)
    rng = np.random.default_rng(4)
    for number, part in enumerate(program.nominal.parts):  # a turn about a corner leaves this corner where it is
        turns = Rotation.from_rotvec(rng.normal(0, tolerance / 10, (len(at), 3)))
        corner = np.array(part.body.vertices)[rng.integers(8)]
        moved = np.array([corner - turn.apply(corner) for turn in turns])
        at[:, number] = np.concatenate([turns.as_matrix().reshape(-1, 9), moved], axis=1)
    found = {clash.pair: set(clash.rows.tolist()) for clash in program.watch.clashes(at, deviations)}
    count = 0
    for pair in itertools.combinations(range(8), 2):
        R, t = at[..., :9].reshape(*at.shape[:2], 3, 3), at[..., 9:]
        back = R[:, pair[1]].transpose(0, 2, 1)
        shift = np.einsum("nij,nj->ni", back, t[:, pair[0]] - t[:, pair[1]])
        X = np.concatenate([(back @ R[:, pair[0]]).reshape(-1, 9), shift], axis=1)
        rows = set(np.flatnonzero(program.watch.neighbours(pair).interfere(X, deviations)).tolist())
        assert found.get(pair, set()) == rows
        count += bool(rows)
    assert count >= least


@pytest.mark.filterwarnings("ignore")
def test_bodies_that_move_by_little_more_than_their_distance_are_looked_at():
    program = compiled(cubes(0.5, 0.3), solver="daqp")
    boxes = np.array([part.body.bounds for part in program.nominal.parts])
    nominal, neighbours = np.zeros((1, len(program.nominal.contributors))), 0
    for (i, j), axis in itertools.product(itertools.combinations(range(8), 2), range(3)):
        gaps = np.maximum(boxes[i, 0] - boxes[j, 1], boxes[j, 0] - boxes[i, 1])
        if gaps[axis] < 0 or (np.delete(gaps, axis) > -1).any():
            continue
        neighbours += 1
        for beyond in (0.01, -0.01):
            at = np.tile(np.r_[np.eye(3).ravel(), np.zeros(3)], (1, 8, 1))
            at[0, [i, j], 9 + axis] = (gaps[axis] + beyond) / 2 * np.array([1, -1])
            found = {clash.pair for clash in program.watch.clashes(at, nominal)}
            assert ((i, j) in found) == (beyond > 0)
    assert neighbours == 12
