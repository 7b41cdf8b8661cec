"""The least and the largest possible value of each measure, with the combination of deviations that causes it."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import poses, vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.analysis import Analysis, Answer, Progress
from tolcontact.analyses.extreme_search import Evaluation, Searcher
from tolcontact.analyses.linear_model import LinearModel, farthest_poses, linear_model
from tolcontact.analyses.searches import Effort, Searches
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.features.freedoms import FORM
from tolcontact.method import Solver
from tolcontact.simulation import simulate_blocks
from tolcontact.variation import GivenDraws
from tolcontact.workflow.models import Choice, Model

PER_LEVEL, PER_CONTRIBUTOR = 20.0, 6.0  # combinations that a search needs at each step length
PER_POLISH, PER_POLISHED_CONTRIBUTOR = 110.0, 22.0  # combinations that polishing an end needs
EXCHANGES = 24  # combinations at which influences are looked for
END_TOLERANCE = 1e-3  # of a measure's spread: searches that end at values closer than this have the same end


def worst_case(
    model: Model | Program, *, samples: int = 512, seed: int = 1, solver: Solver | None = None, method: Choice | None = None,
    into: str | Path | None = None, client: Any = None, progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return the worst-case minimum and maximum of each measure over everything that the tolerances allow.

        worst       (measure, state, end)               found by searches on the engine, nonlinear and with contact
        deviations  (measure, state, end, contributor)  the combination that causes it
        bound       (measure, state, end)               linear estimate. Raw: the sum of all tolerances times their nominal
                                                        sensitivities. Corrected: in the linear model no pose free of
                                                        penetration lies beyond (see tolcontact.analyses.linear_model);
                                                        infinite if contact or springs alone would have to hold
                                                        the part
        random      (measure, state, end)               the worst of `samples` random combinations
        agreeing    (measure, state, end)               number of searches that met: they ended at the value of the best one, or
                                                        the measure grows along the straight line from their end to its end
        ends        (measure, state, end)               number of distinct end values of searches from random combinations
        unseen      (measure, state, end)               expected share of starts that lead to an end which no search found
        by_status   (status_meaning)                    number of realizations, out of all that were simulated
        measured, rotation, translation, gap_min, kkt_residual, status  (case, ...)  corrected worst cases in the form of
                                                        archived realizations; a case is "least" or "largest" of a measure
        station_rotation, station_translation  (case, state, station_part, ...)  their poses in all stations, in sequence

    tolcontact.analyses.allowed_space describes the region of the combinations. With contact a measure is neither smooth nor
    concave, and the linearized resolution jumps: the searches may miss a worse combination, and `agreeing` states how many of
    them met. Each measure is searched along the contributors that have an influence on it; the others change nothing when they
    are exchanged all at once, in 24 random combinations and at each end (see tolcontact.analyses.extreme_search).
    `samples` / 256 searches start at the best of all trial combinations: random ones, the first `samples` rows of each
    population, the far ends along nominal sensitivities, and the far ends along the slopes of a regression; `samples` / 128
    start at any of them (see tolcontact.analyses.extreme_search). The best one continues in other random directions until it
    gains no more. `unseen` is the estimate w (w + 1) / (n (n - 1)) for w distinct ends of n searches from random combinations
    (Boender, Rinnooy Kan, 1987). Faces with form keep their shape, as with form=None: no worst case is searched in the
    zones of forms, and the attribute `without_form` names these features. The linear estimate is exact to first order in the
    deviations: large tilts may exceed it. Only certified realizations count. `progress` is called with the number of
    realizations simulated, and the approximate total.
    `model`, `samples` (512 by default), `seed`, `solver`, `method`, `into`, `client` and `minutes` are as in all analyses (see
    tolcontact.analyses).

    `tc.analyses.worst_case("model.py", solver="daqp")`
    """
    analysis = Analysis(
        terms.WORST_CASE, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress, minutes=minutes,
    )  # fmt: skip
    return search_worst_case(analysis, Effort.of(analysis.samples))


