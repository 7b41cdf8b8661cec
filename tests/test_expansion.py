"""Parts that a temperature expands: stacks, fits and seats against closed forms, in any frame, and what is refused."""

import numpy as np
import pytest
import trimesh
from scipy.stats import norm

import tolcontact as tc
from tests import cases
from tests.cases import floating, round_contact
from tests.cases.frames import STILL, Frame
from tests.helpers import assembly_of, compiled
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute

TURNED = Frame(tc.degrees(30, 20, 10), (3, -4, 5))
WARMTH = np.array([0.0, 100.0, -60.0])  # K


def measured_when_warm(model, **coefficients):
    """Measured values (temperature, measure) with contact, less the cold ones, of parts with these coefficients [1e-6/K]."""
    model.variable("warmth", norm(20, 5), units="K", expands={name: 1e-6 * alpha for name, alpha in coefficients.items()})
    program = compiled(model)
    deviations = np.repeat(program.draws(seed=3, start=0, stop=1), len(WARMTH), axis=0)
    deviations[:, -1] = WARMTH
    block = simulate_block(program, deviations)
    assert not block.clashes.any()
    return block.measured[:, 1] - block.measured[0, 1], block


def tower(frame=STILL, on_features=False):
    """Two blocks on a plate, each located on the one below, whose frames have their origins at a corner of their undersides."""
    a = tc.Assembly("tower")
    below = plate = a.part("plate", tc.Box(100, 50, 10), **frame.place(0, 0, 0), fixed=True)
    for name, size, place in (("low", (50, 25, 20), (10, 10, 10)), ("high", (40, 20, 7), (15, 12, 30))):
        block = a.part(name, tc.Box(*size), **frame.place(*place))
        ground = below.feature("top", below.face("+z")) if on_features else below
        a.locate(block, tc.three_two_one(*(block.face(f"-{axis}") for axis in "zyx"), inset=2), tolerance=0, on=ground)
        a.contact(f"under {name}", moving=block.face("-z"), reference=below.face("+z"))
        below = block
    for axis, along in (("x", (1, 0, 0)), ("z", (0, 0, 1))):
        a.measure(f"to {axis}", plate.point(0, 0, 0), to=below.point(5, 5, 7), along=frame.along(*along))
    return a


@pytest.mark.parametrize(("frame", "on_features"), [(STILL, False), (TURNED, True)])
def test_a_stack_grows_by_the_sum_of_its_dimensions_times_their_coefficients(frame, on_features):
    grown, _ = measured_when_warm(tower(frame, on_features), plate=12, low=23, high=9)
    expected = 1e-6 * np.outer(WARMTH, [12 * 10 + 23 * 5 + 9 * 5, 12 * 10 + 23 * 20 + 9 * 7])
    assert grown == pytest.approx(expected, abs=1e-9)


def test_parts_with_one_coefficient_keep_their_proportions():
    """All distances grow alike, and contact stays what it was: an even stack still touches nowhere more than before."""
    a = tower()
    a.measure("gap", tc.Gap(a.parts[2].point(20, 10, 0), a.parts[0].face("+z")))
    grown, block = measured_when_warm(a, plate=15, low=15, high=15)
    assert grown == pytest.approx(15e-6 * np.outer(WARMTH, [20, 37, 20]), abs=1e-9)
    assert np.abs(block.gap_min[:, 1]).max() < 1e-9


def test_a_shaft_of_aluminium_closes_its_clearance_in_a_bore_of_steel():
    """A force pushes it aside by half the clearance, 0.1 mm when cold, along (1, -2), about the origin of both frames."""
    a = floating.floating_peg_in_a_hole()
    bore, barrel = a.parts[0].features[2], a.parts[1].features[0]
    a.measure("left", tc.AxisDistance(barrel, bore))
    grown, _ = measured_when_warm(a, peg=23.5, plate=11.5)
    radial = 1e-6 * WARMTH * (10.1 * 11.5 - 10 * 23.5) / 2
    assert grown[:, :3:2] == pytest.approx(np.outer(radial, np.array([1, -2]) / np.sqrt(5)), abs=1e-7)  # less a spring
    assert grown[:, -1] == pytest.approx(radial, abs=1e-8)


def test_a_shaft_in_a_v_and_a_ball_in_a_cone_rise():
    """Walls of the V lie 5 mm from the origins of their frames, the apex of the cone 12 mm below, its locators 10 mm below."""
    grown, _ = measured_when_warm(floating.floating_shaft_in_a_v(frame=None), shaft=20, left=10, right=12)
    axis = 1e-6 * WARMTH * (20 * 20 + 5 * 10 + 5 * 12) / np.sqrt(2)
    assert grown == pytest.approx(np.column_stack([axis, axis + 10 * 20e-6 * WARMTH]), abs=1e-6)
    grown, _ = measured_when_warm(round_contact.EVERY["cone"](), ball=20, seat=10)
    assert grown[:, 0] == pytest.approx(1e-6 * WARMTH * (10 * np.sqrt(2) * 20 - (12 - 10) * 10), abs=2e-6)  # it is askew


