"""Each mistake gets one message that names the thing at fault, exit code 2, and leaves files alone."""

import sys

import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import SCRIPTS, call, run

HEADER = """
import math
import tolcontact as tc

def assembly():
    a = tc.Assembly("A")
    base = a.part("base", tc.Box(100, 50, 10))
    top = a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    held = tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5)
    scheme = tc.three_two_one(top.face("-z"), top.face("+y"), top.face("-x"), inset=5)
"""
GOOD = {
    "base": "    a.locate(base, held, tolerance=10)\n",
    "top": "    a.locate(top, scheme, tolerance=10)\n",
    "contact": "    a.contact('interface', moving=top.face('-z'), reference=base.face('+z'), points=20)\n",
    "measure": "    a.measure('height', top.point(50, 0, 10), along='z', tolerance=1)\n",
    "end": "    return a\n",
}
COLLINEAR = (
    "    points = [(5, 5, 0), (25, 5, 0), (45, 5, 0), (5, 0, 5), (45, 0, 5), (0, 10, 5)]\n"
    "    a.locate(top, [tc.Locator(f'L{k}', p, n, 1) for k, (p, n) in enumerate(zip(points, 'zzzyyx'))])\n"
)

MISTAKES = {
    "locators that do not fix the part": ({"top": COLLINEAR}, ['part "top"', "do not fix it", "condition number"]),
    "five locators": ({"top": COLLINEAR.replace(", (0, 10, 5)", "")}, ['part "top"', "5 locators", "exactly 6"]),
    "negative tolerance": ({"top": GOOD["top"].replace("10", "-10")}, ['part "top"', "-10", "0 or above"]),
    "tolerance NaN": ({"top": GOOD["top"].replace("10", "math.nan")}, ['part "top"', "nan"]),
    "surfaces apart": (
        {"contact": GOOD["contact"].replace("'-z'", "'+z'").replace("points", "within=1.5, points")},
        ['contact pair "interface"', "1.5 mm", "10 mm away"],
    ),
    "surfaces that look the same way": (
        {"contact": GOOD["contact"].replace("'-z'", "'+z'").replace("points", "within=15, points")},
        ['contact pair "interface"', "look the same way"],
    ),
    "unknown face": ({"contact": GOOD["contact"].replace("'+z'", "'up'")}, ['"up"', 'part "base"', "+x, -x"]),
    "measure on an unknown part": (
        {"measure": "    a.measure('height', tc.Assembly('B').part('lid', tc.Box(1, 1, 1)).point(0, 0, 0), along='z')\n"},
        ['measure "height"', 'unknown part "lid"', "base, top"],
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
        {"contact": GOOD["contact"].replace("'+z'", "'+z', tc.Inside((0, 0, 9), (9, 9, 8))")},
        ['contact pair "interface"', 'part "base"', "empty"],
    ),
    "box beside the part": (
        {"contact": GOOD["contact"].replace("'+z'", "'+z', tc.Inside((0, 0, 90), (9, 9, 99))")},
        ['contact pair "interface"', "base +z", "(100, 50, 10)"],
    ),
    "B-rep face of a box": (
        {"contact": GOOD["contact"].replace("'+z'", "tc.Brep((5, 5, 10))")},
        ['contact pair "interface"', "no STEP file"],
    ),
    "near a part of another assembly": (
        {"contact": GOOD["contact"].replace("'+z'", "tc.Near(tc.Assembly('B').part('lid', tc.Box(1, 1, 1)), 1)")},
        ['contact pair "interface"', 'unknown part "lid"'],
    ),
    "two names alike": ({"measure": 2 * GOOD["measure"]}, ['measure "height"', "2 times"]),
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
        ['part "top"', "7 locators", "no more than six"],
    ),
    "no measure": ({"measure": ""}, ["measures nothing"]),
    "no assembly() at all": ({"whole": "x = 1\n"}, ["model.py", "no function assembly()"]),
    "assembly() returns something else": ({"whole": "def assembly():\n    return 3\n"}, ["returned a int"]),
    "script that fails": ({"whole": "def assembly():\n    return 1 / 0\n"}, ["line 2", "ZeroDivisionError"]),
    "script that is no Python": ({"whole": "def assembly(:\n"}, ["line 1", "SyntaxError"]),
}


