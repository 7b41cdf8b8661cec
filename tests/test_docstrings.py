"""An editor shows what an argument means: docstrings name every argument, and have an example."""

import inspect
import re
import types

import tolcontact as tc

MODULES = {
    "tc": tc, "tc.analyses": tc.analyses, "tc.io": tc.io, "tc.plot": tc.plot, "tc.select": tc.select, "tc.testing": tc.testing,
}  # fmt: skip
DECLARING = {  # the methods of a script
    tc.Assembly: "part locate contact force measure station variable correlate population may_overlap",
    tc.Part: "feature pattern datum_targets point face",
    tc.declaration.Feature: "point axis",
    tc.declaration.Station: "join",
    tc.Stack: "link gap read",
    tc.Method: "paper",
}
MADE = {tc.DatumTargets, tc.Part, tc.Program, tc.Status, tc.Variable}  # by functions and methods, not by scripts


def functions():
    for prefix, module in MODULES.items():
        for name in module.__all__:
            value = getattr(module, name)
            is_made = inspect.isclass(value) and (value in MADE or issubclass(value, Exception))
            if isinstance(value, types.FunctionType) or (inspect.isclass(value) and not is_made):
                yield f"{prefix}.{name}", value
    for owner, names in DECLARING.items():
        for name in names.split():
            yield f"tc.{owner.__name__}.{name}", getattr(owner, name)


def test_docstrings_name_every_argument_and_have_an_example():
    for name, function in functions():
        text = inspect.getdoc(function)
        arguments = [argument for argument in inspect.signature(function).parameters if argument != "self"]
        assert not [argument for argument in arguments if not re.search(rf"\b{argument}\b", text)], name
        assert re.search(r"`[^`]*\b\w+\([^`]*\)[^`]*`|>>> ", text), f"{name} has no example, such as `model.part(...)`"
