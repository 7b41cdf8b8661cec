"""Products by their upper half, against whole ones; moments of points about two centres, against each other."""

import casadi as ca
import numpy as np
import pytest

from tolcontact.mechanics.displacement import moment_table, moments_about
from tolcontact.mechanics.pose import congruent


@pytest.mark.parametrize("share", [1.0, 0.4])
def test_a_congruent_matrix_is_the_product_and_symmetric(share):
    rng = np.random.default_rng(2)
    A, half = rng.normal(size=(5, 7)) * (rng.uniform(size=(5, 7)) < share), rng.normal(size=(5, 5))
    B = half + half.T
    symbols = ca.SX.sym("A", ca.sparsify(ca.DM(A)).sparsity())
    product = ca.Function("product", [symbols], [congruent(ca.SX(ca.DM(B)), symbols)])(A).full()
    assert np.abs(product - A.T @ B @ A).max() < 1e-13
    assert (product == product.T).all()


def test_moments_move_to_another_centre():
    rng = np.random.default_rng(3)
    points, centre, other_centre = rng.normal(size=(20, 3)), rng.normal(size=3), rng.normal(size=3)
    moved = moments_about(centre, moment_table(points, other_centre, 0.1).sum(axis=1), other_centre)
    assert moved == pytest.approx(moment_table(points, centre, 0.1).sum(axis=1), abs=1e-12)
