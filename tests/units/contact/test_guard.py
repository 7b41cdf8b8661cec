"""Guards of pairs of the same two bodies say the same, each in the frames of its own faces."""

import numpy as np
import pytest

from tests.cases.several_pairs import corner, tab_in_a_slot
from tests.helpers import compiled
from tolcontact import poses as pose
from tolcontact.contact.guard import Guard


def at(X, points):
    """Where points (n, 3) are at poses (n, 12)."""
    return pose.apply(X, points[:, None])[:, 0]


@pytest.fixture(scope="module")
def guarded():
    """The guards of a model, and raw X_RM (realization, pair, 12) and deviations where its two bodies interfere."""

    def guards(model):
        program = compiled(model, solver="daqp")
        deviations = program.draws(seed=1, start=0, stop=100)
        relative = program.observed(program.place(deviations=deviations)["poses"], deviations)[1]
        guards = [Guard.of(program, k) for k in range(relative.shape[1])]
        found = [guard.interferes(relative[:, k], deviations) for k, guard in enumerate(guards)]
        assert found[0].any() and not found[0].all() and all(np.array_equal(found[0], other) for other in found[1:])
        columns = {label: deviations[found[0], k] for k, label in enumerate(program.draws.labels)}
        return guards, relative[found[0]], deviations[found[0]], columns

    return guards


def test_of_a_wall_that_tilts(guarded):
    (wall, floor), relative, deviations, _ = guarded(corner((0, 1), (0, 0, 0)))
    tilted = pose.compose(relative[:, 1], pose.inverse(relative[:, 0]))  # the pose of the wall in its body
    R = pose.rotation(tilted)
    assert np.ptp(R, axis=0).max() > 1e-3
    for directions in (None, np.tile((0.0, 1.0, 0.0), (len(relative), 1)), np.tile((0.0, 0.0, 1.0), (len(relative), 1))):
        way = floor.ways_out(relative[:, 1], deviations, directions)
        in_frame_of_wall = None if directions is None else np.einsum("nji,nj->ni", R, directions)
        of_wall = wall.ways_out(relative[:, 0], deviations, in_frame_of_wall)
        np.testing.assert_allclose(of_wall.widths, way.widths, atol=1e-9)
        np.testing.assert_allclose(np.einsum("nij,nj->ni", R, of_wall.normals), way.normals, atol=1e-9)
        # Of several points at one level, either may be named.
        feet = np.einsum("nij,nj->ni", R, of_wall.feet) + pose.translation(tilted)
        for points, others in ((feet, way.feet), (at(relative[:, 1], of_wall.places), at(relative[:, 1], way.places))):
            np.testing.assert_allclose(((points - others) * way.normals).sum(axis=1), 0, atol=1e-9)


def test_of_faces_that_move_with_sizes(guarded):
    (near, _, floor), relative, deviations, columns = guarded(tab_in_a_slot())
    way, of_near = floor.ways_out(relative[:, 2], deviations), near.ways_out(relative[:, 0], deviations)
    halves = np.stack([columns["tab.tab.size"], columns["body.slot.size"]]) / 2
    outwards = halves[..., None] * [0, 1, 0]  # both faces move towards -y as the sizes grow
    np.testing.assert_allclose(of_near.places, way.places + outwards[0], atol=1e-9)
    np.testing.assert_allclose(of_near.feet, way.feet + outwards[1], atol=1e-9)
    np.testing.assert_allclose(of_near.normals, way.normals, atol=1e-12)
