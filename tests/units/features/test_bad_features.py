"""Insides of `features` under the claims of `tests/test_bad_features.py`."""

import tolcontact as tc
from tests.test_guide import GUIDE
from tolcontact.declaration.feature_tolerance import KINDS
from tolcontact.features.tolerance_kinds import FORMS, ZONES


def test_every_tolerance_kind_has_a_zone_a_public_name_and_a_place_in_the_guide():
    assert set(ZONES) == set(KINDS.values())
    assert set(FORMS) == {kind for kind in KINDS.values() if not kind.needs_datums}
    chapter = (GUIDE / "features.md").read_text(encoding="utf-8")
    for kind in KINDS.values():
        assert getattr(tc, kind.name) is kind and f"`tc.{kind.name}" in chapter
