"""What can be understood is taken, and the rest is refused in one line."""

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tolcontact.errors import OptionError


@pytest.fixture(scope="module")
def program():
    return tc.build(cases.stack(), solver="daqp")


@pytest.mark.parametrize("option", [{"solver": "qpoases"}, {"method": tc.Method(resolution="exact")}])
def test_a_program_is_not_run_with_another_solver_or_method(option, program):
    with pytest.raises(OptionError, match="a Program has its solver and method"):
        tc.run(program, samples=10, **option)


@pytest.mark.parametrize("option", ["resume", "overwrite"])
def test_what_speaks_of_an_archive_needs_one(option, program, tmp_path):
    with pytest.raises(OptionError, match=rf"{option} needs an archive, and none is named; name one: out="):
        tc.run(program, samples=10, **{option: True})
    (tmp_path / "m.py").write_text("")
    done = call(tmp_path, "run", "m.py", f"--{option}")
    assert done.returncode == 2 and "--out FILE.nc" in done.stderr


@pytest.mark.slow
def test_a_model_may_be_given_as_assembly_function_or_path(tmp_path):
    path = tmp_path / "model.py"
    path.write_text((cases.MODELS / "ra1.py").read_text())
    runs = [
        tc.run(model, samples=20, solver="daqp") for model in (cases.model("ra1"), lambda: cases.model("ra1"), path, str(path))
    ]
    for run in runs[1:]:
        assert (run["measured"].values == runs[0]["measured"].values).all()


@pytest.mark.parametrize("model", [7, None, [], np.zeros(3), {"name": "x"}, lambda: "x"])
def test_what_is_no_model_is_refused(model):
    for use in (tc.run, tc.build, lambda model: tc.compare(model, "daqp")):
        with pytest.raises(OptionError, match=r"the model is a .*; expected a tc.Assembly, a function that returns one"):
            use(model)


def test_one_solver_and_one_method_need_no_list():
    found = tc.compare(cases.stack(), "daqp", samples=10, methods=tc.Method(resolution="exact"))
    assert list(found["solver"].values) == ["daqp"] and found.attrs["resolution"] == "exact"


@pytest.mark.slow
def test_results_may_be_given_as_a_tree_or_by_the_archives_name(program, tmp_path):
    with tc.run(program, samples=50, out=tmp_path / "out.nc") as results:
        expected = tc.summarize(results)
    assert tc.summarize(tmp_path / "out.nc").identical(expected)
    assert tc.summarize(str(tmp_path / "out.nc")).identical(expected)
    for wrong in (xr.load_dataset(tmp_path / "out.nc"), None, 7):
        with pytest.raises(OptionError, match=r"results are a .*; expected what tc.run or tc.open_archive returns"):
            tc.summarize(wrong)


def test_check_finds_what_run_would_refuse(tmp_path):
    (tmp_path / "m.py").write_text((cases.MODELS / "ra1.py").read_text())
    for options, words in ((["--objective", "seating"], "force"), (["--solver", "nobody"], "nobody")):
        both = [call(tmp_path, verb, "m.py", *options) for verb in ("check", "run")]
        assert [done.returncode for done in both] == [2, 2]
        assert both[0].stderr == both[1].stderr and words in both[0].stderr


def test_resolutions_are_compared_with_the_default_solver_and_nothing_is_cut_in_a_pipe(tmp_path):
    (tmp_path / "m.py").write_text((cases.MODELS / "ra1.py").read_text().replace('Assembly("RA1"', f'Assembly("{"RA1 " * 40}"'))
    done = call(tmp_path, "compare", "m.py", "--resolution", "linearized,exact", "--samples", "20")
    assert done.returncode == 0, done.stderr
    assert "qpoases linearized" in done.stdout and "qpoases exact" in done.stdout
    assert "RA1 " * 39 in done.stdout.splitlines()[0]


def test_long_names_are_whole_in_a_pipe(tmp_path):
    name = "a measure with a long name " * 6 + "end"
    (tmp_path / "m.py").write_text((cases.MODELS / "ra1.py").read_text().replace("corner height", name))
    done = call(tmp_path, "run", "m.py", "--samples", "20")
    assert name in done.stdout and "…" not in done.stdout


def test_what_a_run_will_take_is_said_before_it_begins(program, tmp_path, caplog):
    path = tmp_path / "out.nc"

    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tc.run(program, samples=2_000_000, keep="measures", out=path, progress=stop)
    assert "contact points: 2000000 realizations will take about" in caplog.text


def test_a_method_that_does_not_exist_is_refused():
    for wrong in (
        {"regularization": "ridge"},
        {"active_set": "some"},
        {"search": "often"},
        {"search": "bounded", "resolution": "linearized"},
    ):
        with pytest.raises(tc.TolcontactError, match=next(iter(wrong))):
            tc.Method(**wrong)
