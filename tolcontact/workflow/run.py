"""Runs: from a declared assembly to an archive in one call, and the statistics of its results."""

import logging
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import xarray as xr

from tolcontact.archive import ArchiveWriter, Run, check_rows, open_archive, opened, taken
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation.cluster import MapBlocks, mapping, threads_of
from tolcontact.simulation.surfaces import check_surfaces, simulated_poses, warn_of
from tolcontact.statistics import Summary, summarize as summary_of
from tolcontact.vocabulary import FIELD_CHOICES, KEPT, MONTE_CARLO, PLANS
from tolcontact.workflow.forecast import announce
from tolcontact.workflow.models import Choice, Model, check_counts, check_program, program_of
from tolcontact.workflow.run_sums import RunSums
from tolcontact.workflow.until import Target

SURFACES = 64
Progress = Callable[[int], None]

log = logging.getLogger(__name__)


def run(
    model: Model | Program,
    *,
    samples: int = 1000,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    keep: str = "all",
    surfaces: int = SURFACES,
    fields: int | str = "some",
    plan: str = MONTE_CARLO,
    until: str | None = None,
    client: Any = None,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Simulate `samples` realizations, raw and corrected, into the archive `out`, and open it.

    `model` is anything that `build` takes or returns. A Program has its solver and method already; the default solver is
    qpoases, and the default method is the model's own.
    `out` is the path of the archive. Without it, the results stay in memory.
    `keep` states what the archive stores of each realization: "measures" (with gaps, status and residuals), "poses" (these as
    well), or "all" (also the deviations). Displacement fields always come from all realizations.
    `fields` is the number of realizations that the magnitudes of displacement fields cover, starting from the first: a number,
    "all", "none", or "some" (16 384, or fewer where a part has many vertices). The components x, y, z are always exact.
    `plan` is the sampling plan: "monte-carlo", "latin hypercube" or "sobol" (see tolcontact.variation). The latter two draw
    replicates of 256 realizations; from 16 replicates on, intervals come from the replicates and are narrower.
    `until` states how narrow the 95 % interval of a corrected measure must become, for example "corner height: 6 sigma +-1 %",
    "gap: mean +-0.001" or "gap: ppm +-20 %". The run then starts with `samples` realizations and adds more until it is. If that
    takes too many, it stops, and a warning is logged.
    `client` is a client of dask.distributed. Its workers simulate, this process writes, and the results are the same to the
    last bit (see tolcontact.simulation).
    `surfaces` is the number of certified realizations that are checked against the surfaces between contact points at the end.
    With `resume`, continue an interrupted run up to the number of samples it was started with, or `samples` if larger.
    `progress` is called with the number of finished realizations. An interrupted run (Ctrl-C) leaves an archive that can be
    read and resumed; its fields cover the finished realizations.
    Raises ModelError, OptionError, or ArchiveError before anything is simulated or written; ClusterError if workers fail.
    """
    check_counts(samples=samples, seed=seed, surfaces=surfaces)
    _check_choices(keep, fields, plan)
    check_program(model, solver, method)
    target = None if until is None else Target.of(until)
    settings = Run(seed, samples, keep, surfaces, str(fields), plan)

    def write(path: Path) -> None:
        program = program_of(model, solver, method)
        program = replace(program, draws=program.draws.planned(plan))
        if target:
            target.check(program)
        write_archive(path, program, settings, target, client, progress, is_resumed=resume and path.exists())

    results = _results_of(write, out, overwrite=overwrite, resume=resume)
    if target and (sentence := target.shortfall(results)):
        log.warning(sentence)
    return results


def _results_of(write: Callable[[Path], None], out: str | Path | None, *, overwrite: bool, resume: bool) -> xr.DataTree:
    """Return the results of `write` from the archive `out`, or from memory."""
    if out is None:
        return _results_in_memory(write, overwrite=overwrite, resume=resume)
    with taken(out, overwrite=overwrite, resume=resume) as path:
        write(path)
    return opened(path)


def _results_in_memory(write: Callable[[Path], None], **archive_options: bool) -> xr.DataTree:
    """Return the results of `write` without keeping its archive. Raises OptionError for options that need an archive."""
    for option, is_set in archive_options.items():
        if is_set:
            raise OptionError(f"{option} needs an archive, and none is named; name one: out=...")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "results.nc"
        write(path)
        with opened(path) as tree:
            return tree.load()


def _check_choices(keep: str, fields: int | str, plan: str) -> None:
    """Raise OptionError for a choice that `run` does not offer."""
    if keep not in KEPT:
        raise OptionError(f"keep is {keep!r}; expected one of: {', '.join(KEPT)}")
    if fields not in FIELD_CHOICES and not (type(fields) is int and 2 <= fields < 2**63):
        raise OptionError(f"fields is {fields!r}; expected a whole number, at least 2, or one of: {', '.join(FIELD_CHOICES)}")
    if plan not in PLANS:
        raise OptionError(f"plan is {plan!r}; expected one of: {', '.join(PLANS)}")


def write_archive(
    path: Path,
    program: Program,
    settings: Run,
    target: Target | None = None,
    client: Any = None,
    progress: Progress | None = None,
    *,
    is_resumed: bool = False,
) -> None:
    """Simulate into the archive at `path`, and add realizations until the target is met, if there is one."""
    blocks = mapping(client)
    while True:
        sums = RunSums(program, settings)
        with (
            ArchiveWriter.resume(path, program, settings) if is_resumed else ArchiveWriter(path, program, settings, sums.sizes)
        ) as writer:
            remaining = writer.samples - writer.rows
            announce(program, samples=remaining, seed=settings.seed, keep=settings.keep, threads=threads_of(client))
            _simulate(program, writer, sums, settings.seed, blocks, progress)
        enlarged = target.next(path, program) if target else None
        if enlarged is None:
            return
        settings, is_resumed = settings._replace(samples=enlarged), True


def _simulate(
    program: Program, writer: ArchiveWriter, sums: RunSums, seed: int, blocks: MapBlocks, progress: Progress | None
) -> None:
    """Simulate the rows that an archive lacks, write them with their sums, and check some against the surfaces."""
    sums.start_from(writer)
    is_summed = bool(writer.rows)
    try:
        for rows, block_sums in blocks(sums.of_blocks, program, samples=writer.samples, seed=seed, start=writer.rows):
            is_summed = False
            sums.merge(block_sums)
            writer.append(rows)
            is_summed = True
            if writer.is_checkpoint_due:
                writer.write_checkpoint(sums.numbers)
                sums.write_to(writer)
            if progress:
                progress(writer.rows)
        sums.write_to(writer)
    except KeyboardInterrupt:
        if is_summed and writer.is_between_blocks:
            writer.write_checkpoint(sums.numbers)
        elif not is_summed:  # the interrupt may have come within a sum: only those of the last checkpoint are sure
            is_summed = sums.start_from(writer)
        if is_summed:
            sums.write_to(writer)
        raise
    rows_to_check, at_random = writer.chosen(seed)
    if rows_to_check.size:
        stored_poses = writer.poses(rows_to_check)
        deviations = program.draws.rows(rows_to_check, seed=seed)
        poses = simulated_poses(program, deviations) if stored_poses is None else stored_poses
        surfaces = check_surfaces(program, poses, deviations)
        writer.write_checked(rows_to_check, at_random, surfaces)
        warn_of(program, surfaces)


def summarize(results: xr.DataTree | str | Path) -> Summary:
    """Return the statistics of results, or of the archive at a path (see tolcontact.statistics.summarize).

    Raises ArchiveError if realizations differ from what was written, or if fewer than two are finished.
    """
    if isinstance(results, str | Path):
        with open_archive(results) as tree:
            return summarize(tree)
    if not isinstance(results, xr.DataTree):
        raise OptionError(
            f"results are a {type(results).__name__}; expected what tc.run or tc.open_archive returns, or an archive's path"
        )
    check_rows(results)
    return summary_of(results)
