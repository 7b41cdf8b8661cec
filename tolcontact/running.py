"""From a declared assembly to an archive: the whole flow in one call."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import xarray as xr

from tolcontact.archive import ArchiveWriter, open_archive
from tolcontact.assembly import Assembly
from tolcontact.discretization import discretize
from tolcontact.errors import ArchiveError, OptionError
from tolcontact.method import Method
from tolcontact.simulation import simulate_blocks
from tolcontact.simulation.run import BLOCK
from tolcontact.simulation.surfaces import check_surfaces, simulated_poses
from tolcontact.symbolic import Program, compile_program
from tolcontact.vocabulary import KEPT

DEFAULT_SOLVER = "qpoases"
SURFACES = 64
Progress = Callable[[int], None]


def build(assembly: Assembly, *, solver: str = DEFAULT_SOLVER, method: Method | None = None) -> Program:
    """Discretize and compile a model.

    Raises ModelError with all its faults, OptionError for a solver that cannot be used.
    """
    return compile_program(discretize(assembly), solver, method or Method())


def run(
    assembly: Assembly | Program,
    *,
    samples: int = 1000,
    seed: int = 1,
    solver: str = DEFAULT_SOLVER,
    method: Method | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    resume: bool = False,
    keep: str = "all",
    surfaces: int = SURFACES,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Simulate `samples` realizations, raw and corrected, into the archive `out`, and open it.

    Without `out` the results are kept in memory only. `keep` says what is kept of each realization: "measures" (with gaps,
    status and residuals), also "poses", or "all" (also the deviations of the locators); fields come from all realizations.
    `surfaces` of the certified realizations are checked, in the end, against the surfaces themselves, between contact points.
    To `resume` is to go on to as many as the archive was begun for, or to `samples` if that is more.
    `progress` is called with the number of finished realizations.
    Raises ModelError, OptionError, or ArchiveError before anything is simulated or written.
    """
    check_counts(samples=samples, seed=seed, surfaces=surfaces)
    if keep not in KEPT:
        raise OptionError(f"keep is {keep!r}; expected one of: {', '.join(KEPT)}")
    if out is None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "results.nc"
            run(
                assembly,
                samples=samples,
                seed=seed,
                solver=solver,
                method=method,
                out=path,
                keep=keep,
                surfaces=surfaces,
                progress=progress,
            )
            with open_archive(path) as tree:
                return tree.load()
    path = Path(out)
    if overwrite and resume:
        raise OptionError("an archive cannot be overwritten and resumed; choose one of the two")
    check_writable(path, overwrite=overwrite, resume=resume)
    program = assembly if isinstance(assembly, Program) else build(assembly, solver=solver, method=method)
    start = ArchiveWriter.resume if resume and path.exists() else ArchiveWriter
    with start(path, program, seed=seed, samples=samples, keep=keep, surfaces=surfaces) as writer:
        for done in simulate_blocks(program, samples=writer.samples, seed=seed, start=writer.rows):
            writer.append(done)
            if len(done) == BLOCK:
                writer.check_point()
            if progress:
                progress(writer.rows)
        writer.write_fields()
        rows = writer.chosen(seed)
        if rows.size:
            kept = writer.poses(rows)
            found = check_surfaces(program, simulated_poses(program, rows, seed) if kept is None else kept)
            writer.write_checked(rows, *found)
    return open_archive(path)


def check_counts(**counts: int) -> None:
    """Raise OptionError for a count that is no whole number, or too small (samples 2, seed and surfaces 0)."""
    for word, value in counts.items():
        least = {"samples": 2, "seed": 0, "surfaces": 0}[word]
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value < 2**63:
            raise OptionError(f"{word} is {value!r}; expected a whole number, {least} or above and below 2^63")


def check_writable(path: Path, *, overwrite: bool, resume: bool) -> None:
    """Raise ArchiveError where `path` cannot become an archive, before any work is done."""
    if path.exists() and not path.is_file():
        raise ArchiveError(f'archive "{path}" cannot be written: it is not a file')
    if path.exists() and not (overwrite or resume):
        raise ArchiveError(f'archive "{path}" exists; choose another name, or ask to overwrite or to resume it')
    if not path.parent.is_dir():
        raise ArchiveError(f'archive "{path}" cannot be written: folder "{path.parent}" does not exist; make it first')
    existed = path.exists()
    try:
        with path.open("ab"):
            pass
    except OSError as error:
        raise ArchiveError(f'archive "{path}" cannot be written: {error.strerror}') from error
    if not existed:
        path.unlink()
