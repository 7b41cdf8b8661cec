"""The base of all analyses: checks, simulations, answers of growing accuracy, groups of contributors, dataset and storage.

An analysis is a sequence of answers. The first ones take little time, and the last one is complete. An analysis that is
stopped, or whose time ends, leaves its latest answer, which says so. The answers are given as functions: each makes its answer
from what is known when it is called, so an answer that nobody asks for takes no time.
"""

import copy
import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tolcontact import interrupts, vocabulary as terms
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError, check_choice
from tolcontact.features.freedoms import FORM
from tolcontact.method import Solver
from tolcontact.report import brief_lines
from tolcontact.simulation import Block, block_rows, outcomes
from tolcontact.simulation.cluster import mapping, threads_of
from tolcontact.simulation.threads import Sampler
from tolcontact.statistics.variance_shares import joined_columns
from tolcontact.variation import GivenDraws
from tolcontact.variation.draws import Draws
from tolcontact.vocabulary import GROUPED_BY
from tolcontact.workflow.forecast import check_affordable
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

MAX_ROWS_OF_BODIES = 8192  # realizations of a block, times the bodies that contact couples: a block ends within seconds
MIN_BLOCKS = 8  # for few realizations, so that they occupy all processors
VERIFICATION_FACTOR = 4  # realizations of a fresh run, in multiples of samples
SPREAD_SAMPLES = 1 << 14  # realizations for the spreads of contributors
LONG = 30_000  # realizations at most: with more to come, answers are shown on the way
NEXT_LOOK, MIN_LOOK = 2.0, 20.0  # an answer is shown when this many times the time of the previous one has passed; at least [s]
MIN_STAGE, MIN_BASE = 500, 4  # realizations of the first stage, and its base realizations

Progress = Callable[[int, int], None]  # called with the number of finished steps, and the total
Observer = Callable[[Block], tuple[Any, ...]]  # returns arrays of a block; the last one is the statuses (n,)
Results = Callable[[], list[np.ndarray]]  # returns the joined arrays of an observer

log = logging.getLogger(__name__)


class Answer(NamedTuple):
    """The answer of an analysis.

    values      array for each variable of the record
    labels      labels of dimensions that are neither in the vocabulary nor in the model
    attributes  in addition to the title and the settings
    coarse      what the answer rests on, in words, if it is not complete
    units       units of the only measure, where no dimension lists measures
    """

    values: Mapping[str, Any]
    labels: Mapping[str, Sequence[str]]
    attributes: Mapping[str, Any]
    coarse: str = ""
    units: str | None = None


