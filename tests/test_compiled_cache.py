"""Compiled functions are kept on disk where that is possible, and work where it is not."""

import os
import shutil
import sys
from pathlib import Path

import pytest

import tolcontact
from tests.helpers import finish, nightly, run, script, start

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """A copy of the package of its own, whose compiled functions are in its cache."""
    copy = tmp_path_factory.mktemp("warm") / "site"
    shutil.copytree(Path(tolcontact.__file__).parent, copy / "tolcontact", ignore=shutil.ignore_patterns("__pycache__"))
    assert count(copy) == (0, 1)
    return copy


@pytest.fixture
def installed(warm, tmp_path):
    return shutil.copytree(warm, tmp_path / "site")


def count(site, *options, **environment):
    """Hits and misses of the cache in a process of its own that imports the package from `site`."""
    return counted(started(site, *options, **environment))


def started(site, *options, **environment):
    python, *named = script("count_compiled")
    return begin([python, *options, *named], site, {**os.environ, "NUMBA_CACHE_DIR": "", **environment})


def begin(command, site, environment):
    known = {**environment, "PYTHONPATH": str(site)}
    return start(command, env=known, cwd=site)


def counted(begun):
    done = finish(begun)
    assert done.returncode == 0, done.stderr
    hits, misses = done.stdout.split()
    return int(hits), int(misses)


def cached(site, kind):
    (file,) = (site / "tolcontact/statistics/__pycache__").glob(f"kernel.add_magnitudes-*.{kind}")
    return file


def test_a_second_process_finds_it_compiled(installed):
    assert count(installed) == (1, 0)
    assert count(installed, "-O") == (1, 0)


@pytest.mark.parametrize(
    ("kind", "left"),
    [
        ("nbc", "half"),
        *nightly(("nbi", "garbage"), ("nbi", "nothing"), ("nbc", "nothing"), ("nbc", "another pickle")),
    ],
)  # fmt: skip
def test_a_damaged_file_is_replaced(kind, left, installed):
    file = cached(installed, kind)
    whole = file.read_bytes()
    file.write_bytes({
        "nothing": b"", "half": whole[: len(whole) // 2],
        "garbage": b"\x80\x05garbage" * 50, "another pickle": b"\x80\x04K\x05.",
    }[left])  # fmt: skip
    assert count(installed) == (0, 1)
    assert count(installed) == (1, 0)


def test_a_damaged_file_that_cannot_be_replaced_is_passed_over(installed, tmp_path):
    """A folder where files should be stands for what even root cannot write to."""
    for kind in ("nbi", "nbc"):
        file = cached(installed, kind)
        file.unlink()
        file.mkdir()
        assert count(installed) == (0, 1)
        file.rmdir()


def test_without_a_place_to_write_it_compiles_anew(installed):
    shutil.rmtree(installed / "tolcontact/statistics/__pycache__")
    (installed / "tolcontact/statistics/__pycache__").write_text("in the way")
    assert count(installed, HOME="/dev/null", XDG_CACHE_HOME="/dev/null") == (0, 1)


def test_several_processes_may_begin_at_once(installed):
    shutil.rmtree(installed / "tolcontact/statistics/__pycache__")
    begun = [started(installed) for _ in range(3)]
    assert all(sum(counted(one)) == 1 for one in begun)
    assert count(installed) == (1, 0)


READ = "-all,+dac_read_search"  # everything may be read
AS_NOBODY = ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"]
AS_NOBODY += [f"--bounding-set={READ}", f"--inh-caps={READ}", f"--ambient-caps={READ}"]


@pytest.fixture
def nobody():
    """The command that makes one run as a user who can write nowhere."""
    done = shutil.which("setpriv") and run([*AS_NOBODY, sys.executable, "-c", ""])
    if not done or done.returncode:
        pytest.skip("only root may become another user")
    return AS_NOBODY


@pytest.mark.parametrize("home", ["not writable", *nightly("writable", "missing")])
def test_another_user_may_use_it(home, installed, nobody, tmp_path):
    """Who can read the package, but not write to it."""
    folder = tmp_path / "home"
    if home != "missing":
        folder.mkdir()
        folder.chmod(0o777 if home == "writable" else 0o755)
    known = {**os.environ, "HOME": str(folder)}
    for name in ("XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        known.pop(name, None)
    found = [counted(begin([*nobody, *script("count_compiled")], installed, known)) for _ in range(2)]
    assert found == [(0, 1), (1, 0) if home == "writable" else (0, 1)]
