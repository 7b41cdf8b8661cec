"""One writer of one archive, from the first instant to the last, whatever stops it."""

import os
import signal
import time

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import COMMAND, PAPER, SCRIPTS, call, compiled, contents, finish, nightly, posix_only, start
from tolcontact.errors import ArchiveError


def begin(folder, *options):
    """A run of the stack, in a folder."""
    command = [*COMMAND, "run", SCRIPTS / "model_stack.py", "--solver", "daqp", *map(str, options)]
    return start(command, cwd=folder)


def left_in(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("apart", [0.0, *nightly(0.5)])
def test_of_two_runs_on_one_new_name_one_is_refused_and_the_others_rows_are_whole(apart, tmp_path):
    begun = [begin(tmp_path, "--samples", 8000, "--out", "new.nc", "--seed", 1)]
    time.sleep(apart)
    begun.append(begin(tmp_path, "--samples", 8000, "--out", "new.nc", "--seed", 2))
    done = [finish(process) for process in begun]
    assert sorted(one.returncode for one in done) == [0, 2], done
    seed = 1 + [one.returncode for one in done].index(0)
    assert "is being written by another run" in done[2 - seed].stderr
    with tc.open_archive(tmp_path / "new.nc") as found:
        assert found.attrs["seed"] == seed
        assert found.sizes["realization"] == 8000
    assert left_in(tmp_path) == ["new.nc"]


@pytest.mark.slow
def test_the_target_of_a_link_is_overwritten_and_the_link_stays(tmp_path):
    (tmp_path / "disk").mkdir()
    target, link = tmp_path / "disk" / "real.nc", tmp_path / "link.nc"
    program = compiled(cases.stack(), solver="daqp")
    for samples in (10, 20):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        tc.run(program, samples=samples, out=link, overwrite=True).close()
        assert link.is_symlink() and xr.load_dataset(target).sizes["realization"] == samples


def test_what_a_killed_run_left_is_taken_over(tmp_path):
    out = tmp_path / "out.nc"
    for name in (".out.nc.lock", ".out.nc.0123abcd.part", ".out.nc.rows", ".out.nc.checkpoint"):
        (tmp_path / name).write_bytes(b"left")
    tc.run(compiled(cases.stack(), solver="daqp"), samples=10, out=out).close()
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.slow
def test_more_than_the_disk_holds_is_refused_before_the_first_byte(tmp_path):
    program = compiled(cases.stack(), solver="daqp")
    with pytest.raises(ArchiveError, match=r"needs .* TB for 100000000000 realizations, but its disk has .* free"):
        tc.run(program, samples=10**11, out=tmp_path / "vast.nc")
    assert not list(tmp_path.iterdir())
    tc.run(program, samples=10, out=tmp_path / "small.nc").close()
    before = (tmp_path / "small.nc").read_bytes()
    with pytest.raises(ArchiveError, match="free"):
        tc.run(program, samples=10**11, out=tmp_path / "small.nc", resume=True)
    assert (tmp_path / "small.nc").read_bytes() == before and len(list(tmp_path.iterdir())) == 1


@pytest.mark.slow
def test_an_interrupted_run_says_how_far_it_is_has_its_fields_and_goes_on(tmp_path, capsys):
    def interrupt(rows):
        if rows >= 4096:
            raise KeyboardInterrupt

    paths = [tmp_path / "stopped.nc", tmp_path / "whole.nc", tmp_path / "short.nc"]
    options = {"seed": 3, "fields": 5000, "surfaces": 0}
    program = compiled(cases.stack(), solver="daqp", method=PAPER)
    with pytest.raises(KeyboardInterrupt):
        tc.run(program, samples=6000, out=paths[0], progress=interrupt, **options)
    tc.run(program, samples=4096, out=paths[2], **options).close()
    found = tc.summarize(paths[0])
    assert found.attrs["realizations"] == 4096 and found.attrs["samples"] == 6000
    assert found["field_realizations"] == 4096
    assert found["field_extreme"].identical(tc.summarize(paths[2])["field_extreme"])
    tc.run(program, samples=1000, out=paths[0], resume=True, **options).close()
    tc.run(program, samples=6000, out=paths[1], **options).close()
    for group in (None, "sample", "field/middle"):
        one, other = (contents(path, group) for path in paths[:2])
        assert one.identical(other), group


@posix_only
@pytest.mark.slow
@pytest.mark.parametrize(("by", "code"), [(signal.SIGINT, 130), *nightly((signal.SIGTERM, 143))])
def test_a_command_that_is_stopped_says_how_to_go_on_and_leaves_nothing_else(by, code, tmp_path):
    begun = begin(tmp_path, "--samples", 10_000_000, "--out", "stopped.nc", "--keep", "measures")
    journal = tmp_path / ".stopped.nc.rows"
    while begun.poll() is None and not journal.exists():
        time.sleep(0.1)
    begun.send_signal(by)
    done = finish(begun)
    assert done.returncode == code
    assert "of 10 000 000 done; continue with --resume" in done.stderr
    assert left_in(tmp_path) == ["stopped.nc"]
    summary = call(tmp_path, "summary", "stopped.nc")
    assert summary.returncode == 0, summary.stderr
    assert "of 10 000 000 realizations are done; continue with --resume" in summary.stdout


@posix_only
@pytest.mark.slow
def test_a_run_that_is_stopped_before_it_began_leaves_nothing(tmp_path):
    begun = begin(tmp_path, "--samples", 10_000, "--out", "never.nc")
    lock = tmp_path / ".never.nc.lock"
    while not lock.exists() and begun.poll() is None:
        time.sleep(0.01)
    begun.send_signal(signal.SIGTERM)
    done = finish(begun)
    assert done.returncode == 143 and "nothing is kept" in done.stderr
    assert left_in(tmp_path) == []


def test_a_read_only_archive_is_not_replaced(tmp_path):
    path = tmp_path / "out.nc"
    tc.run(compiled(cases.stack(), solver="daqp"), samples=10, out=path).close()
    path.chmod(0o444)
    if os.access(path, os.W_OK):
        pytest.skip("this user may write to read-only files")
    with pytest.raises(ArchiveError, match="read-only"):
        tc.run(cases.stack(), samples=10, solver="daqp", out=path, overwrite=True)


@pytest.mark.slow
def test_numbers_of_realizations_are_whole_after_growth(tmp_path):
    path = tmp_path / "grown.nc"
    program = compiled(cases.stack(), solver="daqp", method=PAPER)
    for samples in (2000, 5000):
        tc.run(program, samples=samples, seed=3, out=path, resume=True, fields="none", surfaces=0).close()
    assert (xr.load_dataset(path).realization.values == np.arange(5000)).all()