class Stopped(KeyboardInterrupt):
    """The user stopped an analysis that already had an answer, its `dataset`.

    `try: tc.analyses.tails("model.py")`, then `except tc.analyses.Stopped as stop: print(stop.dataset.probability)`
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        super().__init__(dataset.attrs[terms.COARSE])
        self.dataset = dataset


class OutOfTime(Exception):
    """The time of an analysis has ended."""


class Design(ABC):
    """Draws with several realizations for each base realization: realization k size + m is member m of base realization k.

    size   number of realizations of each base realization
    """

    size: int

    @abstractmethod
    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (realization, contributor); see Draws."""
        base = start // self.size
        members = self.members(seed, base, -(-stop // self.size))
        return members.reshape(-1, members.shape[2])[start - base * self.size : stop - base * self.size]


class Analysis:
    """A question about one model, its simulations, and its answer: a dataset that can be stored in an archive.

    All options are checked before anything is simulated; without `samples` nothing is. Without an answer when its `minutes`
    have passed, the analysis continues to the first one. Raises ModelError, ArchiveError, OptionError for invalid arguments.

    statuses  (status_meaning,) int: number of realizations simulated so far, by their status
    total     number of realizations that `progress` refers to; an analysis may revise it
    """

    def __init__(
        self, record: terms.AnalysisRecord, model: Model | Program, *, samples: int | None = None, seed: int = 1,
        solver: Solver | None = None, method: Choice | None = None, into: str | Path | None = None, client: Any = None,
        progress: Progress | None = None, minutes: float | None = None,
    ) -> None:  # fmt: skip
        self._started = time.monotonic()
        if minutes is not None and not (isinstance(minutes, int | float) and 0 < minutes < math.inf):
            raise OptionError(f"minutes is {minutes!r}; expected a positive number")
        if samples is not None:
            check_counts(samples=samples, seed=seed)
        self.record, self.program, self._into = record, program_of(model, solver, method), into
        self.samples, self.seed, self.progress, self._minutes = samples or 0, seed, progress, minutes
        self._blocks, self._client = mapping(client), client
        if into is not None:
            check_room_for(into, record, self.program, self.samples)
        self._begin()

    def _begin(self) -> None:
        """Set what depends on the program and on the simulations so far: nothing is simulated, and there is no answer."""
        bodies = max((len(group.group.free) for group in self.program.groups), default=0)
        self._rows = min(block_rows(self.program), max(MAX_ROWS_OF_BODIES // max(bodies, 1), MIN_BLOCKS))
        self.statuses, self.total = np.zeros(len(terms.STATUS_MEANINGS), dtype=int), 0
        self._latest: Callable[[], Answer] | None = None
        self._next_look = 0.0

    @property
    def assembly(self) -> str:
        """The name of the assembly."""
        return self.program.nominal.assembly.name

    @property
    def simulated(self) -> int:
        """The number of realizations so far."""
        return int(self.statuses.sum())

    def of(self, program: Program) -> "Analysis":
        """Return the same analysis of another program, with nothing simulated: without progress, limit of time and answer."""
        analysis = copy.copy(self)
        analysis.program, analysis.progress, analysis._minutes = program, None, None
        analysis._begin()
        return analysis

    def expect(self, total: int) -> None:
        """Set the total of realizations. Raises OptionError if that many would take too much time or memory."""
        check_affordable(self.program, samples=total, seed=self.seed, threads=threads_of(self._client))
        self.total = total

    def simulate(
        self, samples: int, *, start: int = 0, draws: Sampler | None = None, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Simulate `samples` realizations, starting with number `start`, and return the joined results of `observe`.

        By default these are measures (n, state, measure) and statuses (n,). `draws` replaces the draws of the program.
        """
        observed = []
        block = min(self._rows, max(self._rows, samples) // MIN_BLOCKS)  # for any number of threads or workers
        for arrays in self._blocks(
            observe, self.program, samples=start + samples, start=start, seed=self.seed, draws=draws, block=block
        ):
            observed.append(arrays)
            self.statuses += np.bincount(arrays[-1], minlength=len(self.statuses))
            if self.progress:
                self.progress(min(self.simulated, self.total), self.total)
            self._look()
        return tuple(np.concatenate(column) for column in zip(*observed, strict=True))

    def simulate_deviations(self, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return measures (n, state, measure) and statuses (n,) of deviations (n, contributor)."""
        measured, status = self.simulate(len(deviations), draws=GivenDraws(deviations))
        return measured, status

    def simulate_design(
        self, design: Design, samples: int, *, start: int = 0, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Return the results of `observe` for `samples` base realizations of a design, as arrays (base, realization, ...).

        The first base realization has the number `start`.
        """
        arrays = self.simulate(samples * design.size, start=start * design.size, draws=design, observe=observe)
        return tuple(array.reshape(samples, len(array) // samples, *array.shape[1:]) for array in arrays)

    def stages(
        self, design: Design, samples: int, *, start: int = 0, observe: Observer = outcomes
    ) -> Iterator[tuple[int, Results]]:
        """Simulate a design in stages; yield the number of base realizations so far, and a function that returns their results.

        The results of all stages are joined when the function is called: for an answer that is asked for.
        """
        observed: list[tuple[np.ndarray, ...]] = []
        for first, stop in stages(samples, design.size):
            observed.append(self.simulate_design(design, stop - first, start=start + first, observe=observe))
            yield stop, partial(_joined, tuple(observed))

    def dataset(
        self, values: Mapping[str, Any], labels: Mapping[str, Sequence[str]], *, units: str | None = None, **attributes: Any
    ) -> xr.Dataset:
        """Return the dataset of an Answer (see there), and add it to the archive if there is one."""
        return self._kept(self._dataset(Answer(values, labels, attributes, units=units)))

    def finest(self, answers: Iterable[Callable[[], Answer]]) -> xr.Dataset:
        """Return the dataset of the last of some answers, which are more and more accurate, and add it to the archive.

        When the time of the analysis ends, the dataset is that of the latest answer. Raises Stopped, with this dataset, when
        the user stops the analysis.
        """
        try:
            for answer in answers:
                self._latest = answer
            assert self._latest is not None
            dataset = self._dataset(self._latest()._replace(coarse=""))
        except OutOfTime:
            dataset = self._coarse(f"{self._minutes:g} minutes have passed")
        except BaseException as error:
            if self._latest is None or not (isinstance(error, KeyboardInterrupt) or interrupts.is_stopping()):
                raise
            raise Stopped(self._kept(self._coarse("stopped"))) from None
        return self._kept(dataset)

    def _look(self) -> None:
        """Show the latest answer now and then if there are many realizations; raise OutOfTime when time is up."""
        if self._latest is None:
            return
        seconds = time.monotonic() - self._started
        if self._minutes is not None and seconds > 60 * self._minutes:
            raise OutOfTime
        if self.total > LONG and seconds >= self._next_look:
            for line in brief_lines(self.record, self._coarse("so far")):
                log.warning(line)
            self._next_look = max(NEXT_LOOK * (time.monotonic() - self._started), MIN_LOOK)

    def _coarse(self, reason: str) -> xr.Dataset:
        assert self._latest is not None
        answer = self._latest()
        return self._dataset(answer).assign_attrs({terms.COARSE: f"{reason}: {answer.coarse}"})

    def _kept(self, dataset: xr.Dataset) -> xr.Dataset:
        if self._into is not None:
            keep(self._into, self.record, dataset, self.program)
        return dataset

    def _dataset(self, answer: Answer) -> xr.Dataset:
        values, attributes, method = answer.values, dict(answer.attributes), self.program.method
        stated = [*self.record.variables, *(v for v in self.record.of_stations if v.name in values)]
        settings = {
            "seed": self.seed, "solver": self.program.solver.name, "resolution": method.resolution,
            "objective": method.objective,
        }  # fmt: skip
        return xr.Dataset(
            {v.name: v.entry(np.array(values[v.name])) for v in stated},
            coords=self._coordinates(answer.labels) | ({} if answer.units is None else {"measure_units": ((), answer.units)}),
            attrs={"title": self.record.title.format(assembly=self.assembly, **attributes)}
            | attributes
            | (settings if self.samples else {}),
        )

    def _coordinates(self, labels: Mapping[str, Sequence[str]]) -> dict[str, Any]:
        nominal, contributors = self.program.nominal, self.program.draws.contributors
        units = {
            terms.MEASURE: {measure.name: measure.units for measure in nominal.measures},
            terms.CONTRIBUTOR: {contributor.label: contributor.units for contributor in contributors},
        }
        known = {
            **terms.FIXED_LABELS,
            terms.MEASURE: list(units[terms.MEASURE]),
            terms.CONTRIBUTOR: list(nominal.contributors),
            terms.PART: [part.name for part in nominal.last_parts],
            terms.PAIR: [pair.name for pair in nominal.pairs],
            **labels,
        }
        coordinates: dict[str, Any] = {dim: list(known[dim]) for dim in self.record.dims if dim in known}
        for dim in units:
            if self.record.has_units_of(dim):
                coordinates[f"{dim}_units"] = (dim, [units[dim][label] for label in coordinates[dim]])
        return coordinates

    def sampled_deviations(self) -> np.ndarray:
        """Return deviations (n, contributor) of enough realizations for estimates of spreads."""
        return self.program.draws(seed=self.seed, start=0, stop=SPREAD_SAMPLES)

    def check_rigid(self, advice: str) -> None:
        """Raise OptionError, with an `advice`, for a model with elastic parts."""
        elastic = [part.name for part in self.program.nominal.assembly.parts if part.elasticity is not None]
        if elastic:
            raise OptionError(
                f'part "{elastic[0]}" of "{self.assembly}" is elastic, and this analysis is of rigid parts; {advice}'
            )

    def check_varies(self, varies: object) -> None:
        """Raise OptionError if nothing varies."""
        if not varies:
            raise OptionError(f'nothing varies in "{self.assembly}"; give it tolerances first')


def _joined(observed: Sequence[tuple[np.ndarray, ...]]) -> list[np.ndarray]:
    return [np.concatenate(parts) for parts in zip(*observed, strict=True)]


def stages(samples: int, size: int, *, first: int = 0) -> Iterator[tuple[int, int]]:
    """Yield first and last numbers of the base realizations of stages, each with as many as all before.

    size   realizations of each base realization
    first  base realizations of the first stage, if not the default
    """
    start, stop = 0, min(first or max(MIN_STAGE // size, MIN_BASE), samples)
    while start < samples:
        yield start, stop
        start, stop = stop, min(2 * stop, samples)


def owners(program: Program, by: str) -> list[str]:
    """Return the owner of each column of deviations: its contributor, feature or part; the modes of a form have one owner.

    Raises OptionError for a grouping that does not exist.
    """
    check_choice("by", by, GROUPED_BY)
    nominal, labels = program.nominal, list(program.nominal.contributors)
    if by == "contributor":
        contributors = zip(labels, program.draws.contributors, strict=True)
        return [label.rpartition(" ")[0] if contributor.source == FORM else label for label, contributor in contributors]
    # Locators belong to the part that they locate, even if `by` is "feature"; in a station to the part or joint there.
    owner_of = {label: part.located for part in nominal.parts for label in part.locators.labels}
    for pattern in nominal.patterns:
        part = pattern.declared.part.name
        labels_of_pattern = [freedom.label for freedom in pattern.freedoms]
        owner_of |= {label: part if by == "part" else label.rpartition(".")[0] for label in labels_of_pattern}
    return [owner_of.get(label, label) for label in labels]


def independent_groups(
    draws: Draws, owners: Sequence[str], varies: np.ndarray, *, correlated: bool = True
) -> dict[str, np.ndarray]:
    """Return columns that vary, by independent groups: owners are joined if any of their columns are drawn jointly.

    Without `correlated`, groups that are correlated by declaration remain separate.
    """
    return joined_columns(owners, draws.dependent(correlated=correlated), np.flatnonzero(varies))
