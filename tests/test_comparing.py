"""Solvers side by side."""

import json

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled


def test_solvers_that_agree_are_said_to_agree():
    found = tc.compare(cases.ra1(), ["daqp", "qpoases", "osqp"], samples=200, seed=3)
    assert list(found.solver) == ["daqp", "qpoases", "osqp"]
    assert (found.by_status.sum("status_meaning") == 200).all()
    assert (found.both_resolved == 200).all()
    assert (found.pose_difference.sel(solver="daqp") == 0).all()
    assert 0 < found.pose_difference.sel(solver="qpoases", extent="largest") < 1e-9
    assert 0 < found.pose_difference.sel(solver="osqp", extent="largest") < 1e-5
    assert (found.measure_difference.sel(extent="median") <= found.measure_difference.sel(extent="largest")).all()
    assert (found.seconds > 0).all()


@pytest.mark.slow
def test_the_difference_of_poses_is_that_of_the_furthest_surface_point():
    found = tc.compare(cases.ra1(), ["daqp", "osqp"], samples=50)
    runs = {s: tc.run(compiled(cases.ra1(), solver=s), samples=50, surfaces=0) for s in ("daqp", "osqp")}
    tree = {s: run.sel(state="corrected") for s, run in runs.items()}
    furthest = 0.0
    for part in ("base", "top"):
        v = tree["daqp"][f"field/{part}"].vertices.values
        moved = [t.rotation.sel(part=part).values @ v.T + t.translation.sel(part=part).values[..., None] for t in tree.values()]
        furthest = max(furthest, np.linalg.norm(moved[0] - moved[1], axis=1).max())
    assert float(found.pose_difference.sel(solver="osqp", extent="largest")) == pytest.approx(furthest, rel=1e-3)


def test_the_command_prints_a_table_writes_a_file_and_speaks_json(tmp_path):
    model = cases.MODELS / "ra1.py"
    options = ("compare", model, "--solvers", "daqp, qpoases", "--samples", "50")
    done = call(tmp_path, *options, "--out", "both.nc")
    assert done.returncode == 0
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "qpoases" in done.stdout and "resolved" in done.stdout
    with xr.open_dataset(tmp_path / "both.nc") as read:
        assert list(read.solver.values.astype(str)) == ["daqp", "qpoases"]
        assert read.seconds.attrs["units"] == "s"
    assert call(tmp_path, *options, "--out", "both.nc").returncode == 2
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["data_vars"]["by_status"]["data"][0] == said["data_vars"]["by_status"]["data"][1]
    assert said["coords"]["solver"]["data"] == ["daqp", "qpoases"]


@pytest.mark.slow
def test_resolutions_and_objectives_are_compared_too(tmp_path):
    options = ("compare", cases.MODELS / "channel.py", "--solvers", "daqp,qpoases", "--samples", "40")
    both = ("--resolution", "linearized,exact", "--objective", "active points,all points")
    assert call(tmp_path, *options, *both, "--out", "all.nc").returncode == 0
    with xr.open_dataset(tmp_path / "all.nc") as found:
        assert found.sizes["solver"] == 8
        assert [str(label) for label in found.solver.values[:3]] == [
            "daqp linearized active points", "qpoases linearized active points", "daqp linearized all points"
        ]  # fmt: skip
        exact = found.sel(solver=[label for label in found.solver.values if "exact" in str(label)])
        assert (exact.by_status.sel(status_meaning="resolved") >= 38).all()
    assert call(tmp_path, *options, "--resolution", "exact,exact").returncode == 2


@pytest.mark.parametrize(("names", "words"), [("daqp,daqp", "each once"), (",", "at least one"), ("daqp,simplex", "simplex")])
def test_wrong_lists_of_solvers_are_refused(names, words, tmp_path):
    done = call(tmp_path, "compare", cases.MODELS / "ra1.py", "--solvers", names)
    assert done.returncode == 2 and words in done.stderr


def test_where_nothing_can_be_compared_the_json_says_null(tmp_path):
    """One linear step leaves every realization of the channel unresolved."""
    linear = ("--resolution", "linearized", "--samples", "20", "--json")
    done = call(tmp_path, "compare", cases.MODELS / "channel.py", "--solvers", "daqp,qpoases", *linear)
    said = json.loads(done.stdout, parse_constant=pytest.fail)["data_vars"]
    assert said["both_resolved"]["data"] == [0, 0]
    assert said["pose_difference"]["data"] == [[None, None], [None, None]]


def test_labels_name_whatever_methods_differ_in():
    methods = [tc.Method(), tc.Method(objective="active points"), tc.Method(regularization="identity")]
    found = tc.compare(cases.ra1(), ["daqp"], samples=20, methods=methods)
    assert list(found["solver"].values) == [
        "daqp all points regularization points",
        "daqp active points regularization points",
        "daqp all points regularization identity",
    ]
    assert (found["measure_difference"].sel(extent="largest").values[1:] > 0).all()
