"""How often a measure is outside its limits, or parts do not go together, where that is too rare to be counted."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtr

from tolcontact import vocabulary as terms
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import outcomes
from tolcontact.simulation.cluster import MapBlocks, mapping
from tolcontact.statistics.rare_events import Score, tail_probability
from tolcontact.variation import GivenDraws
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

LEAST = 4000  # realizations for an event
INFLATIONS = 1.3 ** np.arange(7)  # of all deviations, up to 4.8: from which on do parts not go together?
LOOKS = 3  # that tell which of them is the first, or that none is
MIN_UNIFORM = 1e-16  # the least distance of a number from 0 and 1


def tails(
    model: Model | Program,
    *,
    samples: int = 100_000,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Probabilities of rare events, by subset simulation (see tolcontact.statistics.rare_events).

        probability  (event, interval)          with its 95 % interval
        simulated    (event)                    number of realizations, of about `samples`
        by_status    (event, status_meaning)    number of realizations, most of them unlikely ones

    Events are that a corrected measure is outside its limits, and, in an exact resolution, that parts cannot be assembled. The
    first are led to by the measure itself; the second by what factor all deviations, as normal scores, have to grow until
    parts do not go together, which is right if they do whenever they do with larger ones.
    Estimates are of realizations as they are, also of those that are not resolved. `progress` is called with the number of
    realizations simulated, and about how many there will be.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the same model, as the group
    statistics/tails; the report shows it.
    Raises ModelError, ArchiveError, OptionError for options that cannot be used, a model without such an event, or in which
    nothing varies.
    """
    check_counts(samples=samples, seed=seed)
    if samples < LEAST:
        raise OptionError(f"samples is {samples!r}; expected {LEAST} realizations for an event, or more")
    program, blocks = program_of(model, solver, method), mapping(client)
    if into is not None:
        check_room_for(into, terms.OF_TAILS, program)
    if not program.draws.varying:
        raise OptionError(f'nothing varies in "{program.nominal.assembly.name}"; give it tolerances first')
    events = dict(_events(program))
    if not events:
        raise OptionError(
            f'"{program.nominal.assembly.name}" has no rare event: no measure has limits, and parts always go together; '
            "give measures tolerance=... or limits=..."
        )
    found, statuses = [], []
    for number, event in enumerate(events.values()):
        engine = _Engine(program, blocks, done=number * samples, total=len(events) * samples, progress=progress)
        score, looks = event(engine)
        rng = np.random.default_rng([seed, number])
        found.append(tail_probability(score, len(program.draws.varying), samples=samples // looks, rng=rng))
        statuses.append(engine.statuses)
    values = {"probability": found, "simulated": np.sum(statuses, axis=1), "by_status": statuses}
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(values[of.name]), of.all_attributes) for of in terms.TAILS},
        coords={
            terms.EVENT: list(events),
            terms.INTERVAL: list(terms.ESTIMATE),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        },
        attrs={
            "title": f"rare events of {program.nominal.assembly.name}",
            "samples": samples,
            "seed": seed,
            "solver": program.plugin.name,
            "resolution": program.method.resolution,
            "objective": program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_TAILS, answer, program)
    return answer


class _Engine:
    """The engine on normal scores of contributors, and how many of each status it has seen."""

    def __init__(
        self, program: Program, blocks: MapBlocks, *, done: int, total: int, progress: Callable[[int, int], None] | None
    ) -> None:
        self._program, self._blocks, self._done, self._total, self._progress = program, blocks, done, total, progress
        self.statuses = np.zeros(len(terms.STATUS_MEANINGS), dtype=int)

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Measures (n, state, measure) and statuses (n,) of realizations u (n, d)."""
        place = {label: k for k, label in enumerate(self._program.draws.varying)}

        def numbers(label: str) -> np.ndarray:
            if label in place:
                return np.asarray(ndtr(u[:, place[label]]).clip(MIN_UNIFORM, 1 - MIN_UNIFORM))
            if "#" in label:
                raise OptionError(
                    f'"{label.partition(" #")[0]}" is drawn anew until it lies in its zone, which rare events cannot follow; '
                    'choose another rule, such as "99.73 % inside"'
                )
            return np.full(len(u), 0.5)

        draws = GivenDraws(self._program.draws.from_numbers(numbers, len(u)))
        found = list(self._blocks(outcomes, self._program, samples=len(u), seed=0, draws=draws))
        measured, status = (np.concatenate(every) for every in zip(*found, strict=True))
        self.statuses += np.bincount(status, minlength=len(self.statuses))
        if self._progress:
            self._progress(min(self._done + int(self.statuses.sum()), self._total), self._total)
        return measured, status


Event = Callable[[_Engine], tuple[Score, int]]  # its score, and how many realizations one takes


def _events(program: Program) -> Iterator[tuple[str, Event]]:
    for number, (measure, nominal) in enumerate(zip(program.nominal.measures, program.nominal_measures, strict=True)):
        lower, upper = measure.bounds(nominal)
        if np.isfinite(lower) or np.isfinite(upper):
            yield f"{measure.name} outside limits", _outside(number, lower, upper)
    if program.method.is_exact and program.nominal.pairs:
        yield "not assemblable", _not_assemblable


def _outside(measure: int, lower: float, upper: float) -> Event:
    def event(engine: _Engine) -> tuple[Score, int]:
        def score(u: np.ndarray) -> np.ndarray:
            measured, _ = engine(u)
            x: np.ndarray = measured[:, terms.CORRECTED, measure]
            return np.maximum(lower - x, x - upper)

        return score, 1

    return event


def _not_assemblable(engine: _Engine) -> tuple[Score, int]:
    """How few of the inflations parts bear: 0.5 if not even 1, -0.5 if one, ...; bisected."""

    def score(u: np.ndarray) -> np.ndarray:
        low, high = np.zeros(len(u), dtype=int), np.full(len(u), len(INFLATIONS))
        for _ in range(LOOKS):
            middle = (low + high) // 2
            _, status = engine(INFLATIONS[middle][:, None] * u)
            stuck = status == terms.Status.NOT_ASSEMBLABLE
            low, high = np.where(stuck, low, middle + 1), np.where(stuck, middle, high)
        return 0.5 - low

    return score, LOOKS
