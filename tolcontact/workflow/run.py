"""From a declared assembly to an archive: the whole flow in one call."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import xarray as xr

from tolcontact.archive import ArchiveWriter, Run, check_rows, open_archive, opened, taken
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model
from tolcontact.discretization import discretize
from tolcontact.errors import ModelError, OptionError
from tolcontact.method import Method
from tolcontact.simulation.cluster import MapBlocks, mapping, threads_of
from tolcontact.simulation.surfaces import check_surfaces, simulated_poses
from tolcontact.statistics import Summary
from tolcontact.statistics import summarize as statistics_of
from tolcontact.vocabulary import FIELD_CHOICES, KEPT, MONTE_CARLO, PLANS
from tolcontact.workflow.forecast import announce
from tolcontact.workflow.run_sums import RunSums
from tolcontact.workflow.until import Target

DEFAULT_SOLVER = "qpoases"
SURFACES = 64
Model = Assembly | Callable[[], Assembly] | str | Path
Progress = Callable[[int], None]
Choice = Method | Mapping[str, Any]  # a method, or some of its choices; the others are the model's


def build(model: Model, *, solver: str = DEFAULT_SOLVER, method: Choice | None = None) -> Program:
    """Discretize and compile a model: an assembly, the function that declares it, or the path of its script.

    `method` is used instead of the model's own; a mapping, such as {"resolution": "exact"}, replaces single choices.
    Raises ModelError with all its faults, OptionError for a solver or a method that cannot be used.
    """
    assembly = declared(model)
    return compile_program(discretize(assembly), solver, chosen(assembly, method))


def program_of(model: Model | Program, solver: str | None, method: Choice | None) -> Program:
    """The program of a model (see `build`), or the one that is given, which has its solver and method already."""
    check_program(model, solver, method)
    return model if isinstance(model, Program) else build(model, solver=solver or DEFAULT_SOLVER, method=method)


def check_program(model: Model | Program, solver: str | None, method: Choice | None) -> None:
    """Raise OptionError for a program with a solver or a method beside it: they could not act."""
    if isinstance(model, Program) and not (solver is None and method is None):
        raise OptionError(
            "a Program has its solver and method; leave them out, or build it with them: tc.build(..., solver=..., method=...)"
        )


def check(model: Model, *, solver: str = DEFAULT_SOLVER, method: Choice | None = None) -> tuple[str, ...]:
    """Every fault of a model; none if it can be built (see `build`)."""
    try:
        build(model, solver=solver, method=method)
    except ModelError as error:
        return error.faults
    return ()


def chosen(assembly: Assembly, method: Choice | None) -> Method:
    """The method that an assembly is resolved with. Raises OptionError for a choice that no method has."""
    own = assembly.method or Method()
    if method is None or isinstance(method, Method):
        return method or own
    if not isinstance(method, Mapping):
        raise OptionError(f'method is {method!r}; expected a tc.Method, or some of its choices: {{"resolution": "exact"}}')
    known = [field.name for field in fields(Method)]
    for word in method:
        if word not in known:
            raise OptionError(f"a method has no choice {word!r}; expected some of: {', '.join(known)}")
    return replace(own, **method)


def declared(model: Model) -> Assembly:
    """The assembly of a model, however it is given."""
    if isinstance(model, str | Path):
        return load_model(Path(model))
    if not isinstance(model, Assembly) and callable(model):
        model = model()
    if not isinstance(model, Assembly):
        raise OptionError(
            f"the model is a {type(model).__name__}; expected a tc.Assembly, a function that returns one, or a script's path"
        )
    return model


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

    `model` is what `build` takes, or what it gives: a Program, which has its solver and method (else qpoases, and the
    model's own method).
    Without `out` the results are kept in memory only. `keep` states what is kept of each realization: "measures" (with gaps,
    status and residuals), also "poses", or "all" (also the deviations of the locators); fields come from all realizations.
    `fields` is the number of realizations, the first ones, that the magnitudes of displacement fields cover, "all", "none", or
    "some": 16 384, and fewer where a part has many vertices. Their components are always exact, over all realizations.
    `plan` is how contributors are drawn: "monte-carlo", "latin hypercube" or "sobol" (see tolcontact.variation). The latter two
    draw 256 realizations together; from 16 such replicates on, intervals are theirs, and narrower.
    `until` says how narrow an interval has to become, such as "corner height: 6 sigma +-1 %", "gap: mean +-0.001" or "gap: ppm
    +-20 %", of corrected measures: `samples` are the first ones, and as many more follow as it takes.
    `client` of dask.distributed, if there is one: its workers simulate, this process writes; the results are the same to the
    last bit (see tolcontact.simulation).
    `surfaces` of the certified realizations are checked, in the end, against the surfaces themselves, between contact points.
    To `resume` is to go on to as many as the archive was begun for, or to `samples` if that is more.
    `progress` is called with the number of finished realizations. An interrupted run (Ctrl-C) leaves an archive that can be
    read, with fields of what is finished, and resumed.
    Raises ModelError, OptionError, or ArchiveError before anything is simulated or written; ClusterError if workers fail.
    """
    check_counts(samples=samples, seed=seed, surfaces=surfaces)
    if keep not in KEPT:
        raise OptionError(f"keep is {keep!r}; expected one of: {', '.join(KEPT)}")
    if fields not in FIELD_CHOICES and not (type(fields) is int and 2 <= fields < 2**63):
        raise OptionError(f"fields is {fields!r}; expected a whole number, at least 2, or one of: {', '.join(FIELD_CHOICES)}")
    if plan not in PLANS:
        raise OptionError(f"plan is {plan!r}; expected one of: {', '.join(PLANS)}")
    check_program(model, solver, method)
    target = None if until is None else Target.of(until)

    def write(path: Path) -> None:
        program = program_of(model, solver, method)
        program = replace(program, draws=program.draws.planned(plan))
        if target:
            target.check(program)
        blocks = mapping(client)
        asked, goes_on = Run(seed, samples, keep, surfaces, str(fields), plan), resume and path.exists()
        while True:
            sums = RunSums(program, asked)
            with (
                ArchiveWriter.resume(path, program, asked) if goes_on else ArchiveWriter(path, program, asked, sums.sizes)
            ) as writer:
                announce(program, samples=writer.samples - writer.rows, seed=seed, keep=keep, threads=threads_of(client))
                _simulate(program, writer, sums, seed, blocks, progress)
            more = target.next(path, program) if target else None
            if more is None:
                return
            asked, goes_on = asked._replace(samples=more), True

    if out is None:
        for word, value in {"overwrite": overwrite, "resume": resume}.items():
            if value:
                raise OptionError(f"{word} needs an archive, and none is named; name one: out=...")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "results.nc"
            write(path)
            with opened(path) as tree:
                return tree.load()
    with taken(out, overwrite=overwrite, resume=resume) as path:
        write(path)
    return opened(path)


