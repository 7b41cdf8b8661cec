"""Files of shapes are read by another process: none ends or stalls this one."""

import contextlib
import io
import pickle
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import tolcontact as tc
from tests.forked_shape_reader import ForkedShapeReader
from tests.helpers import finish, posix_only, run, script, start
from tests.shapes import BLOCK, refusal, shape
from tests.step_files import Step, step_block
from tolcontact import shape_worker
from tolcontact.child import TIME_LIMIT, crash, environment
from tolcontact.discretization import discretize


def crashing():
    """The direction of an edge is a vertex: its reader runs into memory that is not its own."""
    return re.sub(r"VECTOR\('',#\d+", "VECTOR('',#15", step_block(), count=1)


def stalling():
    """A ball of 1 km beside many points that make its file look small: its reader cuts it into triangles for ever."""
    made = Step()
    for _ in range(300):
        made.point((0, 0, 0))
    made.product("ball", [made.ball(1e6)])
    return str(made)


def alone(folder, *names):
    """The faults of some files in a folder, from another process, which they may end or stall."""
    done = run(script("read_shapes", 2, *names), cwd=folder, timeout=60)
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert done.stderr == ""
    return done.stdout


@pytest.mark.slow
def test_a_file_that_brings_its_reader_down_is_a_fault(tmp_path):
    (tmp_path / "rotten.step").write_text(crashing())
    said = alone(tmp_path, "rotten.step")
    assert "rotten.step" in said and "damaged" in said and "export it again" in said


@pytest.mark.slow
def test_a_file_that_stalls_its_reader_is_a_fault(tmp_path):
    (tmp_path / "endless.step").write_text(stalling())
    said = alone(tmp_path, "endless.step")
    assert "endless.step" in said and "took too long" in said and "within 2 s of processor time" in said


def test_numbers_that_are_not_finite_are_named(tmp_path):
    for number in ("NaN", "-inf", "1.E999"):
        content = re.sub(r"CARTESIAN_POINT\('',\(0.0", f"CARTESIAN_POINT('',({number}", step_block(), count=1)
        said = refusal(tmp_path / "endless.step", content)
        assert f"holds the number {number}, which is not finite" in said and "export it again" in said
    (tmp_path / "named.step").write_text(step_block().replace("'part'", "'(inf)'"))
    assert shape(tc.Mesh(tmp_path / "named.step")).is_watertight


@pytest.mark.slow
def test_all_faults_are_said_at_once_though_the_reader_dies_twice(tmp_path):
    (tmp_path / "rotten.step").write_text(crashing())
    (tmp_path / "rotten too.step").write_text(crashing())
    (tmp_path / "empty.stl").touch()
    (tmp_path / "good.step").write_text(step_block())
    (tmp_path / "notes.obj").write_bytes(b"these are notes\n")
    said = alone(tmp_path, "rotten.step", "good.step", "rotten too.step", "empty.stl", "notes.obj")
    for name in ("rotten.step", "rotten too.step", "empty.stl", "notes.obj"):
        assert name in said
    assert "good.step" not in said


def test_each_file_is_read_once_and_one_process_reads_them_all(tmp_path, monkeypatch):
    started, popen = [], subprocess.Popen

    class Noting(popen):
        """A process that notes what is written to it."""

        def __init__(self, *arguments, **keywords):
            super().__init__(*arguments, **keywords)
            started.append(io.BytesIO())
            stream, self.stdin = self.stdin, SimpleNamespace(flush=lambda: stream.flush(), close=lambda: stream.close())
            self.stdin.write = lambda content: [file.write(content) for file in (started[-1], stream)]

    monkeypatch.setattr(subprocess, "Popen", Noting)
    a = tc.Assembly("many")
    for k, name in enumerate(("a.stl", "b.ply", "a.stl", "c.step")):
        if name == "c.step":
            (tmp_path / name).write_text(step_block())
        else:
            BLOCK.export(tmp_path / name)
        a.part(f"part {k}", tc.Mesh(tmp_path / name, units="mm" if name != "c.step" else None), fixed=True)
    a.measure("height", a.parts[0].point(0, 0, 30), along="z")
    with contextlib.suppress(tc.TolcontactError):
        discretize(a)
    (jobs,) = started
    end = jobs.seek(0, io.SEEK_END)
    jobs.seek(0)
    assert [Path(pickle.load(jobs).path).name for _ in range(3)] == ["a.stl", "b.ply", "c.step"] and jobs.tell() == end


@pytest.mark.slow
@posix_only
def test_the_reader_ends_with_an_interrupted_process(tmp_path):
    (tmp_path / "endless.step").write_text(stalling())
    process = start(script("read_shapes", 50, "endless.step"), cwd=tmp_path)
    try:
        end = time.monotonic() + 40
        while not (readers := children(process.pid)) and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(2)  # it is in the middle of it, and would end by itself after 50 s
        process.send_signal(signal.SIGINT)
        assert finish(process, timeout=40).returncode != 0
        assert readers and not any(Path(f"/proc/{reader}").exists() for reader in readers)
    finally:
        process.kill()
        process.wait()


@posix_only
def test_files_are_read_by_forks_in_these_tests(tmp_path, monkeypatch):
    started, starts = [], ForkedShapeReader.start
    monkeypatch.setattr(ForkedShapeReader, "start", lambda *arguments: started.append(arguments) or starts(*arguments))
    BLOCK.export(tmp_path / "block.stl")
    assert shape(tc.Mesh(tmp_path / "block.stl", units="mm")).is_watertight and started


def test_a_new_process_reads_the_files_if_the_early_one_is_gone(tmp_path, early_process):
    early_process.kill()
    early_process.wait()
    (tmp_path / "block.step").write_text(step_block())
    assert shape(tc.Mesh(tmp_path / "block.step")).is_watertight


def test_a_process_that_nobody_needs_ends_with_its_parent(early_process):
    with early_process.stdin:
        pass
    assert early_process.wait(timeout=60) == 0


@pytest.mark.parametrize(
    "code, name",
    [(0, ""), (1, ""), (-11, "signal 11, SIGSEGV"), (-99, "signal 99"), (0xC0000005, "exception 0xc0000005")],
)
def test_exit_codes_of_crashes_are_told_on_all_systems(code, name):
    assert crash(code) == name


def test_the_process_limits_its_own_processor_time():
    limited = "from tolcontact.child import limit_resources; limit_resources(2**33, seconds=1)\nwhile True: pass"
    done = subprocess.run([sys.executable, "-c", limited], env=environment(), timeout=300, check=False)
    assert done.returncode == TIME_LIMIT


@pytest.mark.parametrize("text", ["tc.Box(1, 1, 1)", "step = 1; step.stp", "# see block.step for its shape"])
def test_no_process_is_started_for_models_without_step_files(tmp_path, text):
    (tmp_path / "model.py").write_text(text)
    assert shape_worker.start_early([str(tmp_path / "model.py"), str(tmp_path / "none.step"), "run.nc", "\0"]) is None


def children(pid):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return []


def test_nothing_is_printed_and_nothing_left_behind(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    refusal(tmp_path / "rotten.step", step_block().replace("VERTEX_POINT", "VERTEX_PINT"))
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == ["rotten.step"]
    assert np.isfinite(shape(tc.Mesh(BLOCK)).vertices).all()
