"""Insides of `contact` under the claims of `tests/test_engine.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import nightly
from tests.units.contact import plain_scan
from tolcontact.contact import kernel
from tolcontact.contact.scan import cluster_labels, pair_scan
from tolcontact.poses import AT_REST
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW


@pytest.mark.slow
@pytest.mark.parametrize("activity", [0.3, *nightly(1e-9)])
@pytest.mark.parametrize(
    "make",
    [cases.ra1, cases.stack, lambda: cases.model("ra2"), cases.stopped, lambda: cases.stopped(2)],
    ids=["ra1", "stack", "ra2", "one stop", "two stops"],
)
def test_compiled_scans_equal_those_in_numpy(make, activity):
    program = tc.build(make(), solver="daqp")
    block = next(simulate_blocks(program, samples=50, seed=1))
    relative, later = (
        program.observe(poses=block.poses[:, state], deviations=block.deviations)["relative"].reshape(50, -1, 12)
        for state in (RAW, CORRECTED)
    )
    (group,) = program.groups
    for position, index in enumerate(group.group.pairs):
        tables = [side.table for side in group.group.sides if side.pair == position]
        scan = pair_scan(program.nominal.pairs[index], program.gaps[index], tables, 6)
        active, moments = scan.survey(relative[:, index], block.deviations, activity)
        expected = plain_scan.survey(scan, relative[:, index], block.deviations, activity)
        assert (active == expected[0]).all()
        assert np.allclose(moments, expected[1], rtol=1e-12, atol=1e-9)
        level = np.tile(AT_REST, (3, 1))  # all points of a flat face are as deep: the first one counts
        level[:, 9:] = -0.05 * program.nominal.pairs[index].n_r[0]
        for poses in (relative[:, index], later[:, index], level):
            deviations = block.deviations[: len(poses)]
            gaps = plain_scan.gaps(scan, poses, deviations)
            assert (scan.gaps(poses, deviations) == gaps).all()
            assert (scan.min_gap(poses, deviations) == gaps.min(axis=1)).all()
            for mask in (None, plain_scan.gaps(scan, relative[:, index], block.deviations)[: len(poses)] < activity):
                points, depth = scan.deepest(poses, deviations, mask)
                expected = plain_scan.deepest(scan, poses, deviations, mask)
                assert (points == expected.points).all() and (depth == expected.depth).all()
        assert scan.deepest(relative[:, index], block.deviations).depth.max() > 0.01


@pytest.mark.parametrize(("offset", "tilt"), [(-1000.0, 1.0), (-0.5, 1e-3), (0.5, 1e-3)])
def test_no_gap_of_a_box_is_below_its_bound_in_spite_of_rounding(offset, tilt):
    rng = np.random.default_rng(3)
    lower, upper = np.sort(rng.normal(scale=50, size=(2, 1, 500)), axis=0)  # each box has points in both of its ends
    boxes, (middle, reach) = np.array([(upper + lower) / 2, (upper - lower) / 2]), np.empty((2, 500))
    for slope in tilt * rng.normal(size=20):
        kernel.bounds(boxes, 0, 500, np.array([offset, slope]), middle, reach)
        gaps = offset + slope * np.concatenate([lower, upper])
        assert (gaps >= middle - reach).all() and (gaps <= middle + reach).all()


def test_clusters_are_neighbours():
    """Four heaps far from each other, of points in any order."""
    rng = np.random.default_rng(1)
    heap = rng.integers(4, size=200)
    points = 100 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, -1, 1]])[heap] + rng.normal(size=(200, 3))
    label = cluster_labels(points, 4)
    assert sorted({(a, b) for a, b in zip(heap, label, strict=True)}) == sorted(dict(zip(heap, label, strict=True)).items())
    assert sorted(set(label)) == [0, 1, 2, 3]