def search_worst_case(analysis: Analysis, effort: Effort) -> xr.Dataset:
    """Return the dataset of `worst_case`, by searches with a given effort."""
    return analysis.finest(_answers(analysis, effort))


def _answers(analysis: Analysis, effort: Effort) -> Iterator[Callable[[], Answer]]:
    """Yield the worst of random combinations, which searches then improve, and the result of the searches."""
    analysis.check_rigid("ask for tails, or run many realizations")
    analysis.expect(analysis.samples)
    program = analysis.program
    region = AllowedRegion(program.draws, seed=analysis.seed)
    analysis.check_varies(region.varies.size)
    linear, evaluation, rng = linear_model(program), Evaluation(analysis, region), np.random.default_rng(analysis.seed)
    analysis.total += _expected(np.full(len(program.nominal.measures), region.moves.size), effort)
    _check_defined(
        program, ~np.isfinite(np.column_stack([linear.measures, linear.by_deviations, linear.by_motion])).all(axis=1)
    )
    starts, measured = _starts(region, linear, rng, analysis.samples, evaluation)
    _check_defined(program, evaluation.is_undefined)
    if not np.isfinite(measured[:, terms.CORRECTED]).any():
        raise OptionError(f'"{analysis.assembly}" cannot be resolved for any of {len(starts)} combinations tried')
    spread = np.nanmax(measured, axis=(0, 1)) - np.nanmin(measured, axis=(0, 1))
    searches, bound = Searches.begin(starts, measured, effort, rng), farthest_poses(program, region, linear)
    random = np.stack([np.nanmin(measured, axis=0), np.nanmax(measured, axis=0)], axis=-1).swapaxes(0, 1)

    def answer(best: Searches | None = None) -> Answer:
        best = best or searches.best_of(effort.searches)
        values = _extremes(program, region, effort, spread, searches, best)
        values |= {"bound": bound, "random": random, "by_status": analysis.statuses}
        cases = [f"{end} {measure.name}" for measure in program.nominal.measures for end in terms.ENDS]
        labels = [contributor.label for contributor in program.draws.contributors if contributor.source == FORM]
        formed = dict.fromkeys(label.rpartition(".")[0] for label in labels)
        without = {terms.WITHOUT_FORM: ", ".join(formed)} if formed else {}
        attributes = {"random_combinations": analysis.samples, "searches": effort.searches, **without}
        text = f"the worst among {len(starts)} combinations, and of searches that have not ended"
        return Answer(values, {terms.CASE: cases}, attributes, text)

    yield answer
    searcher = Searcher(region, evaluation, spread, rng, effort)
    searcher.explore(starts[rng.choice(len(starts), EXCHANGES)], region.scattered(rng, EXCHANGES))
    advanced = _forecast(analysis, searcher.is_active.sum(axis=1), effort)
    best = searcher.run(searches, advanced, region.scattered(rng, EXCHANGES))
    _check_defined(program, evaluation.is_undefined)
    yield lambda: answer(best)


def _extremes(
    program: Program, region: AllowedRegion, effort: Effort, spread: np.ndarray, searches: Searches, best: Searches
) -> dict[str, np.ndarray]:
    """Return the variables of the best searches, and how many searches agree with them."""
    values = searches.value.reshape(-1, effort.searches)
    tolerances = END_TOLERANCE * spread[best.measure]
    ends = 1 + (np.diff(np.sort(values[:, effort.best :], axis=1), axis=1) > tolerances[:, None]).sum(axis=1)
    corrected = best.take(np.flatnonzero(best.state == terms.CORRECTED))
    shape = (len(program.nominal.measures), len(terms.STATES), len(terms.ENDS))
    return {
        "worst": (best.sense * best.value).reshape(shape),
        "deviations": region.deviations(best.point).reshape(*shape, -1),
        "agreeing": (values >= (values.max(axis=1) - tolerances)[:, None]).sum(axis=1).reshape(shape),
        "ends": ends.reshape(shape),
        "unseen": np.minimum(1.0, ends * (ends + 1) / (effort.random * (effort.random - 1))).reshape(shape),
        **_as_realizations(program, region.deviations(corrected.point)),
    }


