"""Texts of models and files on their way out, whatever letters they have."""

import ast
import csv
import io
import json
import re
import tempfile
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import openpyxl
import pytest
from hypothesis import HealthCheck, given, settings, strategies

import tolcontact as tc
from tests.helpers import call, compiled, nightly
from tolcontact.report import write_view
from tolcontact.texts import csv_cell, literal, sheet_cell, shown, shown_name

TEXTS = strategies.text(strategies.characters(exclude_categories=()), max_size=20)  # surrogates and all
STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
SLOWLY = {"deadline": None, "derandomize": True, "suppress_health_check": list(HealthCheck)}


@given(TEXTS)
def test_a_literal_is_read_back_as_it_was(text):
    written = literal(text)
    assert ast.literal_eval(written) == text
    assert len(written.splitlines()) == 1
    assert ast.literal_eval(f'""{written}""') == text  # as the docstring of a script
    written.encode()


@given(TEXTS)
def test_no_cell_of_a_csv_file_is_a_formula(text):
    file = io.StringIO(newline="")
    csv.writer(file).writerow([csv_cell(text), 1.5])
    ((cell, _),) = csv.reader(io.StringIO(file.getvalue(), newline=""))
    assert not cell.lstrip(" ").startswith(("=", "+", "-", "@", "\t", "\r"))
    assert cell.removeprefix("'") == sheet_cell(text).removeprefix("'")
    assert csv_cell(-1.5) == -1.5


@given(TEXTS)
def test_every_cell_of_a_spreadsheet_is_sound_xml(text):
    parsed = ElementTree.fromstring(f"<t>{escape(sheet_cell(text))}</t>").text or ""
    assert parsed == sheet_cell(text).replace("\r\n", "\n").replace("\r", "\n")


@given(TEXTS)
def test_what_is_printed_steers_no_terminal(text):
    assert not STEERING.search(shown(text)) and shown(shown(text)) == shown(text)
    assert len(shown_name(text).splitlines()) <= 1
    shown(text).encode()


class Tags(HTMLParser):
    """The tags of a page, counted, and its texts."""

    def __init__(self, page):
        super().__init__()
        self.counts, self.texts = Counter(), []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.counts[tag, *(name for name, _ in attrs)] += 1

    def handle_data(self, data):
        self.texts.append(data)


def page_of(name):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "page.html"
        write_view(tc.Assembly(name), None, ["a fault"], path)
        return path.read_text(encoding="utf-8")


@settings(max_examples=15, **SLOWLY)
@given(TEXTS)
def test_no_name_adds_a_tag_to_a_page(text):
    expected, actual = (Tags(page_of(name)) for name in ("x", text))
    assert actual.counts == expected.counts
    data = [[json.loads(words).keys() for words in tags.texts if words.startswith('{"')] for tags in (expected, actual)]
    assert data[0] == data[1] and data[0]


@settings(max_examples=100, **SLOWLY)
@given(TEXTS)
def test_a_file_has_the_name_that_is_asked_for_or_there_is_none(text):
    with tempfile.TemporaryDirectory() as folder:
        done = call(folder, "new", "--", text)
        files = [path.name for path in Path(folder).rglob("*")]
        assert (done.returncode, files) in [(2, []), (0, [f"{text.removesuffix('.py')}.py"])]


def judge(text):
    """Read a measurement's name from every output of a run, if it may have it."""
    model = tc.Assembly("block")
    block = model.part("block", tc.Box(50, 25, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    model.measure(text, block.point(0, 0, 10), along="z", tolerance=1)
    with tempfile.TemporaryDirectory() as folder:
        try:
            tc.run(compiled(model, solver="daqp"), samples=20, surfaces=0, fields="none", out=Path(folder) / "run.nc").close()
        except tc.ModelError as error:
            assert repr(text)[1:40] in str(error) or shown(text)[:40] in str(error)
            return
        printed, table, data, _, _ = (
            call(folder, *words)
            for words in (
                ("summary", "run.nc"), ("summary", "run.nc", "--csv"), ("summary", "run.nc", "--json"),
                ("report", "run.nc", "--xlsx", "run.xlsx"), ("report", "run.nc"),
            )
        )  # fmt: skip
        assert not STEERING.search(printed.stdout)
        assert {row[0] for row in csv.reader(io.StringIO(table.stdout))} == {"measure", csv_cell(text)}
        assert json.loads(data.stdout)["coords"]["measure"]["data"] == [text]
        (cell,) = list(openpyxl.load_workbook(Path(folder) / "run.xlsx")["Results"]["A"])[1:2]
        assert (cell.value, cell.data_type) == (sheet_cell(text), "s")
        with tc.open_archive(Path(folder) / "run.nc") as results:
            assert [str(name) for name in results.measure.values] == [text]
        assert shown(text) in "".join(Tags((Path(folder) / "run.html").read_text(encoding="utf-8")).texts)


@pytest.mark.slow
@pytest.mark.parametrize("examples", [3, *nightly(60)])
def test_every_output_has_the_name_that_was_declared(examples):
    settings(max_examples=examples, **SLOWLY)(given(strategies.one_of(TEXTS, TEXTS.map(lambda text: f"a{text}b")))(judge))()