def fit():
    """A shaft of aluminium in a bore of steel, whose diameters differ by 0.1 mm, both with tolerances; it is held."""
    a = tc.Assembly("fit")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(10.05, 30, 20, sections=48)), fixed=True)
    shaft = a.part("shaft", tc.Mesh(trimesh.creation.cylinder(10, 20, sections=48)), fixed=True)
    bore = ring.feature("bore", ring.face(tc.select.Cylinder(inner=True)), tc.Size(20.1, 0.03))
    barrel = shaft.feature("barrel", shaft.face(tc.select.Cylinder()), tc.Size(20, 0.02))
    a.measure("clearance", tc.Clearance(barrel, bore), limits=(0.03, None))
    a.variable("warmth", tc.Tolerance(60, "uniform", shift=20), units="K", expands={ring: 11.5e-6, shaft: 23.5e-6})
    return a


def test_analyses_name_the_temperature():
    growth = (20.1 * 11.5e-6 - 20 * 23.5e-6) / 2  # mm per K
    worst = tc.analyses.worst_case(fit(), samples=64, solver="daqp")["worst"].isel(measure=0).sel(state="corrected").values
    half = (0.03 + 0.02) / 2
    assert worst == pytest.approx([0.05 - half + 50 * growth, 0.05 + half - 10 * growth], abs=1e-7)
    shares = tc.analyses.contributions(fit(), samples=64, solver="daqp").isel(measure=0)
    variances = np.array([(0.06 / 12) ** 2, (0.04 / 12) ** 2, 60**2 / 12 * growth**2])
    assert shares["group"].values.tolist() == ["ring.bore.size", "shaft.barrel.size", "warmth"]
    assert shares["linear"].values == pytest.approx(variances / variances.sum(), abs=1e-6)


def test_archives_and_models_as_data_hold_the_expansion(tmp_path):
    a = tower(TURNED)
    a.variable("warmth", 30, units="K", expands={"low": 23e-6, "high": 9e-6})
    results = tc.run(compiled(a), samples=8, keep="all")
    assert_gaps_recompute(results)
    warmth = results["sample"].deviation.sel(contributor="warmth").values
    assert results.measured.sel(state="corrected", measure="to z").values - 37 == pytest.approx(523e-6 * warmth, abs=1e-9)
    tc.io.write_model(a, tmp_path / "tower.json")
    for again in (tc.io.model_of(results), assembly_of(tmp_path / "tower.json")):
        assert again.variables[0].expands == {"low": 23e-6, "high": 9e-6}


def test_searches_reach_the_bound_of_an_expanding_pair_in_contact():
    """Two methods that share no code: searches on the engine, and a mixed-integer program; 2e-5 mm are of second order."""
    a = tc.Assembly("pair", method=tc.Method(objective="all points", resolution="exact"))
    base, top = a.part("base", tc.Box(100, 50, 10)), a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    for part, side in ((base, "-y"), (top, "+y")):
        a.locate(part, tc.three_two_one(part.face("-z"), part.face(side), part.face("-x"), inset=5), tolerance=0.02)
    a.contact("interface", moving=top.face("-z"), reference=base.face("+z"))
    a.measure("corner", top.point(50, 0, 10), along="z")
    a.variable("warmth", tc.Tolerance(40, "uniform"), units="K", expands={"base": 12e-6, "top": 80e-6})
    found = tc.analyses.worst_case(a, samples=256, solver="daqp").isel(measure=0).sel(state="corrected")
    assert found["worst"].values == pytest.approx(found["bound"].values, abs=3e-5)
    assert found["worst"].values[1] > 20 * 80e-6 * 10 + 0.02  # the locators alone are 0.0222


def test_what_cannot_expand_is_refused_by_name():
    a = tower()
    a.parts[0].elastic(E=70e3, nu=0.33)
    a.variable("warmth", 20, units="K", expands={"plate": 12e-6, "hgih": 1e-6})
    a.variable("heat", 20, units="K", expands={"low": 12})
    a.variable("length", 20, expands={"low": 12e-6})
    faults = "\n".join(tc.check(a))
    assert 'expands has "low": 12; expected a coefficient of expansion in 1/K' in faults
    assert 'units is "mm", and a temperature expands parts; give units="K"' in faults
    a = tower()
    a.parts[1].elastic(E=70e3, nu=0.33)
    a.variable("warmth", 20, units="K", expands={"low": 12e-6, "hgih": 1e-6})
    faults = "\n".join(tc.check(a))
    assert 'it expands part "low", which is elastic' in faults and 'the nearest name is "high"' in faults
    a = cases.ra1()
    a.contact("all", moving=a.parts[1].face(), reference=a.parts[0].face("+z"))
    a.variable("warmth", 20, units="K", expands={a.parts[1]: 12e-6})
    assert any("which expands: its face spans more than one surface" in fault for fault in tc.check(a))
