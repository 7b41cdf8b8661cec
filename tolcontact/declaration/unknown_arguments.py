"""Arguments that a declaring call does not have, as a message about them says it."""

import functools
import inspect
import re
import sys
from typing import Any

from tolcontact.errors import nearest_name

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
