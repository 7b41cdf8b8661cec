"""Runs with results that xarray reads."""

import tempfile
from pathlib import Path
from typing import Any

import xarray as xr

from tolcontact.archive import Run, open_archive, open_unchecked
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.vocabulary import MONTE_CARLO
from tolcontact.workflow.accessor import Results
from tolcontact.workflow.archived_run import SURFACES, RunProgress, write_run
from tolcontact.workflow.models import Choice, Model

__all__ = ["open_archive", "run"]

# The import registers the methods of results, for anyone who runs a model or opens an archive.
xr.register_datatree_accessor("tolcontact")(Results)  # type: ignore[no-untyped-call]


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
    progress: RunProgress | None = None,
) -> xr.DataTree:
    """Simulate `samples` realizations, raw and corrected, into the archive `out`, and open it.

    `model` is anything that `build` takes or returns. A Program has its solver and method already; the default solver is
    qpoases, and the default method is the model's own.
    `out` is the path of the archive. Without it, the results stay in memory.
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
    `surfaces` is the number of certified realizations that are checked against the surfaces between contact points at the end.
    With `resume`, continue an interrupted run up to the number of samples it was started with, or `samples` if larger.
    `progress` is called with the number of finished realizations. An interrupted run (Ctrl-C) leaves an archive that can be
    read and resumed; its fields cover the finished realizations.
    Raises ModelError, OptionError, or ArchiveError before anything is simulated or written; ClusterError if workers fail.
    """
    settings = Run(seed, samples, keep, surfaces, fields, plan)
    options = {"solver": solver, "method": method, "until": until, "client": client, "progress": progress}
    if out is None:
        return _results_in_memory(model, settings, options, overwrite=overwrite, resume=resume)
    return open_unchecked(write_run(model, settings, Path(out), overwrite=overwrite, resume=resume, **options))


def _results_in_memory(model: Model | Program, settings: Run, options: dict[str, Any], **archive_options: bool) -> xr.DataTree:
    """Return the results of a run without keeping its archive. Raises OptionError for options that need an archive."""
    for option, is_set in archive_options.items():
        if is_set:
            raise OptionError(f"{option} needs an archive, and none is named; name one: out=...")
    with (
        tempfile.TemporaryDirectory() as folder,
        open_unchecked(write_run(model, settings, Path(folder) / "results.nc", **options)) as tree,
    ):
        return tree.load()
