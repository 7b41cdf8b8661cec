"""Which tolerance to tighten first, and ranges at least cost for what is required, with contact."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import Bounds, minimize

from tolcontact import vocabulary as terms
from tolcontact.analyses.contributions import owners
from tolcontact.analyses.requirement import Requirement
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import outcomes
from tolcontact.simulation.cluster import MapBlocks, mapping
from tolcontact.statistics.intervals import Estimate, mean
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

NARROWEST, WIDEST = 0.1, 3.0  # times the present range
STEP = 0.1  # of ranges: differences
BATCHES = 32
ROUNDS = 24  # steps of the allocation
FARTHEST, NEAREST = 0.5, 0.004  # of the logarithm of a range: a step at most, in the beginning and in the end
PENALTY = 10.0  # for what is missed, in costs that would be saved where margins are as large as the slopes
GAIN = 1e-4  # of the cost: less is no progress
FRESH = 4  # times as many realizations verify it
VERIFICATIONS = 4
Cost = float | Callable[[float], float]


def allocate(
    model: Model | Program,
    require: str | Sequence[str],
    *,
    costs: Mapping[str, Cost] | None = None,
    by: str = "contributor",
    samples: int = 8192,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Ranges at least cost with which measures keep what is required, contact resolved.

        range        (group, stage)                      full width of the zones, "before" and "after"; NaN if they differ
        factor       (group)                             after over before, for all zones of the group alike
        cost         (group, stage)
        kept         (requirement, stage, interval)      the share outside of the limits, or the Ppk, in a fresh run of
                                                         4 samples realizations, with its 95 % interval
        required     (requirement)                       what it should be
        effect       (measure, of_effect, group, interval)  change of 6 sigma, and of the share outside, if a group's zones were
                                                         a tenth narrower: which to tighten first

    `require` is "corner height: ppm 1000" or "corner height: Ppk 1.33", or several such texts. `costs` has for each group that
    may change a number c, for c * present range / new range, or a function of the factor; all others keep their ranges. Without
    costs all groups may change, and c is 1. `by` is as in `contributions`: "contributor", "feature" or "part".

    Ranges stay between a tenth and three times the present ones. Each step replaces what is required by a function of squared
    ranges that agrees with it in value and slopes, on the same draws, and solves that with scipy's SLSQP within a region that
    shrinks when a step fails (a sequential separable approximation; Svanberg, 1987). If the fresh run does not keep what is
    required, the aim is tightened by what it was missed by, and the search goes on.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the same model, as the group
    statistics/allocation; the report shows it.
    Raises ModelError, ArchiveError, OptionError for options that cannot be used, or a model in which no range varies.
    """
    check_counts(samples=samples, seed=seed)
    if by not in terms.GROUPED_BY:
        raise OptionError(f"by is {by!r}; expected one of: {', '.join(terms.GROUPED_BY)}")
    program, blocks = program_of(model, solver, method), mapping(client)
    if into is not None:
        check_room_for(into, terms.OF_ALLOCATION, program)
    required = [Requirement.of_text(text, program) for text in ([require] if isinstance(require, str) else require)]
    if not required:
        raise OptionError('require is empty; expected a text such as "corner height: ppm 1000"')
    for each in required:
        each.check(samples)
    groups = _groups(program, by)
    curves = _curves(costs, groups)
    engine = _Engine(program, blocks, list(groups.values()), seed, samples)
    free = np.array([name in curves for name in groups])
    cost = [curves.get(name, 0.0) for name in groups]
    logs, kept = _allocated(engine, required, cost, free, progress)
    stages = np.exp(np.stack([np.zeros(len(groups)), logs], axis=1))
    found = {
        "range": [[width * factor for factor in row] for width, row in zip(_ranges(program, groups), stages, strict=True)],
        "factor": stages[:, 1],
        "cost": [[_cost(curve, factor) for factor in row] for curve, row in zip(cost, stages, strict=True)],
        "kept": [[kept[0][k], kept[1][k]] for k in range(len(required))],
        "required": [each.value for each in required],
        "effect": _effects(engine, program),
    }
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(found[of.name]), of.all_attributes) for of in terms.ALLOCATION},
        coords={
            terms.GROUP: list(groups),
            terms.STAGE: list(terms.STAGES),
            terms.REQUIREMENT: [each.name for each in required],
            terms.MEASURE: [measure.name for measure in program.nominal.measures],
            terms.OF_EFFECT: list(terms.EFFECTS),
            terms.INTERVAL: list(terms.ESTIMATE),
            "measure_units": (terms.MEASURE, [measure.units for measure in program.nominal.measures]),
        },
        attrs={
            "title": f"allocation of tolerances of {program.nominal.assembly.name}",
            "samples": samples,
            "fresh": FRESH * samples,
            "seed": seed,
            "by": by,
            "solver": program.plugin.name,
            "resolution": program.method.resolution,
            "objective": program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_ALLOCATION, answer, program)
    return answer


