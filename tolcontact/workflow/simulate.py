"""Realizations as a lazy dataset: simulated by dask, chunk by chunk, when they are asked for."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive import Run, labelled, row_values, run_settings, sizes_of_rows
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import Block
from tolcontact.simulation.lazy import chunk_rows, dask_arrays, lazy_draws, lazy_realizations
from tolcontact.workflow.run import Choice, Model, check_counts, program_of

OF_ARCHIVES = ("kept", "fields")  # settings of a run that are not of its realizations


def simulate(
    model: Model | Program,
    samples: int | xr.DataArray,
    *,
    seed: int = 1,
    solver: str | None = None,
    method: Choice | None = None,
) -> xr.Dataset:
    """The realizations of `run`, with the variables that archives have of them, but nothing is simulated yet.

    `samples` is their number; or it is their deviations (realization, contributor) themselves, for which the `seed` does not
    matter: an xarray of the user's own, with labels of contributors or in the order of the model, in memory or chunked.
    Labels of its realizations stay.
    Each variable is a dask array whose chunks are simulated when they are asked for, and forgotten then: by threads here, or on
    the workers of the client of dask.distributed that was made last. `to_netcdf` and `to_zarr` stream, and so does what xarray
    computes, such as `.measured.mean("realization")`; what is asked for in two computations is simulated twice.
    Drawn realizations are those of a run to the last bit, whatever dask makes of them.
    Raises ModelError, OptionError for options or deviations that cannot be used, or if dask is not installed.
    """
    program = program_of(model, solver, method)
    check_counts(seed=seed)
    if isinstance(samples, xr.DataArray):
        deviations = _given(samples, program)
    elif not isinstance(samples, int):
        raise OptionError(
            f"samples is a {type(samples).__name__}; expected a number of realizations, or their deviations as an "
            f"xarray.DataArray ({terms.REALIZATION}, {terms.CONTRIBUTOR})"
        )
    else:
        check_counts(samples=samples)
        deviations = lazy_draws(program, samples, seed)
    variables = [of for of in terms.BY_REALIZATION if of is not terms.DEVIATION]
    sizes = sizes_of_rows(program.nominal)
    records = _Records(tuple((of.name, of.kind, tuple(sizes[dim] for dim in of.dims[1:])) for of in variables))
    found = lazy_realizations(program, deviations, records, records.kind)
    settings = run_settings(program, Run(seed, len(deviations), "", 0, ""))
    if isinstance(samples, xr.DataArray):
        settings |= {"sampler": "given"}
        del settings["seed"]
    rows = labelled(
        program,
        {of: found[of.name] for of in variables} | {terms.DEVIATION: deviations},
        {
            "Conventions": terms.CONVENTIONS,
            "title": f"realizations of {program.nominal.assembly.name}",
            **{name: value for name, value in settings.items() if name not in OF_ARCHIVES},
        },
    )
    if isinstance(samples, xr.DataArray) and terms.REALIZATION in samples.coords:
        return rows.assign_coords({terms.REALIZATION: samples[terms.REALIZATION]})
    return rows


@dataclass(frozen=True)
class _Records:
    """A block as records (realization,) of some fields: name, kind, shape."""

    fields: tuple[tuple[str, str, tuple[int, ...]], ...]

    @property
    def kind(self) -> np.dtype:
        return np.dtype(list(self.fields))

    def __call__(self, block: Block) -> np.ndarray:
        found = np.empty(len(block), self.kind)
        for name, values in row_values(block, [name for name, *_ in self.fields]).items():
            found[name] = values
        return found


def _given(deviations: xr.DataArray, program: Program) -> Any:
    """Deviations of the user's own as an array (realization, contributor) in chunks."""
    known = list(program.nominal.contributors)
    if set(deviations.dims) != {terms.REALIZATION, terms.CONTRIBUTOR}:
        raise OptionError(
            f"deviations have the dimensions {', '.join(map(str, deviations.dims)) or 'none'}; "
            f"expected {terms.REALIZATION} and {terms.CONTRIBUTOR}"
        )
    if terms.CONTRIBUTOR in deviations.coords:
        labels = deviations[terms.CONTRIBUTOR].values.tolist()
        wrong = sorted(set(map(str, labels)) ^ set(known)) or sorted({label for label in labels if labels.count(label) > 1})
        if wrong:
            raise OptionError(
                f'deviations of "{wrong[0]}" are missing, unknown, or given twice; expected one of each: {", ".join(known)}'
            )
        deviations = deviations.sel({terms.CONTRIBUTOR: known})
    elif deviations.sizes[terms.CONTRIBUTOR] != len(known):
        raise OptionError(
            f"deviations are of {deviations.sizes[terms.CONTRIBUTOR]} contributors; expected {len(known)}: {', '.join(known)}"
        )
    if not deviations.sizes[terms.REALIZATION]:
        raise OptionError("deviations are of no realization; expected one or more")
    if deviations.dtype.kind not in "fiu":
        raise OptionError(f"deviations are {deviations.dtype}; expected numbers")
    found, array = deviations.transpose(terms.REALIZATION, terms.CONTRIBUTOR).astype(float).data, dask_arrays()
    chunked = found if isinstance(found, array.Array) else array.from_array(found, chunks=(chunk_rows(program), -1))
    return chunked.rechunk({1: -1})
