"""Loading of models: a Python script with a function `assembly()` that returns the declared Assembly, or a JSON file."""

import contextlib
import importlib.util
import sys
import traceback
from dataclasses import FrozenInstanceError
from pathlib import Path

from tolcontact.declaration import Assembly
from tolcontact.declaration.json_model import read_json
from tolcontact.declaration.unknown_arguments import unknown_argument
from tolcontact.errors import ScriptError, TolcontactError

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