def script(folder, changes):
    (folder / "empty.stl").write_bytes(b"")
    (folder / "notes.obj").write_text("these are notes\n")
    step = cases.MODELS / "housing.step"
    (folder / "cut.step").write_bytes(step.read_bytes()[: step.stat().st_size // 2])
    (folder / "none.stl").write_bytes(b"\0" * 84)
    with (folder / "huge.stl").open("wb") as file:
        file.write(b"\0" * 80 + (10_000_000).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10_000_000)
    inverted = trimesh.creation.box(bounds=[[0, 0, 0], [100, 50, 10]])
    inverted.invert()
    inverted.export(folder / "inverted.stl")
    path = folder / "model.py"
    path.write_text(changes.get("whole") or HEADER + "".join({**GOOD, **changes}.values()))
    return path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_wrong_model_is_refused(mistake, tmp_path):
    changes, expected = MISTAKES[mistake]
    for verb in ("check", "run"):
        out = () if verb == "check" else ("--out", "out.nc")
        done = call(tmp_path, verb, script(tmp_path, changes), *out)
        assert done.returncode == 2, done.stderr
        assert "Traceback" not in done.stderr
        assert done.stdout == ""
        for words in expected:
            assert words in done.stderr, done.stderr
        assert not (tmp_path / "out.nc").exists()


def test_a_doubtful_size_is_a_warning_on_stderr(tmp_path):
    trimesh.creation.box(bounds=[[0, 0, 0], [4, 2, 0.4]]).export(tmp_path / "inches.stl")
    lid = (
        "    lid = a.part('lid', tc.Mesh('inches.stl'), at=(5, 5, 10))\n    a.locate(lid, tc.three_two_one(lid.face('-z'), "
        "lid.face('-y'), lid.face('-x')), tolerance=1)\n"
        "    a.contact('lid', moving=lid.face('-z'), reference=base.face('+z'))\n"
    )
    done = call(tmp_path, "check", script(tmp_path, {"measure": lid + GOOD["measure"]}))
    assert done.returncode == 0
    assert done.stderr.startswith('warning: part "lid"') and "4.49 mm across" in done.stderr and 'units="in"' in done.stderr
    assert done.stdout.endswith("no faults found\n")


def test_all_faults_of_a_model_are_reported_at_once(tmp_path):
    changes = {name: MISTAKES[mistake][0][name] for mistake, name in [("five locators", "top"), ("unknown face", "contact")]}
    done = call(tmp_path, "check", script(tmp_path, changes | MISTAKES["measure on an unknown part"][0]))
    assert "3 faults" in done.stderr
    for words in ("exactly 6", '"up"', '"lid"'):
        assert words in done.stderr


OPTIONS = {
    "unknown resolution": (["--resolution", "precise"], ["resolution", "precise", "linearized, exact"]),
    "unknown objective": (["--objective", "least effort"], ["objective", "least effort", "locator stiffness"]),
    "seating without a force": (["--objective", "seating"], ["force"]),
    "unknown solver": (["--solver", "simplex"], ["simplex", "qpoases"]),
    "refused solver": (["--solver", "superscs"], ["refused", "wrong answers", "daqp"]),
    "too few samples": (["--samples", "0"], ["samples is 0"]),
    "negative seed": (["--seed", "-1"], ["seed is -1"]),
    "output in a folder that does not exist": (["--out", "nowhere/out.nc"], ["nowhere", "does not exist"]),
    "output that is a folder": (["--out", "."], ["not a file"]),
    "output on a device that is no disk": (["--out", "/proc/out.nc"], ["/proc/out.nc", "cannot be written"]),
}


@pytest.mark.parametrize("mistake", OPTIONS)
def test_a_wrong_option_is_refused_before_the_run(mistake, tmp_path):
    options, expected = OPTIONS[mistake]
    done = call(tmp_path, "run", script(tmp_path, {}), *options)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    for words in expected:
        assert words in done.stderr, done.stderr


def test_an_existing_archive_is_not_overwritten_without_being_asked(tmp_path):
    model, out = script(tmp_path, {}), ("--out", "out.nc", "--samples", "20")
    assert call(tmp_path, "run", model, *out).returncode == 0
    before = (tmp_path / "out.nc").read_bytes()
    again = call(tmp_path, "run", model, *out)
    assert again.returncode == 2 and "exists" in again.stderr
    assert (tmp_path / "out.nc").read_bytes() == before
    assert call(tmp_path, "run", model, *out, "--seed", "9", "--overwrite").returncode == 0
    assert (tmp_path / "out.nc").read_bytes() != before


def test_a_comment_in_the_script_does_not_make_another_model(tmp_path):
    model = script(tmp_path, {})
    run = ("run", model, "--samples", "50", "--out", "out.nc")
    first = call(tmp_path, *run)
    model.write_text("# moved\n" + model.read_text())
    again = call(tmp_path, *run, "--resume")
    assert first.returncode == again.returncode == 0, again.stderr
    assert again.stdout == first.stdout


def test_a_file_that_is_no_archive_is_refused(tmp_path):
    (tmp_path / "notes.nc").write_text("these are notes\n")
    for name in ("notes.nc", "nowhere.nc"):
        done = call(tmp_path, "summary", name)
        assert done.returncode == 2 and name in done.stderr and "Traceback" not in done.stderr
    done = call(tmp_path, "run", script(tmp_path, {}), "--out", "notes.nc", "--resume")
    assert done.returncode == 2
    assert (tmp_path / "notes.nc").read_text() == "these are notes\n"


def test_results_go_to_stdout_in_80_columns_and_summary_repeats_them(tmp_path):
    bracketed = HEADER.replace('"top"', '"top [red]"')  # which is no markup
    model = script(tmp_path, {"whole": bracketed + "".join(GOOD.values())})
    ran = call(tmp_path, "run", model, "--samples", "200", "--out", "out.nc")
    told = call(tmp_path, "summary", "out.nc")
    assert ran.returncode == told.returncode == 0
    assert ran.stdout.startswith(told.stdout)
    assert max(map(len, told.stdout.splitlines())) <= 80
    for words in ("6 sigma", "variance", "outside", "touched by contact", "top [red]"):
        assert words in told.stdout


def test_a_run_with_too_many_failures_exits_with_1(tmp_path):
    """A tab wider than its slot."""
    model = SCRIPTS / "model_tab.py"
    done = call(tmp_path, "run", model, "--samples", "50")
    assert done.returncode == 1
    assert "50 realizations" in done.stderr
    assert "use --resolution exact" in " ".join(done.stdout.split())
    done = call(tmp_path, "run", model, "--samples", "50", "--resolution", "exact")
    assert done.returncode == 1
    told = " ".join(done.stdout.split())
    for words in ("50 not_assemblable", "pairs in conflict there: left side (50), right side (50)", "resolution: exact"):
        assert words in told


def test_a_model_script_runs_by_itself(tmp_path):
    model = script(tmp_path, {})
    model.write_text(model.read_text() + "\nif __name__ == '__main__':\n    tc.main(assembly)\n")
    done = run([sys.executable, model, "--samples", "50"])
    assert done.returncode == 0 and "height" in done.stdout


def test_a_method_that_does_not_exist_is_refused():
    for wrong in (
        {"regularization": "ridge"},
        {"active_set": "some"},
        {"eta": 0.0},
        {"activity": -1.0},
        {"search": "often"},
        {"search": "iterated"},
    ):
        with pytest.raises(tc.TolcontactError, match=next(iter(wrong))):
            tc.Method(**wrong)
