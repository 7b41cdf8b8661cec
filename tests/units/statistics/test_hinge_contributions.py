"""An over-constrained hinge whose sizes vary: contributions through contact, against the lines that pin and leaf rest on."""

import numpy as np
import pytest

import tolcontact as tc
from models import hinge
from tests.helpers import compiled
from tolcontact.simulation import simulate_block
from tolcontact.statistics.variance_shares import sobol_indices

GROUPS = ("base.bore 1", "base.bore 2", "leaf.bore 1", "leaf.bore 2", "pin.barrel")
ENDS = np.array([-hinge.WIDTH / 2, hinge.WIDTH / 2])
LEFT, RIGHT = -50.0, 50.0  # where the leaf is measured


def hangs(sizes):
    """How far both ends of the leaf move (n, end) for sizes' deviations (n, group), to first order.

    The pin lies on the ends of its bores that it is pressed to, on one of the left and one of the right, and the leaf hangs on
    the pin at one end of each of its bores: of all lines that lie above what is below, the lowest in the middle. Its stop is as
    far behind the pin as the ends are before it, so that they sink twice as far.
    """
    bores = (hinge.PIN + hinge.CLEARANCE + sizes[:, :4]) / 2
    radius = (hinge.PIN + sizes[:, 4]) / 2
    pin = lowest(hinge.LUGS, radius[:, None] - bores[:, :2])

    def upper(x):
        return pin[:, 0] + pin[:, 1] * x + radius

    floors = np.stack([np.stack([upper(place + end) for end in ENDS], axis=1) for place in hinge.KNUCKLES], axis=1)
    leaf = lowest(hinge.KNUCKLES, floors - bores[:, 2:, None])
    return np.stack([2 * leaf[:, 0] + leaf[:, 1] * x for x in (LEFT, RIGHT)], axis=1)


def lowest(places, floors):
    """Height in the middle and slope (n, 2) of the lowest line there above floors (n, bore) or (n, bore, end) at its ends."""
    floors = np.broadcast_to(floors if floors.ndim == 3 else floors[..., None], (len(floors), 2, 2))
    found = []
    for left in (0, 1):
        for right in (0, 1):
            x, y = (place + ENDS[end] for place, end in zip(places, (left, right), strict=True))
            slope = (floors[:, 1, right] - floors[:, 0, left]) / (y - x)
            found.append(np.stack([floors[:, 0, left] - slope * x, slope], axis=1))
    every = np.stack(found)
    return np.take_along_axis(every, every[..., 0].argmax(axis=0)[None, :, None], axis=0)[0]


@pytest.fixture(scope="module")
def program():
    return compiled(hinge.assembly(place=1e-9), solver="daqp")


@pytest.mark.slow
def test_a_hinge_hangs_on_its_lines(program):
    deviations = program.draws(seed=3, start=0, stop=40)
    labels = list(program.nominal.contributors)
    sizes = deviations[:, [labels.index(f"{group}.size") for group in GROUPS]]
    found = simulate_block(program, deviations)
    assert (found.status == tc.Status.RESOLVED).all()
    off = hangs(sizes) - found.measured[:, 1]
    assert off.min() > 0 and off.max() < 0.0015  # the leaf turns by 0.2 / 30: a second order of 20 mm (0.2 / 30)^2
    assert np.ptp(off) < 4e-4 and found.measured[:, 1].std(axis=0).min() > 5e-3


@pytest.mark.nightly
@pytest.mark.slow
def test_contributions_of_a_hinge_are_those_of_its_lines(program):
    spreads = np.array([hinge.BORE] * 4 + [hinge.SHAFT]) / 6
    draws = np.random.default_rng(5).normal(size=(2, 100_000, 5)) * spreads
    mixed = [np.where(np.arange(5) == k, draws[1], draws[0]) for k in range(5)]
    values = np.stack([hangs(x) for x in (*draws, *mixed)], axis=1)
    found = tc.analyses.contributions(program, samples=300, by="feature")
    assert int(found["by_status"].sel(status_meaning="resolved")) == 2100
    for measure, name in enumerate(found["measure"].values):
        for word, exact in zip(("first", "total"), sobol_indices(values[..., measure]), strict=True):
            for group, truth in zip(GROUPS, exact, strict=True):
                estimate, lower, upper = found[word].sel(measure=name, state="corrected", group=group).values
                assert abs(estimate - truth.value) < 1.7 * (upper - lower) / 2 + 0.005, (name, word, group)
