"""What a summary says, against figures worked out by hand from a few rows."""

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

import tolcontact as tc
from tests import cases
from tests.helpers import compiled
from tolcontact.errors import ArchiveError
from tolcontact.report import summary_text

UNTOUCHED, RESOLVED, NOT_CONVERGED, NOT_ASSEMBLABLE, DOUBTFUL = range(5)


@pytest.fixture(scope="module")
def run():
    """A stack of three plates: a measure with the nominal value 0, and one, a distance, with another."""
    a = cases.stack()
    upper, bottom = a.parts[-1], a.parts[0]
    a.measure("thickness", bottom.point(0, 0, 10), to=upper.point(0, 0, 10), along="z", tolerance=1)
    a.measure("free", upper.point(0, 0, 10), along="x")
    with tc.run(compiled(a, solver="daqp"), samples=20) as results:
        return results.load()


def summary_of(run, **rows):
    """The summary of as many rows as are given, `name=(row, ...)`."""
    count = len(next(iter(rows.values())))
    some = run.isel(realization=slice(count)).copy()
    whole = some.to_dataset()
    for name, values in rows.items():
        whole[name] = whole[name].copy(data=np.array(values, dtype=whole[name].dtype))
    some.dataset = whole
    return tc.summarize(some)


def measured(run, measure, raw, corrected):
    """Rows in which one measure has given values, and the others their nominal ones."""
    values = np.tile(run["measure_nominal"].values, (len(raw), 2, 1))
    k = list(run["measure"].values).index(measure)
    values[:, 0, k], values[:, 1, k] = raw, corrected
    return values


def test_outside_tolerance_is_counted_around_the_nominal_value(run):
    """Nominally 20 mm, 1 mm wide: from 19.5 to 20.5, the limits included."""
    raw, corrected = [19.4, 19.5, 20.0, 20.5, 20.6, 20.7, 0.1, -0.2], [20.0] * 7 + [20.51]
    found = summary_of(run, measured=measured(run, "thickness", raw, corrected))["statistic_value"]
    shares = found.sel(measure="thickness", statistic="outside limits", interval="estimate")
    assert shares.values.tolist() == [5 / 8, 1 / 8]
    assert found.sel(measure="top", statistic="outside limits", interval="estimate").values.tolist() == [0, 0]
    assert np.isnan(found.sel(measure="free", statistic="outside limits").values).all()


def test_statistics_are_those_of_the_rows(run):
    raw, corrected = np.arange(10.0) * 2 - 9, np.arange(10.0)[::-1] + 3
    found = summary_of(run, measured=measured(run, "top", raw, corrected))
    values = found["statistic_value"].sel(measure="top", interval="estimate")
    # Of 0 ... 9 the variance is 10 * 11 / 12, percentiles lie evenly between the least and the largest.
    variance = 110 / 12
    for state, first, step in (("raw", -9, 2), ("corrected", 3, 1)):
        of = values.sel(state=state)
        assert of.sel(statistic="mean") == pytest.approx(first + 4.5 * step)
        assert of.sel(statistic="variance") == pytest.approx(variance * step**2)
        assert of.sel(statistic="standard deviation") == pytest.approx(np.sqrt(variance) * step)
        assert of.sel(statistic="6 sigma") == pytest.approx(6 * np.sqrt(variance) * step)
        for percent in (5, 50, 95):
            assert of.sel(statistic=f"{percent:g} %") == pytest.approx(first + 9 * step * percent / 100)
    change = found["change"].sel(measure="top", interval="estimate")
    assert change.sel(change_of="shift of the mean") == pytest.approx(7.5)
    assert change.sel(change_of="ratio of 6 sigma") == pytest.approx(0.5)
    assert change.sel(change_of="ratio of variance") == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("steps", "median", "largest"),
    [
        ([0, 0, 0, 0, 0, 1, 2, 9], 2, 9),
        ([0, 0, 0, 0, 0, 0, 3, 4], 3.5, 4),
        ([5, 1, 1, 7, 5, 6, 0, 0], 5, 7),
        ([8, 2, 2, 8], 5, 8),
        ([0, 0, 0], 0, 0),
    ],
)
def test_linear_steps_are_those_of_touched_realizations(steps, median, largest, run):
    found = summary_of(run, iterations=steps)["iterations"]
    assert found.sel(of_iterations="median") == median and found.sel(of_iterations="largest") == largest


