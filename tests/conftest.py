"""Fixtures of several test modules."""

import pytest

import tolcontact as tc
from tests import cases


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """An archive of 300 realizations of the stack. Copy it to change it."""
    path = tmp_path_factory.mktemp("archive") / "stack.nc"
    tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=path).close()
    return path
