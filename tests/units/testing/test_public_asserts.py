"""Insides of `testing` under the claims of `tests/test_public_asserts.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tolcontact.testing.referee import ArchivedPair


@pytest.fixture
def results(archive):
    """Realizations in memory, to be tampered with."""
    with tc.open_archive(archive) as tree:
        return tree.load()


def test_normals_have_their_length_whatever_the_poses_do(results):
    """Archived poses of parts that others rest on are rotations; gaps are those of the paper's (5) also where they are not."""
    results["rotation"].values[:, :, 0] *= 1.25
    gaps = ArchivedPair(results, 0).gaps(results.to_dataset(), slice(0, 5))
    contact = results["contact"].to_dataset()
    contact = contact.isel(point=contact["pair_of_point"].values == 0)
    R, t = results["rotation"].values[:5], results["translation"].values[:5]
    x_m = np.einsum("nsij,pj->nspi", R[:, :, 1], contact["moving_point"].values) + t[:, :, None, 1]
    x_r = np.einsum("nsij,pj->nspi", R[:, :, 0], contact["reference_point"].values) + t[:, :, None, 0]
    n = np.einsum("nsij,pj->nspi", R[:, :, 0], contact["reference_normal"].values)
    assert gaps == pytest.approx(((x_m - x_r) * n).sum(axis=-1) / np.linalg.norm(n, axis=-1), abs=1e-9)
