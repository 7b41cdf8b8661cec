"""Insides of `report` under the claims of `tests/test_document.py`."""

from io import StringIO

import pytest
from rich.console import Console

import tolcontact as tc
from tests import cases
from tolcontact.report import summary_text
from tolcontact.report.table import Table


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("document") / "ra1.nc"
    tc.run(cases.ra1(), samples=1000, seed=1, solver="daqp", out=path, surfaces=8).close()
    return path


def test_headings_of_several_lines_stand_at_the_bottom(archive):
    with tc.open_archive(archive) as results:
        summary = tc.summarize(results)
    console = Console(width=80, file=StringIO(), highlight=False)
    console.print(summary_text(summary))
    lines = console.file.getvalue().splitlines()
    place = next(k for k, line in enumerate(lines) if line.endswith("specification"))
    assert lines[place - 1].strip() == "out of" and "mean" in lines[place] and max(map(len, lines)) <= 80
    console.print(Table("", ["a", "two\nlines"], [["x", "1"]]))
    assert [line.rstrip() for line in console.file.getvalue().splitlines()[-4:]] == [
        "     two",
        "a  lines",
        "────────",
        "x      1",
    ]


def test_a_label_stands_beside_the_first_line_of_its_figures_in_tables_that_are_too_wide():
    console = Console(width=80, file=StringIO(), highlight=False)
    label = "a label of many words that is wrapped since the table is too wide"
    console.print(Table("", ["", "mean", "two\nlines"], [[label, "1 [0, 2]", "3 [2, 4]"], ["b", f"{'9' * 40} [0, 2]", ""]]))
    lines = [line.rstrip() for line in console.file.getvalue().splitlines()]
    assert lines[0].endswith("two") and lines[1].split() == ["mean", "lines"]
    first = next(line for line in lines if line.startswith("a label"))
    assert first.split()[-2:] == ["1", "3"] and lines[lines.index(first) + 1].endswith("[0, 2]   [2, 4]")