class _Engine:
    """Corrected measures for factors of the groups' ranges, on the same draws."""

    def __init__(self, program: Program, blocks: MapBlocks, groups: Sequence[np.ndarray], seed: int, samples: int) -> None:
        self._program, self._blocks, self._groups, self._seed, self._samples = program, blocks, groups, seed, samples

    def __call__(self, factors: np.ndarray, *, fresh: int = 0) -> np.ndarray:
        """Measures (n, measure); of other draws, and more of them, if `fresh` is the number of a verification."""
        scale = np.ones(len(self._program.nominal.contributors))
        for factor, columns in zip(factors, self._groups, strict=True):
            scale[columns] = factor
        draws, first = self._program.draws.scaled(scale), fresh << 32
        count = FRESH * self._samples if fresh else self._samples
        found = self._blocks(outcomes, self._program, samples=first + count, start=first, seed=self._seed, draws=draws)
        return np.asarray(np.concatenate([measured[:, terms.CORRECTED] for measured, _ in found]))

    def __len__(self) -> int:
        return len(self._groups)


def _groups(program: Program, by: str) -> dict[str, np.ndarray]:
    """Columns of the deviations by who owns them, of those that have ranges."""
    found: dict[str, list[int]] = {}
    for column, (owner, each) in enumerate(zip(owners(program, by), program.draws.contributors, strict=True)):
        if np.isfinite(each.range) and each.range > 0:
            found.setdefault(owner, []).append(column)
    if not found:
        raise OptionError(f'"{program.nominal.assembly.name}" has no range to allocate; give locators or features tolerances')
    return {owner: np.array(columns) for owner, columns in found.items()}


def _ranges(program: Program, groups: Mapping[str, np.ndarray]) -> list[float]:
    every = program.draws.contributors
    own = [{every[column].range for column in columns} for columns in groups.values()]
    return [ranges.pop() if len(ranges) == 1 else np.nan for ranges in own]


def _curves(costs: Mapping[str, Cost] | None, groups: Mapping[str, np.ndarray]) -> dict[str, Cost]:
    if costs is None:
        return dict.fromkeys(groups, 1.0)
    for name, curve in costs.items():
        if name not in groups:
            raise OptionError(f'costs has "{name}"; expected some of: {", ".join(groups)}')
        if not callable(curve) and not (isinstance(curve, int | float) and np.isfinite(curve) and curve > 0):
            raise OptionError(
                f'cost of "{name}" is {curve!r}; expected a number above 0, or a function of the factor of its range'
            )
    if not costs:
        raise OptionError("costs is empty; name the groups that may change, or leave it out")
    return dict(costs)


def _cost(curve: Cost, factor: float) -> float:
    return float(curve(factor)) if callable(curve) else float(curve / factor)


def _allocated(
    engine: _Engine,
    required: Sequence[Requirement],
    cost: Sequence[Cost],
    free: np.ndarray,
    progress: Callable[[int, int], None] | None,
) -> tuple[np.ndarray, list[list[Estimate]]]:
    """Logarithms of the factors (group,), and what was kept before and after, in fresh runs."""
    logs, aims = np.zeros(len(engine)), np.zeros(len(required))
    before = engine(np.ones(len(engine)), fresh=1)
    kept = [[each.estimate(before[:, each.measure]) for each in required]]
    for number in range(VERIFICATIONS):
        logs = _least_cost(engine, required, aims, cost, free, logs)
        if progress:
            progress(number + 1, VERIFICATIONS)
        values = engine(np.exp(logs), fresh=2 + number)
        margins = np.array([each.margin(values[:, each.measure]) for each in required])
        if (margins >= 0).all():
            break
        aims += np.maximum(-margins, 0.0)
    return logs, [*kept, [each.estimate(values[:, each.measure]) for each in required]]