def test_realizations_are_counted_by_what_became_of_them(run):
    status = [UNTOUCHED] * 3 + [RESOLVED] * 4 + [NOT_CONVERGED] + [NOT_ASSEMBLABLE] * 2
    gap = np.full((10, 2, 2), 0.5)
    gap[4, 1] = -3e-9, 0.1  # a residue is not a conflict
    gap[7, 1] = -0.3, -0.1  # nor is what did not converge
    gap[8, 1] = -0.2, 0.0
    gap[9, 1] = -0.05, -2e-8
    gap[2, 0] = 0.1, -0.7
    found = summary_of(run, status=status, gap_min=gap)
    assert found["by_status"].values.tolist() == [3, 4, 1, 2, 0]
    assert found["touched"].values[0] == 0.7
    # Exact interval of 7 among 10, from tables.
    assert found["touched"].values[1:] == pytest.approx([0.3475, 0.9333], abs=1e-4)
    assert found["not_assemblable"].values == pytest.approx([0.2, 0.0252, 0.5561], abs=1e-4)
    assert dict(zip(found["pair"].values, found["conflicts"].values, strict=True)) == {"lower joint": 2, "upper joint": 1}
    assert found["penetration"].sel(state="raw") == 0.7 and found["penetration"].sel(state="corrected") == 0.3
    assert found.attrs["realizations"] == found.attrs["samples"] == 10  # that somebody took


def test_realizations_that_cannot_be_assembled_are_out_of_specification_and_in_no_other_statistic(run):
    values, status = np.arange(10.0) / 100, [RESOLVED] * 10
    status[3] = status[8] = NOT_ASSEMBLABLE
    corrected, exists = np.where(np.equal(status, RESOLVED), values, 1e7), np.equal(status, RESOLVED)
    reaction = np.where(exists, 2.0, 1e7)[:, None] * [1.0, 3.0]
    found = summary_of(run, measured=measured(run, "top", values, corrected), status=status, reaction=reaction)
    estimates = found["statistic_value"].sel(measure="top", interval="estimate")
    assert estimates.sel(state="raw", statistic="mean") == pytest.approx(values.mean())
    assert estimates.sel(state="corrected", statistic="mean") == pytest.approx(values[exists].mean())
    assert estimates.sel(statistic="outside limits").values.tolist() == [0.0, 0.2]
    assert estimates.sel(state="corrected", statistic="above limit").item() == 0.0
    assert found["change"].sel(measure="top", change_of="shift of the mean", interval="estimate") == 0.0
    assert found["reaction"].sel(of_reaction="mean", interval="estimate").values.tolist() == [2.0, 6.0]


@pytest.mark.parametrize("wrong", [-2, 5, 6])
def test_a_status_without_a_meaning_is_damage(wrong, run):
    with pytest.raises(ArchiveError, match="some statuses are unknown"):
        summary_of(run, status=[RESOLVED, wrong, RESOLVED])


def test_the_smallest_range_is_that_of_a_locator_or_of_a_measure_in_mm(run):
    assert summary_of(run, iterations=[1, 1]).attrs["smallest_range"] == 1.0
    a = cases.one_dimensional(0)
    block = a.parts[1]
    a.measure("tilt", lambda poses: poses.rotation(block)[2, 0], units="rad", tolerance=0.01)
    with tc.run(compiled(a, solver="daqp"), samples=5) as results:
        assert tc.summarize(results).attrs["smallest_range"] == 6.0


def test_the_summary_of_an_interrupted_run_says_for_how_many_realizations_it_was_begun(run):
    interrupted = run.isel(realization=slice(3)).copy()
    interrupted.attrs["realizations"] = 3
    found = tc.summarize(interrupted)
    assert found.attrs["realizations"] == 3 and found["by_status"].values.sum() == 3
    assert found.attrs["samples"] == 20


def test_fields_are_told_where_they_are_least_and_largest(run):
    found, field = tc.summarize(run)["field_extreme"], run["field/upper"].to_dataset()
    for state in ("raw", "corrected"):
        size = field["six_sigma"].sel(state=state, component="magnitude").values
        bounds = field["magnitude_six_sigma_interval"].sel(state=state).values
        for extreme, k in (("least", size.argmin()), ("largest", size.argmax())):
            told = found.sel(part="upper", state=state, extreme=extreme).values
            assert told.tolist() == [size[k], *bounds[k]]
    assert tc.summarize(run)["field_realizations"] == 20


def test_what_is_checked_against_surfaces_is_told(run):
    surface = run["surface"].to_dataset()
    deep, beside = (surface[name].copy(deep=True) for name in ("surface_penetration", "beside"))
    rows = surface["realization_checked"].values
    deep[:], beside[:] = np.nan, np.nan
    deep[0, 1], deep[1, 0], beside[1, 1] = 0.2, 0.1, 3.0
    changed = run.copy()
    changed["surface"] = xr.DataTree(surface.assign(surface_penetration=deep, beside=beside))
    found = tc.summarize(changed)
    assert float(found["surface_penetration"]) == 0.2 and float(found["beside"]) == 3.0
    assert int(found["surfaces_checked"]) == (rows != -1).sum()


def test_parts_that_do_not_move_have_no_row_of_fields():
    a = tc.Assembly("stand")
    a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Box(50, 25, 10), at=(20, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.2)
    a.measure("height", block.point(50, 0, 10), along="z")
    console = Console(width=100)
    with console.capture() as printed:
        console.print(summary_text(tc.summarize(tc.run(compiled(a, solver="daqp"), samples=20))))
    _, _, fields = printed.get().partition("6 sigma of the displacement magnitude")
    fields, _, _ = fields.partition("\ncontact\n")
    assert "block" in fields and "table" not in fields
