"""Insides of `simulation` under the claims of `tests/test_round_forms.py`."""

import numpy as np
from scipy.optimize import linprog

import tolcontact as tc
from tests.cases.fits import CLEARANCE, LENGTH, PULL, RADIUS, shaft_in_a_bore
from tests.helpers import SEATED, simulate
from tests.test_round_forms import heights_on
from tolcontact.simulation.surfaces import check_surfaces
from tolcontact.vocabulary import CORRECTED, Status


def sums_of_heights(program, run, along, azimuths):
    return sum(heights_on(program, run, *face, along, azimuths) for face in (("shaft", RADIUS), ("bore", RADIUS + CLEARANCE)))


def farthest(heights, along, azimuths):
    """The largest motion along the pull of an axis at z = 3 (realization,), at first order: a linear programme."""
    z, angle = (grid.ravel() for grid in np.meshgrid(along, azimuths, indexing="ij"))
    n, share = np.column_stack([np.cos(angle), np.sin(angle)]), (z / LENGTH + 0.5)[:, None]
    rows = np.hstack([n * share, n * (1 - share)])  # of the ends of the axis
    aim = np.array(PULL) / np.linalg.norm(PULL)
    cost = -np.concatenate([aim * (3 / LENGTH + 0.5), aim * (0.5 - 3 / LENGTH)])
    return [
        -linprog(cost, A_ub=rows, b_ub=CLEARANCE - of_one, bounds=[(None, None)] * 4, method="highs").fun for of_one in heights
    ]


def test_a_fit_is_the_one_of_a_linear_programme_and_needs_no_more_points():
    """The grid of the pair tells within 0.5 um what 25 x 144 places tell."""
    program, run = simulate(shaft_in_a_bore(tc.Cylindricity(0.02), tc.Cylindricity(0.02)), 20, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all() and run["gap_min"][:, CORRECTED].min() > -1e-9
    P = program.nominal.pairs[0].P_m
    along, azimuths = np.unique(P[:, 2].round(9)), np.unique(np.arctan2(P[:, 1], P[:, 0]).round(9))
    assert len(P) == len(along) * len(azimuths) and len(azimuths) == 48
    far = run["measured"][:, CORRECTED, 4:] @ PULL / np.linalg.norm(PULL)
    np.testing.assert_allclose(far, farthest(sums_of_heights(program, run, along, azimuths), along, azimuths), atol=1e-4)
    fine = np.linspace(-20, 20, 25), np.arange(144) * 2 * np.pi / 144
    np.testing.assert_allclose(far, farthest(sums_of_heights(program, run, *fine), *fine), atol=5e-4)
    surfaces = check_surfaces(program, run["poses"][:5, CORRECTED], run["deviations"][:5])
    assert 0 < surfaces.penetration[:, 0].max() < 1e-3
