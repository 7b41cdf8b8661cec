"""Probabilities of rare events: a measure outside its limits, or parts that cannot be assembled."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc, ndtr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Engine, Progress
from tolcontact.analyses.answers import Answer
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.method import Solver
from tolcontact.statistics.intervals import UNDEFINED, proportion
from tolcontact.statistics.rare import NEGLIGIBLE, Tail, either, sufficient_tail
from tolcontact.variation.draws import MIN_UNIFORM
from tolcontact.workflow.models import Choice, Model

MIN_SAMPLES = 30_000  # for a search: fewer see too few of an event's regions (studies/verification)
COUNTED = 1000  # realizations of the first answer, by counting
MIN_AT_STOP = 50  # values at a limit that is never exceeded
UNDEFINED_TAIL = Tail(UNDEFINED, 1.0)


def tails(
    model: Model | Program, *, samples: int | None = None, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, into: str | Path | None = None, client: Any = None,
    progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return probabilities of rare events (see tolcontact.statistics.rare).

        probability  (event, interval)          with its 95 % interval
        disagreement (event)                    ratio of the results of two searches for the event; 1 if they agree
        stop         (event)                    1: many values were at one of the limits, and none beyond; if the other limit
                                                can be exceeded, this one is left out
        simulated    (event)                    number of realizations, about `samples` for each limit
        by_status    (event, status_meaning)    number of realizations, most of them unlikely ones

    In an event a corrected measure is beyond its limits by more than its accuracy, or, in an exact resolution, parts cannot be
    assembled. The score of the former is the measure, and each limit has its own search; the latter only has a search by
    inflation of all deviations. Each search has about `samples` realizations, by default and at least 30 000, since fewer miss
    regions of an event. A quarter of 120 000 or more suffices where the upper bound of the interval is at most 1.5 times the
    lower one; otherwise the result comes from the other three quarters. A probability of 0 with an upper bound means that the
    search ended below 1e-9. Where two searches disagree, the interval covers both results, and more realizations are needed. A
    measure that is not a number in any realization has the probability NaN, as in `run`. Probabilities include unresolved
    realizations, with their last poses.
    `progress` is called with the number of realizations simulated, and the approximate total.
    `model`, `samples`, `seed`, `solver`, `method`, `into`, `client` and `minutes` are as in all analyses (see tolcontact.analyses).
    Raises OptionError for a model that has no rare event.

    `tc.analyses.tails("model.nc")`
    """
    samples = MIN_SAMPLES if samples is None else samples
    if isinstance(samples, int) and samples < MIN_SAMPLES:
        raise OptionError(f"samples is {samples!r}; expected at least {MIN_SAMPLES} realizations for each limit")
    analysis = Analysis(
        terms.TAILS, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress, minutes=minutes,
    )  # fmt: skip
    program = analysis.program
    analysis.check_varies(program.draws.varying)
    return analysis.finest(_answers(analysis, _events(program)))


def _answers(analysis: Analysis, events: "dict[str, list[Callable[[Engine], Any]]]") -> Iterator[Callable[[], Answer]]:
    """Yield an answer by counting, and answers by searches for one event after the other."""
    samples, dimensions = analysis.samples, len(analysis.program.draws.varying)
    engine = analysis.engine(sum(map(len, events.values())) * samples)
    found: list[tuple[Tail, bool, np.ndarray]] = []  # for each event: its tail, whether a limit is a stop, and statuses

    def answer() -> Answer:
        searched = [f"{number} of {len(events)} events are searched for"] if found else []
        rest = f"the {'others' if found else 'events'} are counted among {COUNTED} realizations"
        entries = found + counted[len(found) :]
        values = {
            "probability": [tail.probability for tail, *_ in entries],
            "disagreement": [tail.disagreement for tail, *_ in entries],
            "stop": np.array([is_stop for _, is_stop, _ in entries], dtype=np.int8),
            "simulated": [int(statuses.sum()) for *_, statuses in entries],
            "by_status": [statuses for *_, statuses in entries],
        }
        return Answer(values, {terms.EVENT: list(events)}, {"samples": samples}, "; ".join([*searched, rest]))

    counted = _counted(analysis, engine, list(events.values()), dimensions)
    yield answer
    for number, sides in enumerate(events.values()):
        before, scores, side_tails = engine.statuses.copy(), [make_score(engine) for make_score in sides], []
        for side, score in enumerate(scores):  # each has its own region, and could hide the region of the other
            rng = np.random.default_rng([analysis.seed, number, side])
            side_tails.append(sufficient_tail(score, dimensions, samples=samples, rng=rng, leads=score.leads))
        # If the other limit can be exceeded, a limit that acts as a stop would only add its detection bound, so it is left out.
        exceedable = [tail for score, tail in zip(scores, side_tails, strict=True) if not score.is_stop] or side_tails
        tail = UNDEFINED_TAIL if any(score.is_undefined for score in scores) else either(exceedable)
        found.append((tail, any(score.is_stop for score in scores), engine.statuses - before))
        yield answer


