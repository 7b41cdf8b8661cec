"""Insides of `contact` under the claims of `tests/test_certified_residuals.py`."""

import numpy as np
import pytest

from tolcontact.contact.resolver import checked_residual
from tolcontact.contact.state import State


def test_penetration_does_not_excuse_locators_that_do_not_hold():
    """Where locators are off by more than a solver's accuracy, the penetration that was allowed for them counts, too."""
    depth = np.array([1e-3, 0, 0, 0])
    poses = np.zeros((4, 1, 12))
    state = State.start(poses, poses, 2, [])
    state.kkt_residual[:], state.astray[:], state.slack[:] = [0, 1e-12, 0, 0.5], [0, 1e-13, 2e-4, 2e-4], 0.3
    assert checked_residual(state, depth) == pytest.approx([1e-3, 1e-12, 0.3002, 0.5])
