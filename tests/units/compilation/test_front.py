"""Insides of `compilation` under the claims of `tests/test_front.py`."""

from dataclasses import fields
from typing import get_args

from tolcontact.compilation.solvers import SOLVERS
from tolcontact.declaration import GeometricTolerance
from tolcontact.declaration.feature_tolerance import ToleranceOptions
from tolcontact.declaration.geometry import UNITS, Unit
from tolcontact.method import OBJECTIVES, ObjectiveName, Solver


def test_the_words_that_an_editor_offers_are_the_words_of_the_tables():
    literal, _ = get_args(Solver)
    assert get_args(literal) == tuple(SOLVERS)
    assert get_args(ObjectiveName) == tuple(OBJECTIVES)
    assert get_args(Unit) == tuple(UNITS)
    assert list(ToleranceOptions.__annotations__) == [field.name for field in fields(GeometricTolerance) if field.kw_only]
