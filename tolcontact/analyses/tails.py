"""Probabilities that a measure is outside its limits, or that parts cannot be assembled, where this is rare."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis
from tolcontact.analyses.engine import Engine, Progress
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.statistics.rare_events import Score, tail_probability
from tolcontact.variation.draws import MIN_UNIFORM
from tolcontact.workflow.models import Choice, Model

MIN_SAMPLES = 4000  # for an event
INFLATIONS = 1.3 ** np.arange(7)  # of all deviations, up to 4.8: the first one that prevents assembly is the score
BISECTIONS = 3  # that find the first one of them, or that there is none
Event = Callable[[Engine], Score]


def tails(
    model: Model | Program, *, samples: int = 100_000, seed: int = 1, solver: str | None = None, method: Choice | None = None,
    into: str | Path | None = None, client: Any = None, progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return probabilities of rare events, by subset simulation (see tolcontact.statistics.rare_events).

        probability  (event, interval)          with its 95 % interval
        simulated    (event)                    number of realizations, of about `samples`
        by_status    (event, status_meaning)    number of realizations, most of them unlikely ones

    An event is that a corrected measure is outside its limits, or, in an exact resolution, that parts cannot be assembled. The
    score of the former is the measure itself. The score of the latter is the factor by which all deviations, as normal scores,
    have to grow until parts cannot be assembled. This is right if larger deviations never make assembly possible again.
    Probabilities include realizations that are not resolved, with their last poses. `progress` is called with the number of
    realizations simulated, and with the approximate number of all.
    Arguments that all analyses share, and what they raise, are described in tolcontact.analyses. Raises OptionError also for a
    model that has no rare event.
    """
    if isinstance(samples, int) and samples < MIN_SAMPLES:
        raise OptionError(f"samples is {samples!r}; expected at least {MIN_SAMPLES} realizations for an event")
    analysis = Analysis(
        terms.TAILS, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress,
    )  # fmt: skip
    program = analysis.program
    analysis.check_varies(program.draws.varying)
    events = _events(program)
    if not events:
        raise OptionError(
            f'"{analysis.assembly}" has no rare event: no measure has limits, and parts can always be assembled; '
            "give measures tolerance=... or limits=..."
        )
    engine, probabilities, statuses = analysis.engine(len(events) * samples), [], []
    for number, (score_of, simulations) in enumerate(events.values()):
        counted = engine.statuses.copy()
        rng, dimensions = np.random.default_rng([seed, number]), len(program.draws.varying)
        probabilities.append(tail_probability(score_of(engine), dimensions, samples=samples // simulations, rng=rng))
        statuses.append(engine.statuses - counted)
    values = {"probability": probabilities, "simulated": np.sum(statuses, axis=1), "by_status": statuses}
    return analysis.dataset(values, {terms.EVENT: list(events)}, samples=samples)


def simulated_scores(engine: Engine, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return measures (n, state, measure) and statuses (n,) for normal scores u (n, d) of the contributors that vary."""
    draws = engine.program.draws
    place = {label: k for k, label in enumerate(draws.varying)}

    def numbers(label: str) -> np.ndarray:
        if label in place:
            return np.asarray(ndtr(u[:, place[label]]).clip(MIN_UNIFORM, 1 - MIN_UNIFORM))
        if "#" in label:
            raise OptionError(
                f'"{label.partition(" #")[0]}" is redrawn until it lies in its zone, and rare events need one draw of each; '
                'choose another rule, such as "99.73 % inside"'
            )
        return np.full(len(u), 0.5)

    return engine.simulate_deviations(draws.from_numbers(numbers, len(u)))


def _events(program: Program) -> dict[str, tuple[Event, int]]:
    """Return the score of each event, and the number of simulations that one score takes."""
    events: dict[str, tuple[Event, int]] = {}
    for number, (measure, nominal) in enumerate(zip(program.nominal.measures, program.nominal_measures, strict=True)):
        lower, upper = measure.bounds(nominal)
        if np.isfinite(lower) or np.isfinite(upper):
            events[f"{measure.name} outside limits"] = _outside(number, lower, upper), 1
    if program.method.is_exact and program.nominal.pairs:
        events["not assemblable"] = not_assemblable, BISECTIONS
    return events


def _outside(measure: int, lower: float, upper: float) -> Event:
    def event(engine: Engine) -> Score:
        def score(u: np.ndarray) -> np.ndarray:
            measured, _ = simulated_scores(engine, u)
            x: np.ndarray = measured[:, terms.CORRECTED, measure]
            return np.maximum(lower - x, x - upper)

        return score

    return event


def not_assemblable(engine: Engine) -> Score:
    """Return the score 0.5 - k, where the inflation with number k is the first one that prevents assembly; by bisection."""

    def score(u: np.ndarray) -> np.ndarray:
        low, high = np.zeros(len(u), dtype=int), np.full(len(u), len(INFLATIONS))
        for _ in range(BISECTIONS):
            middle = (low + high) // 2
            _, status = simulated_scores(engine, INFLATIONS[middle][:, None] * u)
            is_stuck = status == terms.Status.NOT_ASSEMBLABLE
            low, high = np.where(is_stuck, low, middle + 1), np.where(is_stuck, middle, high)
        return 0.5 - low

    return score
