"""The models do what their docstrings say."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from tests import cases, referee
from tests.helpers import ALL_POINTS, EXACT, PAPER, R_t, compiled, joined, nightly, realizations, simulate
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW, Status

METHODS = {
    "cells": ALL_POINTS,
    "channel": EXACT,
    "cover": ALL_POINTS,
    "door": PAPER,
    "ra1": PAPER,
    "ra2": PAPER,
    "tower": ALL_POINTS,
}
# Table 1: mean, 6 sigma, variance.
RA2 = {RAW: (-0.0014, 12.5187, 4.3534), CORRECTED: (-0.0664, 5.8544, 0.9521)}


@cache
def program_of(name, search=None):
    """The program of a model, which tests share."""
    method = METHODS[name] if search is None else replace(METHODS[name], search=search)
    return compiled(cases.model(name), solver="daqp", method=method)


def run_of(program, samples):
    return joined(simulate_blocks(program, samples=samples, seed=1))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*(name for name in METHODS if name != "cover"), *nightly("cover")])
def test_every_model_resolves_all_its_contacts(name):
    for search in (None, "fixed"):
        program = program_of(name, search)
        run = run_of(program, 30)
        assert np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED]).all()
        assert (run["status"] == Status.RESOLVED).mean() > 0.5
        assert run["gap_min"][:, RAW].min() < -0.1
    R, t = R_t(run["poses"])  # of the fixed search
    for pair in program.nominal.pairs:
        for k in range(0, 30, 5):
            assert referee.gaps(pair, R[k, CORRECTED], t[k, CORRECTED], run["deviations"][k]).min() > -1e-6


def spreads(name, samples=2000):
    """Mean and standard deviation (measure, state) by measure, on one set of draws."""
    program = program_of(name)
    x = run_of(program, samples)["measured"]
    return {m.name: (x[:, :, k].mean(axis=0), x[:, :, k].std(axis=0, ddof=1)) for k, m in enumerate(program.nominal.measures)}


def test_bump_stops_push_a_door_outwards_and_leave_its_gaps():
    found = spreads("door")
    for name, (mean, sigma) in found.items():
        if name.startswith("flush"):
            assert mean[CORRECTED] - mean[RAW] > 0.05
            assert sigma[CORRECTED] < 0.6 * sigma[RAW]
        else:
            assert abs(sigma[CORRECTED] / sigma[RAW] - 1) < 0.02


@pytest.mark.slow
def test_cells_give_way_most_in_the_middle_and_their_pitch_varies_less():
    found = {name: sigma[CORRECTED] / sigma[RAW] for name, (_, sigma) in spreads("cells", 200).items()}
    assert found["first terminal"] < found["middle terminal"] < 0.8
    assert found["pitch in the middle"] < 0.7


@pytest.mark.slow
def test_blocks_of_a_tower_only_push_each_other_up():
    run = run_of(program_of("tower"), 200)
    top = run["measured"][..., 0]
    assert top[:, CORRECTED].mean() > 0.05
    assert top[:, CORRECTED].std() < 0.5 * top[:, RAW].std()
    assert top[:, RAW].min() < -0.5
    assert top[:, CORRECTED].min() > -0.4


@pytest.mark.slow
def test_a_cover_stays_within_the_clearance_of_its_pins():
    """The hole stays within half the clearance of its pin, wherever the pin stands."""
    program = program_of("cover")
    run = run_of(program, 75)
    assert np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED]).all()
    names = [part.name for part in program.nominal.parts]
    R, t = R_t(run["poses"][:, CORRECTED])
    hole, pin = names.index("cover"), names.index("round pin")
    places = np.array([15.0, 15.0, 44.0])
    apart = (R[:, hole] @ places + t[:, hole] - R[:, pin] @ places - t[:, pin])[:, :2]
    labels = list(program.nominal.contributors)
    wider, thicker = (run["deviations"][:, labels.index(f"{name}.size")] for name in ("cover.hole", "round pin.barrel"))
    off = np.linalg.norm(apart, axis=1) - (0.1 + wider - thicker) / 2  # turned parts have their hole a little aside
    assert off.max() < 1e-4
    assert np.quantile(off, 0.5) > -0.005
    raw = run["poses"][:, RAW, hole, 9:11] - run["poses"][:, RAW, pin, 9:11]
    assert np.linalg.norm(raw, axis=1).max() > 0.2


@pytest.fixture(scope="module")
def ra2():
    return compiled(cases.model("ra2"), solver="daqp")


def test_ra2_has_3000_contact_points(ra2):
    assert [len(pair.P_m) for pair in ra2.nominal.pairs] == [1480, 760, 760]
    for pair in ra2.nominal.pairs:
        assert np.abs(pair.P_m - pair.P_r).max() < 1e-9
    lean = np.degrees(np.arccos(np.abs(ra2.nominal.pairs[1].n_r[:, 2])))
    assert 74 < lean.min() and lean.max() < 76  # flanges are not orthogonal to the web


@pytest.mark.slow
def test_ra2_comes_to_the_papers_figures(ra2):
    """As for RA1: inside the 95 % prediction interval for one more run of N = 1000, all six figures together."""
    runs = []
    for seed in range(1, 11):
        run = joined(simulate_blocks(ra2, samples=1000, seed=seed))
        assert run["status"].max() == Status.RESOLVED
        runs.append(run["measured"][..., 0])
    figures = np.array([[(x.mean(), 6 * x.std(ddof=1), x.var(ddof=1)) for x in run.T] for run in runs])
    reach = stats.t.ppf(1 - 0.025 / 6, len(runs) - 1) * np.sqrt(1 + 1 / len(runs)) * figures.std(axis=0, ddof=1)
    for state, paper in RA2.items():
        assert (np.abs(figures.mean(axis=0)[state] - paper) < reach[state]).all()
    assert (figures[:, CORRECTED, 1] < 0.6 * figures[:, RAW, 1]).all()
    x = np.concatenate(runs)
    shift = x[:, CORRECTED] - x[:, RAW]
    assert shift.mean() + 1.96 * shift.std() / np.sqrt(len(x)) < 0  # towards the wide end


def of(run, program, label):
    """Deviations (realization,) of a contributor."""
    return run["deviations"][:, list(program.nominal.contributors).index(label)]


@pytest.mark.parametrize("solver", ["daqp", "qpoases"])
def test_a_clutch_jams_at_the_angle_of_its_formula(solver):
    """One-way clutch; to what a thousandth of the spring's force yields."""
    program, run = simulate(cases.model("clutch"), samples=1000, solver=solver, method=cases.model("clutch").method)
    assert (run["status"] == Status.RESOLVED).all()
    a = 27.645 + of(run, program, "hub.flat.offset")
    c, e = 11.43 + of(run, program, "roller.barrel.size") / 2, 50.8 + of(run, program, "ring.bore.size") / 2
    angle = np.degrees(np.arccos((a + c) / (e - c)))
    assert np.abs(run["measured"][:, CORRECTED, 0] - angle).max() < 1e-6
    error = 0.21971 / np.sqrt(len(angle))
    assert abs(angle.mean() - 7.01477) < 4 * error and abs(angle.std() - 0.21971) < 4 * error


