"""Archives that were damaged, or made to mislead: one message, and nothing else happens."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import trimesh
import xarray as xr

import tolcontact as tc
from models import ra1
from tests.helpers import COMMAND, PAPER, call, compiled, model_in, nightly, posix_only, run, script
from tests.hostile import HOSTILE, make
from tolcontact import vocabulary
from tolcontact.errors import ArchiveError

CRASHES = ("measured is text",)  # the netCDF library, so only where it is another process's
# What is shown as it is written: checksums detect damage, not values that somebody wrote with the netCDF library.
HARMLESS = ("declared_at is an escape", "times", "iterations are huge", "iterations are negative", "measured is endless")
LIES = [name for name in HOSTILE if name not in CRASHES]
NAMES = [coordinate.name for coordinate in vocabulary.COORDINATES]


@pytest.fixture(scope="module")
def good(program, tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "ra1.nc"
    tc.run(program, samples=5000, out=path, surfaces=4).close()
    return path


@pytest.fixture(scope="module")
def said(good):
    return tc.summarize(good)


@pytest.fixture(scope="module")
def program():
    return compiled(ra1.assembly, solver="daqp", method=PAPER)


@pytest.fixture
def once(forked_reader, monkeypatch):
    """A file that has not changed is inspected once."""
    answers, answer = {}, forked_reader.answer

    def answer_once(command):
        question = (*command, Path(command[-3]).read_bytes())
        if question not in answers:
            answers[question] = answer(command)
        return answers[question]

    monkeypatch.setattr(forked_reader, "answer", answer_once)


@pytest.mark.slow
@pytest.mark.usefixtures("once")
@pytest.mark.parametrize("name", [*LIES[::4], *nightly(*(name for name in LIES if name not in LIES[::4]))])
def test_an_archive_with_a_lie_is_refused_in_one_line(name, good, program, tmp_path):
    path = tmp_path / "hostile.nc"
    make(good, path, name)
    before, refused = path.read_bytes(), []
    for use in (lambda: tc.summarize(path), lambda: model_in(path), lambda: resume(program, path)):
        try:
            use()
        except ArchiveError as error:
            refused.append(str(error))
            assert "\n" not in str(error) and "\x1b" not in str(error) and len(str(error)) < 1000
            assert path.read_bytes() == before
    assert refused or name in HARMLESS


def resume(program, path):
    tc.run(program, samples=5000, out=path, resume=True, surfaces=4).close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["runs tests", "title is an escape", "claims 1e12 realizations", "is deep", *CRASHES])
def test_the_command_refuses_with_code_2(name, good, tmp_path):
    path = tmp_path / "hostile.nc"
    make(good, path, name)
    done = run([*COMMAND, "summary", path]) if name in CRASHES else call(tmp_path, "summary", path)
    assert "Traceback" not in done.stderr and "\x1b" not in done.stdout + done.stderr
    assert done.returncode == (0 if name in ("runs tests",) else 2), done.stderr
    if name in CRASHES:
        assert "ArchiveError" in run(script("model_of", path)).stderr.splitlines()[-1]
        return
    with pytest.raises(ArchiveError):
        model_in(path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(6), *nightly(*range(6, 40))])
@pytest.mark.usefixtures("once")
def test_a_damaged_file_is_refused_or_says_what_it_said(seed, said, good, program, tmp_path):
    """Bytes changed anywhere, among the headers, or cut off: no other numbers ever."""
    rng = np.random.default_rng(seed)
    path, content = tmp_path / "damaged.nc", bytearray(good.read_bytes())
    where = len(content) if seed % 2 else 60_000
    for place in rng.integers(0, where, rng.choice([1, 4, 32])):
        content[place] ^= int(rng.integers(1, 256))
    path.write_bytes(content if seed % 4 else content[: rng.integers(len(content))])
    for use in (lambda: tc.summarize(path), lambda: xr.Dataset({"model": str(model_in(path))})):
        try:
            found = use()
        except ArchiveError:
            continue
        expected = said if "by_status" in found else xr.Dataset({"model": str(program.nominal.assembly)})
        assert found.identical(expected)


def test_damage_to_realizations_is_told_with_its_place(good, program, tmp_path):
    path, content = tmp_path / "damaged.nc", bytearray(good.read_bytes())
    with netCDF4.Dataset(good) as file:
        value = np.asarray(file["measured"][4500, 1, 0]).tobytes()
    assert content.count(value) == 1
    content[content.index(value)] ^= 1
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match='"measured" of realizations 0 to 4999 is not what was written'):
        tc.summarize(path)
    with pytest.raises(ArchiveError, match="is not what was written"):
        tc.run(program, samples=6000, out=path, resume=True, surfaces=4)
    with xr.open_dataset(path) as without_us, pytest.raises(RuntimeError):
        without_us["measured"].load()


@pytest.mark.slow
@pytest.mark.parametrize("count", [4900, *nightly(100)])
def test_realizations_that_were_taken_from_an_archive_can_be_summarized(count, good, tmp_path):
    with tc.open_archive(good) as whole:
        some = whole.map_over_datasets(
            lambda group: group.isel(realization=slice(count)) if "realization" in group.dims else group
        )
        some.to_netcdf(tmp_path / "some.nc")
    found = tc.summarize(tmp_path / "some.nc")
    assert found.attrs["realizations"] == found.attrs["samples"] == count


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("format is newer", "has format 99, and this version of tolcontact reads format 1; run the model again, or use"),
        ("no format", "is not an archive of tolcontact: it states no format"),
    ],
)
def test_another_format_is_named(fault, message, good, tmp_path):
    make(good, tmp_path / "other.nc", fault)
    with pytest.raises(ArchiveError, match=message):
        tc.open_archive(tmp_path / "other.nc")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["part_", "état", *nightly(*NAMES, "x" * 200, "part__", "sum", "vertices", "e\u0301tat", "a b", "点")],
)
def test_things_may_be_called_like_dimensions_of_the_archive(name, tmp_path):
    a = tc.Assembly(name)
    below = a.part(f"{name}_", tc.Box(20, 20, 5))
    above = a.part(name, tc.Mesh(trimesh.creation.box(bounds=[[0, 0, 0], [10, 10, 5]])), at=(5, 5, 5))
    for part in (below, above):
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=1), tolerance=0.1)
    a.contact(name, moving=above.face("-z"), reference=below.face("+z"), points=20)
    a.measure(name, above.point(5, 5, 5), along="z", tolerance=0.1)
    path = tmp_path / "named.nc"
    with tc.run(compiled(a, solver="daqp"), samples=100, out=path) as results:
        found = tc.summarize(results)
    assert found["statistic_value"].sel(measure=name).notnull().any()
    assert found["field_extreme"].sel(part=name).notnull().all()
    with xr.open_datatree(path) as tree:  # without us
        groups = {str(group.attrs["part"]): key for key, group in tree["field"].children.items()}
        assert set(groups) == {name, f"{name}_"} and len(set(groups.values())) == 2
    assert str(model_in(path)) == str(a)
    tc.run(a, samples=200, solver="daqp", out=path, resume=True).close()


@posix_only
def test_archives_are_inspected_by_forks_in_these_tests(good, forked_reader, monkeypatch):
    asked, answer = [], forked_reader.answer
    monkeypatch.setattr(forked_reader, "answer", lambda command: asked.append(command) or answer(command))
    model_in(good)
    assert asked


def test_a_file_that_is_no_archive_is_refused_with_what_is_expected(tmp_path):
    path = tmp_path / "part.step"
    path.write_text("ISO-10303-21;")
    with pytest.raises(ArchiveError, match=r"part\.step.*expected an undamaged archive, as tolcontact run writes it"):
        tc.summarize(path)
