"""Spreadsheets of hostile names, opened by two programs, and damaged files of measured points, read a second time.

python -m studies.robustness.formats --spreadsheets 200 --scans 200 --seed 41

LibreOffice's converter is used where `soffice` is installed; every text of a cell has to be the one that openpyxl reads.
"""

import argparse
import codecs
import csv
import decimal
import importlib
import json
import random
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from studies.robustness.attempts import Table, attempt, write_table
from studies.robustness.files import stand
from studies.robustness.scripts import renamed
from tolcontact.errors import GeometryFault
from tolcontact.geometry.measured_points import measured_points

FILTER = "csv:Text - txt - csv (StarCalc):44,34,76,1,,0,false,true,false,false,false,-1"  # every sheet, in UTF-8
NUMBER = re.compile(rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
WORDS = (
    b"nan", b"inf", b"1e400", b"1e308", b"1e-320", b"1_0", "\u0661".encode(), b"0x10", b"1O.5", b"", b"1,5", b"1;2", b"--1",
    b"1e", b"+", b"\0", b"\xff\xfe", "\ufeff1".encode(), b"=1+1", b"9" * 5000, b"\x1b[31m", "\u2028".encode(), b"1\r2",
)  # fmt: skip
MODEL = """import tolcontact as tc
def assembly():
    model = tc.Assembly("stand")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    block.feature("foot", block.face("-z"), tc.Flatness(0.1, form=tc.Form(measured="s*.*")))
    model.measure("gap", tc.Gap(block.point(25, 12, 0), table.face("+z")))
    return model
"""


def spreadsheets(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Write spreadsheets of models with hostile names, and open them."""
    openpyxl = importlib.import_module("openpyxl")
    books: dict[str, dict[str, list[list[str]]]] = {}
    for number in range(count):
        document = renamed(stand(), rng)
        (folder / "m.json").write_text(json.dumps(document))
        ending = attempt(["run", "m.json", "--samples", "20", "--out", "m.nc", "--overwrite", "--quiet"], folder)
        if ending.code == 0:
            name = f"b{number}"
            ending = attempt(["report", "m.nc", "--xlsx", f"{name}.xlsx"], folder)
        fault = ending.fault or ("refused" if ending.code == 2 else "")
        if not fault:
            book = openpyxl.load_workbook(folder / f"{name}.xlsx")
            if any(cell.data_type not in "ns" for sheet in book for row in sheet for cell in row):
                fault = "a formula or an error"
            books[name] = {sheet.title: [[_text(cell.value) for cell in row] for row in sheet] for sheet in book}
        words = f"{document!r}: {ending.error[-400:]}"
        table.add("spreadsheets, openpyxl", fault or "opened", words, is_fault=fault not in ("", "refused"))
    if not books or shutil.which("soffice") is None:
        return
    files = [f"{name}.xlsx" for name in books]
    subprocess.run(
        ["soffice", "--headless", "--convert-to", FILTER, *files], cwd=folder, check=True, capture_output=True, timeout=1800
    )
    for name, sheets in books.items():
        fault = ""
        for title, rows in sheets.items():
            with (folder / f"{name}-{title}.csv").open(encoding="utf-8", newline="") as file:
                cells = list(csv.reader(file))
            for expected, actual in zip(rows, cells, strict=True):
                wrong = [
                    text for text, cell in zip(expected, actual, strict=False) if text and text != cell.replace("\r\n", "\n")
                ]
                fault = fault or (f"another text in {title}: {wrong[0]!r}, {actual!r}" if wrong else "")
        table.add("spreadsheets, LibreOffice", "another text" if fault else "opened", fault, is_fault=bool(fault))


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def scans(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Damage one file of measured points at a time: it is refused in one message, or read as a second reader reads it."""
    (folder / "m.py").write_text(MODEL)
    grid = np.stack(np.meshgrid(np.linspace(0, 50, 17), np.linspace(0, 25, 11)), axis=-1).reshape(-1, 2)
    heights = np.random.default_rng(0)
    sound = [np.column_stack([grid, heights.normal(0, 0.004, len(grid))]) for _ in range(4)]
    for number in range(count):
        for path in folder.glob("s*"):
            path.unlink()
        kind = rng.choice(("csv", "blanks", "semicolons", "ply"))
        for k, points in enumerate(sound):
            (folder / f"s{k}.{'ply' if kind == 'ply' else 'csv'}").write_bytes(_written(points, kind))
        victim = folder / f"s{rng.randrange(4)}.{'ply' if kind == 'ply' else 'csv'}"
        how, content = _damaged(victim.read_bytes(), rng)
        victim.write_bytes(content)
        ending = attempt(["check", "m.py"], folder, limit=120)
        fault = ending.fault
        if not fault and ending.code == 2 and ending.error.count("error: ") != 1:
            fault = "not one message"
        if not fault and ending.code == 0 and kind != "ply":
            try:
                points = measured_points(str(folder / "s*.*"))[victim]
                expected = np.array(list(_second_reading(content)), dtype=float)
                fault = "" if np.array_equal(points, expected) else "another number"
            except (GeometryFault, ValueError, decimal.InvalidOperation) as error:
                fault = f"read against {error}"
        words = f"{number} {kind} {how}: {ending.error[-400:]}"
        table.add(
            f"files of measured points, {kind}",
            fault or ("refused" if ending.code == 2 else "read"),
            words,
            is_fault=bool(fault),
        )


def _written(points: np.ndarray, kind: str) -> bytes:
    if kind == "ply":
        head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        return head.format(len(points)).encode() + b"".join(b"%.9g %.9g %.9g\n" % tuple(point) for point in points)
    mark = {"csv": b",", "blanks": b"  ", "semicolons": b"; "}[kind]
    return b"x%by%bz\n" % (mark, mark) + b"".join(mark.join(b"%.9g" % value for value in point) + b"\n" for point in points)


def _damaged(content: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return a kind of damage, and the file with it."""
    lines, row = content.splitlines(keepends=True), rng.randrange(len(content.splitlines()))
    match how := rng.choice(
        ("word", "word", "word", "byte", "cut", "line twice", "line lost", "column lost", "heading", "encoding")
    ):
        case "word":
            numbers = list(NUMBER.finditer(content))
            match_ = rng.choice(numbers)
            return how, content[: match_.start()] + rng.choice(WORDS) + content[match_.end() :]
        case "byte":
            place = rng.randrange(len(content))
            return how, content[:place] + bytes([rng.randrange(256)]) + content[place + 1 :]
        case "cut":
            return how, content[: rng.randrange(len(content))]
        case "line twice" | "line lost":
            lines[row : row + 1] = lines[row : row + 1] * (2 if how == "line twice" else 0)
        case "column lost":
            lines[row] = b" ".join(lines[row].split()[:-1]) + b"\n"
        case "heading":
            lines.insert(0, rng.choice((b"x y z\n", b"1O 2O 3O\n", b"# a\n", b"\n", b"Part 7\n", b"x1,y1,z1\n")))
        case "encoding":
            return how, content.decode("latin-1").encode(rng.choice(("utf-16", "utf-8-sig", "utf-32")))
    return how, b"".join(lines)


def _second_reading(content: bytes) -> Iterator[list[decimal.Decimal]]:
    """Yield the points of a table, without the heading, as decimal numbers."""
    rows = [line.split("#")[0] for line in re.split("\r\n|\r|\n", _decoded(content))]
    for number, row in enumerate(filter(str.strip, rows)):
        if number or re.search("[0-9]", row):
            words = re.split(r"[\s,;]+", row.strip())
            if len(words) != 3 or not all(NUMBER.fullmatch(word.encode()) for word in words):
                raise ValueError(f"{row!r}")
            yield [decimal.Decimal(word) for word in words]


def _decoded(content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("spreadsheets", "scans"):
        parser.add_argument(f"--{name}", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options, table = parser.parse_args(), Table()
    try:
        for kind in (spreadsheets, scans):
            with tempfile.TemporaryDirectory() as folder:
                kind(getattr(options, kind.__name__), random.Random(options.seed), Path(folder), table)
    finally:  # a run that is stopped has its counts as well
        write_table("formats", table)


if __name__ == "__main__":
    main()
