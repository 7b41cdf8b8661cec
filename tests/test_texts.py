"""Texts of models and files on their way out, whatever letters they have."""

import ast
import csv
import io
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from hypothesis import given, strategies

from tolcontact.texts import csv_cell, literal, sheet_cell

TEXTS = strategies.text(strategies.characters(exclude_categories=()), max_size=20)  # surrogates and all


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
