"""Insides of `geometry` under the claims of `tests/test_second_reading.py`."""

from dataclasses import replace

import pytest

import tolcontact as tc
from tests.kernel_annotations import KernelItems, kernel_annotations
from tests.second_reading import compare
from tests.test_second_reading import write
from tolcontact.geometry.step_listing import faces_of_records


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("cover") / "cover.stp")


@pytest.fixture(scope="module")
def kernel(path):
    return kernel_annotations(path)


def test_faces_that_differ_have_the_numbers_of_the_listing(path, kernel):
    tolerances = (replace(kernel.tolerances[0], items=KernelItems(frozenset(), 0)), kernel.tolerances[1])
    first, *_ = compare(tc.io.read_pmi(path), replace(kernel, tolerances=tolerances), faces_of_records(path)).differences
    assert str(first) == "tolerance 1: faces 1, kernel none"
