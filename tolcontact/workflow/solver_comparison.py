"""Several solvers, resolutions or objectives on the same draws: do they agree, do they fail, how long do they take?"""

import itertools
import time
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import poses as pose
from tolcontact import vocabulary as terms
from tolcontact.compilation import Program, compile_program
from tolcontact.discretization import discretize
from tolcontact.errors import OptionError
from tolcontact.method import Method
from tolcontact.simulation import Block
from tolcontact.simulation.cluster import MapBlocks, Workers, mapping
from tolcontact.vocabulary import CORRECTED
from tolcontact.workflow.run import Choice, Model, check_counts, chosen, declared

WARM_UP = 64  # realizations before the clock runs
SPEAKS = ("resolution", "objective")  # choices whose values are clear by themselves
QUANTILES = {"median": 0.5, "largest": 1.0}


def compare(
    model: Model,
    solvers: str | Sequence[str],
    *,
    samples: int = 1000,
    seed: int = 1,
    methods: Choice | Sequence[Choice] | None = None,
    client: Any = None,
) -> xr.Dataset:
    """Simulate the same realizations of a model (see `build`) with each solver and method.

    Differences are from the first one, in the corrected state.

    Labels along the dimension `solver` name the solver, and what the methods differ in.

        seconds            (solver)                   wall time of all realizations, from draws to measures [s]
        by_status          (solver, status_meaning)   number of realizations
        kkt_residual       (solver)                   largest of the certified realizations [mm]
        penetration        (solver)                   largest true penetration left [mm]
        pose_difference    (solver, extent)           largest distance of a part's bounding corners between both answers [mm]
        measure_difference (solver, extent, measure)  in the measure's units
        both_resolved      (solver)                   number of realizations that the differences cover

    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); all but `seconds` is the same to the
    last bit.
    Raises OptionError for a solver that cannot be used or is named twice, ModelError for a wrong model.
    """
    check_counts(samples=samples, seed=seed)
    assembly = declared(model)
    solvers = [solvers] if isinstance(solvers, str) else solvers
    resolved_by = [chosen(assembly, each) for each in (methods if isinstance(methods, Sequence) else [methods])]
    for word, named in {"solvers": solvers, "methods": resolved_by}.items():
        if not named or len(set(named)) < len(named):
            raise OptionError(f"{word} are {', '.join(map(str, named)) or 'none'}; name at least one, and each once")
    nominal, blocks = discretize(assembly), mapping(client)
    contestants = [(solver, method) for method in resolved_by for solver in solvers]
    programs = [compile_program(nominal, *each) for each in contestants]
    corners = np.stack([_corners(part.vertices) for part in nominal.parts])
    first = _simulated(programs[0], blocks, samples, seed)
    rows = [
        _row(first, first, corners),
        *(_row(_simulated(each, blocks, samples, seed), first, corners) for each in programs[1:]),
    ]
    labels = {
        terms.SOLVER: [" ".join([solver, *told_apart(method, resolved_by)]) for solver, method in contestants],
        terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        terms.EXTENT: list(QUANTILES),
    }
    return xr.Dataset(
        {of.name: (of.dims, np.array([row[of.name] for row in rows]), of.all_attributes) for of in terms.COMPARED},
        coords={
            **{of.name: (of.dims, labels[of.name], of.all_attributes) for of in terms.COMPARED_LABELS},
            terms.MEASURE: [measure.name for measure in nominal.measures],
        },
        attrs={
            "title": f"comparison of solvers on {nominal.assembly.name}",
            "reference_solver": labels[terms.SOLVER][0],
            "realizations": samples,
            "seed": seed,
            "resolution": ", ".join(dict.fromkeys(method.resolution for method in resolved_by)),
            "objective": ", ".join(dict.fromkeys(method.objective for method in resolved_by)),
        },
    )


def _simulated(program: Program, blocks: MapBlocks, samples: int, seed: int) -> dict[str, Any]:
    """How long it took [s], and of each realization what is compared, in the corrected state."""
    if isinstance(blocks, Workers):
        blocks.get_ready(_compared, program)
    list(blocks(len, program, samples=WARM_UP, seed=seed))
    start = time.perf_counter()
    found = list(blocks(_compared, program, samples=samples, seed=seed))
    seconds = time.perf_counter() - start
    names = ("status", "kkt_residual", "poses", "measured", "gap_min")
    return {"seconds": seconds, **dict(zip(names, map(np.concatenate, zip(*found, strict=True)), strict=True))}


def _compared(block: Block) -> tuple[np.ndarray, ...]:
    states = (block.poses, block.measured, block.gap_min)
    return block.status, block.kkt_residual, *(values[:, CORRECTED].copy() for values in states)


def told_apart(method: Method, methods: Sequence[Method]) -> list[str]:
    """What distinguishes a method from the others."""
    names = [field.name for field in fields(Method) if len({getattr(each, field.name) for each in methods}) > 1]
    return [_said(name, getattr(method, name)) for name in names]


def _said(name: str, value: object) -> str:
    return value if isinstance(value, str) and name in SPEAKS else f"{name} {value}"


def _row(run: dict, first: dict, corners: np.ndarray) -> dict:
    resolved = np.isin(run["status"], terms.CERTIFIED)
    both = resolved & np.isin(first["status"], terms.CERTIFIED)
    poses, others = (each["poses"][both] for each in (run, first))
    apart = pose.apply(poses - others, corners)  # which is linear in the pose
    distance = np.linalg.norm(apart, axis=3).max(axis=(1, 2), initial=0)
    measured = np.abs(run["measured"] - first["measured"])[both]
    return {
        "seconds": run["seconds"],
        "by_status": np.bincount(run["status"], minlength=len(terms.STATUS_MEANINGS)),
        "kkt_residual": run["kkt_residual"][resolved].max(initial=0),
        "penetration": max(0.0, -float(run["gap_min"].min(initial=0))),
        "pose_difference": _extent(distance),
        "measure_difference": _extent(measured),
        "both_resolved": int(both.sum()),
    }


def _extent(values: np.ndarray) -> np.ndarray:
    """Median and largest value along the first dimension; NaN if there is none."""
    if not len(values):
        return np.full((len(QUANTILES), *values.shape[1:]), np.nan)
    return np.asarray(np.quantile(values, list(QUANTILES.values()), axis=0))


def _corners(vertices: np.ndarray) -> np.ndarray:
    """The corners (8, 3) of a part's bounding box: no point of the part moves further than the furthest of them."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.array(list(itertools.product(*zip(low, high, strict=True))))
