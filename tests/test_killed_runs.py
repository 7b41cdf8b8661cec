"""What ends a run before its time leaves an archive to go on with, or nothing."""

import contextlib
import random
import re
import subprocess
import sys
import time

import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import ROOT, assert_same_archive, compiled, contents, finish, layout, nightly, run, script, start
from tolcontact.archive import bytes_of_rows
from tolcontact.errors import ArchiveError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def program():
    return compiled(cases.one_dimensional(2))


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """The archive of a run of 12 000 realizations that nothing ended."""
    path = tmp_path_factory.mktemp("whole") / "whole.nc"
    tc.run(program, samples=12_000, seed=3, out=path).close()
    return path


@pytest.mark.parametrize(("samples", "after", "keep"), [(12_000, 4096, "all"), *nightly((20_000, 12_000, "measures"))])
def test_a_killed_run_keeps_its_rows_and_goes_on(samples, after, keep, program, whole, tmp_path):
    path = tmp_path / "killed.nc"
    with start(script("run_blocks", path, samples, "--keep", keep)) as begun:
        for line in begun.stdout:
            if int(line) >= after:
                break
        begun.kill()
    row_bytes = bytes_of_rows(program.nominal, keep, 1) - 8  # without the number of the realization
    written = path.with_name(".killed.nc.rows").stat().st_size / row_bytes
    assert after <= written < samples
    with pytest.raises(
        ArchiveError, match=r"^0 realizations are in the archive.* journal of a run that was killed are not counted"
    ):
        tc.summarize(path)
    tc.run(program, samples=samples, seed=3, out=path, keep=keep, resume=True).close()
    with xr.open_dataset(path) as resumed:
        at = int(re.search(r"resumed after (\d+) realizations", resumed.attrs["history"]).group(1))
        assert at % 4096 == 0 and at <= written
    if keep != "all":
        whole = tmp_path / "whole.nc"
        tc.run(program, samples=samples, seed=3, out=whole, keep=keep).close()
    for group in (None, "sample", "contact", "field/block"):
        assert contents(path, group).identical(contents(whole, group)), group


def test_a_journal_that_was_damaged_is_refused_and_left_alone(program, tmp_path):
    path = tmp_path / "killed.nc"
    with start(script("run_blocks", path, 8000, "--step")) as begun:
        begun.stdout.readline()  # there is a checkpoint: no whole block will follow
        begun.kill()
    rows, checkpoint = (path.with_name(f".killed.nc.{name}") for name in ("rows", "checkpoint"))
    whole, state = rows.read_bytes(), checkpoint.read_bytes()
    changed = bytearray(whole)
    changed[len(changed) // 10] ^= 4
    for data, its_state in (
        (changed, state),
        (whole[: len(whole) // 3], state),
        (None, state),
        (whole, state[:-30]),
        (whole, b""),
    ):
        rows.unlink() if data is None else rows.write_bytes(data)
        checkpoint.write_bytes(its_state)
        before = {file.name: file.read_bytes() for file in (path, rows, checkpoint) if file.exists()}
        with pytest.raises(ArchiveError, match=r'is damaged: it has realizations .* delete "\.killed\.nc\.rows" and'):
            tc.run(program, samples=8000, seed=3, out=path, resume=True)
        assert {file.name: file.read_bytes() for file in (path, rows, checkpoint) if file.exists()} == before
    rows.write_bytes(whole)
    checkpoint.write_bytes(state)
    renamed = path.rename(path.with_name("renamed.nc"))
    with pytest.raises(
        ArchiveError, match=r'was named "killed\.nc" .* rename "\.killed\.nc\.rows" to "\.renamed\.nc\.rows" and'
    ):
        tc.run(program, samples=8000, seed=3, out=renamed, resume=True)
    renamed.rename(path)
    for file in (rows, checkpoint):
        file.unlink()
    with tc.run(program, samples=200, seed=3, out=path, resume=True) as results:
        assert results.sizes["realization"] == 8000


@pytest.mark.parametrize("step", [1200, *nightly(15)])
def test_a_run_may_be_killed_at_any_of_its_writes(step, tmp_path):
    done = run(script("kill_at_each_write", tmp_path, step))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("how", ["resume", *nightly("overwrite")])
def test_an_archive_is_not_taken_from_the_run_that_writes_it(how, program, tmp_path):
    path = tmp_path / "live.nc"
    with start(script("run_blocks", path, 1000, "--step")) as begun:
        begun.stdout.readline()
        with pytest.raises(ArchiveError, match="being written by another run"):
            tc.run(program, samples=1000, seed=3, out=path, **{how: True})
        done = finish(begun, "go on\n")
    assert done.returncode == 0
    with tc.open_archive(path) as tree:
        assert tree.sizes["realization"] == 1000
    assert [p.name for p in tmp_path.iterdir()] == ["live.nc"]


def test_a_full_disk_is_told_and_the_run_goes_on_when_there_is_room(program, whole, tmp_path):
    path = tmp_path / "full.nc"
    assert run(script("run_on_a_full_disk", path)).returncode == 7
    tc.run(program, samples=12_000, seed=3, out=path, resume=True).close()
    assert contents(path).identical(contents(whole))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["full.nc"]


def killed_at_random(model, samples, seconds, folder, rng):
    """The archive of a run that is killed at a random moment of those it takes, and then resumed."""
    path = folder / "killed.nc"
    path.unlink(missing_ok=True)
    command = [sys.executable, "-m", "tolcontact", "run", model, "--samples", samples, "--out", path, "--quiet"]
    command = list(map(str, command))
    with start(command) as begun:
        with contextlib.suppress(subprocess.TimeoutExpired):
            begun.wait(rng.uniform(0.2, 1.0) * seconds)
        begun.kill()
    done = run([*command, "--resume"], timeout=1800)
    assert "Traceback" not in done.stderr and done.returncode in (0, 1), done.stderr
    assert [file.name for file in folder.iterdir() if "killed" in file.name] == [path.name]
    return path


@pytest.mark.nightly
@pytest.mark.parametrize("model", sorted((ROOT / "models").glob("*.py")), ids=lambda path: path.stem)
def test_any_model_comes_to_the_same_archive_whenever_its_run_is_killed(model, tmp_path):
    if model.stem == "cover_cad":
        pytest.importorskip("build123d")
    rng, whole, samples = random.Random(model.stem), tmp_path / "whole.nc", 5000
    begin = time.monotonic()
    done = run(
        [sys.executable, "-m", "tolcontact", "run", model, "--samples", str(samples), "--out", whole, "--quiet"], timeout=1800
    )
    assert done.returncode in (0, 1), done.stderr
    seconds = time.monotonic() - begin
    for _ in range(3):
        path = killed_at_random(model, samples, seconds, tmp_path, rng)
        assert_same_archive(path, whole)
        assert layout(path) == layout(whole)
