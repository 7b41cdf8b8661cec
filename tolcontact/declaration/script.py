"""Model scripts: a Python file with a function `assembly()` that returns the declared Assembly; or a model as JSON."""

import contextlib
import importlib.util
import sys
import traceback
from pathlib import Path

from tolcontact.declaration import Assembly
from tolcontact.declaration.json_model import read_json
from tolcontact.errors import ScriptError, TolcontactError

_PACKAGE = Path(__file__).resolve().parent


def load_model(path: Path) -> Assembly:
    """The assembly that a script declares, or a JSON file.

    Raises ScriptError if the file is missing, fails, or has no function `assembly()` that returns an Assembly.
    """
    if not path.is_file():
        raise ScriptError(f'model script "{path}" does not exist')
    if path.suffix.lower() == ".json":
        return read_json(path)
    # A name of its own: a model called random.py must not be what others then import as `random`.
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
        said = error.msg if isinstance(error, SyntaxError) else error
        raise ScriptError(f'model script "{path}" failed{_where(error, path)}: {type(error).__name__}: {said}') from error
    finally:
        with contextlib.suppress(ValueError):  # a script may do anything to it
            sys.path.remove(folder)
    if not isinstance(declared, Assembly):
        raise ScriptError(f'assembly() of "{path}" returned a {type(declared).__name__}; expected a tolcontact.Assembly')
    return declared


def _where(error: Exception, path: Path) -> str:
    """The line of the script, and of the module from its folder, in which an error arose."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [(Path(f.filename).absolute(), f.lineno) for f in frames if Path(f.filename).is_file()]
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        lines.append((Path(error.filename).absolute(), error.lineno))
    in_script = [line for file, line in lines if file == path.absolute()]
    beside = [f"{file.name}:{line}" for file, line in lines if file != path.absolute() and _is_beside(file, path)]
    return (f" in line {in_script[-1]}" if in_script else "") + (f" ({beside[-1]})" if beside else "")


def _is_beside(file: Path, path: Path) -> bool:
    """Whether a file is a module of the script's own, not this package or another one that is installed below its folder."""
    return (
        file.is_relative_to(path.parent.resolve()) and not file.is_relative_to(_PACKAGE) and "site-packages" not in file.parts
    )
