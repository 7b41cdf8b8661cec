"""The command line: what it prints and returns, which options it refuses, and which files it leaves alone."""

import contextlib
import io
import os
import re
import sys
from pathlib import Path

import pytest
import typer
from rich.cells import cell_len
from rich.console import Console

import tolcontact as tc
from tests.cases import MODELS
from tests.helpers import COMMAND, SCRIPTS, call, finish, run, start
from tests.model_scripts import GOOD, HEADER, write_model
from tests.test_report import data_of
from tolcontact.report import summary_text

OPTIONS = {
    "unknown resolution": (["--resolution", "precise"], ["resolution", "precise", "linearized, exact"]),
    "unknown objective": (["--objective", "least effort"], ["objective", "least effort", "locator stiffness"]),
    "seating without a force": (["--objective", "seating"], ["force"]),
    "unknown solver": (["--solver", "simplex"], ["simplex", "qpoases"]),
    "refused solver": (["--solver", "superscs"], ["refused", "wrong answers", "daqp"]),
    "too few samples": (["--samples", "0"], ["samples is 0"]),
    "negative seed": (["--seed", "-1"], ["seed is -1"]),
    "output in a folder that does not exist": (["--out", "nowhere/out.nc"], ["there is no folder", "nowhere", "make it"]),
    "output in a file": (["--out", "model.py/out.nc"], ["model.py", "is not a folder; choose another place"]),
    "output that is a folder": (["--out", "."], ["not a file"]),
    "output on a device that is no disk": (["--out", "/proc/out.nc"], ["/proc/out.nc", "cannot be written"]),
}


@pytest.mark.parametrize("mistake", OPTIONS)
def test_a_wrong_option_is_refused_before_the_run(mistake, tmp_path):
    options, expected = OPTIONS[mistake]
    done = call(tmp_path, "run", write_model(tmp_path), *options)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    for words in expected:
        assert words in done.stderr, done.stderr


@pytest.mark.slow
def test_an_existing_archive_is_not_overwritten_without_being_asked(tmp_path):
    model, out = write_model(tmp_path), ("--out", "out.nc", "--samples", "20")
    assert call(tmp_path, "run", model, *out).returncode == 0
    before = (tmp_path / "out.nc").read_bytes()
    again = call(tmp_path, "run", model, *out)
    assert again.returncode == 2 and "exists" in again.stderr
    assert (tmp_path / "out.nc").read_bytes() == before
    assert call(tmp_path, "run", model, *out, "--seed", "9", "--overwrite").returncode == 0
    assert (tmp_path / "out.nc").read_bytes() != before


@pytest.mark.slow
def test_a_comment_in_the_script_does_not_make_another_model(tmp_path):
    model = write_model(tmp_path)
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
    done = call(tmp_path, "run", write_model(tmp_path), "--out", "notes.nc", "--resume")
    assert done.returncode == 2
    assert (tmp_path / "notes.nc").read_text() == "these are notes\n"


def test_the_name_of_a_file_that_is_no_model_is_refused_with_those_that_are(tmp_path):
    for name in ("run.nc", "part.stl"):
        (tmp_path / name).touch()
    for command, name, words in (
        ("check", "run.nc", "expected one that ends in .py or .json; tolcontact summary and report show an archive\n"),
        ("run", "run.nc", "expected one that ends in .py or .json; tolcontact summary and report show an archive\n"),
        ("run", "part.stl", '"part.stl" is not the name of a model; expected one that ends in .py or .json\n'),
        ("view", "part.stl", "expected one that ends in .py, .json, .nc, .step, .stp\n"),
    ):
        done = call(tmp_path, command, name)
        assert (done.returncode, done.stdout) == (2, "") and done.stderr.endswith(words), done.stderr


@pytest.mark.slow
def test_results_go_to_stdout_in_80_columns_and_summary_repeats_them(tmp_path):
    bracketed = HEADER.replace('"top"', '"top [red]"')  # which is no markup
    model = write_model(tmp_path, {"whole": bracketed + "".join(GOOD.values())})
    ran = call(tmp_path, "run", model, "--samples", "200", "--out", "out.nc")
    told = call(tmp_path, "summary", "out.nc")
    assert ran.returncode == told.returncode == 0
    assert ran.stdout.startswith(told.stdout)
    assert max(map(len, told.stdout.splitlines())) <= 80
    for words in ("6 sigma", "variance", "out of specification", "touched by contact", "top [red]"):
        assert words in told.stdout


