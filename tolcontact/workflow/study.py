"""Designs side by side: models, seeds, solvers and methods as one lazy dataset."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.workflow.models import Choice, Model, assembly_of, program_of
from tolcontact.workflow.simulate import simulate
from tolcontact.workflow.solver_comparison import distinctions


def study(
    models: Mapping[str, Model | Program] | Sequence[Model | Program],
    samples: int,
    *,
    seeds: int | Sequence[int] = 1,
    solver: str | None = None,
    methods: Choice | Sequence[Choice] | None = None,
) -> xr.Dataset:
    """Return the realizations of every model with every seed and method (see `simulate`), along the dimension `design`.

    `models` maps names to models; without names, the names of the assemblies are used. Variables are lazy: a computation over
    all designs is one dask graph, which simulates only the chunks that it needs.
    The coordinates `model`, `seed`, `resolution`, `objective` and `solver` describe each design. Where a design lacks a label,
    such as a pair of another design, its values are NaN; whole numbers are 0.
    Raises ModelError, and OptionError for options that cannot be used or models of the same name.
    """
    method_list = methods if isinstance(methods, Sequence) and not isinstance(methods, str) else [methods]
    seed_list = [seeds] if isinstance(seeds, int) else seeds
    for option, values in {"models": models, "seeds": seed_list, "methods": method_list}.items():
        if not len(values):
            raise OptionError(f"{option} is empty; name at least one")
    programs = [
        (name, program_of(model, solver, choice)) for name, model in _named_models(models).items() for choice in method_list
    ]
    resolved_by = [program.method for _, program in programs]
    designs, labels = [], []
    for (name, program), seed in itertools.product(programs, seed_list):
        designs.append(simulate(program, samples, seed=seed))
        seed_label = [f"seed {seed}"] if len(seed_list) > 1 else []
        labels.append(", ".join([name, *distinctions(program.method, resolved_by), *seed_label]))
    if len(set(labels)) < len(labels):
        duplicate = next(label for label in labels if labels.count(label) > 1)
        raise OptionError(f'the design "{duplicate}" is given twice; name each seed and each method once')
    aligned = [_with_all_labels(design, designs) for design in designs]
    coordinates = {
        "model": [name for name, _ in programs for _ in seed_list],
        "seed": [seed for _ in programs for seed in seed_list],
        **{name: [design.attrs[name] for design in designs] for name in ("resolution", "objective", "solver")},
    }
    dataset = xr.concat(
        aligned, xr.Variable(terms.DESIGN, np.array(labels, dtype=object)), join="exact", combine_attrs="drop_conflicts"
    )
    return dataset.assign_coords({name: (terms.DESIGN, values) for name, values in coordinates.items()})


def _named_models(models: Mapping[str, Model | Program] | Sequence[Model | Program]) -> dict[str, Model | Program]:
    """Return models by name. Raises OptionError for two of the same name."""
    if isinstance(models, Mapping):
        return dict(models)
    declared_models = [model if isinstance(model, Program) else assembly_of(model) for model in models]
    names = [(model.nominal.assembly if isinstance(model, Program) else model).name for model in declared_models]
    if len(set(names)) < len(names):
        duplicate = next(name for name in names if names.count(name) > 1)
        raise OptionError(f'several models are called "{duplicate}"; name them: {{"thin": ..., "thick": ...}}')
    return dict(zip(names, declared_models, strict=True))


def _with_all_labels(design: xr.Dataset, designs: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return a design with the parts, pairs, measures and contributors of all designs."""
    labels = {
        dim: list(dict.fromkeys(label for dataset in designs for label in dataset[dim].values.tolist()))
        for dim in (terms.PART, terms.PAIR, terms.MEASURE, terms.CONTRIBUTOR)
    }
    fill_values = {name: np.nan if variable.dtype.kind == "f" else 0 for name, variable in design.data_vars.items()}
    return design.reindex(labels, fill_value=fill_values)
