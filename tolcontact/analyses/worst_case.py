"""The least and the largest value that each measure can have, with the combination of deviations that gives it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import poses
from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import Region
from tolcontact.analyses.extreme_search import Evaluation, Searcher, Searches
from tolcontact.analyses.farthest_pose import farthest_poses
from tolcontact.analyses.linear_model import linear_model
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import simulate_blocks
from tolcontact.simulation.cluster import mapping
from tolcontact.variation import GivenDraws
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

BEST, OTHERS = 4, 12  # searches for each value: from the best combinations, and from others at random
SAME = 1e-4  # of a measure's spread: ends that differ by less are one


def worst_case(
    model: Model | Program,
    *,
    samples: int = 4096,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """The least and the largest value of each measure over all that drawings allow (see tolcontact.analyses.allowed_space).

        worst       (measure, state, end)               found by searches on the engine, nonlinear and with contact
        deviations  (measure, state, end, contributor)  the combination that gives it
        bound       (measure, state, end)               beyond which no pose free of penetration lies, in the linear model; see
                                                        tolcontact.analyses.farthest_pose. Infinite: contact alone holds nothing
        random      (measure, state, end)               the best of `samples` random combinations
        ends        (measure, state, end)               number of different values that the twelve ended at
        unseen      (measure, state, end)               expected share of starts whose end no search has seen
        by_status   (status_meaning)                    number of realizations, of all that were simulated
        measured, rotation, translation, gap_min, kkt_residual, status  (case, ...)  corrected worst cases, as archives keep
                                                        realizations; a case is "least" or "largest" of a measure

    With contact a measure is neither smooth nor concave, and the linearized resolution jumps: a search finds what it finds.
    Four begin at the best random combinations, twelve at any of them. Each goes on along single contributors, random
    directions, and to the far end of the region in the direction of its slopes, with steps that shrink (a generating set
    search; Kolda, Lewis, Torczon, 2003). `unseen` is the estimate w (w + 1) / (n (n - 1)) of w ends of the n = 12 (Boender,
    Rinnooy Kan, 1987).
    Only certified realizations count. `progress` is called with the number of searches that ended, and of all.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the same model, as the group
    statistics/worst_case; the report shows it.
    Raises ModelError, ArchiveError, OptionError for options that cannot be used, or a model in which nothing varies.
    """
    check_counts(samples=samples, seed=seed)
    program, blocks = program_of(model, solver, method), mapping(client)
    if into is not None:
        check_room_for(into, terms.OF_WORST_CASE, program)
    region = Region(program.draws, seed=seed)
    if not region.varies.size:
        raise OptionError(f'nothing varies in "{program.nominal.assembly.name}"; give it tolerances first')
    rng, evaluate, linear = np.random.default_rng(seed), Evaluation(program, region, blocks), linear_model(program)
    slopes = region.slopes(linear.by_deviations)
    along = [region.exactly_farthest(sense * row) for row in slopes for sense in terms.SENSES]
    starts = np.vstack([region.middle, *along, region.scattered(rng, samples)])
    seen = evaluate(starts)
    if not np.isfinite(seen[:, terms.CORRECTED]).any():
        raise OptionError(f'"{program.nominal.assembly.name}" cannot be resolved for any of {len(starts)} combinations tried')
    spread = np.nanmax(seen, axis=(0, 1)) - np.nanmin(seen, axis=(0, 1))
    searches, searcher = Searches.begun(starts, seen, BEST, OTHERS, rng), Searcher(region, evaluate, spread, rng)
    searcher.search(searches, progress)
    worth = searches.value.reshape(-1, BEST + OTHERS)
    best = searches.take(worth.argmax(axis=1) + worth.shape[1] * np.arange(len(worth)))
    searcher.finish(best)
    shape = (len(program.nominal.measures), len(terms.STATES), len(terms.ENDS))
    ends = np.array([_different(row[BEST:], SAME * spread[of]) for row, of in zip(worth, best.measure, strict=True)])
    found = {
        "worst": (best.sense * best.value).reshape(shape),
        "deviations": region.deviations(best.own).reshape(*shape, -1),
        "bound": farthest_poses(program, region, linear),
        "random": np.stack([np.nanmin(seen, axis=0), np.nanmax(seen, axis=0)], axis=-1).swapaxes(0, 1),
        "ends": ends.reshape(shape),
        "unseen": np.minimum(1.0, ends * (ends + 1) / (OTHERS * (OTHERS - 1))).reshape(shape),
        "by_status": evaluate.statuses,
    }
    corrected = best.take(np.flatnonzero(best.state == terms.CORRECTED))
    found |= _as_realizations(program, region.deviations(corrected.own))
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(found[of.name]), of.all_attributes) for of in terms.WORST_CASE},
        coords={
            terms.MEASURE: [measure.name for measure in program.nominal.measures],
            terms.STATE: list(terms.STATES),
            terms.END: list(terms.ENDS),
            terms.CONTRIBUTOR: list(program.nominal.contributors),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
            terms.CASE: [f"{end} {measure.name}" for measure in program.nominal.measures for end in terms.ENDS],
            terms.AXIS: list(terms.AXES),
            terms.BODY_AXIS: list(terms.AXES),
            terms.PART: [part.name for part in program.nominal.parts],
            terms.PAIR: [pair.name for pair in program.nominal.pairs],
            "measure_units": (terms.MEASURE, [measure.units for measure in program.nominal.measures]),
            "contributor_units": (terms.CONTRIBUTOR, [each.units for each in program.draws.contributors]),
        },
        attrs={
            "title": f"worst cases of the measures of {program.nominal.assembly.name}",
            "random_combinations": samples,
            "searches": BEST + OTHERS,
            "seed": seed,
            "solver": program.plugin.name,
            "resolution": program.method.resolution,
            "objective": program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_WORST_CASE, answer, program)
    return answer


def _as_realizations(program: Program, deviations: np.ndarray) -> dict[str, np.ndarray]:
    """What archives keep of realizations, of deviations (n, contributor)."""
    (block,) = simulate_blocks(program, samples=len(deviations), seed=0, draws=GivenDraws(deviations), block=len(deviations))
    return {
        terms.MEASURED.name: block.measured, terms.ROTATION.name: poses.rotation(block.poses),
        terms.TRANSLATION.name: poses.translation(block.poses),
        terms.GAP_MIN.name: block.gap_min, terms.KKT_RESIDUAL.name: block.kkt_residual, terms.STATUS.name: block.status,
    }  # fmt: skip


def _different(values: np.ndarray, same: float) -> int:
    """How many values (n,) differ by more than `same` from the next smaller one."""
    return 1 + int((np.diff(np.sort(values)) > same).sum())
