"""Pages of assemblies with stations: one scene for each, and a play that goes through them."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases import stations as cases
from tests.helpers import compiled
from tests.test_report import data_of, unpacked
from tolcontact.discretization import discretize
from tolcontact.report import write_page, write_view

SCENES = {"weld": ([0, 1], ["lap"], ["step"]), "check": ([0, 1, 2], [], ["flush"])}


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    model = cases.rail()
    results = tc.run(compiled(model, solver="daqp"), samples=60, seed=1, surfaces=0)
    write_page(results, tc.summarize(results), folder / "report.html")
    write_view(model, discretize(model), [], folder / "view.html")
    return folder


@pytest.mark.parametrize("kind", ["report", "view"])
def test_a_page_has_one_scene_for_each_station(kind, pages):
    scenes = data_of((pages / f"{kind}.html").read_text(encoding="utf-8"))["scene"]["stations"]
    assert {s["name"]: (s["parts"], s["contacts"], s["measures"]) for s in scenes} == SCENES
    assert [len(scene["locators"]) for scene in scenes] == [12, 12]
    assert all(label.startswith(f"{scene['name']}.") for scene in scenes for label in scene["locators"])
    assert kind == "view" or all(scene["motions"]["shape"][1:] == [2, 3, 12] for scene in scenes)


def test_worst_cases_stand_in_their_stations(tmp_path):
    """The scene of a station has the poses of worst cases: those that give the measure again, of the last station too."""
    path, model = tmp_path / "rail.nc", cases.rail()
    tc.run(compiled(model, solver="daqp"), samples=20, seed=1, surfaces=0, out=path).close()
    worst = tc.analyses.worst_case(model, samples=64, solver="daqp", into=path)
    with tc.open_archive(path) as tree:
        write_page(tree, tc.summarize(tree), tmp_path / "report.html")
    scenes = data_of((tmp_path / "report.html").read_text(encoding="utf-8"))["scene"]["stations"]
    motions = {scene["name"]: unpacked(scene["motions"])[: worst.sizes["case"]] for scene in scenes}
    assert np.isfinite(motions["weld"]).all() and not motions["weld"][:, :, 2].any()  # the station does not hold part c
    case, point = worst["case"].values.tolist().index("largest step"), np.array([60.0, 10.0, 10.0])
    moved = motions["weld"][case, 1, :2]
    a_up, b_up = (motion[:9].reshape(3, 3) @ point + motion[9:] for motion in moved)
    assert b_up[2] - a_up[2] == pytest.approx(
        float(worst["worst"].sel(measure="step", state="corrected", end="largest")), abs=1e-5
    )
    last = [worst[name].values for name in ("rotation", "translation")]
    assert motions["check"][..., 9:] == pytest.approx(last[1], abs=1e-6)


@pytest.mark.slow
def test_the_station_is_chosen_and_a_play_goes_through_all(pages, open_page):
    opened = open_page(pages / "report.html", 1280)
    visible = "window.viewer.parts.map((part) => part.group.visible)"
    assert opened.evaluate(visible) == [True, True, True]
    opened.select_option("#station", "0")
    assert opened.evaluate(visible) == [True, True, False]
    assert opened.evaluate("window.viewer.pairs[0].points.visible")
    opened.locator("#play").click()
    shown = set()
    for _ in range(400):
        shown.add((opened.locator("#station").input_value(), opened.locator("#which").input_value()))
        of_both = {which for station, which in shown if station == "0"} & {which for station, which in shown if station == "1"}
        if len(of_both) >= 2:  # a busy machine does not see each
            break
        opened.wait_for_timeout(50)
    assert len(of_both) >= 2
    opened.locator("#play").click()
