"""What a block counts and sums up, in cases where every number is known beforehand."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import simulate
from tolcontact.vocabulary import CORRECTED, RAW, Status

SEATED = tc.Method(objective="seating", resolution="exact")


def heights(program, run):
    """Heights of a block above its base [mm], raw."""
    base, block = (run["deviations"][:, program.nominal.locators.labels.index(f"{name}.Z")] for name in ("base", "block"))
    return block - base


def test_flat_faces_are_active_with_all_their_points_or_none():
    program, run = simulate(cases.one_dimensional(6), samples=300, solver="daqp")
    gap, points = heights(program, run), len(program.nominal.pairs[0].P_m)
    assert np.abs(run["gap_min"][:, RAW, 0] - gap).max() < 1e-12
    assert (run["active"][:, 0] == np.where(gap < 1e-9, points, 0)).all()
    assert np.abs(run["gap_min"][:, CORRECTED, 0] - np.maximum(gap, 0)).max() < 1e-9


@pytest.mark.parametrize("resolution", ["linearized", "exact"])
def test_realizations_without_contact_cost_nothing_and_the_others_one_start(resolution):
    program, run = simulate(cases.one_dimensional(6), samples=300, method=tc.Method(resolution=resolution))
    touched = heights(program, run) < 0
    assert (run["status"] == np.where(touched, Status.RESOLVED, Status.UNTOUCHED)).all()
    assert (run["starts"] == touched).all()
    # The exact resolution takes a step to the answer, and another one to see that it stays.
    assert (run["iterations"] == touched * (1 if resolution == "linearized" else 2)).all()
    for name in ("second_answers", "searched"):
        assert (run[name] == 0).all(), name
    for name in ("kkt_residual", "reaction", "carrying"):
        assert (run[name][~touched] == 0).all(), name
    assert (run["carrying"][touched] > 0).all() and run["kkt_residual"].max() < 1e-9


@pytest.mark.parametrize("objective", ["active points", "all points", "locator stiffness"])
def test_the_reaction_is_what_moving_the_block_takes(objective):
    """The derivative of half the sum of squared displacements, or of the energy of a spring of 1 N/mm."""
    program, run = simulate(cases.one_dimensional(0), samples=100, method=tc.Method(objective=objective))
    weight = 1 if objective == "locator stiffness" else len(program.nominal.pairs[0].P_m)
    expected = weight * np.maximum(-heights(program, run), 0)
    assert run["reaction"][:, 0] == pytest.approx(expected, rel=1e-5)


def plate_on_legs(share: float, *, weight: float = 100.0) -> tc.Assembly:
    """A plate whose weight stands between three legs so that one of them carries a `share` of what the first one does."""
    a = tc.Assembly("plate")
    plate = a.part("plate", tc.Box(100, 60, 5))
    feet = [(5, 5, 0), (95, 5, 0), (5, 55, 0)]
    legs = [tc.Locator(f"leg{k}", foot, "z", 0, one_sided=True) for k, foot in enumerate(feet)]
    guides = [tc.Locator("B1", (20, 0, 2), "y", 0), tc.Locator("B2", (80, 0, 2), "y", 0), tc.Locator("C", (0, 30, 2), "x", 0)]
    a.locate(plate, [*legs, *guides])
    first = 0.7 / (1 + share)
    a.force("weight", at=plate.point(5 + 90 * 0.3, 5 + 50 * share * first, 0), vector=(0, 0, -weight))
    a.measure("corner", plate.point(100, 60, 0), along="z", tolerance=1)
    return a


@pytest.mark.parametrize("solver", ["daqp", "qpoases"])
@pytest.mark.parametrize(("share", "carrying"), [(0.5, 3), (3e-3, 3), (3e-4, 3), (3e-5, 2), (3e-7, 2)])
def test_a_point_carries_with_more_than_a_ten_thousandth_of_the_largest_reaction(share, carrying, solver):
    """Statics: nothing varies, so that only the weight presses."""
    _, run = simulate(plate_on_legs(share), samples=2, solver=solver, method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert (run["carrying"] == carrying).all()
    assert np.abs(run["reaction"].sum(axis=1) - 100).max() < 1e-6


def test_reactions_scale_with_the_forces_and_poses_do_not():
    runs = [simulate(plate_on_legs(0.5, weight=weight), samples=2, method=SEATED)[1] for weight in (1.0, 50.0)]
    assert runs[1]["reaction"] == pytest.approx(50 * runs[0]["reaction"])
    assert runs[1]["poses"] == pytest.approx(runs[0]["poses"], abs=1e-12)
