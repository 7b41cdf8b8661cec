"""Insides of `geometry` under the claims of `tests/test_second_reading.py`."""

from dataclasses import replace

import tolcontact as tc
from tests.kernel_annotations import KernelItems, kernel_annotations
from tests.second_reading import compare
from tests.test_second_reading import write
from tolcontact.geometry.listing import faces_of_records


def test_faces_that_differ_have_the_numbers_of_the_listing(tmp_path):
    path = write(tmp_path / "cover.stp")
    kernel = kernel_annotations(path)
    tolerances = (replace(kernel.tolerances[0], items=KernelItems(frozenset(), 0)), kernel.tolerances[1])
    first, *_ = compare(tc.io.read_pmi(path), replace(kernel, tolerances=tolerances), faces_of_records(path)).differences
    assert str(first) == "tolerance 1: faces 1, kernel none"
