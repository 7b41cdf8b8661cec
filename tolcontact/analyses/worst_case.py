"""The least and the largest value that each measure can have, with the combination of deviations that gives it."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import poses, vocabulary as terms
from tolcontact.analyses.allowed_space import Region
from tolcontact.analyses.analysis import Analysis
from tolcontact.analyses.engine import Progress
from tolcontact.analyses.extreme_search import Effort, Evaluation, Searcher, Searches
from tolcontact.analyses.farthest_pose import farthest_poses
from tolcontact.analyses.linear_model import LinearModel, linear_model
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import simulate_blocks
from tolcontact.variation import GivenDraws
from tolcontact.workflow.models import Choice, Model

END_TOLERANCE = 1e-4  # of a measure's spread: searches that end at values closer than this have the same end


def worst_case(
    model: Model | Program, *, samples: int = 4096, seed: int = 1, solver: str | None = None, method: Choice | None = None,
    into: str | Path | None = None, client: Any = None, progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return the least and the largest value of each measure over all that the drawings allow.

        worst       (measure, state, end)               found by searches on the engine, nonlinear and with contact
        deviations  (measure, state, end, contributor)  the combination that gives it
        bound       (measure, state, end)               no pose free of penetration lies beyond, in the linear model (see
                                                        tolcontact.analyses.farthest_pose); infinite if contact alone would
                                                        have to hold the part
        random      (measure, state, end)               the worst of `samples` random combinations
        ends        (measure, state, end)               number of different values that twelve searches ended at
        unseen      (measure, state, end)               expected share of starts that lead to an end which no search found
        by_status   (status_meaning)                    number of realizations, of all that were simulated
        measured, rotation, translation, gap_min, kkt_residual, status  (case, ...)  corrected worst cases in the form in which
                                                        archives hold realizations; a case is "least" or "largest" of a measure

    tolcontact.analyses.allowed_space describes the region that combinations lie in. With contact a measure is neither smooth
    nor concave, and the linearized resolution jumps: the searches may miss a worse combination. Four searches begin at the
    best random combinations, twelve at any of them (see tolcontact.analyses.extreme_search). `unseen` is the estimate
    w (w + 1) / (n (n - 1)) for w different ends of n = 12 searches (Boender, Rinnooy Kan, 1987).
    Only certified realizations count. `progress` is called with the number of searches that ended, and of all.
    Arguments that all analyses share, and what they raise, are described in tolcontact.analyses.
    """
    analysis = Analysis(
        terms.WORST_CASE, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress,
    )  # fmt: skip
    return search_worst_case(analysis, Effort())


def search_worst_case(analysis: Analysis, effort: Effort) -> xr.Dataset:
    """Return the dataset of `worst_case`, by searches of some effort."""
    program, engine = analysis.program, analysis.engine()
    region = Region(program.draws, seed=analysis.seed)
    analysis.check_varies(region.varies.size)
    linear, evaluation, rng = linear_model(program), Evaluation(engine, region), np.random.default_rng(analysis.seed)
    starts = _starts(region, linear, rng, analysis.samples)
    measured = evaluation.corrected(starts)
    if not np.isfinite(measured[:, terms.CORRECTED]).any():
        raise OptionError(f'"{analysis.assembly}" cannot be resolved for any of {len(starts)} combinations tried')
    spread = np.nanmax(measured, axis=(0, 1)) - np.nanmin(measured, axis=(0, 1))
    searches = Searches.begin(starts, measured, effort, rng)
    searcher = Searcher(region, evaluation, spread, rng, effort.finest_step)
    searcher.search(searches, analysis.progress)
    values = searches.value.reshape(-1, effort.best + effort.random)
    best = searches.take(values.argmax(axis=1) + values.shape[1] * np.arange(len(values)))
    searcher.finish(best)
    random_values = values[:, effort.best :]
    ends = np.array([_count_ends(row, END_TOLERANCE * spread[k]) for row, k in zip(random_values, best.measure, strict=True)])
    corrected = best.take(np.flatnonzero(best.state == terms.CORRECTED))
    shape = (len(program.nominal.measures), len(terms.STATES), len(terms.ENDS))
    arrays = {
        "worst": (best.sense * best.value).reshape(shape),
        "deviations": region.deviations(best.point).reshape(*shape, -1),
        "bound": farthest_poses(program, region, linear),
        "random": np.stack([np.nanmin(measured, axis=0), np.nanmax(measured, axis=0)], axis=-1).swapaxes(0, 1),
        "ends": ends.reshape(shape),
        "unseen": np.minimum(1.0, ends * (ends + 1) / (effort.random * (effort.random - 1))).reshape(shape),
        "by_status": engine.statuses,
        **_as_realizations(program, region.deviations(corrected.point)),
    }
    cases = [f"{end} {measure.name}" for measure in program.nominal.measures for end in terms.ENDS]
    searches_of_each = effort.best + effort.random
    return analysis.dataset(arrays, {terms.CASE: cases}, random_combinations=analysis.samples, searches=searches_of_each)


def _starts(region: Region, linear: LinearModel, rng: np.random.Generator, samples: int) -> np.ndarray:
    """Return points (n, contributor): the middle, the far ends along linear slopes, and `samples` random ones."""
    slopes = region.slopes(linear.by_deviations)
    far_ends = [region.exactly_farthest(sense * row) for row in slopes for sense in terms.SENSES]
    return np.vstack([region.middle, *far_ends, region.scattered(rng, samples)])


def _as_realizations(program: Program, deviations: np.ndarray) -> dict[str, np.ndarray]:
    """Return the variables that archives have of realizations, for deviations (n, contributor)."""
    (block,) = simulate_blocks(program, samples=len(deviations), seed=0, draws=GivenDraws(deviations), block=len(deviations))
    return {
        terms.MEASURED.name: block.measured, terms.ROTATION.name: poses.rotation(block.poses),
        terms.TRANSLATION.name: poses.translation(block.poses),
        terms.GAP_MIN.name: block.gap_min, terms.KKT_RESIDUAL.name: block.kkt_residual, terms.STATUS.name: block.status,
    }  # fmt: skip


def _count_ends(values: np.ndarray, tolerance: float) -> int:
    """Return how many values (n,) differ by more than a tolerance from the next smaller one."""
    return 1 + int((np.diff(np.sort(values)) > tolerance).sum())