def _check_defined(program: Program, is_undefined: np.ndarray) -> None:
    """Raise OptionError if a measure (measure,) is not finite at any point of the region, or near the nominal assembly."""
    names = [f'"{program.nominal.measures[number].name}"' for number in np.flatnonzero(is_undefined)]
    if names:
        raise OptionError(
            f'"{program.nominal.assembly.name}": {"measurement" if len(names) == 1 else "measurements"} {" and ".join(names)}: '
            "not a finite number for some combinations that the tolerances allow, so there is no worst case; define it for all "
            "of them, or leave it out"
        )


def _expected(active: np.ndarray, effort: Effort) -> int:
    """Return the approximate number of combinations of all searches, with `active` (measure,) contributors each."""
    return round(len(terms.ENDS) * effort.searches * effort.levels * (PER_LEVEL + PER_CONTRIBUTOR * active).sum())


def _forecast(analysis: Analysis, active: np.ndarray, effort: Effort) -> Callable[[float], None]:
    """Return a function that revises the expected total when a share of the searches is finished.

    active   (measure,) number of contributors along which each measure is searched
    """
    before, of_searches = analysis.simulated, _expected(active, effort)
    of_polishing = round(len(terms.ENDS) * (PER_POLISH + PER_POLISHED_CONTRIBUTOR * active).sum())

    def advanced(share: float) -> None:
        expected = (1 - share) * of_searches + analysis.simulated - before
        analysis.total = analysis.simulated + round((1 - share) * expected) + of_polishing

    advanced(0.0)
    return advanced


def _starts(
    region: AllowedRegion, linear: LinearModel, rng: np.random.Generator, samples: int, evaluation: Evaluation
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, contributor), and their measures (n, state, measure).

    The points are the centre, `samples` random ones, as many rows of each population of measured parts, and the far ends along
    nominal slopes and along the slopes of a regression of the corrected measures.
    """
    nominal_ends = _far_ends(region, region.slopes(linear.by_deviations))
    points = np.vstack([region.middle, nominal_ends, region.scattered(rng, samples), *region.measured_rows(samples)])
    measured = evaluation.corrected(points)
    corrected = measured[:, terms.CORRECTED]
    resolved = np.isfinite(corrected).all(axis=1)
    offsets, values = (points - region.middle)[resolved], corrected[resolved]
    if not len(values):
        return points, measured
    slopes = np.linalg.lstsq(np.column_stack([np.ones(len(offsets)), offsets]), values, rcond=None)[0][1:].T
    further = _far_ends(region, slopes)
    return np.vstack([points, further]), np.concatenate([measured, evaluation.corrected(further)])


def _far_ends(region: AllowedRegion, slopes: np.ndarray) -> np.ndarray:
    """Return the points (n, contributor) farthest along slopes (measure, contributor), in both senses."""
    ends = [region.exactly_farthest(sense * row) for row in slopes for sense in terms.SENSES]
    return np.array(ends).reshape(-1, slopes.shape[1])


def _as_realizations(program: Program, deviations: np.ndarray) -> dict[str, np.ndarray]:
    """Return the variables of archived realizations, for deviations (n, contributor)."""
    (block,) = simulate_blocks(program, samples=len(deviations), seed=0, draws=GivenDraws(deviations), block=len(deviations))
    last_poses, of_stations = block.poses[:, :, program.nominal.last_indices], dict[str, np.ndarray]()
    if program.stations:  # parts are listed station by station
        of_stations[terms.STATION_ROTATION.name] = poses.rotation(block.poses)
        of_stations[terms.STATION_TRANSLATION.name] = poses.translation(block.poses)
    return of_stations | {
        terms.MEASURED.name: block.measured, terms.ROTATION.name: poses.rotation(last_poses),
        terms.TRANSLATION.name: poses.translation(last_poses),
        terms.GAP_MIN.name: block.gap_min, terms.KKT_RESIDUAL.name: block.kkt_residual, terms.STATUS.name: block.status,
    }  # fmt: skip
