"""Derivatives of each measure with respect to each contributor, with contact."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Answer, Design, Progress, Results
from tolcontact.analyses.linear_model import leverages, total_derivatives
from tolcontact.compilation import Program
from tolcontact.method import Solver
from tolcontact.simulation import Block, defined_measures
from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.variation.draws import Draws
from tolcontact.workflow.models import Choice, Model

STEP = 0.01  # of a contributor's standard deviation
MAX_DIFFERENCE = 0.1  # of a derivative: if its one-sided values differ by more, there is a kink
NEGLIGIBLE = 0.1  # of the largest effect of a step on a measure: smaller ones may differ by a tenth of that


def sensitivities(
    model: Model | Program, *, samples: int = 1000, seed: int = 1, solver: Solver | None = None, method: Choice | None = None,
    into: str | Path | None = None, client: Any = None, progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return derivatives of each measure by each contributor that varies, from differences in each realization.

        nominal      (measure, contributor)                    of the raw measure at the nominal assembly, as in a stack-up;
                                                               NaN where the measure has a kink there
        leverage     (contributor)                             of a locator: the largest displacement of any point of its part,
                                                               for 1 mm; not a number for others
        sensitivity  (measure, state, contributor, interval)   mean over all realizations, with its 95 % interval
        spread       (measure, state, contributor)             standard deviation over realizations
        changing     (contributor, interval)                   share of realizations with a kink or a jump within the step
        by_contact   (measure, contact, contributor, interval) mean, corrected, over the other realizations: those untouched
                                                               by contact, and those touched
        step         (contributor)                             a hundredth of its standard deviation, up and down
        not_a_number (measure)                                 number of realizations in which the measure with contact, there
                                                               or at a step, is not a number: they are left out

    Each contributor is stepped alone, even if it is drawn jointly with others; a shared cause is stepped with the
    contributors that it drives. Where the active set is the same before and after the step, and both sides of the step agree
    within a tenth (or a hundredth of the largest effect of any contributor's step), the central difference is the derivative
    to second order. Elsewhere it is a mean of both sides and of a jump between them. The linearized resolution may cause
    jumps, and so may points that enter the objective "active points". (2 contributors + 1) `samples` are simulated, with 1000
    samples by default. `progress` is called with the number of finished realizations and the total. `model`, `seed`,
    `solver`, `method`, `into`, `client` and `minutes` are as in all analyses: `tc.analyses.sensitivities("model.py",
    samples=500)`.
    """
    analysis = Analysis(
        terms.SENSITIVITIES, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress, minutes=minutes,
    )  # fmt: skip
    program = analysis.program
    deviation = program.draws.without_shared_causes(analysis.sampled_deviations()).std(axis=0)
    columns = np.flatnonzero(deviation > 0)
    analysis.check_varies(columns.size)
    return analysis.finest(_answers(analysis, columns, STEP * deviation[columns]))


class SteppedDraws(Design):
    """Each realization, followed by steps up, then down, of each of `columns` by `steps` (column,) in its units.

    A step of a shared cause also steps the contributors that it drives.
    """

    def __init__(self, draws: Draws, columns: np.ndarray, steps: np.ndarray) -> None:
        self._draws, self._columns, self._steps = draws, columns, steps
        self._drive = draws.drive_matrix
        self.size = 1 + 2 * len(columns)

    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""
        members = np.repeat(self._draws(seed=seed, start=start, stop=stop)[:, None], self.size, axis=1)
        count, width = len(self._columns), members.shape[2]
        changes = self._steps[:, None] * (np.eye(width) + self._drive)[self._columns]
        members[:, 1 : count + 1] += changes
        members[:, count + 1 :] -= changes
        for k in np.flatnonzero(self._drive[self._columns].any(axis=1)):  # a datum depends on the tilts that a cause drives
            self._draws.add_shifts(members[:, 1 + k])
            self._draws.add_shifts(members[:, 1 + count + k])
        return members


