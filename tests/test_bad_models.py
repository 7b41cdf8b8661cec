"""Each mistake in a model gets one message that names the thing at fault, and exit code 2."""

import pytest
import trimesh

from tests import cases
from tests.helpers import call
from tests.model_scripts import GOOD, write_model

COLLINEAR = (
    "    points = [(5, 5, 0), (25, 5, 0), (45, 5, 0), (5, 0, 5), (45, 0, 5), (0, 10, 5)]\n"
    "    a.locate(top, [tc.Locator(f'L{k}', p, n, 1) for k, (p, n) in enumerate(zip(points, 'zzzyyx'))])\n"
)

MISTAKES = {
    "locators that do not fix the part": ({"top": COLLINEAR}, ['part "top"', "do not fix it", "condition number"]),
    "five locators": ({"top": COLLINEAR.replace(", (0, 10, 5)", "")}, ['part "top"', "5 locators", "six independent"]),
    "negative tolerance": ({"top": GOOD["top"].replace("10", "-10")}, ['part "top"', "-10", "0 or above"]),
    "a truth value as a coordinate": (
        {"measure": "    a.measure('height', top.point(0, True, 0), along='z')\n"},
        ['measurement "height"', "finite numbers"],
    ),
    "tolerance NaN": ({"top": GOOD["top"].replace("10", "math.nan")}, ['part "top"', "nan"]),
    "surfaces apart": (
        {"contact": GOOD["contact"].replace("'-z'", "'+z'").replace("points", "within=1.5, points")},
        ['contact pair "interface"', "1.5 mm", "10 mm away"],
    ),
    "surfaces that point the same way": (
        {"contact": GOOD["contact"].replace("'-z'", "'+z'").replace("points", "within=15, points")},
        ['contact pair "interface"', "point the same way"],
    ),
    "unknown face": ({"contact": GOOD["contact"].replace("'+z'", "'up'")}, ['"up"', 'part "base"', "+x, -x"]),
    "measure on an unknown part": (
        {"measure": "    a.measure('height', tc.Assembly('B').part('lid', tc.Box(1, 1, 1)).point(0, 0, 0), along='z')\n"},
        ['measurement "height"', 'unknown part "lid"', "base, top"],
    ),
    "part that is located on itself": (
        {"top": GOOD["top"].replace("tolerance", "on=top, tolerance")},
        ['part "top"', 'is located on itself: "top" on "top"; locate'],
    ),
    "two parts that are located on each other": (
        {
            "top": GOOD["top"].replace("tolerance", "on=base, tolerance"),
            "base": GOOD["base"].replace("tolerance", "on=top, tolerance"),
        },
        ['part "base"', 'is located on itself: "base" on "top" on "base"; locate'],
    ),
    "part that is not located": ({"top": ""}, ['part "top"', "not located"]),
    "mesh file that is missing": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('nowhere.stl'), fixed=True)\n"},
        ['part "extra"', "nowhere.stl", "does not exist"],
    ),
    "mesh file that is empty": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('empty.stl'), fixed=True)\n"},
        ['part "extra"', "empty.stl"],
    ),
    "file that is not a mesh": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('notes.obj'), fixed=True)\n"},
        ['part "extra"', "notes.obj"],
    ),
    "STEP file cut off in the middle": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('cut.step'), fixed=True)\n"},
        ['part "extra"', "cut.step", "cut off", "export it again"],
    ),
    "STL file of zero triangles": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('none.stl'), fixed=True)\n"},
        ['part "extra"', "none.stl"],
    ),
    "ten million triangles": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('huge.stl'), fixed=True)\n"},
        ['part "extra"', "huge.stl", "10000000 triangles", "1000000"],
    ),
    "unknown kind of mesh file": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('model.py'), fixed=True)\n"},
        ['part "extra"', "model.py", ".stl", ".step"],
    ),
    "unknown units": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('none.stl', units='inch'), fixed=True)\n"},
        ['part "extra"', "'inch'", "mm", "in"],
    ),
    "units of a STEP file": (
        {"top": GOOD["top"] + "    a.part('extra', tc.Mesh('cut.step', units='in'), fixed=True)\n"},
        ['part "extra"', "cut.step", "leave units out"],
    ),
    "coincident faces, one of them inverted": (
        {
            "contact": GOOD["contact"]
            .replace("base.face('+z')", "lid.face('+z')")
            .replace("    a.", "    lid = a.part('lid', tc.Mesh('inverted.stl'), fixed=True)\n    a.", 1)
        },
        ['part "lid"', "inverted.stl", "inside out", "volume -50000"],
    ),
    "empty box": (
        {"contact": GOOD["contact"].replace("'+z'", "'+z', tc.select.Inside((0, 0, 9), (9, 9, 8))")},
        ['contact pair "interface"', 'part "base"', "empty"],
    ),
    "box beside the part": (
        {"contact": GOOD["contact"].replace("'+z'", "'+z', tc.select.Inside((0, 0, 90), (9, 9, 99))")},
        ['contact pair "interface"', "base +z", "(100, 50, 10)"],
    ),
    "B-rep face of a box": (
        {"contact": GOOD["contact"].replace("'+z'", "tc.select.Brep((5, 5, 10))")},
        ['contact pair "interface"', "not a STEP file"],
    ),
    "near a part of another assembly": (
        {"contact": GOOD["contact"].replace("'+z'", "tc.select.Near(tc.Assembly('B').part('lid', tc.Box(1, 1, 1)), 1)")},
        ['contact pair "interface"', 'unknown part "lid"'],
    ),
    "two names alike": ({"measure": 2 * GOOD["measure"]}, ['measurement "height"', "2 times"]),
    "distribution that gives NaN": (
        {"top": GOOD["top"].replace("tolerance=10", "tolerance=__import__('scipy.stats').stats.norm(math.nan, 1)")},
        ['part "top"', "finite"],
    ),
    "stiffness of zero": (
        {"top": GOOD["top"] + "    a.locate(base, [tc.Locator('A', (0, 0, 0), 'z', stiffness=0.0)])\n"},
        ["stiffness", "above 0"],
    ),
    "force on an unknown part": (
        {
            "measure": GOOD["measure"]
            + "    a.force('push', at=tc.Assembly('B').part('lid', tc.Box(1, 1, 1)).point(0, 0, 0), vector=(1, 0, 0))\n"
        },
        ['force "push"', 'unknown part "lid"'],
    ),
    "force without size": (
        {"measure": GOOD["measure"] + "    a.force('push', at=top.point(0, 0, 0), vector=(0, 0, 0))\n"},
        ['force "push"'],
    ),
    "seven two-sided locators": (
        {"top": COLLINEAR.replace("(0, 10, 5)]", "(0, 10, 5), (5, 20, 0)]").replace("zzzyyx", "zzzyyxz")},
        ['part "top"', "7 locators", "over-constrained"],
    ),
    "no measure": ({"measure": ""}, ["measures nothing"]),
    "no assembly() at all": ({"whole": "x = 1\n"}, ["model.py", "no function assembly()"]),
    "assembly() returns something else": ({"whole": "def assembly():\n    return 3\n"}, ["returned a int"]),
    "script that fails": ({"whole": "def assembly():\n    return 1 / 0\n"}, ["line 2", "ZeroDivisionError"]),
    "script that is no Python": ({"whole": "def assembly(:\n"}, ["line 1", "SyntaxError"]),
}


