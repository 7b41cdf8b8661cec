"""Runs: from a declared assembly to an archive, up to a stopping rule, and its results."""

import logging
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from tolcontact.archive import ArchiveWriter, Run, locked_archive, open_archive, open_unchecked
from tolcontact.compilation import Program
from tolcontact.errors import OptionError, check_choice
from tolcontact.method import Solver
from tolcontact.replacing import check_identities
from tolcontact.simulation import block_rows, other_objectives
from tolcontact.simulation.cluster import MapBlocks, mapping, threads_of
from tolcontact.simulation.surfaces import check_surfaces, simulated_poses, warn_of
from tolcontact.statistics import STATISTICS, estimate_of
from tolcontact.statistics.measure_statistics import HALF_WIDTH, StatisticRequest
from tolcontact.temporary import temporary_folder
from tolcontact.vocabulary import (
    CORRECTED,
    FIELD_CHOICES,
    KEPT,
    MEASURED,
    OBJECTIVES_GROUP,
    OUTSIDE,
    PLANS,
    PPM,
    STATES,
    FieldChoice,
    Kept,
    Plan,
)
from tolcontact.workflow.accessor import Results
from tolcontact.workflow.forecast import announce
from tolcontact.workflow.models import Choice, Model, check_counts, check_program, program_of
from tolcontact.workflow.run_sums import BlockTotals, RunSums

MIN_GROWTH, MAX_GROWTH = 1.25, 16.0
MARGIN = 1.05  # times the estimated number of realizations that the interval needs
MAX_REALIZATIONS = 100_000_000
MAX_WITHOUT_INTERVAL = 10_000  # realizations: an estimate without an interval at this number will not get one
EXAMPLES = ("corner height: 6 sigma +-1 %", "gap: mean +-0.001")
__all__ = ["SURFACES", "RunProgress", "open_archive", "run", "write_archive", "write_run"]

