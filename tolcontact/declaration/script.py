"""Models in files: Python scripts with a function `assembly()` that returns the declared Assembly, and JSON."""

import contextlib
import functools
import importlib.util
import inspect
import json
import re
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import FrozenInstanceError
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tolcontact.declaration import Assembly
from tolcontact.declaration.codec import EntryError, Sources
from tolcontact.declaration.document import assembly_of, json_schema, to_document
from tolcontact.declaration.geometry import Mesh
from tolcontact.declaration.measure import Tape
from tolcontact.declaration.part import Face
from tolcontact.errors import ScriptError, TolcontactError, nearest_name
from tolcontact.input_files import fault_of, is_archive
from tolcontact.replacing import replacing
from tolcontact.texts import clipped

UNEXPECTED = re.compile(r"([\w.]+)\(\) got an unexpected keyword argument '(\w+)'")  # a TypeError of Python
PACKAGES = ("tolcontact.declaration", "tolcontact.geometry", "tolcontact.fasteners")  # whose functions scripts call
MAX_BYTES = 1 << 26  # of a file
NO_ARGUMENTS: Mapping[str, Any] = MappingProxyType({})
SCHEMA_NAME = "model.schema.json"
_PACKAGE = Path(__file__).resolve().parent


def read_json(path: Path) -> Assembly:
    """Return the assembly that a JSON file declares; files of shapes are named from its folder.

    Defaults may be left out, as in a script. Raises ScriptError, which states the place in the file, for a file of another
    structure.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_unique)
    except (OSError, ValueError, RecursionError) as error:
        raise ScriptError(f'model "{path}" cannot be read as JSON: {error}') from error
    try:
        return assembly_of(document, Sources({}, path.parent, path.name))
    except EntryError as error:
        raise ScriptError(f'model "{path}": {error}') from error


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the named values of an object. Raises ValueError for a name that it has twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        name, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f'"{clipped(name, 40)}" stands twice among the same named values; expected it once')
    return values


def write_json(assembly: Assembly, path: Path, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape]) -> None:
    """Write the declarations of an assembly as JSON; `triangles` returns the triangles of a face that a function picks.

    Raises ScriptError for a shape that is not in a file, or if the file cannot be written.
    """
    for part in assembly.parts:
        if isinstance(part.geometry, Mesh) and not isinstance(part.geometry.source, str | Path):
            raise ScriptError(f'part "{part.name}": its mesh is no file, so JSON cannot name it; save it as STL first')
    document = to_document(assembly, triangles, tapes, path.resolve().parent)
    text = json.dumps({"$schema": SCHEMA_NAME, **document}, indent=1, ensure_ascii=False)
    try:
        with replacing(path) as new:
            new.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise ScriptError(f'"{path}" cannot be written: {error.strerror}') from error


def parameter_fault(declare: Callable[..., Any], arguments: Mapping[str, Any]) -> str:
    """Return why a function does not take these arguments, with its parameters; empty if it does, or there are none."""
    signature = inspect.signature(declare)
    try:
        signature.bind(**arguments)
    except TypeError as error:
        name = getattr(declare, "__name__", "the function")
        return f"{name}({', '.join(signature.parameters)}) {error}" if arguments else ""
    return ""


def load_model(path: Path, arguments: Mapping[str, Any] = NO_ARGUMENTS) -> Assembly:
    """Return the assembly that a script or a JSON file declares; the script's function `assembly` takes the `arguments`.

    Raises ScriptError if the file is missing, fails, or has no function `assembly()` that returns an Assembly.
    """
    if fault := fault_of(path, MAX_BYTES):
        raise ScriptError(f'model script "{path}" {fault}')
    if path.suffix.lower() == ".json":
        return read_json(path)
    # The module's name has a space: a model random.py must not shadow the module `random`.
    spec = importlib.util.spec_from_file_location(f"model {path.stem}", path.absolute())
    if spec is None or spec.loader is None:
        remedy = "; tolcontact summary and report show an archive" if is_archive(path) else ""
        raise ScriptError(f'"{path}" is not the name of a model; expected one that ends in .py or .json{remedy}')
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    folder = str(path.parent.resolve())
    sys.path.insert(0, folder)  # as when Python runs a script: its neighbours can be imported
    try:
        spec.loader.exec_module(module)
        declare = getattr(module, "assembly", None)
        if not callable(declare):
            raise ScriptError(
                f'model script "{path}" has no function assembly(); define one that returns a tolcontact.Assembly'
            )
        if fault := parameter_fault(declare, arguments):
            raise ScriptError(f'model script "{path}": {fault}')
        declared = declare(**arguments)
    except ScriptError:
        raise
    except SystemExit as ended:
        raise ScriptError(f'model script "{path}" ended the program with sys.exit({ended.code!r})') from ended
    except TolcontactError as error:
        raise ScriptError(f'model script "{path}" failed{_where(error, path)}: {error}') from error
    except Exception as error:  # a user's script may raise anything
        reason = error.msg if isinstance(error, SyntaxError) else error
        if isinstance(error, FrozenInstanceError):
            reason = f"{error}, since declarations do not change; state it in the call that declares it"
        text = unknown_argument(error) or f"{type(error).__name__}: {reason}"
        raise ScriptError(f'model script "{path}" failed{_where(error, path)}: {text}') from error
    finally:
        with contextlib.suppress(ValueError):  # a script may do anything to it
            sys.path.remove(folder)
    if not isinstance(declared, Assembly):
        raise ScriptError(f'assembly() of "{path}" returned a {type(declared).__name__}; expected a tolcontact.Assembly')
    return declared


def _where(error: Exception, path: Path) -> str:
    """Return the lines of an error in the script, and in a module from its folder."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [(Path(f.filename).absolute(), f.lineno) for f in frames if Path(f.filename).is_file()]
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        lines.append((Path(error.filename).absolute(), error.lineno))
    in_script = [line for file, line in lines if file == path.absolute()]
    in_modules = [
        f"{file.name}:{line}"
        for file, line in lines
        if file != path.absolute()
        and file.is_relative_to(path.parent.resolve())
        and not file.is_relative_to(_PACKAGE)
        and "site-packages" not in file.parts
    ]
    return (f" in line {in_script[-1]}" if in_script else "") + (f" ({in_modules[-1]})" if in_modules else "")


def unknown_argument(error: Exception) -> str:
    """Return a message on the argument that a call of this package does not have; empty if an error is none of a call.

    Python's error states the name of the function alone, such as `Declarations.locate`.
    """
    if not isinstance(error, TypeError) or not (match := UNEXPECTED.match(str(error))):
        return ""
    path, argument = match[1].split("."), match[2]
    modules = [module for name, module in sorted(sys.modules.items()) if name.startswith(PACKAGES)]
    functions = [function for module in modules if inspect.isfunction(function := _resolved(module, path))]
    if not functions:
        return ""
    names = [name for name in inspect.signature(functions[0]).parameters if name != "self"]
    call = next(name for name in reversed(path) if name != "__init__")
    return f'{call}() has no argument "{argument}"{nearest_name(argument, names)}; expected some of: {", ".join(names)}'


def _resolved(module: Any, path: list[str]) -> Any:
    """Return what a path of names leads to in a module; None if there is none."""
    return functools.reduce(lambda owner, name: getattr(owner, name, None), path, module)


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1))
