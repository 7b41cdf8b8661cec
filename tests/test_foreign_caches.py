"""The cache of machine code is used only if nobody else can have written to it: whoever does runs code as its reader."""

import hashlib
import os
import sys
from pathlib import Path

import pytest

from tests.helpers import posix_only, run
from tolcontact import code_cache

pytestmark = posix_only

NOBODY = 65534
CODE = b"code"
STORED = hashlib.blake2b(CODE, digest_size=32).digest() + CODE


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """A cache folder with one entry, of this user."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    code_cache.store("a", CODE)
    assert code_cache.load("a") == CODE
    return code_cache.cache_folder()


def is_root():
    return os.name == "posix" and os.geteuid() == 0


@pytest.mark.parametrize("umask", [0, 0o022, 0o077])
def test_it_is_private_whatever_the_umask(umask, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    before = os.umask(umask)
    try:
        code_cache.store("a", CODE)
    finally:
        os.umask(before)
    assert code_cache.load("a") == CODE
    modes = {path.stat().st_mode & 0o777 for path in (tmp_path / "other").rglob("*") if path.is_dir()}
    assert modes == {0o700}


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o720, 0o702])
def test_a_folder_that_others_can_write_to_is_not_used(mode, folder):
    folder.chmod(mode)
    assert code_cache.load("a") is None
    code_cache.store("b", CODE)
    assert not (folder / "b").exists()


@pytest.mark.parametrize("mode", [0o777, 0o772])
def test_nor_one_that_others_can_replace(mode, folder):
    folder.parent.chmod(mode)
    assert code_cache.load("a") is None
    folder.parent.chmod(mode | 0o1000)  # sticky, as the folder of temporary files: only its owner can rename it
    assert code_cache.load("a") == CODE


def test_nor_a_link_which_would_have_files_deleted_elsewhere(folder, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    folder.rename(elsewhere)
    (elsewhere / "letter").write_bytes(bytes(1000))
    folder.symlink_to(elsewhere)
    assert code_cache.load("a") is None
    code_cache.store("b", CODE, max_bytes=0)
    assert sorted(path.name for path in elsewhere.iterdir()) == ["a", "letter"]


def test_a_link_a_pipe_and_a_file_for_all_are_not_read(folder, tmp_path):
    (tmp_path / "planted").write_bytes(STORED)
    (folder / "link").symlink_to(tmp_path / "planted")
    os.mkfifo(folder / "pipe")  # nobody will ever write to it
    (folder / "open").write_bytes(STORED)
    (folder / "open").chmod(0o666)
    assert [code_cache.load(name) for name in ("link", "pipe", "open", "a")] == [None, None, None, CODE]
    code_cache.store("link", CODE)  # replaces the link, not its target
    assert code_cache.load("link") == CODE and (tmp_path / "planted").read_bytes() == STORED
    code_cache.store("b", CODE, max_bytes=0)
    assert (tmp_path / "planted").exists()


@pytest.mark.skipif(not is_root(), reason="only root may give files to another user")
def test_what_belongs_to_another_user_is_not_used(folder):
    os.chown(folder / "a", NOBODY, NOBODY)
    assert code_cache.load("a") is None
    code_cache.store("b", CODE)
    os.chown(folder, NOBODY, NOBODY)
    assert code_cache.load("b") is None
    os.chown(folder, 0, 0)
    os.chown(folder.parent, NOBODY, NOBODY)
    assert code_cache.load("b") is None


PLANTED = """
import os, sys
from pathlib import Path
os.setgid({nobody}); os.setuid({nobody})
try:
    Path(sys.argv[1]).write_bytes({stored!r})
except OSError as error:
    print(type(error).__name__)
"""


@pytest.mark.skipif(not is_root(), reason="only root may become another user")
def test_another_user_cannot_plant_a_file_in_it(folder):
    """In a folder for all the file can be planted, and is not read."""
    for ancestor in (folder, *folder.parents):
        if ancestor == Path("/tmp"):
            break
        ancestor.chmod(ancestor.stat().st_mode | 0o005)
    code = PLANTED.format(nobody=NOBODY, stored=STORED)
    assert "PermissionError" in run([sys.executable, "-c", code, folder / "b"]).stdout
    folder.chmod(0o777)
    assert run([sys.executable, "-c", code, folder / "b"]).stdout == "" and (folder / "b").exists()
    assert code_cache.load("b") is None
    folder.chmod(0o755)  # and not when the folder is closed again
    assert code_cache.load("b") is None and code_cache.load("a") == CODE
