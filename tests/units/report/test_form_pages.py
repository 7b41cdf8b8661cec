"""Form and the gap that it leaves on the page of a run."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases.seats import seat
from tests.helpers import SEATED
from tests.test_report import data_of
from tolcontact.report import write_page
from tolcontact.report.html.form_scene import SingleStates


@pytest.fixture(scope="module")
def results():
    model = seat(tc.Form(modes=6))
    model.measure("largest", tc.LargestGap(model.parts[1].face("-z"), model.parts[0].face("+z")))
    return tc.run(model, samples=12, solver="daqp", method=SEATED, surfaces=0)


def test_gaps_of_a_page_are_those_of_the_archive(results):
    states = SingleStates(results, np.array([7, 2]))
    gaps = states.gaps(0)
    np.testing.assert_allclose(gaps.min(axis=2), results["gap_min"].values[[7, 2], :, 0], atol=2e-5)
    assert states.gaps(1) is None  # of supports


@pytest.mark.slow
def test_a_page_shows_form_and_the_gap_that_is_left(results, tmp_path, open_page):
    write_page(results, tc.summarize(results), tmp_path / "seat.html")
    opened = open_page(tmp_path / "seat.html")
    opened.select_option("#field", "gapsLeft")
    name = data_of((tmp_path / "seat.html").read_text())["scene"]["realizations"]["names"][0]
    row = int(name.split()[1])
    largest = float(results["measured"].sel(measure="largest", state="corrected").values[row])
    assert float(opened.locator("#high").inner_text()) == pytest.approx(largest, rel=0.02)
    opened.select_option("#factor", "1000")
    depth = "Math.min(...viewer.parts[1].mesh.geometry.getAttribute('position').array.filter((_, k) => k % 3 === 2))"
    form = next(SingleStates(results, np.array([row])).forms("block", *(
        results["field/block"][name].values for name in ("vertices", "faces")
    )))  # fmt: skip
    assert opened.evaluate(depth) == pytest.approx(-1000 * (form["coefficients"] @ form["modes"].T).max(), rel=1e-4)
    opened.uncheck("#single")
    assert opened.evaluate(depth) == 0
    assert not opened.locator("#bar").is_visible()