@pytest.fixture
def folder(tmp_path):
    """With files that hold no shape, or a wrong one."""
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "notes.obj").write_text("these are notes\n")
    step = cases.MODELS / "housing.step"
    (tmp_path / "cut.step").write_bytes(step.read_bytes()[: step.stat().st_size // 2])
    (tmp_path / "none.stl").write_bytes(b"\0" * 84)
    with (tmp_path / "huge.stl").open("wb") as file:
        file.write(b"\0" * 80 + (10_000_000).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10_000_000)
    inverted = trimesh.creation.box(bounds=[[0, 0, 0], [100, 50, 10]])
    inverted.invert()
    inverted.export(tmp_path / "inverted.stl")
    return tmp_path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_model_is_refused(mistake, folder):
    changes, expected = MISTAKES[mistake]
    for verb in ("check", "run"):
        out = () if verb == "check" else ("--out", "out.nc")
        done = call(folder, verb, write_model(folder, changes), *out)
        assert done.returncode == 2, done.stderr
        assert "Traceback" not in done.stderr
        assert done.stdout == ""
        for words in expected:
            assert words in done.stderr, done.stderr
        assert not (folder / "out.nc").exists()


def test_a_doubtful_size_is_a_warning_on_stderr(tmp_path):
    trimesh.creation.box(bounds=[[0, 0, 0], [4, 2, 0.4]]).export(tmp_path / "inches.stl")
    lid = (
        "    lid = a.part('lid', tc.Mesh('inches.stl'), at=(5, 5, 10))\n    a.locate(lid, tc.three_two_one(lid.face('-z'), "
        "lid.face('-y'), lid.face('-x')), tolerance=1)\n"
        "    a.contact('lid', moving=lid.face('-z'), reference=base.face('+z'))\n"
    )
    done = call(tmp_path, "check", write_model(tmp_path, {"measure": lid + GOOD["measure"]}))
    assert done.returncode == 0
    assert (
        done.stderr.startswith('warning: [units] part "lid"')
        and "4.49 mm across" in done.stderr
        and 'units="in"' in done.stderr
    )
    assert done.stdout.endswith("no faults found, 1 warning\n")


def test_all_faults_of_a_model_are_reported_at_once(tmp_path):
    changes = {name: MISTAKES[mistake][0][name] for mistake, name in [("five locators", "top"), ("unknown face", "contact")]}
    done = call(tmp_path, "check", write_model(tmp_path, changes | MISTAKES["measure on an unknown part"][0]))
    assert "3 faults" in done.stderr
    for words in ("six independent", '"up"', '"lid"'):
        assert words in done.stderr
