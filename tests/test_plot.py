"""Pictures by code: what they show is what the archive says."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import compiled
from tolcontact import vocabulary as terms


@pytest.fixture(scope="module")
def results():
    return tc.run(compiled(cases.ra1(), solver="daqp"), samples=300, seed=2, surfaces=0)


def test_a_histogram_has_all_realizations_and_the_limits(results):
    axes = tc.plot.histogram(results, "corner height", bins=40)
    for container, state in zip(axes.containers, ("raw", "corrected"), strict=True):
        values = results["measured"].sel(state=state, measure="corner height").values
        edges = np.array([patch.get_x() for patch in container])
        heights = np.array([patch.get_height() for patch in container])
        assert heights.sum() == pytest.approx(100) and len(heights) == 40
        assert np.average(edges + container[0].get_width() / 2, weights=heights) == pytest.approx(values.mean(), abs=0.1)
        (curve,) = (line for line in axes.lines if line.get_label() == f"normal, {terms.WORD_OF_STATE[state]}")
        normal = stats.norm(values.mean(), values.std(ddof=1)).pdf(curve.get_xdata())
        assert curve.get_ydata() == pytest.approx(100 * container[0].get_width() * normal)
    limits = [line.get_xdata()[0] for line in axes.lines if line.get_label() == "_limit"]
    assert limits == [-0.5, 0.5] and axes.get_xlabel() == "corner height [mm]"


def test_one_state_is_drawn_alone(results):
    axes = tc.plot.histogram(results, states=["corrected"])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["with contact", "normal, with contact"]


@pytest.mark.slow
@pytest.mark.parametrize("component", ["magnitude", "z"])
@pytest.mark.parametrize("statistic", ["mean", "6 sigma"])
def test_a_field_is_that_of_the_archive_on_one_scale_for_both_states(results, statistic, component, drawing):
    plotter = tc.plot.field(results, statistic, component=component, state="raw")
    name = {"mean": "mean", "6 sigma": "six_sigma"}[statistic]
    drawn = [mesh for mesh in plotter.meshes if "field" in mesh.point_data and mesh.n_lines == 0]  # edges have it, too
    every = [results[f"field/{part}"][name].sel(component=component) for part in ("base", "top")]
    for mesh, field in zip(drawn, every, strict=True):
        assert np.array_equal(mesh["field"], field.sel(state="raw"))
    (bar,) = plotter.scalar_bars.values()
    low, high = bar.GetLookupTable().GetTableRange()
    largest = max(float(abs(field).max()) for field in every)
    assert high == pytest.approx(largest)
    assert low == pytest.approx(-largest if (statistic, component) == ("mean", "z") else min(float(f.min()) for f in every))
    picture = plotter.screenshot(return_img=True)
    assert (picture != 255).any(axis=-1).mean() > 0.05
    plotter.close()


def test_a_realization_is_drawn_where_its_poses_place_it(results, drawing):
    plotter = tc.plot.assembly(results, realization=7, state="raw", marks=False)
    at = {"realization": 7, "state": "raw", "part": "top"}
    vertices = results["field/top"].vertices.values
    expected = vertices @ results["rotation"].sel(at).values.T + results["translation"].sel(at).values
    assert any(mesh.points.shape == expected.shape and np.abs(mesh.points - expected).max() < 1e-4 for mesh in plotter.meshes)
    plotter.close()


def test_results_and_models_have_the_same_marks(results, drawing):
    drawn = [tc.plot.assembly(of) for of in (results, cases.ra1())]
    sizes = [sorted(mesh.n_points for mesh in plotter.meshes) for plotter in drawn]
    assert sizes[0] == sizes[1] and 202 in sizes[0]
    [plotter.close() for plotter in drawn]


@pytest.mark.parametrize(
    ("draw", "said"),
    [
        (lambda r: tc.plot.histogram(r, "height"), "expected one of: corner height"),
        (lambda r: tc.plot.histogram(r, states=["final"]), "expected some of: raw, corrected"),
        (lambda r: tc.plot.field(r, "median"), "expected one of: mean, 6 sigma"),
        (lambda r: tc.plot.field(r, component="w"), "expected one of: x, y, z, magnitude"),
        (lambda r: tc.plot.assembly(r, realization=300), "expected 0 to 299"),
        (lambda r: tc.plot.assembly(r, realization=1, state="first"), "expected one of: raw, corrected"),
        (lambda r: tc.plot.assembly(cases.ra1(), realization=1), "a declared model has no realizations"),
    ],
)
def test_what_cannot_be_drawn_is_said(draw, said, results, drawing):
    with pytest.raises(tc.OptionError, match=said):
        draw(results)


def test_two_states_are_drawn_into_one_picture(results, drawing):
    plotter = tc.plot.assembly(results, realization=7, state="raw", marks=False)
    before = len(plotter.renderer.actors)
    assert tc.plot.assembly(results, realization=7, state="corrected", marks=False, plotter=plotter) is plotter
    assert len(plotter.renderer.actors) == 2 * before
    plotter.close()
