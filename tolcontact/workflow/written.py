"""Models written as JSON."""

from pathlib import Path

from tolcontact.compilation import compile_program
from tolcontact.declaration.json_model import write_json
from tolcontact.discretization import discretize
from tolcontact.workflow.run import DEFAULT_SOLVER, Model, chosen, declared


def write_model(model: Model, path: str | Path) -> None:
    """Write a model as JSON to `path`: its declarations (see tolcontact.declaration).

    Shapes are named as files, from the folder of `path` if they are in it. Faces that a function picks become triangles, and
    functions of poses the steps of their expressions.
    Raises ModelError for a model with faults, ScriptError for a mesh that is no file.
    """
    assembly = declared(model)
    program = compile_program(discretize(assembly), DEFAULT_SOLVER, chosen(assembly, None))
    write_json(assembly, Path(path), program.nominal.triangles, program.tapes)
