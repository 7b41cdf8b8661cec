"""Models with hostile names, and with functions that do what no function should: every way out, and what stays behind.

A function of a measurement or of a face has to leave the other measurement as it is, to the last bit, or be refused in one
message. What closes standard error itself, or changes a library, is not tried: no message could be printed, or trusted.
"""

import argparse
import ast
import csv
import importlib
import io
import json
import random
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studies.robustness.attempts import Table, attempt, write_table
from studies.robustness.files import stand
from studies.robustness.step_texts import damaged
from tests.pmi_records import Annotated
from tests.test_cad import COVER
from tests.test_features_from_pmi import drawing

LETTERS = (
    "=", "+", "-", "@", "'", '"', "\\", "{", "}", "%s", "{{1}}", "<script>", "</script>", "&lt;", "[bold]", "#N/A", "#REF!",
    "\t", "\ufffe", "\uffff", "\ufdd0", "\ufeff", "\u2028", "\u2029", "\u202e", "\x85", "\xa0", "\u3000", "\u200b",
    "\U0001f600", "\U0010ffff", "Ä", "電", "ß", "ﬁ", "İ", "٣", "²", " ", "a", "Z", "0", ",", ";", "|", ":", "/",
    "cmd|'/C calc'!A0", "1e5", "TRUE", "nan",
)  # fmt: skip
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?inf", re.IGNORECASE)
CONTROL = "\t\x85\u2028\u2029\u202e"
SCRIPT = """import casadi, gc, os, signal, sys, threading, time, warnings
import numpy as np
import tolcontact as tc

class Own(BaseException):
    pass

def assembly():
    model = tc.Assembly("stand")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    def measured(poses):
        value = poses.translation(block)[2]
{measured}
        return value
    def seat(centres, normals):
        mask = normals[:, 2] < -0.9
{picked}
        return mask
    model.contact("seat", moving=block.face(seat), reference=table.face("+z"))
    model.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
    model.measure("function", measured, units="mm", limits=(-1, 1))
    return model
"""
BEHAVIOUR = (
    "pass", "sys.exit(0)", "sys.exit('bye')", "raise Own('x')", "raise KeyError", "raise GeneratorExit",
    "raise StopIteration", "raise MemoryError", "raise RecursionError('deep')", "1 / 0", "raise Exception('a\\nb')",
    "raise Exception('\\x1b[31m')", "os.chdir('/')", "sys.stdout = None", "sys.stderr = None", "sys.stdout.close()",
    "sys.stdin.close()", "print('\\x1b[2J\\ud800')", "warnings.simplefilter('error')", "np.seterr(all='raise')",
    "np.random.seed(0)", "signal.signal(signal.SIGINT, signal.SIG_IGN)", "signal.signal(signal.SIGTERM, signal.SIG_DFL)",
    "gc.disable()", "threading.Thread(target=time.sleep, args=(0.2,)).start()",
    "threading.Thread(target=time.sleep, args=(9,), daemon=True).start()", "sys.setrecursionlimit(60)", "sys.path.clear()",
    "os.environ.clear()", "os.umask(0o777)", "model.part('third', tc.Box(1, 1, 1))",
    "model.measure('late', block.point(0, 0, 0), along='z')", "time.sleep(0.1)", "sys.settrace(lambda *_: None)",
    "sys.setprofile(lambda *_: None)", "warnings.warn('a\\x1bb')",
)  # fmt: skip
READERS = (
    ("pmi", "a.step"), ("pmi", "a.step", "--csv"), ("pmi", "a.step", "--json"), ("pmi", "a.step", "--script"),
    ("bodies", "a.step"),
)  # fmt: skip
VALUES = (
    "None", "'text'", "[]", "[1, 2]", "float('nan')", "float('inf')", "1j", "np.zeros(3)", "casadi.MX.sym('x')",
    "casadi.SX.sym('x')", "casadi.SX.sym('x', 2)", "casadi.DM(3)", "3", "True", "10**400", "value * float('nan')",
    "casadi.sqrt(value)", "1 / (value * 0)", "value.T", "sum([value] * 20000)", "poses", "lambda: 1", "object()",
    "casadi.SX(0, 0)",
)  # fmt: skip


def renamed(document: Any, rng: random.Random) -> Any:
    """Return the document of a model with hostile names."""
    for entry in (document, *document["parts"], document["pairs"][0], document["measures"][0]):
        name = "".join(rng.choices(LETTERS, k=rng.randint(1, 4)))
        if rng.random() < 0.95:  # else it may be refused
            name = "".join(letter for letter in name if letter not in CONTROL).strip() or "@"
            name = name if entry is document else f"a{name.replace('/', '')}"
        entry["name"] = name
    base, block = (part["name"] for part in document["parts"])
    for face in (
        *document["locations"][0]["scheme"]["three_two_one"],
        document["pairs"][0]["moving"],
        document["measures"][0]["of"],
    ):
        face["part"] = block
    document["locations"][0]["part"], document["pairs"][0]["reference"]["part"] = block, base
    document["measures"][0]["units"] = rng.choice(("mm", "=1+1", "@", "\ufffe"))
    return document


