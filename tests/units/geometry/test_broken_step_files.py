"""STEP files that are broken in twenty ways: each is read, or ends in one message that names it; nothing crashes or hangs."""

import re

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import nightly
from tolcontact.errors import GeometryFault, OptionError
from tolcontact.geometry.files import ReadingLimits, read_files

pytestmark = pytest.mark.slow
WHOLE = (cases.MODELS / "cover.step").read_text()
LINES = WHOLE.splitlines(keepends=True)
HALF = len(WHOLE) // 2


def without(entity):
    return "".join(line for line in LINES if entity not in line)


def swapped(pattern, new, count=0):
    changed, times = re.subn(pattern, new, WHOLE, count=count)
    assert times, pattern
    return changed


BROKEN = {
    "cut off in the middle": WHOLE[:HALF],
    "cut off in the header": WHOLE[:100],
    "without its end": WHOLE.replace("END-ISO-10303-21;", ""),
    "without its data": WHOLE[: WHOLE.index("DATA;")],
    "without points": without("CARTESIAN_POINT"),
    "without directions": without("DIRECTION("),
    "without planes": without("PLANE("),
    "without faces": without("ADVANCED_FACE"),
    "without its shell": without("CLOSED_SHELL"),
    "without its solid": without("MANIFOLD_SOLID_BREP"),
    "without edges": without("EDGE_CURVE"),
    "without units": without("LENGTH_UNIT"),
    "points far off": swapped(r"CARTESIAN_POINT\('',\(0\.,0\.,", "CARTESIAN_POINT('',(1.E300,0.,", 5),
    "points that are no numbers": swapped(r"CARTESIAN_POINT\('',\(0\.,", "CARTESIAN_POINT('',(NaN,", 5),
    "radii below 0": swapped(r"(CYLINDRICAL_SURFACE\('',#\d+,)", r"\1-"),
    "radii of nothing": swapped(r"(CYLINDRICAL_SURFACE\('',#\d+,)[^)]*", r"\g<1>0."),
    "references to nothing": swapped(r"#1\d\b", "#99999"),
    "references to themselves": swapped(r"(#(\d+)\s*=\s*EDGE_LOOP\('',\(#)\d+", r"\1\2"),
    "zeros within": WHOLE[:HALF] + "\0" * 1000 + WHOLE[HALF + 1000 :],
    "a line twice": "".join(LINES[:100] + LINES[50:]),
}
NAMED = ("cut off in the middle", "without its data", "without points", "without faces", "without units", "a line twice")


@pytest.mark.parametrize("kinds", [NAMED, *nightly([*BROKEN])], ids=len)
def test_broken_files_end_in_a_message_each_or_are_read(kinds, tmp_path):
    limits = ReadingLimits(seconds=8.0)  # in which the whole one is read ten times over
    paths = {}
    for number, (kind, text) in enumerate((kind, BROKEN[kind]) for kind in kinds):
        paths[kind] = tmp_path / f"{number}.step"
        paths[kind].write_text(text)
    found = {path: content for (path, _), content in read_files([tc.Mesh(path) for path in paths.values()], limits).items()}
    messages = {kind: str(found[path]) for kind, path in paths.items() if isinstance(found[path], GeometryFault)}
    for kind, message in messages.items():
        assert paths[kind].name in message and "\n" not in message and len(message) < 600, (kind, message)
    assert {"cut off in the middle", "without its data", "without points", "without faces"} <= set(messages)
    assert len(BROKEN) == 20
    for kind, path in paths.items():
        if kind not in messages:
            assert tc.io.bodies_in(path), kind


def test_a_byte_order_mark_is_named(tmp_path):
    path = tmp_path / "cover.step"
    path.write_text("\ufeff" + WHOLE, encoding="utf-8")
    with pytest.raises(OptionError, match=r'cover\.step" begins with a byte order mark.*save it as UTF-8 without'):
        tc.io.bodies_in(path)
