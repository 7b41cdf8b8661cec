"""Runs: from a declared assembly to an archive."""

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from tolcontact.archive import ArchiveWriter, Run, locked_archive, open_unchecked
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation.cluster import MapBlocks, mapping, threads_of
from tolcontact.simulation.surfaces import check_surfaces, simulated_poses, warn_of
from tolcontact.vocabulary import FIELD_CHOICES, KEPT, PLANS
from tolcontact.workflow.forecast import announce
from tolcontact.workflow.models import Choice, Model, check_counts, check_program, program_of
from tolcontact.workflow.run_sums import RunSums
from tolcontact.workflow.until import Target

SURFACES = 64
RunProgress = Callable[[int], None]  # called with the number of finished realizations

log = logging.getLogger(__name__)


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
    _check_choices(settings)
    check_program(model, solver, method)
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


def _check_choices(settings: Run) -> None:
    """Raise OptionError for an invalid choice of `run`."""
    keep, fields, plan = settings.keep, settings.fields, settings.plan
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
    progress: RunProgress | None = None,
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
    program: Program, writer: ArchiveWriter, sums: RunSums, seed: int, blocks: MapBlocks, progress: RunProgress | None
) -> None:
    """Simulate the missing rows of an archive, write them with their sums, and check some of them against the surfaces."""
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
        elif not is_summed:  # the interrupt may have come during a summation: only the sums of the last checkpoint are valid
            is_summed = sums.start_from(writer)
        if is_summed:
            sums.write_to(writer)
        raise
    rows_to_check, at_random = writer.rows_to_check(seed)
    if rows_to_check.size:
        stored_poses = writer.poses(rows_to_check)
        deviations = program.draws.rows(rows_to_check, seed=seed)
        poses = simulated_poses(program, deviations) if stored_poses is None else stored_poses
        surfaces = check_surfaces(program, poses, deviations)
        writer.write_checked(rows_to_check, at_random, surfaces)
        warn_of(program, surfaces)
