"""A model script with the features that the PMI of a file states, as a starting point."""

import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from tolcontact.declaration import Brep, Face, Feature, Mesh, Part, Pattern, Point
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.size import Size
from tolcontact.pmi.annotations import Tolerance
from tolcontact.pmi.declared import DeclaredFile
from tolcontact.texts import literal, shown

MAX_WIDTH = 120  # of a line that can be broken
COMMENT: dict[str, Any] = {"initial_indent": "    # ", "subsequent_indent": "    #   "}
_DIGITS = 9  # of lengths: more than a shape resolves


def script(path: Path, declared: DeclaredFile) -> str:
    """Return a model script that declares the parts of a file with their features."""
    tolerances = [entry for entry in declared.annotations if isinstance(entry.annotation, Tolerance)]
    comments = [str(entry) for entry in tolerances if entry.reason or entry.remark]
    comments = [f"- {comment}" for comment in [*comments, *declared.faults]]
    return "\n".join([
        f'""{literal(f"Parts of {path.name}, with the tolerances that it states; add locators, contact and measures.")}""',
        "",
        "import tolcontact as tc",
        "",
        "",
        "def assembly() -> tc.Assembly:",
        f"    model = tc.Assembly({literal(path.stem)})",
        *(line for part in declared.parts for line in _part_lines(part)),
        *(["    # Not declared, not wholly, or with a remark:"] if comments else []),
        *(line for comment in comments for line in textwrap.wrap(shown(comment), MAX_WIDTH, **COMMENT)),
        "    return model",
        "",
        "",
        'if __name__ == "__main__":',
        "    tc.main(assembly)",
        "",
    ])  # fmt: skip


def _part_lines(part: Part) -> Iterator[str]:
    assert isinstance(part.geometry, Mesh)
    body = "" if part.geometry.body is None else f", body={literal(part.geometry.body)}"
    place = "".join(f", {name}={vector!r}" for name in ("at", "rotation") if any(vector := getattr(part, name)))
    yield f"    part = model.part({literal(part.name)}, tc.Mesh({literal(str(part.geometry.source))}{body}){place})"
    named = {feature for pattern in part.toleranced if isinstance(pattern, Pattern) for feature in pattern.borrowed}
    named |= {feature for targets in part.targets for feature in targets.features}
    for declared in part.toleranced:
        name = f"{_identifier(declared.name)} = " if declared in named else ""
        yield from _lines(f"    {name}part.{declared.noun}(", _arguments(declared))
    for targets in part.targets:
        yield from _lines("    part.datum_targets(", [literal(targets.letter), *map(_point, targets.points)])


def _arguments(declared: Feature | Pattern) -> list[str]:
    """Return the arguments with which a feature or pattern is declared."""
    arguments = [literal(declared.name)]
    if isinstance(declared, Feature):
        arguments += map(_face, declared.faces)
    else:
        for member in declared.constituents:
            faces = [_identifier(member.name)] if isinstance(member, Feature) else [*map(_face, member)]
            arguments.append(faces[0] if len(faces) == 1 else f"({', '.join(faces)})")
    arguments += map(_source, declared.tolerances)
    return arguments + ([] if declared.datum is None else [f"datum={literal(declared.datum)}"])


def _point(point: Point) -> str:
    assert point.on is not None and point.position is not None
    return f"{_identifier(point.on.name)}.point({', '.join(f'{c:.{_DIGITS}g}' for c in point.position)})"


def _lines(beginning: str, arguments: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a call: one, or one for each of its arguments if that would be too long."""
    line = f"{beginning}{', '.join(arguments)})"
    if len(line) <= MAX_WIDTH:
        yield line
    else:
        yield from (beginning, *(f"        {argument}," for argument in arguments), "    )")


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", f"feature_{name}" if len(name) < 3 else name)


def _face(face: Face) -> str:
    (selection,) = face.selections
    assert isinstance(selection, Brep)
    return f"part.face(tc.select.Brep({', '.join(map(literal, selection.which))}))"


def _source(tolerance: Size | GeometricTolerance) -> str:
    """Return the call that makes a tolerance. Options that have their default value are left out."""
    arguments = []
    for option in (member for member in fields(tolerance) if member.name != "of"):
        value = getattr(tolerance, option.name)
        if value != option.default:
            text = f"{value:.{_DIGITS}g}" if isinstance(value, float) else literal(value)
            arguments.append(f"{option.name}={text}" if option.kw_only else text)
    name = tolerance.of.name if isinstance(tolerance, GeometricTolerance) else type(tolerance).__name__
    return f"tc.{name}({', '.join(arguments)})"
