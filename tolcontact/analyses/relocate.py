"""The place of a locator, within a region, where a measure varies least, with contact."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import Bounds, minimize

from tolcontact import vocabulary as terms
from tolcontact.archive import check_room_for, keep
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Assembly, Locator, ThreeTwoOne
from tolcontact.discretization import NominalPart, discretize
from tolcontact.errors import ModelError, OptionError
from tolcontact.method import Method
from tolcontact.simulation import outcomes
from tolcontact.simulation.cluster import MapBlocks, mapping
from tolcontact.statistics import intervals, two_samples
from tolcontact.statistics.capability import share_outside
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.sample import Sample
from tolcontact.workflow.models import DEFAULT_SOLVER, Choice, Model, assembly_of, check_counts, method_of

FIRST = {1: 9, 2: 5, 3: 4}  # places tried along each side, by the number of sides
TRIALS = 40  # more of them, from the best
NEAR = 1e-3  # of the sides: where the search ends
FRESH = 4  # times as many realizations verify it
SIX_SIGMA = "6 sigma"
_FORM = re.compile(rf"(?P<measure>.+): *(?P<of>{SIX_SIGMA}|{terms.PPM})")


def relocate(
    model: Model,
    locator: str,
    *,
    between: tuple[Any, Any],
    least: str,
    samples: int = 4096,
    seed: int = 1,
    solver: str = DEFAULT_SOLVER,
    method: Choice | None = None,
    into: str | Path | None = None,
    client: Any = None,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """The best place of a locator, "part.locator", in the box `between` two corners, in its part's own frame [mm].

        point        (stage, axis)      its place "before" and "after" [mm]
        reached      (stage, interval)  what is to be least, in a fresh run of 4 samples realizations, with its 95 % interval
        change       (interval)         6 sigma after over before, or the share outside after less before, of the same draws
        unresolved   (stage)            number of realizations of the fresh run that were not resolved
        tried        (trial, axis)      every place that was tried [mm], and
        tried_value  (trial)            what is to be least there; infinite where the model cannot be built

    `least` is "corner height: 6 sigma", or "corner height: ppm" (the share outside of its limits). Coordinates that are the
    same in both corners stay; the locator keeps its direction, so choose corners on the surface that it stands against.
    All places are tried with the same draws: first a grid, from whose best place scipy's COBYQA goes on. The response may have
    several minima, or be flat: look at `tried_value`. Each trial compiles the model anew.
    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); results are the same to the last bit.
    With `into`, the result is kept in the archive of that path, which has to be of the model as it is, as the group
    statistics/relocation; the report shows it.
    Raises ModelError, ArchiveError, OptionError for a locator, a region or a measure that there is not.
    """
    check_counts(samples=samples, seed=seed)
    assembly, blocks = assembly_of(model), mapping(client)
    engine = _Engine(assembly, blocks, locator, least, solver, method_of(assembly, method), samples, seed)
    if into is not None:
        check_room_for(into, terms.OF_RELOCATION, engine.program)
    lower, upper = _corners(between)
    sides = np.flatnonzero(upper > lower)
    tried: list[tuple[np.ndarray, float]] = []

    def value(shares: np.ndarray) -> float:
        point = lower + np.zeros(3)
        point[sides] += shares * (upper - lower)[sides]
        tried.append((point, engine.value(point)))
        if progress:
            progress(len(tried), FIRST[len(sides)] ** len(sides) + TRIALS)
        return tried[-1][1]

    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, FIRST[len(sides)])] * len(sides)), axis=-1).reshape(-1, len(sides))
    found = [value(shares) for shares in grid]
    if not np.isfinite(found).any():
        raise OptionError(
            f'"{locator}" cannot stand anywhere between {lower.tolist()} and {upper.tolist()}; choose other corners'
        )
    minimize(
        lambda shares: min(value(shares), 1e3 * max(each for each in found if np.isfinite(each))),  # it takes no infinity
        grid[int(np.argmin(found))], method="COBYQA", bounds=Bounds(np.zeros(len(sides)), np.ones(len(sides))),
        options={"maxfev": TRIALS, "initial_tr_radius": 0.5 / FIRST[len(sides)], "final_tr_radius": NEAR},
    )  # fmt: skip
    best = min(tried, key=lambda each: each[1])[0]
    (before, lost), (after, lost_after) = (engine.measured(point, fresh=True) for point in (engine.point, best))
    values = {
        "point": [engine.point, best],
        "reached": [engine.estimate(before), engine.estimate(after)],
        "change": engine.change(before, after),
        "unresolved": [lost, lost_after],
        "tried": [point for point, _ in tried],
        "tried_value": [each for _, each in tried],
    }
    answer = xr.Dataset(
        {of.name: (of.dims, np.array(values[of.name]), of.all_attributes) for of in terms.RELOCATION},
        coords={
            terms.STAGE: list(terms.STAGES),
            terms.AXIS: list(terms.AXES),
            terms.INTERVAL: list(terms.ESTIMATE),
            "measure_units": ((), engine.units),
        },
        attrs={
            "title": f"place of {locator} in {assembly.name}",
            "locator": locator,
            "least": least,
            "samples": samples,
            "fresh": FRESH * samples,
            "seed": seed,
            "solver": engine.program.plugin.name,
            "resolution": engine.program.method.resolution,
            "objective": engine.program.method.objective,
        },
    )
    if into is not None:
        keep(into, terms.OF_RELOCATION, answer, engine.program)
    return answer


class _Engine:
    """What is to be least, for places of a locator, on the same draws."""

    def __init__(
        self,
        assembly: Assembly,
        blocks: MapBlocks,
        locator: str,
        least: str,
        solver: str,
        method: Method,
        samples: int,
        seed: int,
    ) -> None:
        self._assembly, self._blocks, self._solver, self._method = assembly, blocks, solver, method
        self._samples, self._seed = samples, seed
        self.program = self._program(assembly)
        nominal = self.program.nominal
        if locator not in nominal.locators.labels:
            raise OptionError(f'there is no locator "{locator}"; expected one of: {", ".join(nominal.locators.labels)}')
        self._part = next(part for part in nominal.parts if locator in part.locators.labels)
        self._own = declared_locators(self._part)
        self._number = self._part.locators.labels.index(locator)
        self._measure, self._is_spread = _told(least, self.program)
        self._limits = nominal.measures[self._measure].bounds(self.program.nominal_measures[self._measure])
        if not self._is_spread and not np.isfinite(self._limits).any():
            raise OptionError(f"least is {least!r}, and the measure has no limits; give it tolerance=... or limits=...")

    @property
    def point(self) -> np.ndarray:
        """Where the locator is declared, (3,) [mm]."""
        return np.array(self._own[self._number].point)

    @property
    def units(self) -> str:
        return self.program.nominal.measures[self._measure].units if self._is_spread else "1"

    def value(self, point: np.ndarray) -> float:
        """What is to be least with the locator at a point (3,) [mm]; infinite if the model cannot be built."""
        try:
            measured, _ = self.measured(point)
        except ModelError:
            return np.inf
        return self.estimate(measured).value

    def measured(self, point: np.ndarray, *, fresh: bool = False) -> tuple[np.ndarray, int]:
        """Values (n,) of the corrected measure, and how many realizations were not resolved; of other draws, if `fresh`."""
        scheme = [at_point(each, point) if k == self._number else each for k, each in enumerate(self._own)]
        program, first = self._program(self._with(tuple(scheme))), FRESH * self._samples if fresh else 0
        values, lost = [], 0
        for measured, status in self._blocks(
            outcomes, program, samples=first + (first or self._samples), start=first, seed=self._seed
        ):
            values.append(measured[:, terms.CORRECTED, self._measure])
            lost += int(np.isin(status, terms.UNRESOLVED).sum())
        return np.concatenate(values), lost

    def estimate(self, measured: np.ndarray) -> Estimate:
        """Of values (n,): 6 sigma, or the share outside, with its interval."""
        sample = Sample.of(measured)
        return intervals.standard_deviation(sample, times=6) if self._is_spread else share_outside(sample, *self._limits)

    def change(self, before: np.ndarray, after: np.ndarray) -> Estimate:
        """From values (n,) to others of the same draws."""
        if self._is_spread:
            return Estimate(*np.sqrt(two_samples.variance_ratio(Sample.of(after), Sample.of(before), paired=True)))
        lower, upper = self._limits
        hits = [Sample.of((x < lower) | (x > upper)) for x in (after, before)]
        return two_samples.share_shift(*hits, paired=True)

    def _program(self, assembly: Assembly) -> Program:
        return compile_program(discretize(assembly), self._solver, self._method)

    def _with(self, scheme: tuple[Locator, ...]) -> Assembly:
        """The assembly with these locators of the part."""
        own = self._assembly
        locations = [replace(each, scheme=scheme) if each.part is self._part.part else each for each in own.locations]
        return Assembly.of(
            own.name, own.method, parts=own.parts, locations=locations, pairs=own.pairs, measures=own.measures,
            forces=own.forces, variables=own.variables, correlations=own.correlations, populations=own.populations,
        )  # fmt: skip


def declared_locators(part: NominalPart) -> tuple[Locator, ...]:
    """The locators of a part in its own frame, as a script would declare them one by one."""
    if not isinstance(part.scheme, ThreeTwoOne):
        return part.scheme or ()
    R_WP, t_WP = part.placement
    features = {f"{part.name}.{feature.name}": feature for feature in part.part.features}
    own = part.locators
    return tuple(
        Locator(label.removeprefix(f"{part.name}."), point, direction, on=features[face.name] if face else None)
        for label, point, direction, face in zip(
            own.labels, (own.points - t_WP) @ R_WP, own.directions @ R_WP, own.faces, strict=True
        )
    )


def at_point(locator: Locator, point: np.ndarray) -> Locator:
    """The same locator elsewhere."""
    return Locator(
        locator.name, point, locator.direction, locator.tolerance, one_sided=locator.one_sided, stiffness=locator.stiffness,
        on=locator.on,
    )  # fmt: skip


def _corners(between: tuple[Any, Any]) -> tuple[np.ndarray, np.ndarray]:
    try:
        lower, upper = (np.array(corner, dtype=float) for corner in between)
    except (TypeError, ValueError):
        lower = upper = np.empty(0)
    if lower.shape != (3,) or upper.shape != (3,) or not np.isfinite([lower, upper]).all() or not (lower != upper).any():
        raise OptionError(f"between is {between!r}; expected two different corners, such as ((0, 0, 0), (50, 25, 0)) [mm]")
    return np.minimum(lower, upper), np.maximum(lower, upper)


def _told(least: str, program: Program) -> tuple[int, bool]:
    """Of which measure, by number, and whether its spread is to be least, or the share outside of its limits."""
    found = _FORM.fullmatch(least.strip()) if isinstance(least, str) else None
    if found is None:
        raise OptionError(f'least is {least!r}; expected a text such as "corner height: {SIX_SIGMA}" or "gap: {terms.PPM}"')
    known = [measure.name for measure in program.nominal.measures]
    if found["measure"] not in known:
        raise OptionError(f'least has the measure "{found["measure"]}"; expected one of: {", ".join(known)}')
    return known.index(found["measure"]), found["of"] == SIX_SIGMA
