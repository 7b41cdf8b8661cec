"""A model script with the features that the PMI of a file states, to go on from."""

import json
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from tolcontact.declaration import Brep, Feature, Mesh, Part
from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.errors import shown
from tolcontact.pmi.annotations import Tolerance
from tolcontact.pmi.declared_file import DeclaredFile

MAX_WIDTH = 120  # of a line that can be broken
_DIGITS = 9  # of lengths: more than a shape resolves


def script(path: Path, declared: DeclaredFile) -> str:
    """Return a model script that declares the parts of a file with their features."""
    rest = [
        f"    # - {shown(str(one))}" for one in declared.annotations if one.reason and isinstance(one.annotation, Tolerance)
    ]
    return "\n".join([
        f'"""The parts of {shown(path.name)}, with the tolerances that it states; add locators, contact and measures."""',
        "",
        "import tolcontact as tc",
        "",
        "",
        "def assembly() -> tc.Assembly:",
        f"    model = tc.Assembly({_text(path.stem)})",
        *(line for part in declared.parts for line in _part_lines(part)),
        *(["    # Tolerances that are not declared, or not wholly:", *rest] if rest else []),
        "    return model",
        "",
        "",
        'if __name__ == "__main__":',
        "    tc.main(assembly)",
        "",
    ])  # fmt: skip


def _part_lines(part: Part) -> Iterator[str]:
    assert isinstance(part.geometry, Mesh)
    body = "" if part.geometry.body is None else f", body={_text(part.geometry.body)}"
    place = "".join(f", {name}={vector!r}" for name in ("at", "rotation") if any(vector := getattr(part, name)))
    yield f"    part = model.part({_text(part.name)}, tc.Mesh({_text(str(part.geometry.source))}{body}){place})"
    for feature in part.features:
        yield from _feature_lines(feature)


def _feature_lines(feature: Feature) -> Iterator[str]:
    """Yield the lines that declare a feature: one, or one for each of its arguments if that would be too long."""
    arguments = [_text(feature.name), *(f"part.face({_brep(face.selections[0])})" for face in feature.faces)]
    arguments += [_source(tolerance) for tolerance in feature.tolerances]
    arguments += [] if feature.datum is None else [f"datum={_text(feature.datum)}"]
    line = f"    part.feature({', '.join(arguments)})"
    if len(line) <= MAX_WIDTH:
        yield line
    else:
        yield from ("    part.feature(", *(f"        {argument}," for argument in arguments), "    )")


def _brep(selection: Any) -> str:
    assert isinstance(selection, Brep)
    return f"tc.Brep({', '.join(map(_text, selection.which))})"


def _source(tolerance: Size | GeometricTolerance) -> str:
    """Return the call that makes a tolerance. Options that have their default value are left out."""
    arguments = []
    for option in fields(tolerance):
        value = getattr(tolerance, option.name)
        if value != option.default:
            text = f"{value:.{_DIGITS}g}" if isinstance(value, float) else _text(value)
            arguments.append(f"{option.name}={text}" if option.kw_only else text)
    return f"tc.{type(tolerance).__name__}({', '.join(arguments)})"


def _text(value: Any) -> str:
    """Return a text or a number as Python reads it, texts in double quotes."""
    return json.dumps(value, ensure_ascii=False)
