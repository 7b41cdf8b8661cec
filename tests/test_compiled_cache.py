"""Compiled functions are kept on disk where that is possible, and work where it is not."""

import os
import shutil
from pathlib import Path

import pytest

import tolcontact
from tests.helpers import finish, nightly, posix_only, script, start

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """A cache that holds the compiled function."""
    home = tmp_path_factory.mktemp("warm")
    assert count(home) == (0, 1)
    return home


@pytest.fixture
def home(warm, tmp_path):
    return shutil.copytree(warm, tmp_path / "home")


def count(home, *options, **environment):
    """Hits and misses of the cache in a process of its own whose caches lie in `home`."""
    return counted(started(home, *options, **environment))


def started(home, *options, **environment):
    python, *named = script("count_compiled")
    known = {**os.environ, "HOME": str(home), **environment}
    known.pop("XDG_CACHE_HOME", None)
    return start([python, *options, *named], env=known, cwd=home)


def counted(begun):
    done = finish(begun)
    assert done.returncode == 0, done.stderr
    hits, misses = done.stdout.split()
    return int(hits), int(misses)


def test_a_second_process_finds_it_compiled(home):
    assert count(home) == (1, 0)
    assert count(home, "-O") == (1, 0)


def test_without_a_place_to_write_it_compiles_anew(home):
    assert count(home, HOME="/dev/null") == (0, 1)


@pytest.mark.nightly
def test_several_processes_may_begin_at_once(tmp_path):
    begun = [started(tmp_path) for _ in range(3)]
    assert all(sum(counted(one)) == 1 for one in begun)
    assert count(tmp_path) == (1, 0)


def test_a_change_in_a_kernel_of_the_package_is_noticed(tmp_path):
    """A compiled function may call one of another file, which Numba would not look at."""
    package = shutil.copytree(Path(tolcontact.__file__).parent, tmp_path / "tolcontact")
    counts = [count(tmp_path, PYTHONPATH=str(tmp_path)) for _ in range(2)]
    with (package / "geometry/vector_kernel.py").open("a") as kernel:
        kernel.write("# changed\n")
    assert [*counts, count(tmp_path, PYTHONPATH=str(tmp_path))] == [(0, 1), (1, 0), (0, 1)]


def test_all_that_is_written_lies_in_the_cache_folder(tmp_path):
    """So a package in a folder that is read-only is cached, too."""
    package = shutil.copytree(Path(tolcontact.__file__).parent, tmp_path / "tolcontact")
    assert count(tmp_path, "-B", PYTHONPATH=str(tmp_path)) == (0, 1)
    assert not list(package.rglob("*.nb[ci]"))
    assert len(list((tmp_path / ".cache/tolcontact/numba").rglob("*.nb[ci]"))) == 2


@pytest.mark.parametrize("home", ["own", *nightly("not writable", "writable", "missing")])
@posix_only
def test_another_user_may_use_it(home, nobody, tmp_path):
    """Who can read the package, but not write to it."""
    folder = tmp_path / "home"
    if home != "missing":
        folder.mkdir()
        folder.chmod(0o777 if home == "writable" else 0o755)
    if home == "own":
        os.chown(folder, 65534, 65534)
    known = {**os.environ, "HOME": str(folder)}
    known.pop("XDG_CACHE_HOME", None)
    found = [counted(start([*nobody, *script("count_compiled")], env=known)) for _ in range(2)]
    assert found == [(0, 1), (1, 0) if home == "own" else (0, 1)]
