"""The figures of a tolerance stack: worst case, RSS and inflated RSS by the linear model, compared with the Monte Carlo range.

With the contribution t_i of contributor i, half the range of its slope times its zone, and n of them that vary:

    worst case  W = sum t_i
    RSS         R = (sum t_i^2)^(1/2)
    MRSS        f R, f = 1 + (W / R - 1) / (2 (n^(1/2) - 1))     Drake, Dimensioning and Tolerancing Handbook (1999), ch. 9
    1.5 RSS     1.5 R                                            Bender, ASME paper 62-WA-18 (1962)

All are about the value at the centres of the zones. Contributors that vary jointly, as those of a feature in its zone, count as
one. Correlations, distributions and capabilities affect the Monte Carlo range alone.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.analysis import Analysis, Progress
from tolcontact.analyses.linear_model import linear_model
from tolcontact.compilation import Program
from tolcontact.features.freedoms import FORM
from tolcontact.method import Solver
from tolcontact.statistics.capability import PERCENTS
from tolcontact.statistics.intervals import UNDEFINED, percentiles
from tolcontact.workflow.models import Choice, Model

BENDER = 1.5
THREE_SIGMA = 3.0


def stack_up(
    model: Model | Program, *, samples: int = 10_000, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, into: str | Path | None = None, client: Any = None, progress: Progress | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return worst case, RSS and inflated RSS of each measure by linear sensitivities, and the simulated range.

        drawn       (measure)                        value without deviations
        centred     (measure)                        linear value at the centres of all zones
        half_width  (measure, approach)              worst case, RSS, MRSS (Drake) and 1.5 RSS (Bender), about the centred value
        lots        (measure)                        largest shift of the mean if each lot with side="either" is on the worse
                                                     side: the sum of slopes times distances of the means from the centre
        simulated   (measure, state, end, interval)  0.135 % and 99.865 % percentiles of a Monte Carlo run
        links       (measure)                        number of contributors that have an effect
        forms       (measure)                        those among them that are forms of faces: they count with 3 sigma in RSS,
                                                     and there is no worst case, nor MRSS
        by_status   (status_meaning)                 number of realizations

    For normal distributions with 6 sigma equal to the zone, and without contact, RSS is the range that holds 99.73 %. Half
    widths are NaN for a measure with a kink in the nominal assembly. `model`, `samples` (10 000 by default), `seed`, `solver`,
    `method`, `into`, `client` and `progress` are as in all analyses (see tolcontact.analyses):
    `tc.analyses.stack_up("stack.py")`.
    """
    analysis = Analysis(
        terms.STACK_UP, model, samples=samples, seed=seed, solver=solver, method=method, into=into, client=client,
        progress=progress,
    )  # fmt: skip
    analysis.expect(samples)
    linear, region = linear_model(analysis.program), AllowedRegion(analysis.program.draws, seed=seed)
    slopes = np.where(linear.kinked[0][:, None], np.nan, region.slopes(linear.by_deviations))
    rows = [_linear_range(analysis.program, region, row) for row in slopes]
    measured, _ = analysis.simulate(samples)
    values = {
        "drawn": linear.measures,
        "centred": linear.measures + [row[0] for row in rows],
        "half_width": [row[1] for row in rows],
        "lots": np.abs(slopes) @ [contributor.lot_distance for contributor in analysis.program.draws.contributors],
        "simulated": [[_ends(measured[:, k, m]) for k in range(len(terms.STATES))] for m in range(len(rows))],
        "links": [row[2] for row in rows],
        "forms": [row[3] for row in rows],
        "by_status": analysis.statuses,
    }
    return analysis.dataset(values, {}, realizations=samples)


def _linear_range(program: Program, region: AllowedRegion, slopes: np.ndarray) -> tuple[float, list[float], int, int]:
    """Return the shift of the centre, half widths by approach, and the numbers of links and of forms.

    slopes   (contributor,) of a measure
    """
    if not np.isfinite(slopes).all():
        return np.nan, [np.nan] * len(terms.APPROACHES), 0, 0
    high, low = slopes * region.exactly_farthest(slopes), slopes * region.exactly_farthest(-slopes)
    halves = np.array([(high - low)[columns].sum() / 2 for columns in region.independent_columns])
    sigmas: dict[str, float] = {}
    for slope, contributor in zip(slopes, program.draws.contributors, strict=True):
        if contributor.source == FORM and slope:
            face = contributor.label.rpartition(" ")[0]
            sigmas[face] = float(np.hypot(sigmas.get(face, 0.0), slope * contributor.spread))
    links, worst = int((halves > 0).sum()) + len(sigmas), float(halves.sum())
    rss = float(np.linalg.norm([*halves, *(THREE_SIGMA * sigma for sigma in sigmas.values())]))
    if sigmas:
        worst = np.nan
    factor = 1 + (worst / rss - 1) / (2 * (np.sqrt(links) - 1)) if links > 1 else worst / (rss or 1.0)
    return float((high + low).sum() / 2), [worst, rss, factor * rss, BENDER * rss], links, len(sigmas)


def _ends(x: np.ndarray) -> list[Any]:
    """Return the percentiles (end, interval) of values (n,); undefined if one is not finite."""
    return percentiles(x, PERCENTS[::2]) if np.isfinite(x).all() else [UNDEFINED, UNDEFINED]
