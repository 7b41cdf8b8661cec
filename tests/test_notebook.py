"""What things show in a notebook, and what results are asked by name."""

import html
import re

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import compiled
from tests.test_report import data_of


@pytest.fixture(scope="module")
def results():
    return tc.run(compiled(cases.stack(), solver="daqp"), samples=200, seed=3, surfaces=0)


def scene_in(shown):
    """The scene of the page that is framed in what a thing shows."""
    return data_of(html.unescape(re.search(r'srcdoc="(.*?)" sandbox="allow-scripts"', shown, re.DOTALL)[1]))["scene"]


def test_models_and_programs_show_their_scene():
    model = cases.stack()
    for thing in (model, tc.build(model, solver="daqp")):
        shown = thing._repr_html_()
        assert str(thing).splitlines()[0] in shown
        assert [part["name"] for part in scene_in(shown)["parts"]] == [part.name for part in model.parts]


def test_a_model_with_faults_shows_them():
    model = cases.stack()
    model.part("broken <b>", tc.Mesh("nowhere.stl"))
    shown = model._repr_html_()
    assert "nowhere.stl" in shown and "<b>" not in shown.split("<iframe")[0] and len(scene_in(shown)["parts"]) == 3


@pytest.mark.slow
def test_results_show_figures_and_the_report(results):
    shown = results.tolcontact._repr_html_()
    assert shown.index("<table class=") < shown.index("<iframe") and len(scene_in(shown)["realizations"]["names"]) == 200


def test_a_summary_shows_tables_and_a_selection_of_it_what_xarray_shows(results):
    summary = results.tolcontact.summary()
    assert summary.identical(tc.summarize(results)) and isinstance(summary, xr.Dataset)
    assert "touched by contact" in summary._repr_html_() and "<table class=" in summary._repr_html_()
    for selected in (summary.sel(measure="top"), summary[["touched"]], summary.isel(state=0)):
        assert "touched by contact" not in selected._repr_html_() and len(selected._repr_html_()) > 100


def test_results_are_asked_by_name(results):
    field = results.tolcontact.field("upper")
    assert np.array_equal(field.six_sigma, results["field/upper"].six_sigma) and {*field.coords} <= {*field.dims}
    one = results.tolcontact.realization(17)
    assert np.array_equal(one.measured, results.measured[17]) and np.array_equal(one.deviation, results["sample/deviation"][17])
    assert one.status_meaning == tc.Status(int(results.status[17])).name.lower() and int(one.realization) == 17
    touched = results.tolcontact.where_status("resolved")
    assert touched.realization.values.tolist() == np.flatnonzero(results.status == tc.Status.RESOLVED).tolist()
    assert touched["sample/deviation"].shape[0] == touched.sizes["realization"]
    assert results.tolcontact.where_status(tc.Status.DOUBTFUL).sizes["realization"] == 0
    assert tc.plot.histogram(results, "top").get_xlabel() == "top [mm]"


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda of: of.field("lower"), "expected one of: bottom, middle, upper"),
        (lambda of: of.realization(200), "expected 0 to 199"),
        (lambda of: of.realization(-1), "expected 0 to 199"),
        (lambda of: of.where_status("lost"), "expected one of: untouched"),
        (lambda of: of.where_status(9), "expected one of: untouched"),
    ],
)
def test_what_results_do_not_have_is_said(ask, said, results):
    with pytest.raises(tc.OptionError, match=said):
        ask(results.tolcontact)


def test_archives_that_xarray_opens_have_the_verbs_too(archive):
    with xr.open_datatree(archive) as results:
        assert results.tolcontact.summary().attrs["realizations"] == 300
