"""What a user sees first: names, handles, versions, how things print, and a model's own method."""

import html
import tomllib
from pathlib import Path

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import ALL_POINTS, call, compiled
from tolcontact.errors import OptionError


def test_every_public_name_is_there_and_the_version_is_the_projects(tmp_path):
    for name in tc.__all__:
        assert getattr(tc, name) is not None
    project = tomllib.loads((Path(tc.__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert tc.__version__ == project["version"]
    done = call(tmp_path, "--version")
    assert (done.returncode, done.stdout) == (0, f"tolcontact {project['version']}\n")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Facing", "has no name Facing; it is tc.select.Facing"),
        ("read_pmi", "it is tc.io.read_pmi"),
        ("tails", "it is tc.analyses.tails"),
        ("ArchiveError", "it is tc.errors.ArchiveError"),
        ("Postion", 'no name Postion; the nearest name is "Position"'),
        ("qqq", "has no name qqq$"),
    ],
)
def test_a_name_that_is_elsewhere_is_told_with_its_place(name, message):
    with pytest.raises(AttributeError, match=message):
        getattr(tc, name)
    assert not hasattr(tc, "__wrapped__")


def test_declarations_return_what_they_declare():
    a = tc.Assembly("handles")
    below, above = a.part("below", tc.Box(20, 20, 5), fixed=True), a.part("above", tc.Box(10, 10, 5), at=(5, 5, 5))
    location = a.locate(above, tc.three_two_one(above.face("-z"), above.face("-y"), above.face("-x"), inset=1), tolerance=0.1)
    pair = a.contact("joint", moving=above.face("-z"), reference=below.face("+z"), points=20)
    force = a.force("push", at=above.point(5, 5, 5), vector=(0, 0, -1))
    measure = a.measure("height", above.point(5, 5, 5), along="z")
    assert (location,) == a.locations and (pair,) == a.pairs and (force,) == a.forces and (measure,) == a.measures
    assert (
        isinstance(pair, tc.declaration.ContactPair)
        and isinstance(measure, tc.declaration.Measure)
        and isinstance(force, tc.declaration.Force)
    )


def test_declared_things_print_as_rows():
    a = cases.model("ra1")
    assert repr(a) == str(a) and "contact interface" in repr(a)
    assert (
        a._repr_html_().startswith("<details><summary>assembly RA1") and "<script" not in tc.Assembly("<script>")._repr_html_()
    )
    assert repr(a.parts[0]) == "part base: box 100 x 50 x 10 mm"
    assert repr(a.parts[0].face("+z")) == "base +z" and repr(a.parts[0].point(1, 2, 3)) == "base (1, 2, 3)"
    for declared in (*a.pairs, *a.measures, *a.parts, tc.Locator("A", (0, 0, 0), "z", 1.0), tc.Tolerance(1)):
        assert repr(declared) == str(declared) and "object at" not in str(declared) and "\n" not in str(declared)
        assert declared._repr_html_() == f"<pre>{html.escape(str(declared))}</pre>"


def test_programs_and_blocks_are_readable():
    program = compiled(cases.ra1(), solver="daqp")
    assert repr(program).splitlines()[0] == "program of RA1: daqp, exact, all points"
    assert "  contact interface: 202 contact points" in repr(program)
    (block,) = tc.simulate_blocks(program, samples=100, seed=1)
    assert repr(block).startswith("realizations 0 to 99: ") and "resolved" in repr(block)


def test_faults_are_listed_without_a_run():
    assert tc.check(cases.model("ra1")) == ()
    (fault,) = tc.check(cases.model("ra1"), method={"objective": "seating"})
    assert "force" in fault


@pytest.mark.slow
def test_a_model_is_resolved_by_its_own_method_unless_somebody_says_otherwise(tmp_path):
    model, quick = cases.model("tower", 2), {"surfaces": 0, "fields": "none"}
    assert model.method == ALL_POINTS
    for given, expected, whose in (
        (None, ALL_POINTS, "model"),
        ({"resolution": "linearized"}, tc.Method(resolution="linearized", objective="all points"), "options"),
        (tc.Method(objective="active points"), tc.Method(objective="active points"), "options"),
    ):
        with tc.run(model, samples=4, solver="daqp", method=given, **quick) as run:
            assert (run.attrs["resolution"], run.attrs["objective"]) == (expected.resolution, expected.objective)
            assert run.attrs["method_from"] == whose
            assert tc.io.model_of(run).method == ALL_POINTS
    with tc.run(cases.stack(), samples=4, solver="daqp", **quick) as run:
        assert run.attrs["method_from"] == "defaults" and tc.io.model_of(run).method is None
    (tmp_path / "tower.py").write_text("from models import tower\n\n\ndef assembly():\n    return tower.assembly(2)\n")
    assert "resolution: exact" in call(tmp_path, "run", "tower.py", "--samples", "20").stdout
    linear = call(tmp_path, "run", "tower.py", "--samples", "20", "--resolution", "linearized").stdout
    assert "resolution: linearized; objective: all points" in linear
    found = tc.compare(model, "daqp", samples=20)
    assert (found.attrs["resolution"], found.attrs["objective"]) == ("exact", "all points")
    assert np.isfinite(found["pose_difference"]).all()


def test_what_is_no_method_is_refused():
    with pytest.raises(TypeError, match=r'assembly "x": method is a str; expected tc.Method'):
        tc.Assembly("x", method="exact")
    with pytest.raises(OptionError, match="a method has no choice 'resolutoin'; expected some of: resolution, objective"):
        tc.run(cases.stack(), samples=20, method={"resolutoin": "exact"})
