"""Compiled functions are kept on disk where that is possible, and work where it is not."""

import hashlib
import os
import shutil

import pytest

from tests.helpers import finish, nightly, script, start
from tolcontact.compiled import compiled

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


def folder_of(home):
    return home / ".cache/tolcontact/code"


def cached(home):
    (file,) = folder_of(home).iterdir()
    return file


def test_a_second_process_finds_it_compiled(home):
    assert count(home) == (1, 0)
    assert count(home, "-O") == (1, 0)


@pytest.mark.parametrize("left", ["half", *nightly("nothing", "garbage", "another pickle")])
def test_a_damaged_file_is_replaced(left, home):
    file = cached(home)
    whole = file.read_bytes()
    pickled = b"\x80\x04K\x05."
    file.write_bytes({
        "nothing": b"", "half": whole[: len(whole) // 2], "garbage": b"\x80\x05garbage" * 50,
        "another pickle": hashlib.blake2b(pickled, digest_size=32).digest() + pickled,
    }[left])  # fmt: skip
    assert count(home) == (0, 1)
    assert count(home) == (1, 0)


def test_a_damaged_file_that_cannot_be_replaced_is_passed_over(home):
    """A folder where a file should be stands for what even root cannot write to."""
    file = cached(home)
    file.unlink()
    file.mkdir()
    assert count(home) == (0, 1)


def test_without_a_place_to_write_it_compiles_anew(home):
    assert count(home, HOME="/dev/null") == (0, 1)


def test_several_processes_may_begin_at_once(tmp_path):
    begun = [started(tmp_path) for _ in range(3)]
    assert all(sum(counted(one)) == 1 for one in begun)
    assert count(tmp_path) == (1, 0)


def caller(added):
    """A compiled function, always the same, that calls another one."""
    names = {"compiled": compiled}
    exec(f"@compiled\ndef called(x): return x + {added}\n@compiled\ndef calling(x): return called(x)\n", names)
    return names["calling"]


def test_a_change_in_a_function_that_it_calls_is_noticed(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found = []
    for added in (1, 2, 1):
        calling = caller(added)
        assert calling(1.0) == 1 + added
        found.append(sum(calling.stats.cache_hits.values()))
    assert found == [0, 0, 1]


@pytest.mark.parametrize("home", ["own", *nightly("not writable", "writable", "missing")])
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