def names(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Run models with hostile names, and read what was written: spreadsheets, CSV, JSON, pages."""
    for _ in range(count):
        document = renamed(stand(), rng)
        (folder / "m.json").write_text(json.dumps(document))
        ending = attempt(["run", "m.json", "--samples", "40", "--out", "m.nc", "--overwrite", "--quiet"], folder)
        if ending.fault or ending.code == 2:
            table.add(
                "hostile names",
                ending.fault or "refused",
                f"{document['name']!r}: {ending.error[-400:]}",
                is_fault=bool(ending.fault),
            )
            continue
        fault = ""
        for command in (["report", "m.nc", "--xlsx", "m.xlsx", "--overwrite"], ["report", "m.nc"], ["summary", "m.nc"],
                        ["summary", "m.nc", "--csv"], ["summary", "m.nc", "--json"]):  # fmt: skip
            ending = attempt(command, folder)
            fault = fault or ending.fault or (f"refused by {command[0]}" if ending.code == 2 else "")
            if command[-1] == "--csv":
                fault = fault or _formula(csv.reader(io.StringIO(ending.out)))
            elif command[-1] == "--json":
                json.loads(ending.out)
        if not fault:
            fault = _formula(
                [
                    [cell.value for cell in row if cell.data_type != "s"]
                    for sheet in importlib.import_module("openpyxl").load_workbook(folder / "m.xlsx")
                    for row in sheet
                ]
            )
        table.add("hostile names", fault or "as they are", f"{document!r}: {ending.error[-400:]}", is_fault=bool(fault))


def pmi(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Read a STEP file with hostile texts or damaged numbers by five readers; a script must be no other program."""
    drawing(file := Annotated(COVER.read_text()))
    sound = Path(file.write(folder / "sound.step")).read_bytes()
    texts = list(re.finditer(rb"'((?:[^'\n]|'')*)'", sound))
    for _ in range(count):
        kind, content = ("texts", sound) if rng.random() < 0.6 else damaged(sound, rng)
        if kind == "texts":
            for match in sorted(rng.sample(texts, 40), key=lambda match: -match.start()):
                words = "".join(rng.choices([*LETTERS, '"""; raise SystemExit(9); """'], k=rng.randint(1, 4)))
                content = (
                    content[: match.start(1)] + words.replace("'", "''").encode("utf-8", "replace") + content[match.end(1) :]
                )
        (folder / "a.step").write_bytes(content)
        for options in READERS:
            ending = attempt([*options], folder)
            fault = ending.fault
            if not fault and ending.code == 0:
                fault = _said(options[-1], ending.out)
            words = f"{kind}: {' '.join(options)}: {ending.error[-500:]}"
            table.add(f"PMI, {kind}", fault or ("refused" if ending.code == 2 else "read"), words, is_fault=bool(fault))


def _said(option: str, said: str) -> str:
    """Return what is wrong with what a reader printed; empty if nothing is."""
    if option == "--csv":
        return _formula(csv.reader(io.StringIO(said)))
    if option == "--json":
        json.loads(said)
    if option == "--script":
        tree = ast.parse(said)
        calls = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
        kinds = {type(node).__name__ for node in tree.body}
        if (
            calls
            or not kinds <= {"Expr", "Import", "FunctionDef", "If"}
            or any(isinstance(node, ast.Raise) for node in ast.walk(tree))
        ):
            return "another program"
    return ""


def _formula(rows: Iterable[Iterable[Any]]) -> str:
    """Return what a spreadsheet would run or take for an error in some rows; empty if nothing."""
    texts = [cell for row in rows for cell in row if isinstance(cell, str)]
    bad = [text for text in texts if text.lstrip(" ")[:1] in ("=", "+", "-", "@") and not NUMBER.fullmatch(text)]
    return f"formula {bad[0]!r}" if bad else ""


def functions(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Run models whose functions do something that they should not."""
    measured = [(f"        {line}", "") for line in BEHAVIOUR] + [(f"        value = {value}", "") for value in VALUES]
    picked = [("", f"        {line}") for line in BEHAVIOUR] + [
        ("", f"        mask = {value}") for value in VALUES if "value" not in value
    ]
    heights = None
    if not count:
        return
    for in_measure, in_face in [("", ""), *rng.sample(measured + picked, min(count, len(measured + picked)))]:
        (folder / "m.py").write_text(SCRIPT.format(measured=in_measure, picked=in_face), encoding="utf-8")
        (folder / "m.nc").unlink(missing_ok=True)
        ending = attempt(["run", "m.py", "--samples", "40", "--out", "m.nc"], folder, limit=300 if heights is None else 60)
        fault, kept = ending.fault, "refused" if ending.code == 2 else "ran"
        if ending.code == 2 and ending.error.count("error: ") != 1:
            fault = "not one message"
        elif ending.code != 2 and not fault:
            if not (folder / "m.nc").exists():
                fault = "no archive"
            else:
                with xr.open_dataset(folder / "m.nc") as archive:
                    found = archive.measured.sel(measure="height").values
                heights = found if heights is None else heights
                fault = "" if np.array_equal(found, heights) else "another number"
        table.add("users' functions", fault or kept, f"{in_measure}{in_face}: {ending.error[-500:]}", is_fault=bool(fault))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("names", "pmi", "functions"):
        parser.add_argument(f"--{name}", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options, table = parser.parse_args(), Table()
    try:
        for kind in (names, pmi, functions):
            with tempfile.TemporaryDirectory() as folder:
                kind(getattr(options, kind.__name__), random.Random(options.seed), Path(folder), table)
    finally:  # a run that is stopped has its counts as well
        write_table("scripts", table)


if __name__ == "__main__":
    main()