SURFACES = 64
RunProgress = Callable[[int], None]  # called with the number of finished realizations

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Target:
    """The largest permitted half-width of the 95 % interval of a corrected measure's statistic.

    half  in the units of the measure, or as a fraction of the estimate if `is_relative`
    """

    request: StatisticRequest
    measure: str
    statistic: str
    half: float
    is_relative: bool

    @classmethod
    def of(cls, text: str) -> "Target":
        """Return the target "corner height: 6 sigma +-1 %" or "gap: ppm +-20 %". Raises OptionError for other texts."""
        request = StatisticRequest.parse(text, "until", statistics=(PPM, *STATISTICS), form=HALF_WIDTH, examples=EXAMPLES)
        is_ppm = request.statistic == PPM
        half = request.value / 100 if request.is_percent else request.value * (1e-6 if is_ppm else 1.0)
        return cls(request, request.measure, OUTSIDE if is_ppm else request.statistic, half, request.is_percent)

    def check(self, program: Program) -> None:
        """Raise OptionError if the model has no such measure."""
        self.request.number_of([measure.name for measure in program.nominal.measures])

    def next(self, path: Path, program: Program) -> int | None:
        """Return the number of realizations that the archive should have next.

        None means that the interval is narrow enough, or cannot become narrow enough.
        """
        with open_unchecked(path) as results:
            samples = int(results.attrs["samples"])
            estimate, half, target_half = self._widths(results)
        is_hopeless = math.isnan(half) and samples >= MAX_WITHOUT_INTERVAL
        if math.isnan(estimate) or half <= target_half or is_hopeless:
            return None
        growth = MAX_GROWTH
        if target_half > 0 and math.isfinite(half):
            ratio = half / target_half
            growth = MARGIN * ratio * ratio  # infinite for a tiny target, where a power would raise an error
        if not samples * growth <= MAX_REALIZATIONS:
            return None
        rows = block_rows(program)
        return -(-int(samples * min(max(growth, MIN_GROWTH), MAX_GROWTH)) // rows) * rows

    def shortfall(self, results: xr.DataTree) -> str:
        """Return a sentence that states why the interval of finished results is not narrow enough; empty if it is."""
        estimate, half, target_half = self._widths(results)
        if math.isnan(estimate):
            values = results.to_dataset()[MEASURED.name].sel(measure=self.measure, state=STATES[CORRECTED])
            is_undefined = not np.isfinite(values[: int(results.attrs["samples"])]).all()
            reason = "it is not a number in some realizations" if is_undefined else "are there limits?"
            return f"{self.statistic} of {self.measure} has no value ({reason}); no more realizations were added"
        if half <= target_half:
            return ""
        stated = f"{estimate:.6g} without an interval" if math.isnan(half) else f"{estimate:.6g} +- {half:.2g}"
        return f"stopped at {results.attrs['samples']} realizations: {self.statistic} of {self.measure} is {stated}; " + (
            "more will not give one" if math.isnan(half) else f"+- {target_half:.2g} needs more than {MAX_REALIZATIONS}"
        )

    def _widths(self, results: xr.DataTree) -> tuple[float, float, float]:
        """Return the estimate, the half-width of its interval, and the largest permitted half-width."""
        estimate, lower, upper = estimate_of(results, self.measure, self.statistic)
        return estimate, (upper - lower) / 2, self.half * (abs(estimate) if self.is_relative else 1.0)


# The import registers the methods of results, for anyone who runs a model or opens an archive.
xr.register_datatree_accessor("tolcontact")(Results)  # type: ignore[no-untyped-call]


def run(
    model: Model | Program,
    *,
    samples: int = 1000,
    seed: int = 1,
    solver: Solver | None = None,
    method: Choice | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    keep: Kept = "all",
    surfaces: int = SURFACES,
    fields: int | FieldChoice = "some",
    plan: Plan = "monte-carlo",
    until: str | None = None,
    client: Any = None,
    progress: RunProgress | None = None,
) -> xr.DataTree:
    """Simulate `samples` realizations, by default 1000, raw and corrected, into the archive `out`, and open it.

    `model` is anything that `build` takes or returns. A Program has its solver and method already; the default solver is
    qpoases, and the default method is the model's own.
    The same `seed` gives the same draws, also with other methods and numbers of `samples`.
    `out` is the path of the archive, which ends in .nc; `overwrite` replaces a file there. Without it, results stay in memory.
    `keep` states what the archive stores for each realization: "measures" (with gaps, status and residuals), "poses" (also the
    poses), or "all" (also the deviations). Displacement fields always come from all realizations.
    `fields` is the number of realizations that the magnitudes of displacement fields cover, starting from the first: a number,
    "all", "none", or "some" (16 384, or fewer where a part has many vertices). The components x, y, z are always exact.
    `plan` is the sampling plan: "monte-carlo", "latin hypercube" or "sobol" (see tolcontact.variation). The latter two draw
    replicates of 256 realizations; with 16 replicates or more, intervals come from the replicates and are narrower, especially
    if `samples` is a multiple of 256.
    `until` states how narrow the 95 % interval of a corrected measure must become, for example "corner height: 6 sigma +-1 %",
    "gap: mean +-0.001" or "gap: ppm +-20 %". The run then starts with `samples` realizations and adds more until the interval
    is narrow enough. If that needs too many realizations, the run stops with a warning.
    `client` is a client of dask.distributed. Its workers simulate, this process writes, and the results are the same to the
    last bit (see tolcontact.simulation).
    `surfaces` (64 by default) certified realizations are checked against the surfaces between contact points at the end.
    With `resume`, continue an interrupted run up to the number of samples it was started with, or `samples` if larger.
    `progress` is called with the number of finished realizations. An interrupted run (Ctrl-C) leaves an archive that can be
    read and resumed; its fields cover the finished realizations.
    Raises ModelError, OptionError, or ArchiveError before anything is simulated or written; ClusterError if workers fail.

    `results = tc.run("model.py", samples=10_000, seed=1, solver="daqp", out="model.nc")`
    """
    settings = Run(seed, samples, keep, surfaces, fields, plan)
    options: dict[str, Any] = {"solver": solver, "method": method, "until": until, "client": client, "progress": progress}
    if out is not None:
        return open_unchecked(write_run(model, settings, Path(out), overwrite=overwrite, resume=resume, **options))
    for option, is_set in {"overwrite": overwrite, "resume": resume}.items():
        if is_set:
            raise OptionError(f"{option} needs an archive, and none is named; name one: out=...")
    with temporary_folder() as folder, open_unchecked(write_run(model, settings, folder / "results.nc", **options)) as tree:
        return tree.load()


def write_run(
    model: Model | Program,
    settings: Run,
    out: Path,
    *,
    solver: str | None = None,
    method: Choice | None = None,
    overwrite: bool = False,
    resume: bool = False,
    until: str | None = None,
    client: Any = None,
    progress: RunProgress | None = None,
) -> Path:
    """Simulate into the archive `out` (see `run`), and return the path of the file; it differs from `out` if that is a link."""
    check_counts(samples=settings.samples, seed=settings.seed, surfaces=settings.surfaces)
    check_choice("keep", settings.keep, KEPT)
    fields = settings.fields
    if fields not in FIELD_CHOICES and not (type(fields) is int and 2 <= fields < 2**63):
        raise OptionError(f"fields is {fields!r}; expected a whole number, at least 2, or one of: {', '.join(FIELD_CHOICES)}")
    check_choice("plan", settings.plan, PLANS)
    check_program(model, solver, method)
    check_identities([] if resume else [model], {"archive": out})
    target = None if until is None else Target.of(until)
    with locked_archive(out, overwrite=overwrite, resume=resume) as path:
        program = program_of(model, solver, method)
        program = replace(program, draws=program.draws.planned(settings.plan))
        if target:
            target.check(program)
        write_archive(path, program, settings, target, client, progress, is_resumed=resume and path.exists())
    if target:
        with open_unchecked(path) as results:
            if sentence := target.shortfall(results):
                log.warning(sentence)
    return path


def write_archive(
    path: Path,
    program: Program,
    settings: Run,
    target: Target | None = None,
    client: Any = None,
    progress: RunProgress | None = None,
    *,
    is_resumed: bool = False,
) -> None:
    """Simulate into the archive at `path`, and add realizations until the target is met, if there is one."""
    blocks = mapping(client)
    while True:
        sums = RunSums(program, settings)
        if is_resumed:
            writer = ArchiveWriter.resume(path, program, settings)
        else:
            writer = ArchiveWriter(path, program, settings, sums.fields.sizes)
        remaining = writer.samples - writer.rows
        announce(program, samples=remaining, seed=settings.seed, keep=settings.keep, threads=threads_of(client))
        _simulate(program, writer, sums, settings.seed, blocks, progress)
        enlarged = target.next(path, program) if target else None
        if enlarged is None:
            return
        settings, is_resumed = settings._replace(samples=enlarged), True


def _simulate(
    program: Program, writer: ArchiveWriter, sums: RunSums, seed: int, blocks: MapBlocks, progress: RunProgress | None
) -> None:
    """Simulate the missing rows of an archive, write them with their sums, and check some of them against the surfaces."""
    sums.start_from(writer)

    def commit(rows: dict[str, np.ndarray], block_sums: BlockTotals) -> None:
        writer.append(rows)
        sums.merge(block_sums)
        if writer.is_checkpoint_due:
            writer.write_checkpoint(sums.fields.numbers)

    try:
        # An interrupt, which only the main thread receives, cannot come between a block and its sums.
        with ThreadPoolExecutor(1) as commits:
            for block in blocks(sums.of_blocks, program, samples=writer.samples, seed=seed, start=writer.rows):
                commits.submit(commit, *block).result()
                if progress:
                    progress(writer.rows)
        with writer.completed(sums.groups):
            _check(program, writer, seed)
            if writer.rows >= other_objectives.MIN_REALIZATIONS and not writer.has_objectives():
                first = writer.first_outcomes(other_objectives.ROWS)
                writer.write_group(OBJECTIVES_GROUP, other_objectives.by_objective(program, *first, blocks, seed))
    except BaseException:
        if writer.has_new_rows:
            if writer.is_between_blocks:
                writer.write_checkpoint(sums.fields.numbers)
            with writer.completed(sums.groups):
                pass
        raise


def _check(program: Program, writer: ArchiveWriter, seed: int) -> None:
    """Check some rows of an archive against the surfaces."""
    rows, at_random, stored_poses = writer.rows_to_check(seed)
    if rows.size:
        deviations = program.draws.rows(rows, seed=seed)
        poses = simulated_poses(program, deviations) if stored_poses is None else stored_poses
        surfaces = check_surfaces(program, poses, deviations)
        writer.write_checked(rows, at_random, surfaces)
        warn_of(program, surfaces)
