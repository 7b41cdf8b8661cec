"""How much each measure follows each contributor, through contact."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.contributions import SOME
from tolcontact.analyses.designs import SteppedDraws
from tolcontact.analyses.linear_model import leverages, linear_model
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import Block
from tolcontact.simulation.cluster import MapBlocks, mapping
from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

STEP = 0.01  # of a contributor's standard deviation
KINK = 0.1  # of a derivative: if both sides differ by more, it is not one
SLIGHT = 0.1  # of the largest derivative of a measure: smaller ones may differ by a tenth of that


def sensitivities(
    model: Model | Program,
    *,
    samples: int = 1000,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Derivatives of each measure by each contributor that varies, realization by realization, by differences on the draws.

        nominal      (measure, contributor)                    of the raw measure at the nominal assembly, as designers read it
        leverage     (contributor)                             of a locator: the largest displacement of any point of its part,
                                                               for 1 mm; not a number for others
        sensitivity  (measure, state, contributor, interval)   mean over all realizations, with its 95 % interval
        spread       (measure, state, contributor)             standard deviation over realizations
        changing     (contributor, interval)                   share of realizations with a kink or a jump within the step
        by_contact   (measure, contact, contributor, interval) mean, corrected, of the others: those untouched, those touched
        step         (contributor)                             a hundredth of its standard deviation, up and down

    A contributor steps alone, also where it is drawn together with others. Where no carrying point comes or goes, and both
    sides of the step agree within a tenth (or a hundredth of the largest derivative of all), a difference is the derivative,
    but for its second order. Elsewhere it is that of both sides, and of a jump between them, which the linearized resolution
    may make, as may points that come into the objective "active points". (2 contributors + 1) samples are simulated.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the same model, as the group
    statistics/sensitivities; the report shows it.
    Raises ModelError, ArchiveError, OptionError for options that cannot be used, or a model in which nothing varies.
    """
    check_counts(samples=samples, seed=seed)
    program = program_of(model, solver, method)
    if into is not None:
        check_room_for(into, terms.OF_SENSITIVITIES, program)
    deviation = program.draws(seed=seed, start=0, stop=SOME).std(axis=0)
    columns = np.flatnonzero(deviation > 0)
    if not columns.size:
        raise OptionError(f'nothing varies in "{program.nominal.assembly.name}"; give it tolerances first')
    stepped = SteppedDraws(program.draws, columns, STEP * deviation[columns])
    measured, carrying, touched, statuses = _simulated(program, stepped, samples, seed, mapping(client), progress)
    up, down = np.split(np.arange(1, stepped.together), 2)
    steps = (STEP * deviation[columns])[:, None, None]
    ahead, behind = (measured[:, up] - measured[:, :1]) / steps, (measured[:, :1] - measured[:, down]) / steps
    slopes = (ahead + behind) / 2
    nominal = linear_model(program).by_deviations[:, columns]
    moved = (carrying[:, up] != carrying[:, :1]).any(axis=2) | (carrying[:, down] != carrying[:, :1]).any(axis=2)
    changes = moved | _kinked(ahead, behind, np.abs(nominal))
    smooth = np.where(changes[:, :, None], np.nan, slopes[:, :, terms.CORRECTED])
    by_contact = [_means(smooth[touched == is_touched]) for is_touched in (False, True)]
    found = {
        "nominal": nominal,
        "leverage": leverages(program)[columns],
        "sensitivity": np.stack([_means(slopes[:, :, state]) for state in range(len(terms.STATES))], axis=1),
        "spread": slopes.std(axis=0, ddof=1).transpose(2, 1, 0),
        "by_contact": np.stack(by_contact, axis=1),
        "changing": [intervals.proportion(column) for column in changes.T],
        "step": STEP * deviation[columns],
        "by_status": statuses,
    }
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(found[of.name]), of.all_attributes) for of in terms.SENSITIVITIES},
        coords={
            terms.MEASURE: [measure.name for measure in program.nominal.measures],
            terms.STATE: list(terms.STATES),
            terms.CONTRIBUTOR: [program.nominal.contributors[k] for k in columns],
            terms.CONTACT: list(terms.CONTACT_STATES),
            terms.INTERVAL: list(terms.ESTIMATE),
            terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
            "measure_units": (terms.MEASURE, [measure.units for measure in program.nominal.measures]),
            "contributor_units": (terms.CONTRIBUTOR, [program.draws.contributors[k].units for k in columns]),
        },
        attrs={
            "title": f"sensitivities of the measures of {program.nominal.assembly.name}",
            "realizations": samples,
            "simulated": samples * stepped.together,
            "seed": seed,
            "solver": program.plugin.name,
            "resolution": program.method.resolution,
            "objective": program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_SENSITIVITIES, answer, program)
    return answer


def _simulated(
    program: Program,
    stepped: SteppedDraws,
    samples: int,
    seed: int,
    blocks: MapBlocks,
    progress: Callable[[int, int], None] | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each realization and its steps: measures (n, step, state, measure) and carrying points (n, step, pair); of the
    realizations themselves whether contact touches them (n,), and statuses by meaning."""
    together, done = stepped.together, 0
    measured: list[np.ndarray] = []
    carrying: list[np.ndarray] = []
    status: list[np.ndarray] = []
    for found in blocks(_observed, program, samples=samples * together, seed=seed, draws=stepped):
        for every, own in zip((measured, carrying, status), found, strict=True):
            every.append(own)
        done += len(status[-1])
        if progress:
            progress(done, samples * together)
    values, points = np.concatenate(measured), np.concatenate(carrying)
    own = np.concatenate(status)[::together]
    return (
        values.reshape(samples, together, *values.shape[1:]),
        points.reshape(samples, together, -1),
        own != terms.Status.UNTOUCHED,
        np.bincount(own, minlength=len(terms.STATUS_MEANINGS)),
    )


def _observed(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return block.measured.copy(), block.carrying.copy(), block.status.copy()


def _kinked(ahead: np.ndarray, behind: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """Whether a measure has a kink or jump within the step, (n, contributor).

    Derivatives are (n, contributor, state, measure), nominal ones (measure, contributor). Contributors that do next to nothing
    have none: what they seem to do is what the solver leaves.
    """
    size = np.maximum(np.abs(ahead), np.abs(behind))
    usual = np.median(size.max(axis=2), axis=0).T  # (measure, contributor), which no jump makes large
    floor = SLIGHT * np.maximum(nominal, usual).max(axis=1, initial=0)
    return np.asarray((np.abs(ahead - behind) > KINK * np.maximum(size, floor)).any(axis=(2, 3)))


def _means(slopes: np.ndarray) -> np.ndarray:
    """Means (measure, contributor, interval) of those derivatives (n, contributor, measure) that are numbers."""

    def of(x: np.ndarray) -> Estimate:
        known = x[np.isfinite(x)]
        return intervals.mean(known) if len(known) > 1 else UNDEFINED

    return np.array([[of(column) for column in measure] for measure in slopes.transpose(2, 1, 0)])
