"""Mistakes that people make in their first models: `tolcontact check` answers each with one message that says what to write."""

import pytest

from tests.helpers import ROOT, call

FILE = str(ROOT / "studies" / "cad" / "as1-oc-214.stp")
MODEL = """import numpy as np
import tolcontact as tc


def assembly():
    model = tc.Assembly("model")
    block = model.part("block", tc.Box(50, 40, 10){part})
    {line}
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")){locate})
    model.measure("height", block.point(1, 2, 10), along="z"{measure})
    return model
"""
WIDTH = 'block.feature("width", block.face("+x"), block.face("-x"), {})'
TURN = "expected three finite numbers, as in rotation=tc.degrees(0, 0, 90)"
EITHER = '"±0.1", "+0.1/-0.05" or (-0.05, 0.1)'

MISTAKES = {
    "rotation=90": ({"part": ", rotation=90"}, TURN),
    "rotation='90 deg'": ({"part": ', rotation="90 deg"'}, TURN),
    "rotation of one angle": ({"part": ", rotation=tc.degrees(90)"}, TURN),
    "rotation of two angles": ({"part": ", rotation=tc.degrees(0, 90)"}, TURN),
    "a matrix": ({"part": ", rotation=np.eye(3)"}, TURN),
    "degrees of a tuple": ({"part": ", rotation=tc.degrees((0, 0, 90))"},
        "expected finite numbers, as in tc.degrees(0, 0, 90)"),
    "degrees of a text": ({"part": ', rotation=tc.degrees("90")'}, "degrees of '90'; expected finite numbers"),
    "at=5": ({"part": ", at=5"}, "at is 5; expected three finite numbers, as in at=(0, 0, 10)"),
    "fixed='yes'": ({"part": ', fixed="yes"'}, "fixed is a str; expected True, False or None"),
    "fixed later": ({"line": "block.fixed = True"}, "declarations do not change; state it in the call that declares it"),
    "no file": ({"line": 'tc.io.parts_from(model, "none.stp")'}, "does not exist; give the path"),
    "no STEP file": ({"line": "tc.io.parts_from(model, __file__)"}, "unknown kind of file; expected one of .stl"),
    "file and model exchanged": ({"line": f"tc.io.parts_from({FILE!r}, model)"},
        "expected an assembly, as in tc.io.parts_from(model,"),
    "another name": ({"line": f'tc.io.parts_from(model, {FILE!r})["nut"]'},
        'no part "nut" is declared of the file; its parts are: "nut_1"'),
    "a near name": ({"line": f'tc.io.parts_from(model, {FILE!r})["rod"]'}, '...; the nearest name is "rod_1"'),
    "a near fixed name": ({"line": f'tc.io.parts_from(model, {FILE!r}, fixed=["plate"])'},
        '...; the nearest name is "plate_1"'),
    "a near body": ({"line": f'model.part("p", tc.Mesh({FILE!r}, body="plate"), fixed=True)'},
        '; the nearest name is "plate_1"'),
    "fixed text": ({"line": f'tc.io.parts_from(model, {FILE!r}, fixed="rod_1")'}, 'as in fixed=["rod_1"]'),
    "fixed name": ({"line": f'tc.io.parts_from(model, {FILE!r}, fixed=["rod"])'}, 'holds no body "rod"; it holds "nut_1"'),
    "names as a text": ({"line": f'tc.io.parts_from(model, {FILE!r}, "rod_1")'}, 'as in names=["rod_1"]'),
    "the file twice": ({"line": f'[tc.io.parts_from(model, {FILE!r}, ["rod_1"], fixed=True) for _ in "ab"]'},
        '"rod_1" is declared 2 times'),
    "a hole's class": ({"line": WIDTH.format('tc.Size(50, "H7")')}, 'is H7, and it is no hole; write "h7"'),
    "a fit": ({"line": WIDTH.format('tc.Size(50, "H7/g6")')}, 'give "H7" to the hole, and "g6" to the shaft'),
    "a grade": ({"line": WIDTH.format('tc.Size(50, "IT7")')}, 'as in "H7" for a hole and "h7" for a shaft'),
    "limits of a size": ({"line": WIDTH.format('tc.Size(50, "49.9/50.1")')}, "a limit has no sign"),
    "a text for a size": ({"line": WIDTH.format('"±0.1"')}, "str is neither a face nor a tolerance; expected"),
    "a signed width": ({"line": 'block.feature("top", block.face("+z"), tc.Profile("±0.1"))'},
        "expected the full width of the zone"),
    "one limit": ({"locate": ', tolerance="+0.1"'}, 'write "+0.1/0" if the other one is 0, "±0.1" for both sides'),
    "from to": ({"locate": ', tolerance="0.1-0.2"'}, "a limit has no sign"),
    "class of a locator": ({"locate": ', tolerance="H7"'}, 'for sizes, as in tc.Size(10, "H7")'),
    "one for each locator": ({"locate": ", tolerance=[0.1] * 6"},
        "expected two numbers, the lower and the upper limit deviation"),
    "upper before lower": ({"locate": ", tolerance=(0.1, -0.05)"}, "swap them"),
    "another unit": ({"locate": ', tolerance="±50 kg"'}, "its unit is kg; expected mm"),
    "a general tolerance": ({"locate": ', tolerance="ISO 2768-m"'}, EITHER),
    "no tolerance": ({"locate": ""}, "has no tolerance; give one to the locate call"),
    "distribution first": ({"locate": ', tolerance=tc.Tolerance("uniform", 0.1)'}, "expected one of normal, uniform"),
    "limits as a tolerance": ({"measure": ', limits="±0.1"'}, "as in tolerance='±0.1'"),
    "limits as a number": ({"measure": ", limits=0.1"}, "expected (lower, upper)"),
    "both": ({"measure": ', tolerance="±0.1", limits=(0, 1)'}, "it has both a tolerance and limits; give one of them"),
    "class of a measure": ({"measure": ', tolerance="H7"'}, EITHER),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_has_one_message_that_says_what_to_write(mistake, tmp_path):
    changes, advice = MISTAKES[mistake]
    model = tmp_path / "model.py"
    model.write_text(MODEL.format(**({"part": "", "line": "pass", "locate": ", tolerance=0.1", "measure": ""} | changes)))
    checked = call(tmp_path, "check", model)
    assert checked.returncode == 2
    assert advice in checked.stderr
    assert "Traceback" not in checked.stderr
    assert len(checked.stderr.splitlines()) <= 2
    assert any(place in checked.stderr for place in (" in line ", "(model.py:", "names must differ"))


def test_the_model_without_a_mistake_has_no_fault(tmp_path):
    model = tmp_path / "model.py"
    tolerances = {"locate": ', tolerance="+0.1/-0.05"', "measure": ', tolerance="±0.1"'}
    model.write_text(MODEL.format(part="", line="pass", **tolerances))
    checked = call(tmp_path, "check", model)
    assert (checked.returncode, checked.stderr) == (0, "")
