"""Comparison of solvers, resolutions or objectives on the same draws: agreement, failures, time."""

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
from tolcontact.workflow.models import Choice, Model, assembly_of, check_counts, method_of

WARM_UP_ROWS = 64  # realizations before the clock starts
SELF_EXPLANATORY = ("resolution", "objective")  # choices whose values need no name beside them
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

    Differences are taken from the first one, in the corrected state. Labels along the dimension `solver` name the solver and
    the choices in which the methods differ.

        seconds            (solver)                   wall time of all realizations, from draws to measures [s]
        by_status          (solver, status_meaning)   number of realizations
        kkt_residual       (solver)                   largest of the certified realizations [mm]
        penetration        (solver)                   largest true penetration left [mm]
        pose_difference    (solver, extent)           largest distance of a part's bounding corners between both answers [mm]
        measure_difference (solver, extent, measure)  in the measure's units
        both_resolved      (solver)                   number of realizations that the differences cover

    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); all but `seconds` is the same to the
    last bit.
    Raises OptionError for a solver that cannot be used or is named twice, and ModelError for a model with faults.
    """
    check_counts(samples=samples, seed=seed)
    assembly = assembly_of(model)
    solvers = [solvers] if isinstance(solvers, str) else solvers
    resolved_by = [method_of(assembly, method) for method in (methods if isinstance(methods, Sequence) else [methods])]
    for option, names in {"solvers": solvers, "methods": resolved_by}.items():
        if not names or len(set(names)) < len(names):
            raise OptionError(f"{option}: {', '.join(map(str, names)) or 'none'}; name at least one, and each once")
    nominal, blocks = discretize(assembly), mapping(client)
    contestants = [(solver, method) for method in resolved_by for solver in solvers]
    programs = [compile_program(nominal, solver, method) for solver, method in contestants]
    rows = _rows(programs, blocks, samples, seed)
    labels = {
        terms.SOLVER: [" ".join([solver, *distinctions(method, resolved_by)]) for solver, method in contestants],
        terms.STATUS_MEANING: list(terms.STATUS_MEANINGS),
        terms.EXTENT: list(QUANTILES),
    }
    return xr.Dataset(
        {v.name: (v.dims, np.array([row[v.name] for row in rows]), v.all_attributes) for v in terms.COMPARED},
        coords={
            **{v.name: (v.dims, labels[v.name], v.all_attributes) for v in terms.COMPARED_LABELS},
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


def _rows(programs: Sequence[Program], blocks: MapBlocks, samples: int, seed: int) -> list[dict]:
    """Return the values of each program in the comparison with the first."""
    corners = np.stack([_corners(part.vertices) for part in programs[0].nominal.parts])
    reference = _timed_results(programs[0], blocks, samples, seed)
    further_results = (_timed_results(program, blocks, samples, seed) for program in programs[1:])
    return [_row(results, reference, corners) for results in itertools.chain([reference], further_results)]


def _timed_results(program: Program, blocks: MapBlocks, samples: int, seed: int) -> dict[str, Any]:
    """Return the wall time [s] and the compared arrays of all realizations, in the corrected state."""
    if isinstance(blocks, Workers):
        blocks.get_ready(_compared, program)
    list(blocks(len, program, samples=WARM_UP_ROWS, seed=seed))
    start = time.perf_counter()
    results = list(blocks(_compared, program, samples=samples, seed=seed))
    seconds = time.perf_counter() - start
    names = ("status", "kkt_residual", "poses", "measured", "gap_min")
    return {"seconds": seconds, **dict(zip(names, map(np.concatenate, zip(*results, strict=True)), strict=True))}


def _compared(block: Block) -> tuple[np.ndarray, ...]:
    states = (block.poses, block.measured, block.gap_min)
    return block.status, block.kkt_residual, *(values[:, CORRECTED].copy() for values in states)


def distinctions(method: Method, methods: Sequence[Method]) -> list[str]:
    """Return the choices of a method in which `methods` differ, in words."""
    values = {
        field.name: getattr(method, field.name)
        for field in fields(Method)
        if len({getattr(alternative, field.name) for alternative in methods}) > 1
    }
    return [value if name in SELF_EXPLANATORY else f"{name} {value}" for name, value in values.items()]


def _row(run: dict, reference: dict, corners: np.ndarray) -> dict:
    """Return the values of a run in the comparison with a reference run. `corners` (part, 8, 3) [mm]."""
    resolved = np.isin(run["status"], terms.CERTIFIED)
    both_resolved = resolved & np.isin(reference["status"], terms.CERTIFIED)
    poses, reference_poses = (results["poses"][both_resolved] for results in (run, reference))
    offsets = pose.apply(poses - reference_poses, corners)  # apply is linear in the pose
    distance = np.linalg.norm(offsets, axis=3).max(axis=(1, 2), initial=0)
    measured = np.abs(run["measured"] - reference["measured"])[both_resolved]
    return {
        "seconds": run["seconds"],
        terms.BY_STATUS.name: np.bincount(run["status"], minlength=len(terms.STATUS_MEANINGS)),
        "kkt_residual": run["kkt_residual"][resolved].max(initial=0),
        "penetration": max(0.0, -float(run["gap_min"].min(initial=0))),
        "pose_difference": _extent(distance),
        "measure_difference": _extent(measured),
        "both_resolved": int(both_resolved.sum()),
    }


def _extent(values: np.ndarray) -> np.ndarray:
    """Return the median and the largest value along the first dimension; NaN without values."""
    if not len(values):
        return np.full((len(QUANTILES), *values.shape[1:]), np.nan)
    return np.quantile(values, list(QUANTILES.values()), axis=0)


def _corners(vertices: np.ndarray) -> np.ndarray:
    """Return the corners (8, 3) of a part's bounding box: one of them moves at least as far as any point of the part."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return np.array(list(itertools.product(*zip(low, high, strict=True))))
