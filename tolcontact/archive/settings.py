"""The settings of a run, as the attributes of its archive state them; whether an archive is of the same model."""

import datetime
import functools
import hashlib
import json
import platform
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.contact_values import contact_values
from tolcontact.compilation import ACCURACY, Program
from tolcontact.declaration.document import to_document
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.errors import ArchiveError
from tolcontact.simulation import block_rows

_LIBRARIES = ("tolcontact", "casadi", "numpy", "scipy", "trimesh", "xarray", "netCDF4")
# When a run is resumed: another version may have other second solvers, or words for correlations, which the model determines.
MAY_CHANGE = ("samples", "solver_second", terms.CORRELATIONS)
POINT_TOLERANCE = 1e-9  # mm: points may differ by rounding from one machine to the next


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


def check_same_run(file: netCDF4.Dataset, path: Path, program: Program, settings: Mapping[str, Any], surfaces: int) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, is of another model or another run."""
    if not file.dimensions[terms.REALIZATION].isunlimited():
        raise ArchiveError(f'"{path}" is a copy that cannot grow; resume the archive that tolcontact wrote')
    check_same_model(file, path, program)
    _check_same_distributions(file, path, program)
    for name, value in settings.items():
        was = getattr(file, name, None)
        if name not in MAY_CHANGE and was != value:
            raise ArchiveError(
                f'"{path}" was run with {name} = {was}, now it is {value}; resume with the same, or write to a new file'
            )
    room = len(file["surface"].dimensions[terms.CHECKED])
    if room != surfaces:
        raise ArchiveError(f'"{path}" was begun with surfaces = {room}, now it is {surfaces}; resume with the same')


def check_same_model(file: netCDF4.Dataset, path: Path, program: Program) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, is of another model."""
    if _comparable(str(file["model"][terms.DECLARATION.name][...])) != _comparable(declaration(program)):
        raise ArchiveError(f'"{path}" contains another model than this one; write to a new file')
    for part in program.nominal.last_parts:
        if not _is_equal(file[f"field/{terms.group_of(part.name)}"][terms.FIELD_VERTICES.name], part.vertices):
            raise ArchiveError(f'"{path}": part "{part.name}" had another shape (was its mesh replaced?); write to a new file')
    if changed := _changed_body(file, program):
        raise ArchiveError(f'"{path}": the stiffness of part "{changed}" was another one; write to a new file')
    for variable, values in contact_values(program).items():
        if variable in (terms.BOUNDED, terms.PLANE_ERROR):  # they follow from the method, which is compared separately
            continue
        stored = file["contact"].variables.get(variable.name)
        if stored is None or not (variable.kind is str or _is_equal(stored, values)):  # texts are in the declaration
            raise ArchiveError(f'"{path}": its contact points differ (it was written by {file.versions}); write to a new file')


def _check_same_distributions(file: netCDF4.Dataset, path: Path, program: Program) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, describes a distribution otherwise than this version."""
    for contributor, was in zip(program.draws.contributors, file["sample"][terms.DISTRIBUTION.name][...], strict=True):
        if str(was) != contributor.description:
            raise ArchiveError(
                f'"{path}": contributor "{contributor.label}" was drawn as "{was}", now as "{contributor.description}"; '
                "write to a new file"
            )


def _comparable(declared: str) -> Any:
    """Return a declaration without what does not affect results: the lines of the script, and the title block."""
    ignored = ("declared_at", "title_block")
    return json.loads(declared, object_hook=lambda item: {key: item[key] for key in item if key not in ignored})


def _is_equal(stored: netCDF4.Variable, values: Any) -> bool:
    return stored.shape == np.shape(values) and np.allclose(stored[...], values, rtol=0, atol=POINT_TOLERANCE, equal_nan=True)


def elastic_parts(nominal: Nominal) -> list[NominalPart]:
    """Return the elastic parts in their last stations."""
    return [part for part in nominal.last_parts if part.part.elasticity is not None]


def _changed_body(file: netCDF4.Dataset, program: Program) -> str:
    """Return the name of an elastic part whose stiffness differs from the one in the archive; empty if none does."""
    parts = elastic_parts(program.nominal)
    stored = file[terms.ELASTIC_GROUP][terms.ELASTIC_HASH.name][...] if parts else []
    return next((part.name for part, was in zip(parts, stored, strict=True) if str(was) != stiffness_hash(part)), "")


def stiffness_hash(part: NominalPart) -> str:
    """Return a hash of what the stiffness of a part is computed from."""
    elastic = part.part.elasticity
    assert elastic is not None
    numbers = elastic.E, elastic.nu, elastic.density, elastic.pad
    digest = hashlib.sha256(repr(numbers if elastic.element_size is None else (*numbers, elastic.element_size)).encode())
    for file in (elastic.stiffness, elastic.nodes):
        digest.update(Path(file).read_bytes() if file is not None else np.asarray(part.mesh.vertices).tobytes())
    return digest.hexdigest()
