"""Model scripts: a Python file with a function `assembly()` that returns the declared Assembly."""

import importlib.util
import sys
import traceback
from pathlib import Path

from tolcontact.assembly import Assembly
from tolcontact.errors import ScriptError, TolcontactError


def load_model(path: Path) -> Assembly:
    """The assembly that a script declares.

    Raises ScriptError where the file is missing, fails, or has no function `assembly()` that returns an Assembly.
    """
    if not path.is_file():
        raise ScriptError(f'model script "{path}" does not exist')
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ScriptError(f'model script "{path}" is not a Python file; expected a name that ends in .py')
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, str(path.parent.resolve()))  # as when Python runs a script: its neighbours can be imported
    try:
        spec.loader.exec_module(module)
        declare = getattr(module, "assembly", None)
        if not callable(declare):
            raise ScriptError(
                f'model script "{path}" has no function assembly(); define one that returns a tolcontact.Assembly'
            )
        declared = declare()
    except TolcontactError:
        raise
    except SystemExit as ended:
        raise ScriptError(f'model script "{path}" ended the program with sys.exit({ended.code!r})') from ended
    except Exception as error:  # a user's script may raise anything
        raise ScriptError(f'model script "{path}" failed{_line_of(error, path)}: {type(error).__name__}: {error}') from error
    finally:
        sys.path.pop(0)
    if not isinstance(declared, Assembly):
        raise ScriptError(f'assembly() of "{path}" returned a {type(declared).__name__}; expected a tolcontact.Assembly')
    return declared


def _line_of(error: Exception, path: Path) -> str:
    if isinstance(error, SyntaxError):
        return f" in line {error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return f" in line {lines[-1]}" if lines else ""
