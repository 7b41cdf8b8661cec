"""What the numbers of an answer mean: certified, in conflict, or none."""

import numpy as np

from tolcontact.compilation import ACCURACY
from tolcontact.contact.progress import PATIENCE, PATIENCE_IN_CONFLICT, Progress
from tolcontact.contact.record import initial_numbers
from tolcontact.contact.resolver import is_better
from tolcontact.contact.slots import Slots
from tolcontact.contact.state import Outcome, State


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


def test_a_problem_that_no_solver_could_solve_is_no_conflict():
    begun = State.start(np.zeros((1, 2, 12)), np.zeros((1, 3, 12)), 4, [])
    assert begun.kkt_residual.tolist() == [np.inf] and begun.outcome.tolist() == [Outcome.UNSOLVED]


def test_a_conflict_is_penetration_beyond_the_accuracy_in_any_pair():
    assert state(0.0, [0.0, 2 * ACCURACY]).in_conflict.tolist() == [True]
    assert state(0.0, [ACCURACY, ACCURACY]).in_conflict.tolist() == [False]


def test_answers_are_ranked_certified_before_conflicts_before_none():
    answers = [state(0.0, [0.0]), state(0.0, [0.01]), state(1.0, [0.0]), state(0.0, [0.0], doubtful=True)]
    assert [int(answer.outcome[0]) for answer in answers] == [
        Outcome.RESOLVED,
        Outcome.IN_CONFLICT,
        Outcome.UNSOLVED,
        Outcome.DOUBTFUL,
    ]


def test_the_better_of_two_states_is_kept():
    """Realization by realization: the one with less penetration, and less that locators are off, which counts more."""
    inside = np.array([[0.1, 0.0], [0.5, 0.2], [0.0, 0.0], [0.3, 0.4]])
    poses = np.zeros((4, 1, 12))
    relative = np.zeros((4, 2, 12))
    best, here = (State.start(poses + number, relative, 2, []) for number in (1.0, 2.0))
    best.slack[:], best.astray[:] = [[0.0, 0.2], [0.5, 0.0], [0.0, 0.0], [0.1, 0.0]], [0, 0, 0, 1.0]
    here.astray[:] = [0, 0, 1e-3, 0]
    progress, still = Progress.start(best), np.zeros(4)
    progress.look(best, best.slack.copy(), still, is_held=False)
    progress.look(here, inside, still, is_held=False)
    assert progress.best.poses[:, 0, 0].tolist() == [2, 1, 1, 2]  # of those that are alike the first one
    assert progress.best.slack.tolist() == [[0.1, 0.0], [0.5, 0.0], [0.0, 0.0], [0.3, 0.4]]


def test_steps_are_over_after_some_that_gained_nothing():
    """In a conflict gains are of penetration, else of the size of steps; steps that are held back do not count."""
    state = State.start(np.zeros((3, 1, 12)), np.zeros((3, 1, 12)), 2, [])
    progress, falls = Progress.start(state), 0.85 ** np.arange(50)
    conflicts, others = np.full(3, True), np.full(3, False)
    for number, fall in enumerate(falls):
        until = falls[min(number, 10)]  # the second goes on to fall, the third does so in the first ten steps
        values = np.array([1.0, fall, until])
        progress.look(state, 0.1 * values[:, None], values, is_held=number == 0)
        for is_in, patience in ((conflicts, PATIENCE_IN_CONFLICT), (others, PATIENCE)):
            assert progress.is_over(is_in).tolist() == [number >= patience, False, number >= 10 + patience]
    assert progress.take(np.array([True, False, False])).is_over(conflicts[:1]).tolist() == [True]


def test_another_answer_is_preferred_by_its_rank_then_its_energy_or_its_depth():
    certified, conflict, deeper, none = state(0.0, [0.0]), state(0.0, [0.01]), state(0.0, [0.02]), state(1.0, [0.0])

    def preferred(answer, energy, best, best_energy):
        return bool(is_better(answer, np.array([energy]), best, np.array([best_energy]), gain=1e-6)[0])

    assert preferred(certified, 9.0, conflict, 1.0) and preferred(conflict, 9.0, none, 1.0)
    assert not preferred(conflict, 1.0, certified, 9.0) and not preferred(none, 1.0, conflict, 9.0)
    assert preferred(certified, 1.0, certified, 2.0) and not preferred(certified, 2.0, certified, 1.0)
    assert not preferred(certified, 1.0, certified, 1.0)  # of two that are alike the first one stays
    assert preferred(conflict, 2.0, deeper, 1.0) and not preferred(deeper, 1.0, conflict, 2.0)
    assert not preferred(conflict, 1.0, conflict, 2.0) and not preferred(none, 1.0, none, 2.0)


def test_a_point_that_changes_its_slot_keeps_its_reaction():
    slots = Slots(np.array([[7, 3, 5]]), np.array([[True, True, False]]), np.array([[0.2, 0.9, 0.4]]))
    assert slots.reactions_of(np.array([[3, 7, 5, 8]])).tolist() == [[0.9, 0.2, 0.0, 0.0]]  # the slot of 5 is not in use
