"""Insides of `analyses` under the claims of `tests/test_form.py`."""

from tests.cases.seats import seat
from tests.helpers import compiled
from tolcontact.analyses.analysis import owners


def test_the_modes_of_a_form_contribute_as_one():
    program = compiled(seat())
    assert list(dict.fromkeys(owners(program, "contributor"))) == [
        *(f"block.{name}" for name in ("Z0", "Z1", "Z2", "X", "Y1", "Y2")),
        "block.under.form",
    ]
    assert set(owners(program, "feature")[6:]) == {"block.under"}
