"""Probabilities of rare events: a measure outside its limits, or parts that cannot be assembled."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import gammaincc, ndtr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Answer, Progress, stages
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.method import Solver
from tolcontact.statistics.intervals import UNDEFINED, proportion
from tolcontact.statistics.rare import Tail, either, sufficient_tail
from tolcontact.statistics.rare_searches import NEGLIGIBLE
from tolcontact.variation.draws import MIN_UNIFORM
from tolcontact.workflow.models import Choice, Model

MIN_SAMPLES = 30_000  # for a search: fewer see too few of an event's regions (studies/verification)
COUNTED, MAX_COUNTED = 1500, 3000  # realizations of the first answer, by counting; and of the last, without a common event
MIN_SHARE = 1 / 30  # of the first realizations: more common sides of events are only counted
MIN_AT_STOP = 50  # values at a limit that is never exceeded


def tails(
    model: Model | Program, *, samples: int | None = None, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, into: str | Path | None = None, client: Any = None,
    progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return probabilities of rare events (see tolcontact.statistics.rare).

        probability  (event, interval)          with its 95 % interval
        disagreement (event)                    ratio of the results of two searches for the event; 1 if they agree
        stop         (event)                    1: many values were at one of the limits, and none beyond; if the other limit
                                                can be exceeded, this one is left out; 0 without a probability
        simulated    (event)                    number of realizations, some of them the same for all events
        by_status    (event, status_meaning)    number of realizations, most of them unlikely ones

    In an event a corrected measure is beyond its limits by more than its accuracy, or, in an exact resolution, parts cannot be
    assembled. Limits that a thirtieth of the realizations or more exceed are counted in the same `samples` realizations. For
    others there are searches: the score of a limit is the measure, and each limit has its own search; parts that cannot be
    assembled only have a search by inflation of all deviations. Each search has about `samples` realizations, by default and
    at least 30 000, since fewer miss regions of an event. A quarter of 120 000 or more suffices where the upper bound of the
    interval is at most 1.5 times the lower one; otherwise the result comes from the other three quarters. A probability of 0
    with an upper bound means that the search ended below 1e-9. Where two searches disagree, the interval covers both results,
    and more realizations are needed. A measure that is not a number in any realization has the probability NaN, as in `run`.
    Probabilities include unresolved realizations, with their last poses: the event "outside limits" counts a realization that
    cannot be assembled only if the measure is outside in its pose of least penetration.
    `progress` is called with the number of realizations simulated, and the approximate total. `model`, `samples`, `seed`,
    `solver`, `method`, `into`, `client` and `minutes` are as in all analyses (see tolcontact.analyses).
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
    analysis.check_varies(analysis.program.draws.varying)
    return analysis.finest(_answers(analysis, _events(analysis)))


def _answers(analysis: Analysis, events: "dict[str, list[Side]]") -> Iterator[Callable[[], Answer]]:
    """Yield answers by counting in more and more realizations, and then by searches for one event after the other."""
    samples, dimensions = analysis.samples, len(analysis.program.draws.varying)
    analysis.expect(sum(map(len, events.values())) * samples)
    statuses, searched = np.zeros_like(analysis.statuses), list[tuple[Tail, np.ndarray]]()

    def answer() -> Answer:
        total, counted = int(statuses.sum()), list(events.values())[len(searched) :]
        found = [f"{len(searched)} of {len(events)} events are searched for"] if searched else []
        coarse = "; ".join([*found, f"the {'others' if found else 'events'} are counted among {total} realizations"])
        tails = [tail for tail, _ in searched] + [_tail(sides) for sides in counted]
        by_status = [statuses + further for _, further in searched] + [statuses] * len(counted)
        values = {
            "probability": [tail.probability for tail in tails],
            "disagreement": [tail.disagreement for tail in tails],
            "stop": np.array(
                [any(side.is_stop for side in sides) and not _is_undefined(sides) for sides in events.values()], dtype=np.int8
            ),
            "simulated": np.sum(by_status, axis=1),
            "by_status": by_status,
        }
        return Answer(values, {terms.EVENT: list(events)}, {"samples": samples}, coarse)

    all_sides = [side for sides in events.values() for side in sides]
    rng = np.random.default_rng([analysis.seed, len(events)])
    for start, stop in stages(samples, 1, first=COUNTED):
        if start >= MAX_COUNTED and not any(side.is_common for side in all_sides):
            break
        u = rng.standard_normal((stop - start, dimensions))
        measured, status = simulated_scores(analysis, u)
        statuses += np.bincount(status, minlength=len(statuses))
        for side in all_sides:
            side.hits = np.append(side.hits, side.scores(measured, status, u) > 0)
        yield answer
    analysis.total = analysis.simulated + samples * sum(not side.is_common for side in all_sides)
    for number, sides in enumerate(events.values()):
        before = analysis.statuses.copy()
        for place, side in enumerate(sides):  # each has its own region, and could hide the region of the other
            if not side.is_common:
                rng = np.random.default_rng([analysis.seed, number, place])
                side.searched = sufficient_tail(side, dimensions, samples=samples, rng=rng, leads=side.leads)
        searched.append((_tail(sides), analysis.statuses - before))
        yield answer


def _tail(sides: "list[Side]") -> Tail:
    """Return the probability of an event: counted, but for the sides that were searched for.

    If the other limit can be exceeded, a limit that acts as a stop would only add its detection bound, so it is left out.
    """
    if _is_undefined(sides):
        return Tail(UNDEFINED, 1.0)
    exceedable = [side for side in sides if not side.is_stop] or sides
    counted = [side.hits for side in exceedable if side.searched is None]
    tails = [side.searched for side in exceedable if side.searched is not None]
    return either([*tails, *([Tail(proportion(np.any(counted, axis=0)), 1.0)] if counted else [])])


def _is_undefined(sides: "list[Side]") -> bool:
    """Return whether the measure of an event is not a number where that counts."""
    return any(side.is_undefined for side in sides)


def simulated_scores(analysis: Analysis, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return measures (n, state, measure) and statuses (n,) for normal scores u (n, d) of the contributors that vary."""
    draws = analysis.program.draws
    place = {label: k for k, label in enumerate(draws.varying)}

    def numbers(label: str) -> np.ndarray:
        if label in place:
            return np.asarray(ndtr(u[:, place[label]]).clip(MIN_UNIFORM, 1 - MIN_UNIFORM))
        return np.full(len(u), 0.5)

    return analysis.simulate_deviations(draws.from_numbers(numbers, len(u)))


