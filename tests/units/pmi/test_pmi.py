"""Insides of `pmi` under the claims of `tests/test_pmi.py`."""

import time

import pytest

from tolcontact.errors import OptionError
from tolcontact.pmi.part21 import Records


@pytest.mark.parametrize("text", ["#1=", "'", "/*", "/", "#1=A((", "(", "#1", "1", "#1=A('';", "'/*'"])
def test_no_text_takes_more_than_linear_time(text):
    start = time.process_time()
    with pytest.raises(OptionError, match="is cut off"):
        Records(b"ISO-10303-21;" + text.encode() * 300_001, "a.stp")
    assert time.process_time() - start < 5