def _counted(
    analysis: Analysis, engine: Engine, events: "list[list[Callable[[Engine], Any]]]", dimensions: int
) -> list[tuple[Tail, bool, np.ndarray]]:
    """Return the shares of the events among the same realizations."""
    u = np.random.default_rng([analysis.seed, len(events)]).standard_normal((COUNTED, dimensions))
    engine.total += COUNTED
    simulated, found = simulated_scores(engine, u), []
    for sides in events:
        scores = [make_score(engine) for make_score in sides]
        hits = np.any([score.of(*simulated, u) > 0 for score in scores], axis=0)
        tail = UNDEFINED_TAIL if any(score.is_undefined for score in scores) else Tail(proportion(hits), 1.0)
        found.append((tail, False, np.bincount(simulated[1], minlength=len(engine.statuses))))
    return found


def simulated_scores(engine: Engine, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return measures (n, state, measure) and statuses (n,) for normal scores u (n, d) of the contributors that vary."""
    draws = engine.program.draws
    place = {label: k for k, label in enumerate(draws.varying)}

    def numbers(label: str) -> np.ndarray:
        if label in place:
            return np.asarray(ndtr(u[:, place[label]]).clip(MIN_UNIFORM, 1 - MIN_UNIFORM))
        return np.full(len(u), 0.5)

    return engine.simulate_deviations(draws.from_numbers(numbers, len(u)))


def _events(program: Program) -> "dict[str, list[Callable[[Engine], Any]]]":
    """Return the scores of the mutually exclusive sides of each event. Raises OptionError if there is no event."""
    events: dict[str, list[Callable[[Engine], Any]]] = {}
    for number, measure in enumerate(program.nominal.measures):
        limits = program.limits(number)
        if not limits.are_open:
            events[f"{measure.name} outside limits"] = [partial(_Beyond, measure=number, limits=side) for side in limits.sides]
    if program.method.is_exact and program.nominal.pairs:
        events["not assemblable"] = [NotAssemblable]
    if not events:
        raise OptionError(
            f'"{program.nominal.assembly.name}" has no rare event: no measurement has limits, and parts can always be '
            "assembled; give measurements tolerance=... or limits=..."
        )
    return events


class _Beyond:
    """The score of one side of a measure's limits: the excess of values over the limit and their accuracy.

    leads          whether scores outside the event state how near it is
    is_undefined   whether the measure is not a number in realizations of non-negligible probability
    """

    leads = True

    def __init__(self, engine: Engine, measure: int, limits: Limits) -> None:
        self._engine, self._measure, self._limits = engine, measure, limits
        self._beyond = self._at_limit = 0
        self.is_undefined = False

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return self.of(*simulated_scores(self._engine, u), u)

    def of(self, measured: np.ndarray, _: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the scores (n,) of measures (n, state, measure) at normal scores u (n, d)."""
        is_likely = gammaincc(u.shape[1] / 2, (u**2).sum(axis=1) / 2) > NEGLIGIBLE  # otherwise only inflation leads there
        self.is_undefined |= bool(np.isnan(measured[is_likely, terms.CORRECTED, self._measure]).any())
        excess = np.nan_to_num(self._limits.excess(measured[:, terms.CORRECTED, self._measure]), nan=-np.inf, posinf=np.inf)
        self._beyond += int((excess > 0).sum())
        self._at_limit += int(((excess >= -2 * self._limits.accuracy) & (excess <= 0)).sum())
        return excess

    @property
    def is_stop(self) -> bool:
        """Whether many values, including inflated ones, were at the limit, and none beyond."""
        return self._beyond == 0 and self._at_limit >= MIN_AT_STOP


class NotAssemblable:
    """The score of the event that parts cannot be assembled: 1 inside, -1 outside."""

    leads = is_stop = is_undefined = False

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return self.of(*simulated_scores(self._engine, u), u)

    def of(self, _: np.ndarray, status: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the scores (n,) of statuses (n,) at normal scores u (n, d)."""
        return np.where(status == terms.Status.NOT_ASSEMBLABLE, 1.0, -1.0)
