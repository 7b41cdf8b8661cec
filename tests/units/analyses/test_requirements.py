"""Requirements and goals of searches count realizations that cannot be assembled as summaries do."""

from dataclasses import replace

import numpy as np
import pytest

from tolcontact.analyses.relocate import goal_estimate
from tolcontact.analyses.requirements import Corrected, Requirement
from tolcontact.limits import Limits
from tolcontact.vocabulary import Status


def test_they_are_outside_limits_and_a_ppk_leaves_them_out():
    values, status = np.tile([[-0.1], [0.1]], (50, 1)), np.repeat([Status.RESOLVED, Status.NOT_ASSEMBLABLE], 50)
    values[50:] = 0.5
    corrected, every = Corrected(values, status), Corrected(values, np.full(100, Status.RESOLVED))
    share, ppk = (Requirement("x", 0, Limits(-0.3, 0.3), is_share, 0.4) for is_share in (True, False))
    assert share.estimate(corrected).value == share.estimate(every).value == 0.5 and share.margin(corrected) < 0
    share = replace(share, limits=Limits(-1.0, 1.0))
    assert share.margin(corrected) < 0 < share.margin(every) and share.sure_margin(corrected) < 0
    assert ppk.estimate(corrected).value == ppk.estimate(every.take(np.arange(50))).value != ppk.estimate(every).value


def test_they_are_outside_limits_at_each_position_of_a_locator_and_6_sigma_leaves_them_out():
    status = np.array([Status.RESOLVED] * 60 + [Status.NOT_ASSEMBLABLE] * 40)
    values = np.where(status == Status.RESOLVED, np.tile([-0.1, 0.1], 50), 5.0)[:, None]
    statuses = status, np.full(100, Status.RESOLVED), np.full(100, Status.NOT_ASSEMBLABLE)
    run, better, none = (Corrected(values, of_run) for of_run in statuses)
    limits = Limits(-9.0, 9.0)
    assert goal_estimate(run, limits).value == 0.4 and goal_estimate(better, limits).value == 0
    assert goal_estimate(run, None).value == pytest.approx(6 * values[:60].std(ddof=1))
    assert np.isnan(goal_estimate(none, None).value)
