"""Lazy realizations: a dataset whose chunks dask simulates when they are needed."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive import Run, labelled, row_values, run_settings, sizes_of_rows
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.method import Solver
from tolcontact.simulation import Block, ProgramFunction
from tolcontact.simulation.lazy import chunk_rows, dask_arrays, lazy_draws, lazy_realizations
from tolcontact.workflow.models import Choice, Model, check_counts, program_of

ARCHIVE_SETTINGS = ("kept", "fields")  # settings of a run that do not affect its realizations


def simulate(
    model: Model | Program,
    samples: int | xr.DataArray,
    *,
    seed: int = 1,
    solver: Solver | None = None,
    method: Choice | None = None,
) -> xr.Dataset:
    """Return the realizations of a run as a lazy dataset with the variables of archives; nothing is simulated yet.

    `model`, `solver` and `method` are as in `run`: `tc.simulate("model.py", 100_000).measured.mean("realization").compute()`.

    `samples` is the number of realizations, or an xarray.DataArray of deviations (realization, contributor), in memory or
    chunked. Contributors of that array are labelled, or are in the order of the model; labels of realizations are kept. The
    `seed` has no effect on it.
    Each variable is a dask array. Its chunks are simulated when a computation needs them, and are not stored: by threads of
    this process, or by the workers of the latest client of dask.distributed. `to_netcdf`, `to_zarr` and reductions such as
    `.measured.mean("realization")` stream. Two computations simulate twice.
    Drawn realizations equal the realizations of `run` to the last bit, regardless of how dask schedules them.
    Raises ModelError, and OptionError for options or deviations that cannot be used, or if dask is not installed.
    """
    program = program_of(model, solver, method)
    check_counts(seed=seed)
    if isinstance(samples, xr.DataArray):
        deviations = _user_deviations(samples, program)
    elif not isinstance(samples, int):
        raise OptionError(
            f"samples is a {type(samples).__name__}; expected a number of realizations, or their deviations as an "
            f"xarray.DataArray ({terms.REALIZATION}, {terms.CONTRIBUTOR})"
        )
    else:
        check_counts(samples=samples)
        deviations = lazy_draws(program, samples, seed)
    variables = [variable for variable in terms.BY_REALIZATION if variable is not terms.DEVIATION]
    sizes = sizes_of_rows(program.nominal)
    records = _Records(
        tuple((variable.name, variable.kind, tuple(sizes[dim] for dim in variable.dims[1:])) for variable in variables)
    )
    arrays = lazy_realizations(program, deviations, records, records.kind)
    settings = run_settings(program, Run(seed, len(deviations), "", 0, ""))
    if isinstance(samples, xr.DataArray):
        settings |= {"sampler": "given"}
        del settings["seed"]
    rows = labelled(
        program,
        {variable: arrays[variable.name] for variable in variables} | {terms.DEVIATION: deviations},
        {
            "Conventions": terms.CONVENTIONS,
            "title": f"realizations of {program.nominal.assembly.name}",
            **{name: value for name, value in settings.items() if name not in ARCHIVE_SETTINGS},
        },
    )
    if isinstance(samples, xr.DataArray) and terms.REALIZATION in samples.coords:
        return rows.assign_coords({terms.REALIZATION: samples[terms.REALIZATION]})
    return rows


@dataclass(frozen=True)
class _Records(ProgramFunction):
    """Conversion of a block to records (realization,) with fields of a name, kind and shape."""

    fields: tuple[tuple[str, str, tuple[int, ...]], ...]

    @property
    def kind(self) -> np.dtype:
        return np.dtype(list(self.fields))

    def __call__(self, program: Program, block: Block) -> np.ndarray:
        records = np.empty(len(block), self.kind)
        for name, values in row_values(block, [name for name, *_ in self.fields], program.nominal).items():
            records[name] = values
        return records


def _user_deviations(deviations: xr.DataArray, program: Program) -> Any:
    """Return the deviations of a user as a dask array (realization, contributor).

    Raises OptionError for other dimensions, contributors or kinds of values.
    """
    labels = list(program.nominal.contributors)
    if set(deviations.dims) != {terms.REALIZATION, terms.CONTRIBUTOR}:
        raise OptionError(
            f"deviations have the dimensions {', '.join(map(str, deviations.dims)) or 'none'}; "
            f"expected {terms.REALIZATION} and {terms.CONTRIBUTOR}"
        )
    if terms.CONTRIBUTOR in deviations.coords:
        columns = deviations[terms.CONTRIBUTOR].values.tolist()
        wrong = sorted(set(map(str, columns)) ^ set(labels)) or sorted({label for label in columns if columns.count(label) > 1})
        if wrong:
            raise OptionError(
                f'deviations of "{wrong[0]}" are missing, unknown, or given twice; expected one of each: {", ".join(labels)}'
            )
        deviations = deviations.sel({terms.CONTRIBUTOR: labels})
    elif deviations.sizes[terms.CONTRIBUTOR] != len(labels):
        raise OptionError(
            f"deviations have {deviations.sizes[terms.CONTRIBUTOR]} contributors; expected {len(labels)}: {', '.join(labels)}"
        )
    if not deviations.sizes[terms.REALIZATION]:
        raise OptionError("deviations have no realizations; expected at least one")
    if deviations.dtype.kind not in "fiu":
        raise OptionError(f"deviations are {deviations.dtype}; expected numbers")
    values, array = deviations.transpose(terms.REALIZATION, terms.CONTRIBUTOR).astype(float).data, dask_arrays()
    chunked = values if isinstance(values, array.Array) else array.from_array(values, chunks=(chunk_rows(program), -1))
    return chunked.rechunk({1: -1})
