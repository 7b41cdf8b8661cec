"""Insides of `variation` under the claims of `tests/test_form_zones.py`."""

import numpy as np
import pytest

from tests.helpers import nightly
from tests.test_form_zones import FORMS, SHARE, count_inside, field_of
from tolcontact.features.minimum_zone import minimum_widths
from tolcontact.variation.spreads import equal_form_spread


@pytest.mark.parametrize(("form", "count"), [(FORMS[0], 60_000), *nightly(*((form, 200_000) for form in FORMS))], ids=str)
def test_a_stated_share_of_faces_lies_inside(form, count):
    field, width = field_of(form), 0.05
    spread = equal_form_spread(field, width)
    rng, inside, modes = np.random.default_rng(7), 0, field.heights(field.places).T
    for _ in range(count // 2000):
        inside += int((minimum_widths(field.zone, spread * rng.normal(size=(2000, field.modes)) @ modes) <= width).sum())
    lower, upper = count_inside(inside, count)
    assert lower < SHARE < upper
