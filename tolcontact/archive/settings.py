"""The settings of a run, as the attributes of its archive state them."""

import datetime
import functools
import json
import platform
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import ACCURACY, Program
from tolcontact.declaration.document import to_document
from tolcontact.simulation import block_rows

_LIBRARIES = ("tolcontact", "casadi", "numpy", "scipy", "trimesh", "xarray", "netCDF4")


class Run(NamedTuple):
    """The arguments of a run besides its program.

    keep       the variables of each realization that are archived: one of `KEPT`
    surfaces   number of realizations that will be checked against the surfaces
    plan       the sampling plan: one of `PLANS`
    fields     number of realizations in the magnitude of displacement fields: a number, "some", "all" or "none"
    checkpoint_interval   time [s] between two checkpoints, at least
    """

    seed: int
    samples: int
    keep: str
    surfaces: int
    fields: int | str
    plan: str = terms.MONTE_CARLO
    checkpoint_interval: float = 2.0  # checkpoint and fields take some 50 ms for a part with 100 000 vertices


def run_settings(program: Program, run: Run) -> dict[str, Any]:
    """Return the global attributes that determine the rows; a resumed run must agree in all but `samples`."""
    method, assembly = program.method, program.nominal.assembly
    elastic = [f"{part.name} ({part.elasticity})" for part in assembly.parts if part.elasticity is not None]
    optional = {
        terms.STANDARD: assembly.standards,
        terms.STORED_COORDINATES: program.stored_coordinates,
        terms.ELASTIC_PARTS: "; ".join(elastic),
        terms.CORRELATIONS: "\n".join(program.draws.in_words),
    }
    return {
        "solver": program.solver.name,
        "solver_options": json.dumps(program.solver.options),
        "solver_second": ", ".join(program.solver.substitutes(elastic=program.bending is not None)),
        "solver_accuracy": ACCURACY,
        "resolution": method.resolution,
        "objective": method.objective,
        "weighting": _weighting(program),
        "regularization": method.regularization,
        "active_set": method.active_set,
        "search": method.search,
        "method_from": _method_origin(program),
        "sampler": run.plan,
        "seed": np.int64(run.seed),
        "samples": np.int64(run.samples),
        "kept": run.keep,
        "fields": str(run.fields),
        "block_rows": np.int64(block_rows(program)),
        **{name: text for name, text in optional.items() if text},
    }


def watch_settings(program: Program) -> dict[str, Any]:
    """Return the attributes of the interference test: its depth [mm], and the bodies left out; none without a test."""
    if not program.method.is_bounded:
        return {}
    watch, assembly = program.watch, program.nominal.assembly
    untested = {
        "elastic parts": [part.name for part in assembly.parts if part.elasticity is not None],
        "parts that are not closed": watch.open_parts,
        "contact pairs that give way or have form": watch.untested_pairs,
        "round faces of contact pairs, which are judged by their gaps": watch.round_pairs,
        "parts that lie in each other nominally": watch.overlapping_parts,
        "overlaps that are declared": tuple(f"({overlap.name})" for overlap in assembly.overlaps),
    }
    texts = [f"{kind}: {', '.join(names)}" for kind, names in untested.items() if names]
    return {terms.INTERFERENCE_DEPTH: watch.largest_depth, terms.NOT_WATCHED: "; ".join(texts)}


def _weighting(program: Program) -> str:
    """Return which contact points count in the objective, and how."""
    method = program.method
    if not method.minimizes.counts_points:
        return "none"
    by_area = ", by area and its moments" if method.is_exact else ""
    by_area = ", as opposite faces by their moments" if method.counts_faces else by_area
    are_centres = any(pair.counts_centres for pair in program.nominal.pairs)
    return f"{method.objective}{by_area}{', balls and shafts by their centres' if are_centres else ''}"


def _method_origin(program: Program) -> str:
    assembly = program.nominal.assembly
    if program.method == assembly.effective_method:
        return "defaults" if assembly.method is None else "model"
    return "options"


def declaration(program: Program) -> str:
    """Return the declared model as JSON."""
    return json.dumps(to_document(program.nominal.assembly, program.nominal.triangles, program.tapes))


@functools.cache  # each look-up reads the metadata of a package
def versions() -> str:
    """Return the names and versions of the software that computes."""
    return ", ".join([f"python {platform.python_version()}", *(f"{lib} {version(lib)}" for lib in _LIBRARIES)])


def now() -> str:
    """Return the current time in the format of the history."""
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