def _simulate(
    program: Program, writer: ArchiveWriter, sums: RunSums, seed: int, blocks: MapBlocks, progress: Progress | None
) -> None:
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
        elif not is_summed:  # it came at whatever instant: only the sums of the last checkpoint are sure
            is_summed = sums.start_from(writer)
        if is_summed:
            sums.write_to(writer)
        raise
    chosen_rows = writer.chosen(seed)
    if chosen_rows.size:
        kept = writer.poses(chosen_rows)
        deviations = program.draws.rows(chosen_rows, seed=seed)
        poses = simulated_poses(program, deviations) if kept is None else kept
        writer.write_checked(chosen_rows, *check_surfaces(program, poses, deviations))


def summarize(results: xr.DataTree | str | Path) -> Summary:
    """Statistics of a run, or of the archive of that name (see tolcontact.statistics.summarize).

    Raises ArchiveError if realizations are not what was written, or if fewer than two are finished.
    """
    if isinstance(results, str | Path):
        with open_archive(results) as tree:
            return summarize(tree)
    if not isinstance(results, xr.DataTree):
        raise OptionError(
            f"results are a {type(results).__name__}; expected what tc.run or tc.open_archive returns, or an archive's path"
        )
    check_rows(results)
    return statistics_of(results)


def check_counts(**counts: int) -> None:
    """Raise OptionError for a count that is no whole number, or too small (samples 2, seed and surfaces 0)."""
    for word, value in counts.items():
        least = {"samples": 2, "seed": 0, "surfaces": 0}[word]
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value < 2**63:
            raise OptionError(f"{word} is {value!r}; expected a whole number, at least {least} and below 2^63")
