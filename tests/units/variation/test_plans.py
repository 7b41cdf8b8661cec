"""Insides of `variation` under the claims of `tests/test_plans.py`."""

import numpy as np
import pytest
from scipy import stats

from tests.test_plans import LABELS, STRATIFIED
from tolcontact.variation.plans import planned_numbers
from tolcontact.vocabulary import PLANS, REPLICATE


@pytest.mark.parametrize("name", STRATIFIED)
def test_each_replicate_fills_all_classes_of_each_contributor_once(name):
    numbers = planned_numbers(name, LABELS, 7, 0, 5 * REPLICATE)
    for label in LABELS:
        classes = np.floor(numbers(label).reshape(5, REPLICATE) * REPLICATE)
        assert (np.sort(classes, axis=1) == np.arange(REPLICATE)).all()
    firsts = [numbers(label).reshape(5, REPLICATE)[:, 0] for label in LABELS]
    assert len(np.unique(firsts)) == 15  # replicates and contributors differ


@pytest.mark.parametrize("name", PLANS)
def test_a_number_depends_on_seed_label_and_realization_alone(name):
    everything = planned_numbers(name, LABELS, 5, 0, 3000)
    for start, stop in ((0, 1), (7, 20), (255, 257), (256, 512), (1000, 2901)):
        some = planned_numbers(name, LABELS[::-1], 5, start, stop)
        assert all((some(label) == everything(label)[start:stop]).all() for label in [*LABELS, "beside"])
    assert (planned_numbers(name, LABELS, 6, 0, 100)("part.A1") != everything("part.A1")[:100]).all()


@pytest.mark.parametrize("name", PLANS)
def test_single_numbers_are_uniform_and_contributors_independent(name):
    numbers = planned_numbers(name, LABELS, 3, 0, 40 * REPLICATE)
    x = np.column_stack([numbers(label) for label in LABELS])
    assert 0 < x.min() and x.max() < 1
    for column in x[::7].T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(x.T) - np.eye(3)).max() < 4 / np.sqrt(len(x))
