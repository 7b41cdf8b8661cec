"""Where and how often contact is, against closed forms and the rows themselves."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly
from tests.test_report import data_of
from tolcontact.report import write_page
from tolcontact.statistics import touching
from tolcontact.vocabulary import TOUCHING_GAP


def test_figures_are_those_of_the_rows():
    results = tc.run(compiled(cases.stack(), solver="daqp"), samples=400, seed=2, surfaces=0, fields="none")
    summary = tc.summarize(results)
    reaction, carries = results["reaction"].values, results["carrying"].values > 0
    of = summary["reaction"].sel(interval="estimate")
    assert of.sel(of_reaction="mean").values == pytest.approx(reaction.mean(axis=0))
    assert of.sel(of_reaction="95 %").values == pytest.approx(np.percentile(reaction, 95, axis=0))
    assert summary["carried"].sel(interval="estimate").values == pytest.approx(carries.mean(axis=0))
    together = summary["together"].sel(interval="estimate")
    assert float(together.sum()) == pytest.approx(1)
    assert float(together.sel(combination="lower joint + upper joint")) == pytest.approx(carries.all(axis=1).mean())
    if "none" in together["combination"]:
        assert float(together.sel(combination="none")) == pytest.approx((~carries.any(axis=1)).mean())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["door", *nightly("lid")])
def test_points_touch_where_the_least_gap_is_closed(name):
    """A pair whose least gap is closed has a point that touches, and no other has."""
    results = tc.run(compiled(cases.MODELS / f"{name}.py", solver="daqp"), samples=40, seed=3, surfaces=0)
    found, held = touching(results), results["searched"].values == 0
    assert found.attrs["realizations"] == held.sum()
    closed = (results["gap_min"].values[held, 1] < TOUCHING_GAP).mean(axis=0)
    for pair, share in zip(results["pair"].values, closed, strict=True):
        own = found["touching"].sel(interval="estimate").values[found["pair"].values == pair]
        known = own[np.isfinite(own)]
        assert known.max(initial=0) <= share + 1e-12 and known.sum() >= share - 1e-12


def test_archives_without_poses_say_nothing_of_points():
    results = tc.run(compiled(cases.stack(), solver="daqp"), samples=30, keep="measures", surfaces=0)
    found = touching(results)
    assert found.attrs["realizations"] == 0 and np.isnan(found["touching"]).all()
    assert int(results["contact/touching_realizations"]) == 0 and np.isnan(results["contact/touching"]).all()


@pytest.mark.slow
def test_the_page_shows_where_contact_is(tmp_path, open_page):
    results = tc.run(compiled(cases.ra1(), solver="daqp"), samples=200, surfaces=0)
    write_page(results, tc.summarize(results), tmp_path / "ra1.html")
    opened = open_page(tmp_path / "ra1.html")
    opened.select_option("#field", "touching")
    shares = touching(results)["touching"].sel(interval="estimate").values
    assert float(opened.locator("#high").inner_text()) == pytest.approx(shares.max(), rel=1e-3)
    assert opened.locator("#units").inner_text() == "of realizations" and opened.evaluate("viewer.pairs[0].map.visible")
    drawn = opened.evaluate("Array.from(viewer.pairs[0].points.geometry.getAttribute('color').array.slice(0, 3))")
    table = opened.evaluate("TABLES.get(VIRIDIS)")
    assert drawn == pytest.approx(table[round(255 * shares[0] / shares.max())], abs=0.01)
    opened.select_option("#field", "reaction")
    mean = float(tc.summarize(results)["reaction"].sel(of_reaction="mean", interval="estimate").values[0])
    assert float(opened.locator("#high").inner_text()) == pytest.approx(mean, rel=1e-3)
    assert data_of((tmp_path / "ra1.html").read_text())["scene"]["reactionUnits"] == opened.locator("#units").inner_text()
    opened.select_option("#field", "sixSigma")
    assert opened.evaluate("viewer.pairs[0].material.vertexColors") is False
