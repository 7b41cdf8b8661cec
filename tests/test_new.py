"""The model that beginners get."""

import pytest

from tests.helpers import assembly_of, call


@pytest.mark.parametrize("name", ["bracket", "bracket.py", "bracket.v2"])
def test_it_is_named_after_its_file(name, tmp_path):
    done = call(tmp_path, "new", name)
    path = tmp_path / f"{name.removesuffix('.py')}.py"
    assert (done.returncode, [*tmp_path.iterdir()]) == (0, [path]), done.stderr
    assert assembly_of(path).name == path.stem
    assert "NAME" not in path.read_text(encoding="utf-8")


def test_it_is_checked_and_run_as_it_is(tmp_path):
    done = call(tmp_path, "new", "été 2")
    assert done.returncode == 0 and done.stdout.splitlines()[1:] == ["next: tolcontact check 'été 2.py'"]
    assert "    tolcontact view 'été 2.py'\n" in (tmp_path / "été 2.py").read_text(encoding="utf-8")
    done = call(tmp_path, "check", "été 2.py")
    assert done.returncode == 0 and "no faults found" in done.stdout
    done = call(tmp_path, "run", "été 2.py", "--samples", "100", "--surfaces", "8")
    assert done.returncode == 0 and "corner height (mm): displacement, limits -0.2 to 0.3" in done.stdout


def test_a_file_that_is_there_is_left_alone(tmp_path):
    (tmp_path / "mine.py").write_text("# mine\n")
    done = call(tmp_path, "new", "mine")
    assert (done.returncode, done.stdout) == (2, "") and "exists already" in done.stderr
    assert (tmp_path / "mine.py").read_text() == "# mine\n"


def test_a_folder_that_is_not_there_is_said(tmp_path):
    done = call(tmp_path, "new", "nowhere/mine")
    assert (done.returncode, done.stdout) == (2, "") and "cannot be written" in done.stderr


@pytest.mark.parametrize("name", ["", ".hidden", " "])
def test_what_cannot_be_a_name_is_said(name, tmp_path):
    done = call(tmp_path, "new", name)
    assert (done.returncode, done.stdout) == (2, "") and "a name must be text that starts with" in done.stderr
    assert not [*tmp_path.iterdir()]
