"""Models, the input of `run` and of analyses: from the path of a script or an archive to the compiled program."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from tolcontact import archive
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model, write_json
from tolcontact.discretization import discretize
from tolcontact.errors import ArchiveError, ModelError, OptionError, TolcontactError
from tolcontact.input_files import is_archive
from tolcontact.method import Method, Solver
from tolcontact.plausibility import warn_of_nominal
from tolcontact.replacing import check_identities

DEFAULT_SOLVER: Solver = "qpoases"
COUNTS = {  # smallest and largest
    "samples": (2, 10**12), "seed": (0, 2**63 - 1), "surfaces": (0, 10**6),
}  # fmt: skip
Model = Assembly | Callable[[], Assembly] | str | Path
Choice = Method | Mapping[str, Any]  # a method, or some of its choices; the model's own method has the others


def build(model: Model, *, solver: Solver = DEFAULT_SOLVER, method: Choice | None = None) -> Program:
    """Discretize and compile a model: an assembly, the function that declares it, or the path of its script or archive.

    The model of an archive has the method of its run. `method` replaces the model's own; a mapping, such as
    {"resolution": "exact"}, replaces single choices.
    A NominalWarning names probable mistakes in the nominal assembly (see tolcontact.plausibility).
    `solver` is a name of tolcontact.compilation, by default "qpoases". A program may be run several times:
    `program = tc.build("model.py", solver="daqp", method={"objective": "seating"}); tc.run(program, samples=1000)`.
    Raises ModelError with all faults of the model, and OptionError for a solver or a method that cannot be used.
    """
    assembly, method_of_run = _loaded(model) if isinstance(model, str | Path) else (assembly_of(model), None)
    choice = method_of(assembly, method, method_of_run)
    program = compile_program(discretize(assembly, presses=choice.minimizes.presses), solver, choice)
    warn_of_nominal(program)
    return program


def check(model: Model, *, solver: Solver = DEFAULT_SOLVER, method: Choice | None = None) -> tuple[str, ...]:
    """Return every fault of a model, with `solver` and `method` (and defaults) as in `build`; empty if it can be built.

    `for fault in tc.check("model.py"): print(fault)`
    """
    try:
        build(model, solver=solver, method=method)
    except ModelError as error:
        return error.faults
    return ()


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as JSON to `path`, as in `tc.io.write_model("model.py", "model.json")` (see tolcontact.declaration).

    Shapes are stated as file names, relative to the folder of `path` if they are in it. Faces that a function selects become
    triangles, and functions of poses become the steps of their expressions.
    A JSON model of that name is replaced; other files, and the model itself, are not.
    Raises ModelError for a model with faults, ScriptError for a mesh that is not a file, and OptionError for another `path`.
    """
    check_identities([model], {"JSON model": Path(path)})
    if Path(path).suffix.lower() != ".json":
        raise OptionError(f'"{path}" is not the name of a JSON model; expected one that ends in .json')
    assembly = assembly_of(model)
    program = build(assembly)
    write_json(assembly, Path(path), program.nominal.triangles, program.tapes)


def program_of(model: Model | Program, solver: Solver | None, method: Choice | None) -> Program:
    """Return the program of a model (see `build`). A Program already has its solver and method, and is returned unchanged."""
    check_program(model, solver, method)
    return model if isinstance(model, Program) else build(model, solver=solver or DEFAULT_SOLVER, method=method)


def check_program(model: Model | Program, solver: str | None, method: Choice | None) -> None:
    """Raise OptionError for a Program together with a solver or a method, which would have no effect."""
    if isinstance(model, Program) and not (solver is None and method is None):
        raise OptionError(
            "a Program has its solver and method; leave them out, or build it with them: tc.build(..., solver=..., method=...)"
        )


def assembly_of(model: Model) -> Assembly:
    """Return the assembly that a model declares. Raises OptionError for anything that is not a model."""
    if isinstance(model, str | Path):
        return _loaded(model)[0]
    if not isinstance(model, Assembly) and callable(model):
        model = model()
    if not isinstance(model, Assembly):
        raise OptionError(
            f"the model is a {type(model).__name__}; expected a tc.Assembly, a function that returns one, or a script's path"
        )
    return model


def _loaded(path: str | Path) -> tuple[Assembly, Method | None]:
    """Return the assembly of a script, a JSON file or an archive, and the method of the archive's run."""
    if not is_archive(path):
        return load_model(Path(path)), None
    with archive.open_archive(path) as results:
        try:
            return archive.model_of(results), archive.method_of_run(results)
        except TolcontactError as error:
            raise ArchiveError(
                f'the model in "{path}" cannot be rebuilt, so name its script instead of the archive: {error}'
            ) from error


def method_of(assembly: Assembly, method: Choice | None, default: Method | None = None) -> Method:
    """Return the method that resolves an assembly. Raises OptionError for an unknown choice.

    `default` replaces the assembly's own method.
    """
    default = default or assembly.effective_method
    if method is None or isinstance(method, Method):
        return method or default
    if not isinstance(method, Mapping):
        raise OptionError(f'method is {method!r}; expected a tc.Method, or some of its choices: {{"resolution": "exact"}}')
    names = [field.name for field in fields(Method)]
    for name in method:
        if name not in names:
            raise OptionError(f"a method has no choice {name!r}; expected some of: {', '.join(names)}")
    return default.with_choices(**method)


def check_counts(**counts: int) -> None:
    """Raise OptionError for a count that is not a whole number, or outside `COUNTS`."""
    for option, value in counts.items():
        smallest, largest = COUNTS[option]
        if isinstance(value, bool) or not isinstance(value, int) or not smallest <= value <= largest:
            raise OptionError(f"{option} is {value!r}; expected a whole number from {smallest} to {largest}")
