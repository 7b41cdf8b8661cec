"""Machine code is kept on disk for later processes, and everything goes on where that cannot be done."""

import os
import sys
from importlib.metadata import version
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from llvmlite import binding

from tests.helpers import run
from tolcontact import code_cache
from tolcontact.compilation.functions import native
from tolcontact.compilation.functions.named import MIN_COMPILED_CALLS, NamedFunction
from tolcontact.compilation.functions.native import NativeFunction, host_description, key_of


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """A cache folder of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path))
    return code_cache.cache_folder()


def wave(factor=1.0):
    x = ca.SX.sym("x", 3)
    return ca.Function("wave", [x], [ca.sin(factor * x) / (x[0] + 2), ca.norm_2(x)])


INPUTS = [np.random.default_rng(2).uniform(-1, 1, (1001, 3))]


def results(function):
    return np.hstack(function(INPUTS) if isinstance(function, NativeFunction) else [*function(i0=INPUTS[0]).values()])


def test_another_function_finds_the_code_and_gives_the_same_bits(folder):
    assert NativeFunction.from_cache(wave()) is None
    expected = results(NativeFunction(wave()))
    (file,) = folder.iterdir()
    stored = file.stat().st_ino  # of another file, were it compiled again
    found = NativeFunction.from_cache(wave())
    assert np.array_equal(results(found), expected)
    assert NativeFunction.from_cache(wave(1.5)) is None
    assert np.array_equal(results(NamedFunction(wave())), expected)
    assert [file.stat().st_ino for file in folder.iterdir()] == [stored]


def test_evaluations_of_earlier_processes_count():
    function, calls = NamedFunction(wave()), MIN_COMPILED_CALLS // 1001
    expected = [results(function) for _ in range(calls)]
    assert function.native is None
    del function  # as the end of a process would
    other, again = NamedFunction(wave(1.5)), NamedFunction(wave())
    results(other)
    assert other.native is None
    assert np.array_equal(results(again), expected[0])
    assert again.native is not None


def test_a_function_is_compiled_once_when_it_was_evaluated_often(folder):
    function, files = NamedFunction(wave()), set()
    calls = 1 + MIN_COMPILED_CALLS // 1001
    expected = []
    for call in range(calls + 3):
        expected.append(results(function))
        assert (function.native is not None) == (call >= calls - 1)
        files |= {file.stat().st_ino for file in folder.glob("*")}
    assert len(files) == 1 and (np.diff(expected, axis=0) == 0).all()


def test_code_is_used_from_the_first_evaluation_on():
    """Under the key of a function lies the code of another one: it evaluates as that one does."""
    expected = results(NativeFunction(wave(1.5)))
    code_cache.store(key_of(wave()), code_cache.load(key_of(wave(1.5))))
    assert np.array_equal(results(NamedFunction(wave())), expected)


@pytest.mark.parametrize("left", [0, 10, -1])
def test_a_damaged_file_is_passed_over_and_replaced(left, folder):
    expected = results(NativeFunction(wave()))
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[:left] if left >= 0 else whole[:-100] + bytes(100))
    assert NativeFunction.from_cache(wave()) is None
    assert np.array_equal(results(NativeFunction(wave())), expected)
    assert file.read_bytes()[:32] == whole[:32] and NativeFunction.from_cache(wave()) is not None


def test_without_a_folder_it_compiles_anew(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))  # not even root can make a folder in it
    for _ in range(2):
        assert np.isfinite(results(NativeFunction(wave()))).all() and NativeFunction.from_cache(wave()) is None


def test_the_least_recently_used_code_goes_first(folder):
    for name in "abc":
        code_cache.store(name, bytes(1000))
    for age, name in ((50, "a"), (100, "b"), (75, "c")):
        file = folder / name
        then = file.stat().st_mtime - age
        os.utime(file, (then, then))
    assert code_cache.load("b") == bytes(1000)  # which is a use
    code_cache.store("d", bytes(1000), max_bytes=3 * 1032)
    assert sorted(file.name for file in folder.iterdir()) == ["a", "b", "d"]


def test_code_of_another_processor_or_translation_is_another_one():
    host = host_description()
    parts = (binding.get_host_cpu_name().encode(), Path(native.__file__).read_bytes(), version("llvmlite").encode())
    assert all(part in host for part in parts)
    assert key_of(wave()) == key_of(wave(), host) != key_of(wave(), host + b"another processor")


LIMITED = """import resource
from pathlib import Path
import casadi as ca
from tolcontact.compilation.functions.native import NativeFunction
x = ca.SX.sym("x", 8)
y = x[0]
for k in range(10_000):
    y = y * x[k % 8] + x[7 * k % 8]
function = ca.Function("f", [x], [y])
pages = int(Path("/proc/self/statm").read_text().split()[0])
resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + {room},) * 2)
try:
    NativeFunction(function)
    print("compiled")
except MemoryError as error:
    print(error)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="other systems do not limit the address space")
@pytest.mark.parametrize(("room", "words"), [(1 << 28, "compiled"), (1 << 26, "address space is limited")])
def test_code_is_not_compiled_where_the_compiler_would_end_the_process(room, words):
    done = run([sys.executable, "-c", LIMITED.format(room=room)])
    assert done.returncode == 0 and done.stdout.startswith(words), done.stderr
