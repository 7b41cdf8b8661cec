"""Pages replace pages of tolcontact only, are written through no link, and run no scripts but their own."""

import base64
import hashlib
import re

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, ROOT, call, compiled
from tolcontact.replacing import replacing


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "run.nc"
    tc.run(compiled(cases.stack(), solver="daqp", method=PAPER), samples=50, out=path).close()
    return path


def test_a_foreign_file_is_replaced_only_if_that_is_asked_for(archive, tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<p>dear diary</p>")
    other = tmp_path / "other.nc"
    other.write_bytes(archive.read_bytes())
    commands = [
        ["report", archive, "--out", page], ["view", archive, "--out", page],
        ["compare", archive, other, "--report", page], ["run", "models/ra1.py", "--samples", 10, "--report", page],
    ]  # fmt: skip
    for command in commands:
        done = call(ROOT, *command)
        assert done.returncode == 2 and "is not a tolcontact page" in done.stderr and "--overwrite" in done.stderr, command
        assert page.read_text() == "<p>dear diary</p>"
    assert call(ROOT, "report", archive, "--out", page, "--overwrite").returncode == 0
    assert "dear diary" not in page.read_text()
    for command in commands[:3]:
        assert call(ROOT, *command).returncode == 0, command  # now it is a page of tolcontact


def test_the_default_name_of_a_report_is_no_exception(archive):
    page = archive.with_suffix(".html")
    page.write_text("mine")
    assert call(ROOT, "report", archive).returncode == 2 and page.read_text() == "mine"
    page.unlink()


def test_nothing_is_written_through_a_planted_link(archive, tmp_path):
    treasure = tmp_path / "treasure"
    treasure.write_text("gold")
    for name in (".page.html.part", ".run.nc.part", ".run.nc.lock"):
        (tmp_path / name).symlink_to(treasure)
    assert call(ROOT, "report", archive, "--out", tmp_path / "page.html").returncode == 0
    with pytest.raises(tc.errors.ArchiveError, match="cannot be written"):
        tc.run(compiled(cases.stack(), method=PAPER), samples=10, out=tmp_path / "run.nc")
    assert treasure.read_text() == "gold"


def test_a_file_that_fails_leaves_the_former_one_and_nothing_else(tmp_path):
    path = tmp_path / "a"
    path.write_text("before")
    with pytest.raises(OSError), replacing(path) as part:
        part.write_text("half")
        raise OSError
    assert path.read_text() == "before" and list(tmp_path.iterdir()) == [path]


def test_a_page_names_the_hashes_of_its_scripts_and_allows_no_others(archive, tmp_path):
    assert call(ROOT, "report", archive, "--out", tmp_path / "page.html").returncode == 0
    page = (tmp_path / "page.html").read_text()
    (policy,) = re.findall(r"script-src ([^;]*);", page)
    assert "unsafe" not in policy
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    hashes = [f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" for script in scripts]
    assert policy.split() == hashes and len(hashes) > 3
