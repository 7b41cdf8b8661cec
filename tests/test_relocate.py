"""The best place of a locator: a plane's weights, a plane's minimum, contact, what cannot be."""

import io
import json

import numpy as np
import pytest
from rich.console import Console

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled
from tolcontact.report import analysis_text
from tolcontact.vocabulary import RELOCATION

FAST = {"solver": "daqp", "samples": 1024}
QUICK = FAST | {"samples": 256}


def plate(measured=(100, 25, 10), tolerance=0.2):
    """A plate on three points, measured above a place; A3 stands at (50, 50, 0)."""
    a = tc.Assembly("plate")
    part = a.part("plate", tc.Box(100, 50, 10))
    locators = [
        tc.Locator("A1", (0, 0, 0), "z"), tc.Locator("A2", (100, 0, 0), "z"), tc.Locator("A3", (50, 50, 0), "z"),
        tc.Locator("B1", (0, 0, 5), "y", 0), tc.Locator("B2", (100, 0, 5), "y", 0), tc.Locator("C1", (0, 25, 5), "x", 0),
    ]  # fmt: skip
    a.locate(part, locators, tolerance=0.1)
    a.measure("height", part.point(*measured), along="z", tolerance=tolerance)
    return a


def six_sigma(A3, at, tolerance=0.1):
    """By the plane through three points."""
    feet = np.array([[0, 0, 1], [100, 0, 1], [A3[0], A3[1], 1]])
    return float(tolerance * np.linalg.norm(np.linalg.solve(feet.T, [at[0], at[1], 1])))


def test_a_locator_goes_where_the_plane_says():
    found = tc.analyses.relocate(plate(), "plate.A3", between=((0, 20, 0), (100, 50, 0)), least="height: 6 sigma", **FAST)
    places = [(x, y) for x in np.linspace(0, 100, 101) for y in np.linspace(20, 50, 61)]
    best = min(six_sigma(place, (100, 25)) for place in places)
    reached = found["reached"].sel(stage="after")
    assert six_sigma(found["point"].sel(stage="after").values[:2], (100, 25)) < 1.005 * best
    assert reached.sel(interval="lower") < 1.03 * best and reached.sel(interval="upper") > 0.97 * best
    assert found["point"].sel(stage="before").values.tolist() == [50, 50, 0]
    estimate, lower, upper = found["change"].values
    truth = best / six_sigma((50, 50), (100, 25))
    assert lower - 0.02 < truth < upper + 0.02 and upper < 0.95 and lower < estimate < upper
    # every trial on the same draws is the closed form times the same share of them, but for the second order
    ratio = [v / six_sigma(p[:2], (100, 25)) for p, v in zip(found["tried"].values, found["tried_value"].values, strict=True)]
    assert np.ptp(ratio) < 0.12 and found.sizes["trial"] > 25


def test_fewer_are_outside_after_than_before():
    found = tc.analyses.relocate(
        plate(tolerance=0.06), "plate.A3", between=((0, 50, 0), (100, 50, 0)), least="height: ppm", solver="daqp", samples=4096
    )
    assert found["change"].sel(interval="upper") < 0 and found["point"].sel(stage="after", axis="x") > 80
    (before, *_), (after, *_) = found["reached"].values
    assert float(found["change"].sel(interval="estimate")) == pytest.approx(after - before)


@pytest.mark.parametrize(
    ("least", "between"), [("height: 6 sigma", ((0, 20, 0), (100, 50, 0))), ("height: ppm", ((0, 20, 0), (40, 30, 0)))]
)
def test_a_locator_at_the_best_place_stays_there(least, between):
    """Above A3 the plate varies as A3 does, and by more if A3 stands anywhere else."""
    found = tc.analyses.relocate(
        plate((50, 50, 10), 0.06), "plate.A3", between=between, least=least, samples=256, solver="daqp"
    )
    assert found["point"].values.tolist() == [[50, 50, 0]] * 2 and [50, 50, 0] in found["tried"].values.tolist()
    assert found["change"].values.tolist() == [0 if "ppm" in least else 1] * 3
    console = Console(file=io.StringIO(), width=120)
    console.print(analysis_text(RELOCATION, found))
    assert "No position between the corners is better: the locator stays where it is." in console.file.getvalue()