def _events(analysis: Analysis) -> "dict[str, list[Side]]":
    """Return the mutually exclusive sides of each event. Raises OptionError if there is no event."""
    program, events = analysis.program, dict[str, list[Side]]()
    for number, measure in enumerate(program.nominal.measures):
        limits = program.limits(number)
        if not limits.are_open:
            events[f"{measure.name} outside limits"] = [Side(analysis, number, side) for side in limits.sides]
    if program.method.is_exact and program.nominal.pairs:
        events["not assemblable"] = [Side(analysis)]
    if not events:
        raise OptionError(
            f'"{program.nominal.assembly.name}" has no rare event: no measurement has limits, and parts can always be '
            "assembled; give measurements tolerance=... or limits=..."
        )
    return events


class Side:
    """One side of the limits of a measure; without a measure, the event that parts cannot be assembled.

    Its score is the excess of values over the limit and their accuracy, or else 1 inside the event and -1 outside.

    hits          (n,) whether each counted realization is beyond
    searched      the result of a search, if there was one
    leads         whether scores outside the event state how near it is
    is_undefined  whether the measure is not a number in realizations of non-negligible probability
    """

    def __init__(self, analysis: Analysis, measure: int | None = None, limits: Limits | None = None) -> None:
        self._analysis, self._measure, self._limits = analysis, measure, limits
        self._beyond = self._at_limit = 0
        self.hits, self.leads, self.is_undefined = np.zeros(0, dtype=bool), measure is not None, False
        self.searched: Tail | None = None

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return self.scores(*simulated_scores(self._analysis, u), u)

    def scores(self, measured: np.ndarray, status: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the scores (n,) of measures (n, state, measure) and statuses (n,) at normal scores u (n, d)."""
        if self._measure is None or self._limits is None:
            return np.where(status == terms.Status.NOT_ASSEMBLABLE, 1.0, -1.0)
        values = measured[:, terms.CORRECTED, self._measure]
        is_likely = gammaincc(u.shape[1] / 2, (u**2).sum(axis=1) / 2) > NEGLIGIBLE  # otherwise only inflation leads there
        self.is_undefined |= bool(np.isnan(values[is_likely]).any())
        excess = np.nan_to_num(self._limits.excess(values), nan=-np.inf, posinf=np.inf)
        self._beyond += int((excess > 0).sum())
        self._at_limit += int(((excess >= -2 * self._limits.accuracy) & (excess <= 0)).sum())
        return excess

    @property
    def is_stop(self) -> bool:
        """Whether many values, including inflated ones, were at the limit, and none beyond."""
        return self._beyond == 0 and self._at_limit >= MIN_AT_STOP

    @property
    def is_common(self) -> bool:
        """Whether so many of the first realizations are hits that a search would not be more accurate.

        They are a twentieth of those that are counted, so this choice changes no estimate by more than a hundredth.
        """
        return bool(self.hits[:COUNTED].sum() >= MIN_SHARE * min(COUNTED, len(self.hits))) and len(self.hits) > 0
