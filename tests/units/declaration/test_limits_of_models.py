"""Insides of `declaration` under the claims of `tests/test_limits_of_models.py`."""

import pytest

import tolcontact as tc
from tolcontact.declaration.script import MAX_BYTES


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "m.json").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(tc.errors.ScriptError, match=f"expected at most {MAX_BYTES}"):
        tc.build(tmp_path / "m.json")
