"""Machine code is kept on disk for later processes, and everything goes on where that cannot be done."""

import os

import casadi as ca
import numpy as np
import pytest

from tolcontact.compilation.functions import adaptive, code_cache, native
from tolcontact.compilation.functions.adaptive import AdaptiveFunction
from tolcontact.compilation.functions.native import NativeFunction


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """A cache folder of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path))
    return code_cache.cache_folder()


@pytest.fixture
def compilings(monkeypatch):
    """What is compiled, instead of found."""
    seen, compiled = [], native._compiled
    monkeypatch.setattr(native, "_compiled", lambda module, key: seen.append(key) or compiled(module, key))
    return seen


def wave(factor=1.0):
    x = ca.SX.sym("x", 3)
    return ca.Function("wave", [x], [ca.sin(factor * x) / (x[0] + 2), ca.norm_2(x)])


INPUTS = [np.random.default_rng(2).uniform(-1, 1, (1001, 3))]


def results(function):
    return np.hstack(function(INPUTS))


def test_another_function_finds_the_code_and_gives_the_same_bits(folder, compilings):
    assert NativeFunction.from_cache(wave()) is None
    expected = results(NativeFunction(wave()))
    assert len(list(folder.iterdir())) == 1 and len(compilings) == 1
    found = NativeFunction.from_cache(wave())
    assert np.array_equal(results(found), expected) and len(compilings) == 1
    assert NativeFunction.from_cache(wave(1.5)) is None
    assert np.array_equal(results(AdaptiveFunction(wave())), expected) and len(compilings) == 1


def test_code_is_used_from_the_first_evaluation_on(monkeypatch, compilings):
    first = AdaptiveFunction(wave())
    expected = [results(first) for _ in range(1 + adaptive.MIN_COMPILED_CALLS // 1001)]  # the last one with machine code
    assert len(compilings) == 1 and (np.diff(expected, axis=0) == 0).all()
    monkeypatch.setattr(adaptive, "InterpretedFunction", lambda _: None)
    assert np.array_equal(results(AdaptiveFunction(wave())), expected[0]) and len(compilings) == 1


@pytest.mark.parametrize("left", [0, 10, -1])
def test_a_damaged_file_is_passed_over_and_replaced(left, folder, compilings):
    expected = results(NativeFunction(wave()))
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[:left] if left >= 0 else whole[:-100] + bytes(100))
    assert NativeFunction.from_cache(wave()) is None
    assert np.array_equal(results(NativeFunction(wave())), expected) and len(compilings) == 2
    assert file.read_bytes()[:32] == whole[:32] and NativeFunction.from_cache(wave()) is not None


def test_without_a_folder_it_compiles_anew(tmp_path, monkeypatch, compilings):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))  # not even root can make a folder in it
    for _ in range(2):
        assert np.isfinite(results(NativeFunction(wave()))).all() and NativeFunction.from_cache(wave()) is None
    assert len(compilings) == 2


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


def test_code_of_another_processor_or_translation_is_another_one(monkeypatch):
    key = native.key_of(wave())
    monkeypatch.setattr(native, "_surroundings", lambda: b"another processor")
    assert native.key_of(wave()) != key
