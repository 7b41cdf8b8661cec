"""Spreadsheets: one sheet a table, numbers as numbers, and the same figures as the summary."""

import sys

import openpyxl
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled
from tolcontact.report import write_spreadsheet


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("sheets") / "ra1.nc"
    tc.run(compiled(cases.ra1(), solver="daqp"), samples=500, seed=1, out=path, surfaces=8).close()
    return path


def test_the_command_writes_a_sheet_for_each_table(archive, tmp_path):
    done = call(tmp_path, "report", archive, "--xlsx", "tables.xlsx", "--title", "=1+1", "--author", "@me")
    assert (done.returncode, done.stdout) == (0, "spreadsheet: tables.xlsx\n"), done.stderr
    assert [*tmp_path.iterdir()] == [tmp_path / "tables.xlsx"]
    book = openpyxl.load_workbook(tmp_path / "tables.xlsx")
    assert book.sheetnames == [
        "Document",
        "Results",
        "Statistics",
        "Contributors",
        "Contact",
        "Parts",
        "Locators",
        "Contact pairs",
        "Measurements",
    ]
    title = book["Document"]["B2"]
    assert (title.value, title.data_type) == ("=1+1", "s")  # a text, not a formula
    with tc.open_archive(archive) as results:
        summary = tc.summarize(results)
    heads, with_contact, without = book["Results"].iter_rows(values_only=True)
    assert (
        heads.index("lower limit") == 5 and with_contact[5:8] == (-0.5, 0.5, "with contact") and without[7] == "without contact"
    )
    for row, state in ((with_contact, "corrected"), (without, "raw")):
        expected = summary["statistic_value"].isel(measure=0).sel(state=state)
        assert row[8:11] == pytest.approx(expected.sel(statistic="mean").values)
        assert row[20:23] == pytest.approx(expected.sel(statistic="above limit").values)
    locators = [*book["Locators"].iter_rows(values_only=True)]
    assert len(locators) == 13 and locators[1][:2] == ("base", "A1") and locators[1][4] == 10
    shares = [row[2] for row in book["Contributors"].iter_rows(values_only=True, min_row=2)]
    assert shares == sorted(shares, reverse=True) and 50 < sum(shares) < 100


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("t.csv", "expected one that ends in .xlsx"),
        ("no/t.xlsx", "there is no folder"),
        ("old.xlsx", "replace it with --overwrite"),
    ],
)
def test_where_no_spreadsheet_can_be_is_said(name, said, archive, tmp_path):
    (tmp_path / "old.xlsx").write_text("mine")
    done = call(tmp_path, "report", archive, "--xlsx", name)
    assert done.returncode == 2 and said in done.stderr and (tmp_path / "old.xlsx").read_text() == "mine"


def test_without_openpyxl_the_message_says_how_to_install_it(archive, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with tc.open_archive(archive) as results, pytest.raises(tc.OptionError, match=r"pip install '\.\[xlsx\]'"):
        write_spreadsheet(results, tc.summarize(results), tmp_path / "t.xlsx")
    assert not [*tmp_path.iterdir()]


def test_archives_with_little_are_spreadsheets_too(tmp_path):
    a = tc.Assembly("alone")
    block = a.part("block", tc.Box(10, 20, 10))
    a.locate(block, cases.translating(0.1))
    a.measure("height", block.point(5, 5, 10), along="z")
    results = tc.run(compiled(a), samples=10, keep="measures")
    write_spreadsheet(results, tc.summarize(results), tmp_path / "t.xlsx")
    book = openpyxl.load_workbook(tmp_path / "t.xlsx")
    assert "Contact" not in book.sheetnames and "no deviations" in book["Contributors"]["B2"].value