@pytest.mark.slow
def test_lids_at_maximum_material_fit():
    program, run = simulate(cases.model("lid"), samples=40, solver="daqp", method=cases.model("lid").method)
    assert np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED]).all()
    assert (run["status"] == Status.RESOLVED).mean() > 0.2
    R, t = R_t(run["poses"])
    for pair in program.nominal.pairs:
        assert (
            min(referee.gaps(pair, R[k, CORRECTED], t[k, CORRECTED], run["deviations"][k]).min() for k in range(0, 40, 2))
            > -1e-8
        )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "samples"), [("hinge", 12), *nightly(("spindle", 40))])
def test_shafts_in_several_bores_rest_in_all_of_them(name, samples):
    model = cases.model(name)
    program, run = simulate(model, samples=samples, solver="daqp", method=model.method)
    assert (run["status"] == Status.RESOLVED).all()
    R, t = R_t(run["poses"])
    least = np.array(
        [
            [referee.gaps(pair, R[k, CORRECTED], t[k, CORRECTED], run["deviations"][k]).min() for pair in program.nominal.pairs]
            for k in range(samples)
        ]
    )
    assert least.min() > -1e-8 and (np.abs(least) < 1e-7).all()  # each bore carries


@pytest.mark.slow
def test_a_bracket_sags_by_the_clearances_of_its_bolts():
    """The lowest place of the weight at which both holes are within their clearances: a search over the shift along x."""
    results = realizations(compiled(cases.model("bracket"), solver="daqp"), samples=12)
    assert (results.status == Status.RESOLVED).all()
    drawn = results["sample"].deviation

    def of(label):
        return drawn.sel(contributor=label).values

    numbers = (1, 2)
    sizes = [of(f"{part}.hole {k}.size") for part in ("wall", "bracket") for k in numbers]
    room = [1.0 + (sizes[k] + sizes[k + 2]) / 2 - of(f"bolt {k + 1}.shank.size") for k in (0, 1)]
    off = {axis: [of(f"wall.hole {k}.shift {axis}") - of(f"bracket.hole {k}.shift {axis}") for k in numbers] for axis in "xy"}
    x = np.linspace(-1.5, 1.5, 6001)[:, None]
    aside = [x - off["x"][k] for k in (0, 1)]
    reach = [np.sqrt(np.where(np.abs(a) < r, r**2 - a**2, np.nan)) for a, r in zip(aside, room, strict=True)]
    ends = np.array([off["y"][k] - reach[k] for k in (0, 1)])
    lever = (10 + 45) / 90  # share of the weight on the right bolt
    best = np.nanargmin((1 - lever) * ends[0] + lever * ends[1], axis=0)
    sagged = ends[:, best, np.arange(ends.shape[2])].T
    measured = results.measured.sel(state="corrected").values
    # To first order in the turn, which is at most 0.02, and on a grid of 0.5 um.
    assert np.abs(measured - sagged).max() < 0.01 < 0.1 * sagged.std()
    assert -1.15 < measured.mean() < -0.95
