"""Title blocks: in scripts, archives, JSON and on the command line."""

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import assembly_of, call
from tolcontact.errors import OptionError
from tolcontact.report import write_page

BLOCK = tc.TitleBlock(
    title="Lid <A&B>", part_number="4711-02", author="É. Noether", revision="C", date="25 Nov", company="Ω Ltd"
)


def titled(block):
    a = cases.one_dimensional(6)
    a.title_block = block
    return a


def entries_in(results):
    """The entries of a title block in the attributes of an archive."""
    return {name: text for name, text in results.attrs.items() if name.startswith("document_")}


def test_an_archive_holds_the_block_and_the_page_shows_it(tmp_path):
    with tc.run(titled(BLOCK), samples=20, solver="daqp", out=tmp_path / "a.nc") as results:
        assert entries_in(results) == BLOCK.attributes and tc.io.model_of(results).title_block == BLOCK
        write_page(results, tc.summarize(results), tmp_path / "page.html")
        write_page(results, tc.summarize(results), tmp_path / "other.html", tc.TitleBlock(title="Other"))
    page, other = ((tmp_path / f"{name}.html").read_text(encoding="utf-8") for name in ("page", "other"))
    assert "<h1>Lid &lt;A&amp;B&gt;</h1>" in page
    for entry in ("4711-02", "É. Noether", "Ω Ltd", "25 Nov"):
        assert entry in page and entry not in other
    assert "<h1>Other</h1>" in other


def test_an_archive_without_a_block_has_none():
    results = tc.run(titled(None), samples=20, solver="daqp")
    assert not entries_in(results)
    assert tc.io.model_of(results).title_block is None


def test_a_changed_block_does_not_keep_a_run_from_being_resumed(tmp_path):
    tc.run(titled(BLOCK), samples=20, solver="daqp", out=tmp_path / "a.nc").close()
    with tc.run(titled(tc.TitleBlock(revision="D")), samples=40, solver="daqp", out=tmp_path / "a.nc", resume=True) as results:
        assert results.sizes["realization"] == 40


def test_a_resumed_run_says_that_it_keeps_its_title(tmp_path):
    model = str(cases.MODELS / "ra1.py")
    options = ["--out", tmp_path / "a.nc", "--solver", "daqp", "--resume", "--title", "Other"]
    begun = call(tmp_path, "run", model, "--samples", "20", *options)
    resumed = call(tmp_path, "run", model, "--samples", "40", *options)
    assert begun.returncode == resumed.returncode == 0, resumed.stderr
    assert "keeps the title block" not in begun.stderr
    assert "a.nc keeps the title block that it was begun with; another one for its page: tolcontact report" in resumed.stderr


@pytest.mark.parametrize(
    ("block", "said"),
    [(tc.TitleBlock(title="two\nlines"), "text of one line"), (tc.TitleBlock(author=7), "author is 7"),
     (tc.TitleBlock(company="x" * 201), "company has 201 characters")],
)  # fmt: skip
def test_faults_are_named(block, said):
    with pytest.raises(tc.ModelError, match=said):
        tc.run(titled(block), samples=20)


def test_wrong_types_are_refused_where_they_are_given():
    with pytest.raises(TypeError, match=r"title_block is a dict; expected tc.TitleBlock"):
        tc.Assembly("a", title_block={"title": "x"})
    with pytest.raises(OptionError, match="revision is 'a\\\\nb'"):
        BLOCK.overridden({"revision": "a\nb"})


def test_the_command_line_replaces_entries(tmp_path):
    model = tmp_path / "m.py"
    model.write_text(
        "import tolcontact as tc\n\n\ndef assembly():\n"
        "    a = tc.Assembly('a', title_block=tc.TitleBlock(title='Old', author='A. B.'))\n"
        "    b = a.part('b', tc.Box(10, 20, 10))\n"
        "    a.locate(b, tc.three_two_one(b.face('-z'), b.face('-y'), b.face('-x')), tolerance=1)\n"
        "    a.measure('height', b.point(5, 5, 10), along='z', tolerance=1)\n    return a\n"
    )
    done = call(tmp_path, "run", model, "--samples", "20", "--out", "a.nc", "--title", "New", "--part-number", "12")
    assert done.returncode == 0, done.stderr
    with tc.open_archive(tmp_path / "a.nc") as results:
        assert entries_in(results) == tc.TitleBlock(title="New", author="A. B.", part_number="12").attributes
    done = call(tmp_path, "report", "a.nc", "--revision", "Z9")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert done.returncode == 0 and "<h1>New</h1>" in page and "Z9" in page and "A. B." in page
    assert call(tmp_path, "report", "a.nc", "--title", "a\nb").returncode == 2


def test_json_models_have_blocks(tmp_path):
    document = (
        '{"name": "a", "title_block": {"title": "T", "date": "today"}, "parts": [{"name": "b", "geometry": {"box": [1, 2, 3]}, '
        '"fixed": true}], "measures": [{"name": "h", "of": {"part": "b", "position": [0, 0, 3]}, "along": [0, 0, 1]}]}'
    )
    (tmp_path / "a.json").write_text(document)
    assert assembly_of(tmp_path / "a.json").title_block == tc.TitleBlock(title="T", date="today")
    (tmp_path / "b.json").write_text(document.replace('"date"', '"dates"'))
    with pytest.raises(tc.errors.ScriptError, match="title_block"):
        assembly_of(tmp_path / "b.json")
