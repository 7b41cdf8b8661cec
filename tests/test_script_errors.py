"""An error that a model script raises is told with the script's line, whatever raised it and however the script is named."""

import contextlib
import importlib
import os

import pytest

from tests.helpers import assembly_of
from tolcontact.errors import ScriptError

BODY = """import tolcontact as tc

def assembly():
    a = tc.Assembly("A")
    part = a.part("block", tc.Box(1, 1, 1))
    {line}
    return a
"""
LINES = {
    "plain error": ("1 / 0", "ZeroDivisionError"),
    "wrong option": ('tc.Method(resolution="precise")', "resolution"),
    "model that is built too early": ("tc.build(a)", "measures nothing"),
    "wrong kind of argument": ('a.part("other", 5)', "expected tc.Box"),
    "face that cannot be chosen": ("part.face(5)", "cannot be chosen by 5"),
    "argument that a call does not have": (
        "a.locate(part, [], tolerence=1)",
        'locate() has no argument "tolerence"; the nearest name is "tolerance"; expected some of: part, scheme, tolerance, on,',
    ),
    "argument that a class does not have": (
        'tc.Locator("A1", (0, 0, 0), "z", stifness=1)',
        'Locator() has no argument "stifness"; the nearest name is "stiffness"',
    ),
    "argument that a method of resolution does not have": (
        'tc.Method(objectiv="all points")',
        'Method() has no argument "objectiv"; the nearest name is "objective"; expected some of: resolution, objective,',
    ),
    "argument that a function of the script does not have": ("(lambda x: x)(y=1)", "TypeError: "),
    "archive that is missing": ('tc.open_archive("nowhere.nc")', "does not exist"),
}


@pytest.mark.parametrize("way", ["absolute", "relative", "upward", "link to the file", "link to the folder"])
@pytest.mark.parametrize("mistake", LINES)
def test_the_line_is_told(mistake, way, tmp_path):
    line, expected = LINES[mistake]
    folder = tmp_path / "models"
    folder.mkdir()
    path = folder / "model.py"
    path.write_text(BODY.format(line=line))
    if way == "link to the file":
        (tmp_path / "other.py").symlink_to(path)
        path = tmp_path / "other.py"
    if way == "link to the folder":
        (tmp_path / "link").symlink_to(folder)
        path = tmp_path / "link" / "model.py"
    with contextlib.chdir(folder):
        if way in ("relative", "upward"):
            path = path.relative_to(folder) if way == "relative" else folder.relative_to(tmp_path).parent / "../models/model.py"
        with pytest.raises(ScriptError) as raised:
            assembly_of(path)
    assert f'model script "{path}" failed in line 6: ' in str(raised.value) and expected in str(raised.value)
    assert raised.value.__cause__ is not None


@pytest.mark.parametrize(
    ("text", "where"),
    [("x = 1\ny = 1 / 0\n", "sizes.py:2"), ("x = 1\n\ndef (:\n", "sizes.py:3"), ("import nowhere_to_be_found\n", "sizes.py:1")],
)
def test_a_module_beside_the_script_is_told_with_its_line(text, where, tmp_path):
    (tmp_path / "sizes.py").write_text(text)
    (tmp_path / "model.py").write_text("import tolcontact as tc\n\nimport sizes\n")
    (tmp_path / "link").symlink_to(tmp_path)
    for path in (tmp_path / "model.py", tmp_path / "link" / "model.py"):
        with pytest.raises(ScriptError) as raised:
            assembly_of(path)
        assert f" failed in line 3 ({where}): " in str(raised.value)


def test_a_function_of_a_module_beside_the_script(tmp_path):
    (tmp_path / "methods.py").write_text('import tolcontact as tc\n\ndef fine():\n    return tc.Method(objective="least")\n')
    (tmp_path / "model.py").write_text("from methods import fine\n\n\ndef assembly():\n    return fine()\n")
    with pytest.raises(ScriptError, match=r"failed in line 5 \(methods.py:4\): objective is 'least'"):
        assembly_of(tmp_path / "model.py")


@pytest.mark.parametrize("text", ["def assembly(:\n", "\n\n\tx = (\n", "x = '\udce9'\n"])
def test_what_is_no_python_is_told_with_its_line(text, tmp_path):
    path = tmp_path / "model.py"
    path.write_bytes(os.fsencode(text))
    with pytest.raises(ScriptError, match=r"failed( in line \d)?: (SyntaxError|IndentationError|TabError)"):
        assembly_of(path)


def test_a_script_may_change_where_python_looks(tmp_path):
    path = tmp_path / "model.py"
    path.write_text("import sys\nsys.path.pop(0)\nimport tolcontact as tc\n\n\ndef assembly():\n    return tc.Assembly('A')\n")
    assert assembly_of(path).name == "A"


LIKE_A_LIBRARY = """from __future__ import annotations

import dataclasses

import tolcontact as tc
from tests.helpers import assembly_of

@dataclasses.dataclass
class Size:
    x: float = 1.0

def assembly():
    return tc.Assembly(f"sized {Size().x}")
"""


def test_a_script_may_be_called_like_a_library(tmp_path):
    """And is not mistaken for it afterwards."""
    path = tmp_path / "colorsys.py"
    path.write_text(LIKE_A_LIBRARY)
    assert assembly_of(path).name == "sized 1.0"
    assert importlib.import_module("colorsys").rgb_to_hsv(0, 0, 0) == (0, 0, 0)
