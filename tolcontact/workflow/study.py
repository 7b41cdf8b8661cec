"""Designs side by side: models, seeds, solvers and methods as one lazy dataset."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.workflow.run import Choice, Model, declared, program_of
from tolcontact.workflow.simulate import simulate
from tolcontact.workflow.solver_comparison import told_apart


def study(
    models: Mapping[str, Model | Program] | Sequence[Model | Program],
    samples: int,
    *,
    seeds: int | Sequence[int] = 1,
    solver: str | None = None,
    methods: Choice | Sequence[Choice] | None = None,
) -> xr.Dataset:
    """The realizations of every model with every seed and every method (see `simulate`), along the dimension `design`.

    `models` are named, or called as their assemblies are. Variables are lazy: what is computed of all designs is one graph of
    dask, from which it simulates no more than it needs, design beside design.
    Along `design`, coordinates say the `model`, the `seed`, and the `resolution`, `objective` and `solver`. What a design does
    not have, such as a pair of another one, is not a number there; of whole numbers, 0.
    Raises ModelError, OptionError for options that cannot be used, or for models of the same name.
    """
    chosen = methods if isinstance(methods, Sequence) and not isinstance(methods, str) else [methods]
    drawn = [seeds] if isinstance(seeds, int) else seeds
    for word, given in {"models": models, "seeds": drawn, "methods": chosen}.items():
        if not len(given):
            raise OptionError(f"{word} are none; name at least one")
    programs = [(name, program_of(model, solver, method)) for name, model in _named(models).items() for method in chosen]
    resolved_by = [program.method for _, program in programs]
    designs, labels = [], []
    for (name, program), seed in itertools.product(programs, drawn):
        designs.append(simulate(program, samples, seed=seed))
        several = [f"seed {seed}"] if len(drawn) > 1 else []
        labels.append(", ".join([name, *told_apart(program.method, resolved_by), *several]))
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise OptionError(f'the design "{twice}" is given twice; name each seed and each method once')
    every = [_with_all_labels(each, designs) for each in designs]
    own = {
        "model": [name for name, _ in programs for _ in drawn],
        "seed": [seed for _ in programs for seed in drawn],
        **{word: [each.attrs[word] for each in designs] for word in ("resolution", "objective", "solver")},
    }
    found = xr.concat(
        every, xr.Variable(terms.DESIGN, np.array(labels, dtype=object)), join="exact", combine_attrs="drop_conflicts"
    )
    return found.assign_coords({word: (terms.DESIGN, values) for word, values in own.items()})


def _named(models: Mapping[str, Model | Program] | Sequence[Model | Program]) -> dict[str, Model | Program]:
    if isinstance(models, Mapping):
        return dict(models)
    every = [model if isinstance(model, Program) else declared(model) for model in models]
    names = [(model.nominal.assembly if isinstance(model, Program) else model).name for model in every]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise OptionError(f'several models are called "{twice}"; name them: {{"thin": ..., "thick": ...}}')
    return dict(zip(names, every, strict=True))


def _with_all_labels(design: xr.Dataset, designs: Sequence[xr.Dataset]) -> xr.Dataset:
    """A design with the parts, pairs, measures and contributors of all."""
    labels = {
        dim: list(dict.fromkeys(label for each in designs for label in each[dim].values.tolist()))
        for dim in (terms.PART, terms.PAIR, terms.MEASURE, terms.CONTRIBUTOR)
    }
    nothing = {name: np.nan if of.dtype.kind == "f" else 0 for name, of in design.data_vars.items()}
    return design.reindex(labels, fill_value=nothing)
