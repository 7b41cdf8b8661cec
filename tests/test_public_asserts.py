"""The public asserts pass where they should, and say what is wrong where they should not."""

from functools import cache, partial

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import EXACT, FIXED, SEATED, compiled
from tolcontact.errors import OptionError
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import Status


@cache
def run_of(make, method):
    """A run of a model. Copy it to change it."""
    return tc.run(compiled(make(), solver="daqp", method=method), samples=20, seed=3)


@pytest.fixture
def results(archive):
    """Realizations in memory, to be tampered with."""
    with tc.open_archive(archive) as tree:
        return tree.load()


@pytest.mark.slow
def test_a_run_that_is_whole_passes(archive, results):
    assert_resolved(archive)
    assert_gaps_recompute(str(archive))
    assert_same_run(archive, results)


def test_realizations_that_are_not_resolved_are_counted_by_status(results):
    results["status"].values[[5, *range(20, 27)]] = [Status.DOUBTFUL, *[Status.NOT_CONVERGED] * 7]
    with pytest.raises(AssertionError) as failed:
        assert_resolved(results)
    assert str(failed.value) == (
        "8 of 300 realizations are not resolved: "
        "not_converged 7 (realization 20, 21, 22, 23, 24, ...), doubtful 1 (realization 5)"
    )


def part_of(results, some):
    """Some realizations of a run."""
    return results.map_over_datasets(lambda group: group.isel(realization=some) if "realization" in group.dims else group)


def test_realizations_keep_their_numbers_in_a_part_of_a_run(results):
    results["status"].values[105] = Status.DOUBTFUL
    with pytest.raises(AssertionError, match=r"1 of 100 .* doubtful 1 \(realization 105\)"):
        assert_resolved(part_of(results, slice(100, 200)))


@pytest.mark.parametrize(("name", "where"), [("translation", (7, 1, 2)), ("contact/reference_point", 5), ("gap_min", 7)])
@pytest.mark.parametrize("method", [FIXED, EXACT], ids=["fixed", "bounded"])
def test_gaps_that_are_not_those_of_the_points_are_told_with_their_place(name, where, method):
    if method is EXACT and name == "contact/reference_point":
        pytest.skip("places where faces end do not follow from contact points")
    results = run_of(cases.stack, method).copy(deep=True)
    results[name].values[where] += 1e-6
    place = r'realization \d+, (raw|corrected), contact pair "(lower|upper) joint"'
    with pytest.raises(AssertionError, match=rf'"gap_min" is not .* by .*e-0\d mm in {place}; 1e-09 mm are allowed'):
        assert_gaps_recompute(results)
    assert_gaps_recompute(results, within=1e-4)


def test_a_gap_that_is_no_number_is_told(results):
    results["gap_min"].values[7, 1, 1] = np.nan
    with pytest.raises(AssertionError, match=r'by inf mm in realization 7, corrected, contact pair "upper joint"'):
        assert_gaps_recompute(results)


def test_gaps_of_points_that_are_not_archived_are_passed_over(results):
    results["gap_min"].values[7] += 1
    results["searched"].values[7] = 1
    assert_gaps_recompute(results)


@pytest.mark.parametrize(("keep", "lost"), [("measures", "rotation"), ("poses", "deviation")])
def test_gaps_are_not_computed_without_poses_and_the_deviations_of_supports(keep, lost):
    table = tc.run(compiled(cases.table(), solver="daqp", method=SEATED), samples=20, keep=keep)
    with pytest.raises(AssertionError, match=rf'"{lost}", which was not kept'):
        assert_gaps_recompute(table)


def test_gaps_of_supports_are_less_by_their_deviations():
    table = run_of(cases.table, SEATED).copy(deep=True)
    assert_gaps_recompute(table)
    table["sample/deviation"].values[3] -= 0.1
    with pytest.raises(AssertionError, match=r'by 0.1 mm in realization 3, .*, contact pair "supports of plate"'):
        assert_gaps_recompute(table)


def test_the_first_variable_and_realization_that_differ_are_named(results, archive):
    results["measured"].values[[17, 19], 1, 0] = [0.1, np.nan]
    results["sample/deviation"].values[2] += 1e-17
    results["sample/deviation"].values[3, 0] = 0.5
    with pytest.raises(AssertionError) as failed:
        assert_same_run(results, archive)
    said = str(failed.value)
    assert said.startswith(
        'the runs differ in 2 variables; first in "measured", realization 17, state corrected, measure top: '
    )
    assert said.endswith(" (2 of 300 realizations differ)")
    assert_same_run(results, archive, variables=["status", "gap_min"])


def test_the_last_bit_counts_and_nan_equals_nan(results):
    other = results.copy(deep=True)
    for tree in (results, other):
        tree["measured"].values[4] = np.nan
    assert_same_run(results, other)
    other["gap_min"].values[9, 0, 1] = np.nextafter(other["gap_min"].values[9, 0, 1], 1)
    with pytest.raises(
        AssertionError, match=r'in 1 variable; first in "gap_min", realization 9, state raw, pair upper joint: '
    ):
        assert_same_run(results, other)


@pytest.mark.slow
def test_runs_of_other_models_or_sizes_are_not_the_same(archive, results):
    with pytest.raises(AssertionError, match=r"labels of part differ: \['bottom', 'middle', 'upper'\] and \['base', 'top'\]"):
        assert_same_run(archive, run_of(partial(cases.ra1, points=9), None))
    fewer = tc.run(compiled(cases.stack(), solver="daqp"), samples=20, seed=3, keep="poses")
    with pytest.raises(AssertionError, match="300 and 20 realizations"):
        assert_same_run(archive, fewer)
    with pytest.raises(AssertionError, match='in 1 variable; first in "deviation", which only one of them keeps'):
        assert_same_run(part_of(results, slice(20)), fewer)


def test_what_is_no_run_is_refused(results):
    for wrong in (xr.Dataset(), None, 7):
        for judge in (assert_resolved, assert_gaps_recompute, lambda one: assert_same_run(results, one)):
            with pytest.raises(OptionError, match=r"results are a .*; expected what tc.run or tc.open_archive returns"):
                judge(wrong)
    with pytest.raises(OptionError, match="no realization has 'measure'; expected some of: measured, "):
        assert_same_run(results, results, variables=["measure"])
