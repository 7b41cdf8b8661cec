"""One writer of one archive, from the first instant to the last, whatever stops it."""

import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tolcontact import vocabulary
from tolcontact.errors import ArchiveError

COMMAND = [sys.executable, "-m", "tolcontact"]
MODEL = """
import sys
sys.path.insert(0, {root!r})
from tests import cases
assembly = cases.stack
"""


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.py"
    path.write_text(MODEL.format(root=str(cases.__file__).rsplit("/tests", 1)[0]))
    return path


def start(model, *options):
    return subprocess.Popen(
        [*COMMAND, "run", model, "--solver", "daqp", *map(str, options)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=model.parent,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # jobs in the background begin without
    )  # fmt: skip


def finished(path):
    """How many rows of an archive are finished that somebody writes to."""
    if not path.exists():
        return 0
    copy = path.with_name("copy.nc")
    shutil.copyfile(path, copy)
    found = int((xr.load_dataset(copy)["status"] != -1).sum())
    copy.unlink()
    return found


def left_in(folder):
    return sorted(p.name for p in folder.iterdir() if p.name not in ("model.py", "__pycache__"))


@pytest.mark.parametrize("apart", [0.0, 0.5])
def test_of_two_runs_on_one_new_name_one_is_refused_and_the_others_rows_are_whole(apart, model):
    runs = [start(model, "--samples", 30_000, "--out", "new.nc", "--seed", 1)]
    time.sleep(apart)
    runs.append(start(model, "--samples", 30_000, "--out", "new.nc", "--seed", 2))
    told = [run.communicate()[1] for run in runs]
    assert sorted(run.returncode for run in runs) == [0, 2], told
    seed = 1 + [run.returncode for run in runs].index(0)
    assert "is being written by another run" in told[2 - seed]
    with tc.open_archive(model.parent / "new.nc") as found:
        assert found.attrs["seed"] == seed
        assert (found["status"].values != -1).all()
    assert left_in(model.parent) == ["new.nc"]


def test_the_target_of_a_link_is_overwritten_and_the_link_stays(tmp_path):
    (tmp_path / "disk").mkdir()
    target, link = tmp_path / "disk" / "real.nc", tmp_path / "link.nc"
    for samples in (10, 20):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        tc.run(cases.stack(), samples=samples, solver="daqp", out=link, overwrite=True).close()
        assert link.is_symlink() and xr.open_dataset(target).sizes["realization"] == samples


def test_what_a_killed_run_left_is_taken_over(tmp_path):
    out = tmp_path / "out.nc"
    for name in (".out.nc.lock", ".out.nc.part"):
        (tmp_path / name).write_bytes(b"left")
    tc.run(cases.stack(), samples=10, solver="daqp", out=out).close()
    assert list(tmp_path.iterdir()) == [out]


def test_more_than_the_disk_holds_is_refused_before_the_first_byte(tmp_path):
    with pytest.raises(ArchiveError, match=r"needs .* TB for 100000000000 realizations, but its disk has .* free"):
        tc.run(cases.stack(), samples=10**11, solver="daqp", out=tmp_path / "vast.nc")
    assert not list(tmp_path.iterdir())
    tc.run(cases.stack(), samples=10, solver="daqp", out=tmp_path / "small.nc").close()
    before = (tmp_path / "small.nc").read_bytes()
    with pytest.raises(ArchiveError, match="free"):
        tc.run(cases.stack(), samples=10**11, solver="daqp", out=tmp_path / "small.nc", resume=True)
    assert (tmp_path / "small.nc").read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_a_long_run_stands_under_its_own_name_from_its_first_block_on(tmp_path):
    path, sizes, samples = tmp_path / "long.nc", [], vocabulary.FIRST_ROWS + 9000
    tc.run(
        cases.stack(), samples=samples, solver="daqp", out=path, keep="measures",
        progress=lambda rows: sizes.append((rows, path.stat().st_size)),
    ).close()  # fmt: skip
    whole = path.stat().st_size
    assert sizes[0][0] == 4096 and sizes[0][1] < 0.9 * whole
    with tc.open_archive(path) as grown, tc.run(cases.stack(), samples=samples, solver="daqp", keep="measures") as other:
        assert (grown["measured"].values == other["measured"].values).all()
        assert tc.summarize(grown).attrs["realizations"] == samples


def test_an_interrupted_run_says_how_far_it_is_has_its_fields_and_goes_on(tmp_path, capsys):
    def interrupt(rows):
        if rows >= 8192:
            raise KeyboardInterrupt

    paths = [tmp_path / "stopped.nc", tmp_path / "whole.nc", tmp_path / "short.nc"]
    with pytest.raises(KeyboardInterrupt):
        tc.run(cases.stack(), samples=60_000, seed=3, solver="daqp", out=paths[0], progress=interrupt)
    tc.run(cases.stack(), samples=8192, seed=3, solver="daqp", out=paths[2]).close()
    found = tc.summarize(paths[0])
    assert found.attrs["realizations"] == 8192 and found.attrs["samples"] == 60_000
    assert found["field_realizations"] == 8192
    assert found["field_extreme"].identical(tc.summarize(paths[2])["field_extreme"])
    tc.run(cases.stack(), samples=1000, seed=3, solver="daqp", out=paths[0], resume=True).close()
    tc.run(cases.stack(), samples=60_000, seed=3, solver="daqp", out=paths[1]).close()
    for group in (None, "sample", "field/middle"):
        one, other = (xr.load_dataset(path, group=group).drop_attrs() for path in paths[:2])
        assert one.drop_vars(["summed_rows", "sums", "sums_checksum"], errors="ignore").identical(
            other.drop_vars(["summed_rows", "sums", "sums_checksum"], errors="ignore")
        )


@pytest.mark.parametrize(("by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_command_that_is_stopped_says_how_to_go_on_and_leaves_nothing_else(by, code, model):
    run = start(model, "--samples", 10_000_000, "--out", "stopped.nc", "--keep", "measures")
    while run.poll() is None and not finished(model.parent / "stopped.nc"):
        time.sleep(0.1)
    run.send_signal(by)
    _, told = run.communicate(timeout=20)
    assert run.returncode == code
    assert "of 10 000 000 done; continue with --resume" in told
    assert left_in(model.parent) == ["stopped.nc"]
    done = subprocess.run([*COMMAND, "summary", model.parent / "stopped.nc"], capture_output=True, text=True, check=True)
    assert "of 10 000 000 realizations are done; continue with --resume" in done.stdout


def test_a_run_that_is_stopped_before_it_began_leaves_nothing(model):
    run = start(model, "--samples", 10_000, "--out", "never.nc")
    lock = model.parent / ".never.nc.lock"
    while not lock.exists() and run.poll() is None:
        time.sleep(0.01)
    run.send_signal(signal.SIGTERM)
    _, told = run.communicate(timeout=20)
    assert run.returncode == 143 and "nothing is kept" in told
    assert left_in(model.parent) == []


def test_a_read_only_archive_is_not_replaced(tmp_path):
    path = tmp_path / "out.nc"
    tc.run(cases.stack(), samples=10, solver="daqp", out=path).close()
    path.chmod(0o444)
    if os.access(path, os.W_OK):
        pytest.skip("this user may write to read-only files")
    with pytest.raises(ArchiveError, match="read-only"):
        tc.run(cases.stack(), samples=10, solver="daqp", out=path, overwrite=True)


def test_numbers_of_realizations_are_whole_after_growth(tmp_path):
    path = tmp_path / "grown.nc"
    for samples in (5000, 12_000):
        tc.run(cases.stack(), samples=samples, seed=3, solver="daqp", out=path, resume=True).close()
    assert (xr.open_dataset(path).realization.values == np.arange(12_000)).all()
