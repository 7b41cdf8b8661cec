"""Outputs of commands: none is an input, another output, or a file that is no such output."""

import os
import tempfile
import time

import pytest
from filelock import FileLock

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tolcontact.temporary import LOCK, PREFIX, temporary_folder

MODEL = """import tolcontact as tc
from tests import cases
def assembly():
    return cases.stack()
"""


@pytest.mark.parametrize("outputs, words", [
    (["--out", "a.html", "--report", "a.html"], '"a.html" would be the archive and the page'),
    (["--out", "m.py", "--overwrite"], '"m.py" would be the input and the archive'),
    (["--out", "other.py", "--overwrite"], '"other.py" is not the name of an archive; expected one that ends in .nc'),
    (["--out", "other.nc", "--overwrite"], '"other.nc" is no netCDF file, and only these are replaced'),
    (["--out", "A.html", "--report", "./sub/../a.html"], "would be the archive and the page"),
], ids=["page", "model", "ending", "other", "case"])  # fmt: skip
def test_no_output_replaces_an_input_or_another_output(outputs, words, tmp_path):
    (tmp_path / "sub").mkdir()
    for name in ("m.py", "other.py", "other.nc"):
        (tmp_path / name).write_text(MODEL)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    done = call(tmp_path, "run", "m.py", "--samples", "10", *outputs)
    assert done.returncode == 2
    assert words in done.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


@pytest.mark.parametrize("name", ["a.nc", "linked.nc", "hard.nc"])
def test_a_run_from_python_replaces_neither_its_model_nor_a_file_of_another_kind(name, tmp_path):
    tc.run(cases.stack(), samples=20, surfaces=0, fields="none", out=tmp_path / "a.nc").close()
    (tmp_path / "linked.nc").symlink_to("a.nc")
    (tmp_path / "hard.nc").hardlink_to(tmp_path / "a.nc")
    before = (tmp_path / "a.nc").read_bytes()
    with pytest.raises(tc.OptionError, match=f'{name}" would be the input and the archive'):
        tc.run(tmp_path / "a.nc", samples=20, out=tmp_path / name, overwrite=True)
    assert (tmp_path / "a.nc").read_bytes() == before


@pytest.mark.parametrize("name, words", [
    ("m.json", "would be the input and the JSON model"), ("./sub/../m.json", "would be the input and the JSON model"),
    ("m.py", "is not the name of a JSON model"), ("part.stl", "is not the name of a JSON model"),
], ids=["model", "other way", "script", "shape"])  # fmt: skip
def test_a_written_model_replaces_neither_itself_nor_a_file_of_another_kind(name, words, tmp_path):
    (tmp_path / "sub").mkdir()
    tc.io.write_model(cases.stack(), tmp_path / "m.json")
    for other in ("m.py", "part.stl"):
        (tmp_path / other).write_text("text")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(tc.OptionError, match=words):
        tc.io.write_model(tmp_path / "m.json", tmp_path / name)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def test_a_comparison_replaces_none_of_the_runs_that_it_compares(tmp_path):
    for name in ("a.nc", "b.nc"):
        tc.run(cases.stack(), samples=20, surfaces=0, fields="none", out=tmp_path / name).close()
    (tmp_path / "link.nc").hardlink_to(tmp_path / "a.nc")
    before = (tmp_path / "a.nc").read_bytes()
    done = call(tmp_path, "compare", "a.nc", "b.nc", "--out", "link.nc", "--overwrite")
    assert done.returncode == 2 and '"link.nc" would be the input and the comparison' in done.stderr
    assert (tmp_path / "a.nc").read_bytes() == before
    (tmp_path / "both.nc").touch()
    for name, words in (
        ("both.nc", '"both.nc" exists; choose another name, or replace it with --overwrite'),
        ("both.html", '"both.html" is not the name of a comparison; expected one that ends in .nc'),
    ):
        done = call(tmp_path, "compare", "a.nc", "b.nc", "--out", name)
        assert done.returncode == 2 and words in done.stderr and "--resume" not in done.stderr


def test_an_archive_has_the_ending_by_which_commands_know_it(tmp_path):
    """Without the ending an archive would be taken for a script by the commands that read both."""
    with pytest.raises(tc.errors.ArchiveError, match=r'a.html" is not the name of an archive; expected one that ends in .nc'):
        tc.run(cases.stack(), samples=20, out=tmp_path / "a.html")
    tc.run(cases.stack(), samples=20, surfaces=0, fields="none", out=tmp_path / "a.nc").close()
    (tmp_path / "a.archive").hardlink_to(tmp_path / "a.nc")
    refused = call(tmp_path, "seating", "a.nc", "--into", "a.archive")
    assert refused.returncode == 2 and '"a.archive" is not the name of an archive' in refused.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.archive", "a.nc"]


def test_the_folder_of_a_killed_run_is_removed_and_that_of_a_run_in_progress_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    killed, young, used, other = (tmp_path / name for name in (f"{PREFIX}killed", f"{PREFIX}young", f"{PREFIX}used", "other"))
    for folder in (killed, young, used, other):
        folder.mkdir()
        (folder / "results.nc").write_bytes(b"x")
        if folder != young:
            os.utime(folder, (time.time() - 1000,) * 2)
    (tmp_path / f"{PREFIX}link").symlink_to(other)
    with FileLock(used / LOCK):
        os.utime(used, (time.time() - 1000,) * 2)
        with temporary_folder() as folder:
            assert not killed.exists()
            assert all((path / "results.nc").exists() for path in (young, used, other))
    assert not folder.exists()
