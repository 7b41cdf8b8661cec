"""What the numbers of an answer mean: certified, in conflict, or none."""

import numpy as np

from tolcontact.compilation import ACCURACY
from tolcontact.contact.record import initial_numbers
from tolcontact.contact.repeated_steps import better_state
from tolcontact.contact.state import State


def state(residual, slack, *, doubtful=False):
    one, none = np.zeros(1), np.zeros((1, 0))
    return State(
        **initial_numbers(1) | {"kkt_residual": np.array([residual])},
        poses=np.zeros((1, 2, 12)), relative=np.zeros((1, len(slack), 12)), slack=np.array([slack]), astray=one,
        multipliers=none, gap_min=np.zeros((1, len(slack))), doubtful=np.array([doubtful]), slots=[],
    )  # fmt: skip


def test_a_residual_up_to_the_accuracy_is_an_answer():
    assert state(ACCURACY, [0.0, 0.0]).solved.tolist() == [True]
    assert state(1.01 * ACCURACY, [0.0, 0.0]).solved.tolist() == [False]


def test_a_conflict_is_believed_if_it_exceeds_what_was_left_undone():
    assert state(0.001, [0.0, 0.002]).solved.tolist() == [True]
    assert state(0.001, [0.0005, 0.0]).solved.tolist() == [False]


def test_a_conflict_is_penetration_beyond_the_accuracy_in_any_pair():
    assert state(0.0, [0.0, 2 * ACCURACY]).in_conflict.tolist() == [True]
    assert state(0.0, [ACCURACY, ACCURACY]).in_conflict.tolist() == [False]


def test_answers_are_ranked_certified_before_conflicts_before_none():
    answers = [state(0.0, [0.0]), state(0.0, [0.01]), state(1.0, [0.0]), state(0.0, [0.0], doubtful=True)]
    assert [int(answer.rank[0]) for answer in answers] == [0, 1, 2, 2]


def test_the_better_of_two_states_is_kept():
    """Realization by realization: the one with less penetration, and less that locators are off, which counts more."""
    inside = np.array([[0.1, 0.0], [0.5, 0.2], [0.0, 0.0], [0.3, 0.4]])
    poses = np.zeros((4, 1, 12))
    relative = np.zeros((4, 2, 12))
    best, here = (State.start(poses + number, relative, 2, 0) for number in (1.0, 2.0))
    best.slack[:], best.astray[:] = [[0.0, 0.2], [0.5, 0.0], [0.0, 0.0], [0.1, 0.0]], [0, 0, 0, 1.0]
    here.astray[:] = [0, 0, 1e-3, 0]
    found = better_state(best, here, inside)
    assert found.poses[:, 0, 0].tolist() == [2, 1, 1, 2]  # of those that are alike the first one
    assert found.slack.tolist() == [[0.1, 0.0], [0.5, 0.0], [0.0, 0.0], [0.3, 0.4]]
    assert better_state(None, here, inside).slack.tolist() == inside.tolist()
