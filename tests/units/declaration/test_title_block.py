"""Insides of `declaration` under the claims of `tests/test_title_block.py`."""

import tolcontact as tc
from tolcontact.declaration.title_block import title_block_of


def test_attributes_without_a_block_have_an_empty_one():
    assert title_block_of({"title": "variation simulation of x"}) == tc.TitleBlock()