@pytest.mark.slow
def test_a_run_with_too_many_failures_exits_with_1(tmp_path):
    """A tab wider than its slot."""
    model = SCRIPTS / "model_tab.py"
    done = call(tmp_path, "run", model, "--samples", "50", "--resolution", "linearized")
    assert done.returncode == 1
    assert "50 realizations" in done.stderr
    assert "use --resolution exact" in " ".join(done.stdout.split())
    done = call(tmp_path, "run", model, "--samples", "50")
    assert done.returncode == 1
    told = " ".join(done.stdout.split())
    for words in ("50 not_assemblable", "pairs in conflict there: left side (50), right side (50)", "resolution: exact"):
        assert words in told


@pytest.mark.slow
def test_a_model_script_runs_by_itself(tmp_path):
    model = write_model(tmp_path)
    model.write_text(model.read_text() + "\nif __name__ == '__main__':\n    tc.main(assembly)\n")
    done = run([sys.executable, model, "--samples", "50"])
    assert done.returncode == 0 and "height" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fields", "said"), [("none", "not summed up"), ("50", "of at least the first 50 realizations"), ("all", None)]
)
def test_the_summary_says_of_how_many_realizations_magnitudes_are(fields, said, tmp_path):
    options = ["--samples", "100", "--solver", "daqp", "--surfaces", "0", "--fields", fields]
    done = call(tmp_path, "run", MODELS / "ra1.py", *options)
    below = done.stdout.split("over the surface of each part (mm)\n")[1].split("\ncontact\n")[0].splitlines()
    assert below[0] == said if said else below[0].startswith("part")
    assert any(line.startswith("top") for line in below) == (fields != "none")


def test_limits_alone_are_printed(archive, tmp_path):
    done = call(tmp_path, "summary", archive, "--limits")
    assert done.returncode == 0 and "Ppk as normal" in done.stdout and "touched by contact" not in done.stdout
    assert done.stdout.count("\nout of specification  ") == 2
    done = call(tmp_path, "summary", archive, "--limits", "--json")
    assert done.returncode == 2 and "--json and --limits" in done.stderr


def test_tables_are_as_wide_as_the_terminal(archive):
    with tc.open_archive(archive) as results:
        shown = summary_text(tc.summarize(results))
    heights = []
    for width in (80, 200):
        console = Console(width=width, force_terminal=True, file=io.StringIO())
        console.print(shown)
        lines = console.file.getvalue().splitlines()
        assert max(cell_len(re.sub("\x1b.*?m", "", line)) for line in lines) <= width
        heights.append(len(lines))
    assert heights[1] < heights[0]


@pytest.mark.slow
def test_on_a_terminal_a_bar_shows_how_far_a_run_is(tmp_path):
    command = [*COMMAND, "run", MODELS / "ra1.py", "--samples", "20000", "--solver", "daqp", "--surfaces", "0"]
    screen, terminal = pytest.importorskip("pty", reason="a terminal of POSIX").openpty()
    process, shown = start(command, cwd=tmp_path, stderr=terminal), b""
    os.close(terminal)
    with contextlib.suppress(OSError):  # the other end is closed
        while text := os.read(screen, 1 << 16):
            shown += text
    os.close(screen)
    done, quiet = finish(process), call(tmp_path, *command[len(COMMAND) :], "--quiet")
    assert re.search(r"ra1 ━+ 20000/20000 [\d ]+ a second, 0 s left", re.sub("\x1b.*?[a-zA-Z]", "", shown.decode()))
    assert quiet.stderr == "" and quiet.stdout == done.stdout


def test_a_model_is_checked_and_seen(monkeypatch, tmp_path):
    opened = []
    monkeypatch.setattr(typer, "launch", lambda path: opened.append(path))
    bad = write_model(tmp_path, {"contact": GOOD["contact"].replace("-z", "-w")})
    done = call(tmp_path, "check", bad, "--view")
    assert done.returncode == 2 and "-w" in done.stderr
    page = Path(opened[0]).read_text(encoding="utf-8")
    assert [part["name"] for part in data_of(page)["scene"]["parts"] if part["faulty"]] == ["base", "top"]
