"""Which contributors a measure's variance comes from, with contact and without."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.designs import MixedDraws, ReleasedDraws, independent_groups
from tolcontact.analyses.linear_model import linear_model
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import Block
from tolcontact.simulation.cluster import MapBlocks, mapping
from tolcontact.statistics.sobol_indices import missed, shapley_effects, sobol_indices
from tolcontact.vocabulary import GROUPED_BY
from tolcontact.workflow.models import Choice, Model, check_counts, program_of
from tolcontact.workflow.run import Progress

SOME = 1 << 14  # realizations that spreads are estimated from


def contributions(
    model: Model | Program,
    *,
    samples: int = 4096,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    by: str = "contributor",
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Sobol' indices of each measure (see tolcontact.statistics.sobol_indices), beside the classical linear percentages.

        first   (measure, state, group, interval)   share of variance by a group alone, with its 95 % interval
        total   (measure, state, group, interval)   with all that it does together with others
        shapley (measure, state, unit, interval)    Shapley effects, if something is correlated: units are groups without that
        linear  (measure, group)                    by sensitivities of the raw measure at the nominal assembly: (s sigma)^2
        missed  (measure, state, interval)          share of variance that a prediction by these sensitivities misses
        by_status (status_meaning)                  number of realizations

    `by` is "contributor", "feature" or "part". Contributors that are not independent of each other (correlated, drawn together,
    driven by one cause) are one group whatever `by` is; those that do not vary are left out.
    `samples` are base realizations: samples (2 + groups) are simulated, and samples (1 + units) for Shapley effects.
    `progress` is called with how many are done, of all.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the same model, as the group
    statistics/contributions; the report shows it.
    Raises ModelError, ArchiveError, OptionError for options that cannot be used, or a model in which nothing varies.
    """
    check_counts(samples=samples, seed=seed)
    if by not in GROUPED_BY:
        raise OptionError(f"by is {by!r}; expected one of: {', '.join(GROUPED_BY)}")
    program, blocks = program_of(model, solver, method), mapping(client)
    if into is not None:
        check_room_for(into, terms.OF_CONTRIBUTIONS, program)
    some = program.draws(seed=seed, start=0, stop=SOME)
    varies = np.ptp(some, axis=0) > 0
    whose = owners(program, by)
    groups, units = (
        {
            name: columns[varies[columns]]
            for name, columns in independent_groups(program.draws, whose, correlated=correlated).items()
            if varies[columns].any()
        }
        for correlated in (True, False)
    )
    if not groups:
        raise OptionError(
            f'nothing varies in "{program.nominal.assembly.name}"; give tolerances before asking what they contribute'
        )
    mixed, released = MixedDraws(program.draws, list(groups.values())), ReleasedDraws(program.draws, units)
    is_correlated = len(units) > len(groups)
    simulated = samples * (mixed.together + is_correlated * released.together)
    values, statuses, A = _simulated(
        program, mixed, samples, seed, blocks, progress and (lambda done: progress(done, simulated))
    )
    shares = np.empty((values.shape[3], values.shape[2], 0, len(terms.ESTIMATE)))
    if is_correlated:
        before = samples * mixed.together
        freed, more, _ = _simulated(
            program, released, samples, seed, blocks, progress and (lambda n: progress(before + n, simulated))
        )
        statuses, places = statuses + more, released.places(seed, 0, samples)
        shares = np.array([[shapley_effects(of.T, places) for of in state] for state in freed.T])
    slopes = linear_model(program).by_deviations
    first, total, linear, off = [], [], [], []
    for measure in range(len(program.nominal.measures)):
        indices = [sobol_indices(values[:, :, state, measure]) for state in range(len(terms.STATES))]
        first.append([own for own, _ in indices])
        total.append([own for _, own in indices])
        parts = np.array([(some[:, columns] @ slopes[measure, columns]).var() for columns in groups.values()])
        linear.append(parts / parts.sum() if parts.sum() > 0 else np.full(len(parts), np.nan))
        predicted = A @ slopes[measure]
        off.append([missed(values[:, 0, state, measure], predicted) for state in range(len(terms.STATES))])
    found = {
        terms.FIRST: first, terms.TOTAL: total, terms.SHAPLEY: shares, terms.LINEAR: linear, terms.MISSED: off,
        "by_status": statuses,
    }  # fmt: skip
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(found[of.name]), of.all_attributes) for of in terms.CONTRIBUTIONS},
        coords={
            terms.MEASURE: [measure.name for measure in program.nominal.measures],
            terms.STATE: list(terms.STATES),
            terms.GROUP: list(groups),
            terms.UNIT: list(units) if is_correlated else [],
            terms.INTERVAL: list(terms.ESTIMATE),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        },
        attrs={
            "title": f"contributions to the measures of {program.nominal.assembly.name}",
            "base_realizations": samples,
            "realizations": simulated,
            "seed": seed,
            "by": by,
            "solver": program.plugin.name,
            "resolution": program.method.resolution,
            "objective": program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_CONTRIBUTIONS, answer, program)
    return answer


def owners(program: Program, by: str) -> list[str]:
    """Whose each column of the deviations is: its own label's, or that of its feature or part."""
    nominal, labels = program.nominal, list(program.nominal.contributors)
    if by == "contributor":
        return labels
    # Locators belong to their part, which they place, also where features are asked for.
    part_of = {label: part.name for part in nominal.parts for label in part.locators.labels}
    for own in nominal.features:
        part_of |= dict.fromkeys(own.labels, own.feature.part.name if by == "part" else own.label)
    return [part_of.get(label, label) for label in labels]


def _simulated(
    program: Program,
    draws: MixedDraws | ReleasedDraws,
    samples: int,
    seed: int,
    blocks: MapBlocks,
    progress: Progress | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Measures (base, realization, state, measure), statuses by meaning, and the first draws (base, column)."""
    together = draws.together
    measured, A, statuses, done = [], [], np.zeros(len(terms.STATUS_MEANINGS), dtype=int), 0
    for values, own, counts in blocks(_Observed(together), program, samples=samples * together, seed=seed, draws=draws):
        measured.append(values)
        A.append(own)
        statuses += counts
        done += len(values)
        if progress:
            progress(done)
    every = np.concatenate(measured)
    return every.reshape(samples, together, *every.shape[1:]), statuses, np.concatenate(A)


@dataclass(frozen=True)
class _Observed:
    """Of a block: measures, deviations of the first of every so many realizations, and statuses by meaning."""

    together: int

    def __call__(self, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        first = block.deviations[-block.start % self.together :: self.together]
        return block.measured.copy(), first.copy(), np.bincount(block.status, minlength=len(terms.STATUS_MEANINGS))