@pytest.mark.slow
def test_with_contact_and_a_scheme_on_faces():
    """RA1: a 3-2-1 scheme becomes six locators, and nothing else changes."""
    a = cases.model("ra1")
    found = tc.analyses.relocate(a, "base.A2", between=((50, 5, 0), (95, 5, 0)), least="corner height: 6 sigma", **FAST)
    program = compiled(a, solver="daqp")
    (block,) = tc.simulate_blocks(program, samples=2 * 4096, seed=1, start=4096, block=4096)
    estimate, lower, upper = found["reached"].sel(stage="before").values
    assert estimate == pytest.approx(6 * block.measured[:, 1, 0].std(ddof=1), rel=1e-9) and lower < estimate < upper
    own = program.nominal.parts[0].locators
    assert found["point"].sel(stage="before").values == pytest.approx(own.points[own.labels.index("base.A2")])
    assert found["reached"].sel(stage="after", interval="estimate") <= 1.02 * estimate


@pytest.mark.slow
def test_locators_of_a_scheme_stand_on_the_same_features():
    a = tc.Assembly("datum")
    part = a.part("plate", tc.Box(100, 50, 10), at=(7, 3, 1), rotation=(0.1, 0.2, 0.3))
    part.feature("side", part.face("-y"), datum="B")
    part.feature("foot", part.face("-z"), tc.Profile(0.2, "B"))
    scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5)
    a.locate(part, scheme, tolerance=0.0)
    a.measure("height", part.point(100, 50, 10), along="z", tolerance=1)
    program = compiled(a, solver="daqp")
    own = program.nominal.parts[0].locators
    k = own.labels.index("plate.A3")
    found = tc.analyses.relocate(a, "plate.A3", between=((40, 40, 0), (60, 45, 0)), least="height: 6 sigma", **FAST)
    (block,) = tc.simulate_blocks(program, samples=4096 * 2, seed=1, start=4096, block=4096)
    assert float(found["reached"][0, 0]) == pytest.approx(6 * block.measured[:, 1, 0].std(ddof=1), rel=1e-6)
    assert own.faces[k] is not None


def test_a_place_where_nothing_holds_the_part_is_passed_over():
    found = tc.analyses.relocate(plate(), "plate.A3", between=((50, 0, 0), (50, 50, 0)), least="height: 6 sigma", **QUICK)
    worst = found["tried_value"].values
    assert np.isinf(worst).any() and np.isfinite(float(found["reached"][1, 0]))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"locator": "plate.A9"}, 'no locator "plate.A9"; expected one of: plate.A1'),
        ({"between": ((0, 0), (1, 1))}, "expected two different corners"),
        ({"between": ((1, 1, 0), (1, 1, 0))}, "expected two different corners"),
        ({"least": "height: mean"}, 'least has "mean"; expected one of: 6 sigma, ppm'),
        ({"least": "depth: ppm"}, 'the measurement "depth"; expected one of: height'),
        ({"between": ((10, 0, 0), (50, 0, 0))}, "cannot stand anywhere"),
        ({"samples": 1}, "samples is 1"),
    ],
)
def test_what_cannot_be_is_refused(changed, said):
    options = {"locator": "plate.A3", "between": ((0, 20, 0), (100, 50, 0)), "least": "height: 6 sigma", **FAST, **changed}
    with pytest.raises(tc.OptionError, match=said):
        tc.analyses.relocate(plate(), options.pop("locator"), **options)


@pytest.mark.slow
def test_the_command_prints_places_json_and_csv(tmp_path):
    script = tmp_path / "plate.py"
    script.write_text("from tests.test_relocate import plate as assembly\n")
    options = ("relocate", script, "--locator", "plate.A3", "--from=0,50,0", "--to", "100,50,0", "--samples", "256")
    options = (*options, "--least", "height: 6 sigma", "--solver", "daqp")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "before: (50, 50, 0)" in done.stdout, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert json.loads(call(tmp_path, *options, "--json").stdout)["attrs"]["locator"] == "plate.A3"
    table = call(tmp_path, *options, "--csv").stdout.splitlines()
    assert table[0] == "x,y,z,value" and len(table) > 10
    assert "expected three numbers" in call(tmp_path, *options[:5], "--from=a,b,c", *options[5:]).stderr
