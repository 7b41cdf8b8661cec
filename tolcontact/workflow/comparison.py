"""Comparisons of runs in archives, and of solvers and methods on the same draws."""

import itertools
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.archive import check_rows, open_archive
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Assembly
from tolcontact.discretization import discretize
from tolcontact.errors import OptionError
from tolcontact.method import USUAL_SEARCH, Method, Solver
from tolcontact.plausibility import warn_of_nominal
from tolcontact.simulation import Block
from tolcontact.simulation.cluster import MapBlocks, Workers, mapping, threads_of
from tolcontact.statistics import compare_runs as compare_results
from tolcontact.vocabulary import CORRECTED
from tolcontact.workflow.forecast import check_affordable
from tolcontact.workflow.models import Choice, Model, assembly_of, check_counts, method_of

WARM_UP_ROWS = 64  # realizations before the clock starts
SELF_EXPLANATORY = ("resolution", "objective")  # choices with values that are clear without their names
QUANTILES = {"median": 0.5, "largest": 1.0}


def compare(
    model: Model,
    solvers: Solver | Sequence[Solver],
    *,
    samples: int = 1000,
    seed: int = 1,
    methods: Choice | Sequence[Choice] | None = None,
    client: Any = None,
) -> xr.Dataset:
    """Simulate the same realizations of a model (see `build`) with each solver and method.

    `solvers`, `samples` and `seed` are as in `run`; `tc.compare("model.py", ["qpoases", "daqp"], samples=1000)`.
    Differences are relative to the first one, in the corrected state. Labels along the dimension `solver` name the solver and
    the choices that differ between the methods.

        seconds            (solver)                   wall time of all realizations, from draws to measures [s]
        by_status          (solver, status_meaning)   number of realizations
        kkt_residual       (solver)                   largest value in the certified realizations [mm]
        penetration        (solver)                   largest remaining true penetration [mm]
        pose_difference    (solver, extent)           largest distance of a part's bounding corners between both answers [mm]
        measure_difference (solver, extent, measure)  in the measure's units
        both_resolved      (solver)                   number of realizations that the differences cover

    With a `client` of dask.distributed its workers simulate (see tolcontact.simulation); all results except `seconds` are the
    same to the last bit. Raises OptionError for a solver that cannot be used or is named twice, ModelError for a wrong model.
    """
    check_counts(samples=samples, seed=seed)
    assembly = assembly_of(model)
    solvers = [solvers] if isinstance(solvers, str) else solvers
    resolved_by = [method_of(assembly, method) for method in (methods if isinstance(methods, Sequence) else [methods])]
    for option, names in {"solvers": solvers, "methods": resolved_by}.items():
        if not names or len(set(names)) < len(names):
            raise OptionError(f"{option}: {', '.join(map(str, names)) or 'none'}; name at least one, and each once")
    contestants = [(solver, method) for method in resolved_by for solver in solvers]
    programs, blocks = _programs(assembly, contestants), mapping(client)
    nominal = programs[0].nominal
    kept = 2 + 12 * len(nominal.parts) + len(nominal.measures) + len(nominal.pairs)
    for program in programs:
        check_affordable(program, samples=samples, seed=seed, threads=threads_of(client), kept=kept)
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


def _programs(assembly: Assembly, contestants: Sequence[tuple[str, Method]]) -> list[Program]:
    """Return the program of each solver and method, and warn of probable mistakes in the nominal assembly."""
    presses = dict.fromkeys(method.minimizes.presses for _, method in contestants)
    nominals = {choice: discretize(assembly, presses=choice) for choice in presses}
    programs = [compile_program(nominals[method.minimizes.presses], solver, method) for solver, method in contestants]
    warn_of_nominal(programs[0])
    return programs


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
    arrays = dict(zip(names, map(np.concatenate, zip(*results, strict=True)), strict=True))
    rigid = [not pair.is_springy for pair in program.nominal.pairs]  # compliant pairs do not count as penetrating
    return {"seconds": seconds, **arrays, "gap_min": arrays["gap_min"][:, rigid]}


def _compared(block: Block) -> tuple[np.ndarray, ...]:
    states = (block.poses, block.measured, block.gap_min)
    return block.status, block.kkt_residual, *(values[:, CORRECTED].copy() for values in states)


def distinctions(method: Method, methods: Sequence[Method]) -> list[str]:
    """Return the choices of a method that differ among `methods`, in words, except searches implied by the resolution."""
    values = {
        field.name: getattr(method, field.name)
        for field in fields(Method)
        if len({getattr(alternative, field.name) for alternative in methods}) > 1
    }
    if all(alternative.search == USUAL_SEARCH[alternative.resolution] for alternative in methods):
        values.pop("search", None)
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


def compare_runs(runs: Mapping[str, xr.DataTree] | Sequence[str | Path]) -> xr.Dataset:
    """Compare runs with the first one (see tolcontact.statistics.compare_runs): results by name, or paths of archives.

    `tc.compare_runs({"as drawn": results, "better pins": other})`
    Raises ArchiveError for a missing or damaged archive, and OptionError for fewer than two runs or for runs
    without a common measure.
    """
    if isinstance(runs, str | Path):
        runs = [runs]
    if not isinstance(runs, Mapping):
        with ExitStack() as stack:
            return compare_runs({name: stack.enter_context(open_archive(path)) for name, path in named_archives(runs).items()})
    if len(runs) < 2:
        raise OptionError("a comparison needs at least two runs; name another one")
    for name, run in runs.items():
        if not isinstance(run, xr.DataTree):
            raise OptionError(f'run "{name}" is a {type(run).__name__}; expected what tc.run or tc.open_archive returns')
        check_rows(run)
    return compare_results(runs)


def named_archives(paths: Sequence[str | Path]) -> dict[str, Path]:
    """Return archives by the shortest names that distinguish them: stems, file names, or paths.

    Raises OptionError for an archive that is named twice.
    """
    files = [Path(path) for path in paths]
    for name in (lambda path: path.stem, lambda path: path.name, str):
        archives = {name(path): path for path in files}
        if len(archives) == len(files):
            return archives
    raise OptionError(f"archives are {', '.join(map(str, files))}; name each once")