def _answers(analysis: Analysis, columns: np.ndarray, steps: np.ndarray) -> Iterator[Callable[[], Answer]]:
    """Yield answers from more and more realizations; the first one has nominal derivatives only."""
    program, samples = analysis.program, analysis.samples
    stepped = SteppedDraws(program.draws, columns, steps)
    analysis.expect(samples * stepped.size)
    nominal = total_derivatives(program)[:, columns]
    unknown = np.full((len(nominal), 2, len(columns), len(terms.ESTIMATE)), np.nan)
    unknown_values = {
        "sensitivity": unknown, "spread": unknown[..., 0], "by_contact": unknown, "changing": unknown[0, 0],
        "not_a_number": np.zeros(len(nominal), dtype=int), "by_status": np.zeros(len(terms.STATUS_MEANINGS), dtype=int),
    }  # fmt: skip

    def answer(count: int, results: Results | None = None) -> Answer:
        values = unknown_values if results is None else _values(program, steps, nominal, *results())
        values = {"nominal": nominal, "leverage": leverages(program)[columns], "step": steps, **values}
        labels = {terms.CONTRIBUTOR: [program.nominal.contributors[column] for column in columns]}
        coarse = f"{count} of {samples} realizations" if count else "nominal derivatives, without contact"
        return Answer(values, labels, {"realizations": count, "simulated": count * stepped.size}, coarse)

    yield partial(answer, 0)
    for count, results in analysis.stages(stepped, samples, observe=_observed):
        yield partial(answer, count, results)


def _values(
    program: Program, steps: np.ndarray, nominal: np.ndarray, measured: np.ndarray, carrying: np.ndarray, statuses: np.ndarray
) -> dict[str, Any]:
    """Return the variables from measures (n, realization, state, measure) of steps, active points and statuses."""
    status = statuses[:, 0]  # of the realizations before any step
    up, down = np.split(np.arange(1, measured.shape[1]), 2)
    ahead = (measured[:, up] - measured[:, :1]) / steps[:, None, None]
    behind = (measured[:, :1] - measured[:, down]) / steps[:, None, None]
    slopes = (ahead + behind) / 2
    carries_otherwise = (carrying[:, up] != carrying[:, :1]).any(axis=2) | (carrying[:, down] != carrying[:, :1]).any(axis=2)
    rounding = program.accuracies / steps[:, None]
    changes = carries_otherwise | _has_kink(ahead, behind, np.nan_to_num(np.abs(nominal)), rounding, steps)
    smooth = np.where(changes[:, :, None], np.nan, slopes[:, :, terms.CORRECTED])
    is_touched = status != terms.Status.UNTOUCHED
    return {
        "sensitivity": np.stack([_means(slopes[:, :, state]) for state in range(len(terms.STATES))], axis=1),
        "spread": np.ma.masked_invalid(slopes).std(axis=0, ddof=1).filled(np.nan).transpose(2, 1, 0),
        "by_contact": np.stack([_means(smooth[~is_touched]), _means(smooth[is_touched])], axis=1),
        "changing": [intervals.proportion(column) for column in changes.T],
        "not_a_number": np.isnan(slopes[:, :, terms.CORRECTED]).any(axis=1).sum(axis=0),
        "by_status": np.bincount(status, minlength=len(terms.STATUS_MEANINGS)),
    }


def _observed(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return defined_measures(block), block.carrying.copy(), block.status.copy()


def _has_kink(
    ahead: np.ndarray, behind: np.ndarray, nominal: np.ndarray, rounding: np.ndarray, steps: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Return whether any measure has a kink or jump within the step, (n, contributor).

    Forward and backward differences `ahead` and `behind` are (n, contributor, state, measure), nominal derivatives (measure,
    contributor). `rounding` (contributor, measure) is the effect of the solver's rounding on differences, and `steps`
    (contributor,) make derivatives in different units comparable. A contributor with almost no effect has no kink.
    """
    size = np.maximum(np.abs(ahead), np.abs(behind))
    # (measure, contributor), of the values that are numbers; a jump does not enlarge a median.
    typical = np.ma.median(np.ma.masked_invalid(size.max(axis=2)), axis=0).filled(0.0).T  # type: ignore[no-untyped-call]
    largest = (np.maximum(nominal, typical) * steps).max(axis=1, initial=0)  # effect of a step, (measure,)
    floor = np.maximum(NEGLIGIBLE * largest / steps[:, None], rounding / MAX_DIFFERENCE)
    differs = np.abs(ahead - behind) > MAX_DIFFERENCE * np.maximum(size, floor[:, None])
    return np.asarray(differs.any(axis=(2, 3)))


def _means(slopes: np.ndarray) -> np.ndarray:
    """Return means (measure, contributor, interval) of the derivatives (n, contributor, measure) that are not NaN."""

    def mean(column: np.ndarray) -> Estimate:
        finite = column[np.isfinite(column)]
        return intervals.mean(finite) if len(finite) > 1 else UNDEFINED

    return np.array([[mean(column) for column in measure] for measure in slopes.transpose(2, 1, 0)])