def _least_cost(
    engine: _Engine,
    required: Sequence[Requirement],
    aims: np.ndarray,
    cost: Sequence[Cost],
    free: np.ndarray,
    logs: np.ndarray,
) -> np.ndarray:
    """Logarithms of the factors (group,) that cost least, with margins of at least `aims`; from some others."""

    def margins(at: np.ndarray) -> np.ndarray:
        values = engine(np.exp(at))
        return np.array([each.margin(values[:, each.measure]) - aim for each, aim in zip(required, aims, strict=True)])

    def price(at: np.ndarray) -> float:
        return math.fsum(_cost(curve, factor) for curve, factor, moves in zip(cost, np.exp(at), free, strict=True) if moves)

    here, reach, slopes = margins(logs), FARTHEST, None
    for _ in range(ROUNDS):
        if reach < NEAREST:
            break
        if slopes is None:
            slopes = np.zeros((len(required), len(logs)))
            for group in np.flatnonzero(free):
                step = np.eye(len(logs))[group] * STEP
                slopes[:, group] = (margins(logs + step) - margins(logs - step)) / (2 * STEP)
            penalty = PENALTY * price(logs) / max(float(np.abs(slopes).sum()), 1e-300)
        there = _step(here, slopes, logs, price, free, reach)
        found = margins(there)
        merits = [price(at) + penalty * float(np.maximum(-each, 0).sum()) for at, each in ((there, found), (logs, here))]
        if merits[0] < merits[1] - GAIN * abs(merits[1]):
            logs, here, slopes, reach = there, found, None, min(2 * reach, FARTHEST)
        else:
            reach /= 2
    return logs


def _step(
    here: np.ndarray, slopes: np.ndarray, logs: np.ndarray, price: Callable[[np.ndarray], float], free: np.ndarray, reach: float
) -> np.ndarray:
    """Where it costs least, margins taken for functions of squared ranges; if none keeps them, where they are missed least."""

    def margin(at: np.ndarray) -> np.ndarray:
        return np.asarray(here + slopes @ (np.exp(2 * (at - logs)) - 1) / 2)

    lower = np.where(free, np.maximum(logs - reach, np.log(NARROWEST)), logs)
    upper = np.where(free, np.minimum(logs + reach, np.log(WIDEST)), logs)
    bounds = Bounds(lower, upper)
    found = minimize(
        price, logs, method="SLSQP", bounds=bounds, constraints={"type": "ineq", "fun": margin}, options={"maxiter": 200}
    )
    if not found.success:
        found = minimize(lambda at: float(np.maximum(-margin(at), 0).sum()), logs, method="SLSQP", bounds=bounds)
    return np.asarray(np.clip(found.x, lower, upper))


def _effects(engine: _Engine, program: Program) -> np.ndarray:
    """Changes (measure, of_effect, group, interval) if a group's zones were a tenth narrower, by batches of the same draws."""
    ones, limits = (
        np.ones(len(engine)),
        [measure.bounds(nominal) for measure, nominal in zip(program.nominal.measures, program.nominal_measures, strict=True)],
    )
    usual = engine(ones)
    found = np.empty((len(limits), len(terms.EFFECTS), len(engine), len(terms.ESTIMATE)))
    for group in range(len(engine)):
        narrow = engine(ones - STEP * np.eye(len(engine))[group])
        for measure, (lower, upper) in enumerate(limits):
            both = [np.array_split(values[:, measure], BATCHES) for values in (narrow, usual)]
            spreads, shares = (
                [np.array([of(x) for x in each]) for each in both] for of in (_six_sigma, _outside(lower, upper))
            )
            found[measure, 0, group] = mean(spreads[0] - spreads[1])
            found[measure, 1, group] = mean(shares[0] - shares[1])
    return found


def _six_sigma(x: np.ndarray) -> Any:
    return 6 * x.std(ddof=1)


def _outside(lower: float, upper: float) -> Callable[[np.ndarray], Any]:
    return lambda x: ((x < lower) | (x > upper)).mean()
