"""The base of all analyses: checks, the engine that simulates, groups of contributors, the dataset and its storage."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.answers import Answer, Answers, Stopped
from tolcontact.analyses.designs import Design
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError, check_choice
from tolcontact.features.freedoms import FORM
from tolcontact.method import Solver
from tolcontact.simulation import Block, block_rows, outcomes
from tolcontact.simulation.cluster import MapBlocks, mapping, threads_of
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

Progress = Callable[[int, int], None]  # called with the number of finished steps, and the total
Observer = Callable[[Block], tuple[Any, ...]]  # returns arrays of a block; the last one is the statuses (n,)
SPREAD_SAMPLES = 1 << 14  # realizations for the spreads of contributors


class Engine:
    """Simulations of a program.

    statuses  (status_meaning,) int: number of realizations simulated so far, by their status
    total     number of realizations that `progress` refers to; an analysis may revise it
    """

    def __init__(
        self, program: Program, blocks: MapBlocks, *, progress: Progress | None = None, total: int = 0,
        answers: Answers | None = None,
    ) -> None:  # fmt: skip
        self.program = program
        bodies = max((len(group.group.free) for group in program.groups), default=0)
        self._rows = min(block_rows(program), max(MAX_ROWS_OF_BODIES // max(bodies, 1), MIN_BLOCKS))
        self.statuses = np.zeros(len(terms.STATUS_MEANINGS), dtype=int)
        self._blocks, self._progress, self.total, self._answers = blocks, progress, total, answers

    @property
    def simulated(self) -> int:
        """The number of realizations so far."""
        return int(self.statuses.sum())

    @property
    def unresolved(self) -> int:
        """The number of realizations so far that were not resolved."""
        return int(self.statuses[list(terms.UNRESOLVED)].sum())

    def simulate(
        self, samples: int, *, seed: int = 0, start: int = 0, draws: Sampler | None = None, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Simulate `samples` realizations, starting with number `start`, and return the joined results of `observe`.

        By default these are measures (n, state, measure) and statuses (n,). `draws` replaces the draws of the program.
        """
        observed = []
        block = min(self._rows, max(self._rows, samples) // MIN_BLOCKS)  # for any number of threads or workers
        for arrays in self._blocks(
            observe, self.program, samples=start + samples, start=start, seed=seed, draws=draws, block=block
        ):
            observed.append(arrays)
            self.statuses += np.bincount(arrays[-1], minlength=len(self.statuses))
            if self._progress:
                self._progress(min(self.simulated, self.total), self.total)
            if self._answers:
                self._answers.check(self.total)
        return tuple(np.concatenate(column) for column in zip(*observed, strict=True))

    def simulate_deviations(self, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return measures (n, state, measure) and statuses (n,) of deviations (n, contributor)."""
        measured, status = self.simulate(len(deviations), draws=GivenDraws(deviations))
        return measured, status

    def simulate_design(
        self, design: Design, samples: int, *, seed: int, start: int = 0, observe: Observer = outcomes
    ) -> tuple[np.ndarray, ...]:
        """Return the results of `observe` for `samples` base realizations of a design, as arrays (base, realization, ...).

        The first base realization has the number `start`.
        """
        arrays = self.simulate(samples * design.size, seed=seed, start=start * design.size, draws=design, observe=observe)
        return tuple(array.reshape(samples, len(array) // samples, *array.shape[1:]) for array in arrays)


class Analysis:
    """A question about one model, and its answer: a dataset that can be stored in an archive.

    All options are checked before anything is simulated; without `samples` nothing is. Raises ModelError, ArchiveError,
    OptionError for invalid arguments.
    """

    def __init__(
        self, record: terms.AnalysisRecord, model: Model | Program, *, samples: int | None = None, seed: int = 1,
        solver: Solver | None = None, method: Choice | None = None, into: str | Path | None = None, client: Any = None,
        progress: Progress | None = None, minutes: float | None = None,
    ) -> None:  # fmt: skip
        self._answers = Answers(record, self._dataset, minutes)
        if samples is not None:
            check_counts(samples=samples, seed=seed)
        self.record, self.program, self._into = record, program_of(model, solver, method), into
        self.samples, self.seed, self.progress = samples or 0, seed, progress
        self.blocks, self._client = mapping(client), client
        if into is not None:
            check_room_for(into, record, self.program)

    @property
    def assembly(self) -> str:
        """The name of the assembly."""
        return self.program.nominal.assembly.name

    def dataset(
        self, values: Mapping[str, Any], labels: Mapping[str, Sequence[str]], *, units: str | None = None, **attributes: Any
    ) -> xr.Dataset:
        """Return the dataset of an Answer (see there), and add it to the archive if there is one."""
        return self._kept(self._dataset(Answer(values, labels, attributes, units=units)))

    def finest(self, answers: Iterable[Callable[[], Answer]]) -> xr.Dataset:
        """Return the dataset of the last of some answers, which are more and more accurate, and add it to the archive.

        Answers are functions, since most of them are never asked for. When the time of the analysis ends, the dataset is that
        of the latest answer. Raises Stopped, with this dataset, when the user stops the analysis.
        """
        try:
            return self._kept(self._answers.last(answers))
        except Stopped as stop:
            self._kept(stop.dataset)
            raise

    def _kept(self, dataset: xr.Dataset) -> xr.Dataset:
        if self._into is not None:
            keep(self._into, self.record, dataset, self.program)
        return dataset

    def _dataset(self, answer: Answer) -> xr.Dataset:
        values, labels, attributes, units = answer.values, answer.labels, dict(answer.attributes), answer.units
        stated = [*self.record.variables, *(v for v in self.record.of_stations if v.name in values)]
        arrays = {v.name: v.entry(np.array(values[v.name])) for v in stated}
        title = {"title": self.record.title.format(assembly=self.assembly, **attributes)}
        method = self.program.method
        settings = {
            "seed": self.seed, "solver": self.program.solver.name, "resolution": method.resolution,
            "objective": method.objective,
        }  # fmt: skip
        return xr.Dataset(
            arrays,
            coords=self._coordinates(labels) | ({} if units is None else {"measure_units": ((), units)}),
            attrs=title | attributes | (settings if self.samples else {}),
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

    def engine(self, total: int | None = None) -> Engine:
        """Return an engine that reports its progress if there is a `total` of realizations.

        Raises OptionError if that many realizations would take too much time or memory.
        """
        self.check_affordable(self.samples if total is None else total)
        progress = None if total is None else self.progress
        return Engine(self.program, self.blocks, progress=progress, total=total or 0, answers=self._answers)

    def check_affordable(self, realizations: int) -> None:
        """Raise OptionError if that many realizations would take too much time or memory."""
        check_affordable(self.program, samples=realizations, seed=self.seed, threads=threads_of(self._client))

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
