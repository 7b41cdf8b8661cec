"""Insides of `variation` under the claims of `tests/test_contributors.py`."""

from tests.test_contributors import draws_of, with_everything
from tolcontact.variation.plans import STREAM


def test_draws_do_not_depend_on_blocks():
    whole = draws_of(with_everything(), 0, 3 * STREAM)
    for start, stop in ((0, 1), (1000, 1003), (STREAM - 2, STREAM + 3), (2 * STREAM, 3 * STREAM)):
        part = draws_of(with_everything(), start, stop)
        for label, values in part.items():
            assert (values == whole[label][start:stop]).all(), label
