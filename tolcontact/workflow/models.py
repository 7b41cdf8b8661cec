"""Models, the input of `run` and of analyses: from the path of a script or an archive to the compiled program.

Forecasts state the time, memory and disk space of a run or an analysis of a program before it begins.
"""

import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from tolcontact import archive
from tolcontact.archive import bytes_of_rows, size_in_words
from tolcontact.compilation import Program, compile_program
from tolcontact.declaration import Assembly
from tolcontact.declaration.script import load_model, write_json
from tolcontact.discretization import discretize
from tolcontact.errors import ArchiveError, ModelError, OptionError, TolcontactError
from tolcontact.method import Method, Solver
from tolcontact.plausibility import warn_of_nominal
from tolcontact.replacing import check_identities
from tolcontact.simulation import block_rows, simulate_blocks
from tolcontact.system.machine import machine_memory, peak_memory
from tolcontact.vocabulary import BLOCK_ROWS

DEFAULT_SOLVER: Solver = "qpoases"
COUNTS = {  # smallest and largest
    "samples": (2, 10**12), "seed": (0, 2**63 - 1), "surfaces": (0, 10**6),
}  # fmt: skip
FIRST_TRIAL_ROWS = 4
MIN_TRIAL_SECONDS = 0.25  # a shorter trial measures the start of a block
MIN_ANNOUNCED_ROWS = 1_000_000
MIN_ANNOUNCED_SECONDS = 60.0
MAX_SECONDS = 30 * 86_400.0
Model = Assembly | Callable[[], Assembly] | str | Path
Choice = Method | Mapping[str, Any]  # a method, or some of its choices; the model's own method has the others

log = logging.getLogger(__name__)


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


def is_archive(path: str | Path) -> bool:
    """Return whether a path has the extension of an archive."""
    return Path(path).suffix.lower() == ".nc"


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


def announce(program: Program, *, samples: int, seed: int, keep: str, threads: int) -> None:
    """Log a warning with the time and space that `samples` more realizations need on `threads` threads, if that is much.

    Raises OptionError if the run would take more than 30 days.
    """
    if samples < MIN_ANNOUNCED_ROWS and block_rows(program) == BLOCK_ROWS:
        return
    seconds = _checked_seconds(program, samples, seed, threads)
    if samples >= MIN_ANNOUNCED_ROWS or seconds > MIN_ANNOUNCED_SECONDS:
        nominal = program.nominal
        points = sum(len(pair.P_m) for pair in nominal.pairs)
        peak = peak_memory()
        memory = "" if peak is None else f", {size_in_words(peak)} of memory"
        log.warning(
            "%d parts, %d contact pairs, %d contact points: %d realizations will take about %s%s, and %s in an archive",
            len(nominal.parts), len(nominal.pairs), points, samples, duration(seconds), memory,
            size_in_words(bytes_of_rows(nominal, keep, samples)),
        )  # fmt: skip


def check_affordable(program: Program, *, samples: int, seed: int, threads: int, kept: int | None = None) -> None:
    """Raise OptionError if `samples` realizations, with `kept` stored numbers each, would take too much time or memory.

    By default the numbers are deviations, and measures in both states.
    """
    numbers = kept or len(program.nominal.contributors) + 2 * len(program.nominal.measures)
    needed, memory = np.dtype(float).itemsize * samples * numbers, machine_memory()
    if needed > memory:
        raise OptionError(
            f"{samples} realizations need {size_in_words(needed)} of memory, and this machine has {size_in_words(memory)}; "
            "ask for fewer samples"
        )
    if samples >= MIN_ANNOUNCED_ROWS:
        _checked_seconds(program, samples, seed, threads)


def _checked_seconds(program: Program, samples: int, seed: int, threads: int) -> float:
    """Return the time [s] that `samples` realizations need on `threads` threads. Raises OptionError above 30 days."""
    # Trials grow up to a block. Loading takes longer than a block.
    trial, seconds = FIRST_TRIAL_ROWS, 0.0
    list(simulate_blocks(program, samples=trial, seed=seed, threads=1))
    while True:
        started = time.perf_counter()
        list(simulate_blocks(program, samples=trial, seed=seed, threads=1))
        seconds = time.perf_counter() - started
        if seconds > MIN_TRIAL_SECONDS or trial >= block_rows(program):
            break
        trial *= 8
    seconds = seconds / trial / threads
    if seconds * samples > MAX_SECONDS:
        raise OptionError(
            f"{samples} realizations would take about {duration(seconds * samples)}; ask for at most "
            f"{int(MAX_SECONDS / seconds)}, which take {duration(MAX_SECONDS)}"
        )
    return seconds * samples


def duration(seconds: float) -> str:
    """Return a time in words."""
    for size, unit in ((86_400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
