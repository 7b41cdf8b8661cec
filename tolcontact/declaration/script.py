"""Loading of models: a Python script with a function `assembly()` that returns the declared Assembly, or a JSON file."""

import contextlib
import functools
import importlib.util
import inspect
import re
import sys
import traceback
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

from tolcontact.declaration import Assembly
from tolcontact.declaration.json_model import read_json
from tolcontact.errors import ScriptError, TolcontactError, nearest_name

_PACKAGE = Path(__file__).resolve().parent


def load_model(path: Path) -> Assembly:
    """Return the assembly that a script or a JSON file declares.

    Raises ScriptError if the file is missing, fails, or has no function `assembly()` that returns an Assembly.
    """
    if not path.is_file():
        raise ScriptError(f'model script "{path}" does not exist')
    if path.suffix.lower() == ".json":
        return read_json(path)
    # The module's name has a space: a model random.py must not shadow the module `random`.
    spec = importlib.util.spec_from_file_location(f"model {path.stem}", path.absolute())
    if spec is None or spec.loader is None:
        raise ScriptError(f'model script "{path}" is not a Python file; expected a name that ends in .py')
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
        declared = declare()
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
    in_modules = [f"{file.name}:{line}" for file, line in lines if file != path.absolute() and _is_neighbour(file, path)]
    return (f" in line {in_script[-1]}" if in_script else "") + (f" ({in_modules[-1]})" if in_modules else "")


def _is_neighbour(file: Path, path: Path) -> bool:
    """Return True for a module in the folder of the script that belongs to no installed package."""
    return (
        file.is_relative_to(path.parent.resolve()) and not file.is_relative_to(_PACKAGE) and "site-packages" not in file.parts
    )


UNEXPECTED = re.compile(r"([\w.]+)\(\) got an unexpected keyword argument '(\w+)'")  # a TypeError of Python
PACKAGES = ("tolcontact.declaration", "tolcontact.geometry", "tolcontact.fasteners")  # whose functions scripts call


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
