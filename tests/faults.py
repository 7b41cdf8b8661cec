"""Mutation tests: put small faults into the package, one at a time, and see which test fails. A tool to be run by hand:

    python -m tests.faults --count 120 --seed 1 --out faults.jsonl
    python -m tests.faults --survivors faults.jsonl                              the survivors of a run, once more
    python -m tests.faults --survivors faults.jsonl --tests tests/test_new.py    against new tests only

A first run of all tests records which test reaches which line, and how long each takes. Its record is stored and used until a
source changes (with --store, always). Each fault is then tried in a copy of the repository, on the tests that reach it, from
cheap to expensive, until one fails. A fault that survives has no visible effect, or lacks a test.
"""

import argparse
import ast
import faulthandler
import hashlib
import itertools
import json
import multiprocessing
import os
import queue
import random
import re
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import coverage
import numba
import pytest

ROOT = Path(__file__).resolve().parents[1]
# Packages and modules that get no faults, by name: they do not compute results. All others are tested.
SPARED = {"declaration", "vocabulary", "workflow", "report", "plot", "cli", "testing"}
SPARED |= {"method", "errors", "child", "compiled", "readable", "version", "__main__", "__init__"}
SPARED |= {"quiet", "inspection", "reader"}
WEIGHTS = {"contact": 4, "compilation": 3, "statistics": 3, "archive": 3, "simulation": 2, "mechanics": 2}  # others 1
PATIENCE, TIMES = 40.0, 10.0  # s, and multiple of its usual time: then a test is stopped, and the fault counts as found
OUTCOMES = ("found", "timeout", "survived", "not reached", "not run")

FORKS = multiprocessing.get_context("forkserver")  # processes that start with the slow imports done
FORKS.set_forkserver_preload(["casadi", "igl", "netCDF4", "numba", "pandas", "pytest", "scipy.stats", "trimesh", "xarray"])

COMPARED = {"Lt": ("<", "<=", ">"), "LtE": ("<=", "<"), "Gt": (">", ">=", "<"), "GtE": (">=", ">")}
COMPARED |= {"Eq": ("==", "!="), "NotEq": ("!=", "==")}
COMPUTED = {"Add": ("+", "-"), "Sub": ("-", "+"), "Mult": ("*", "/"), "Div": ("/", "*"), "Pow": ("**", "*")}
COMPUTED |= {"BitAnd": ("&", "|"), "BitOr": ("|", "&")}
EXTREMES = [("maximum", "minimum"), ("max", "min"), ("fmax", "fmin"), ("mmax", "mmin"), ("argmax", "argmin"), ("any", "all")]
SWAPPED = {one: other for pair in EXTREMES for one, other in (pair, pair[::-1])}
DROPPED = {"maximum", "minimum", "fmax", "fmin", "abs", "clip", "sqrt"}  # of these calls the first argument is left
Change = tuple[str, int, int, bytes]  # operator, and what stands in place of which bytes


@dataclass(frozen=True)
class Fault:
    """A fault: the lines `before` and `after` it; it is the `nth` equal fault in its function."""

    file: str
    function: str
    operator: str
    before: str
    after: str
    nth: int
    lines: range = field(compare=False)  # of its statement
    source: bytes = field(compare=False)  # the whole file with it

    def record(self, **more) -> dict:
        return {name: getattr(self, name) for name in ("file", "function", "operator", "before", "after", "nth")} | more


def room_of(record) -> str:
    return Path(record["file"] if isinstance(record, dict) else record.file).parts[1].removesuffix(".py")


class Source:
    """Places in a text. Trees count columns in bytes."""

    def __init__(self, path: Path) -> None:
        self.text = path.read_bytes()
        self._starts = [0, *itertools.accumulate(map(len, self.text.splitlines(keepends=True)))]

    def span(self, node) -> tuple[int, int]:
        return self._starts[node.lineno - 1] + node.col_offset, self._starts[node.end_lineno - 1] + node.end_col_offset

    def of(self, node) -> bytes:
        return self.text[slice(*self.span(node))]

    def between(self, left, right, old: str, new: str) -> tuple[int, int, bytes]:
        """Another operator between two operands and their parentheses."""
        start, end = self.span(left)[1], self.span(right)[0]
        return start, end, self.text[start:end].replace(old.encode(), new.encode(), 1)

    def changed(self, start: int, end: int, new: bytes) -> tuple[str, str, bytes]:
        """The lines that a change touches, before and after; and the text after."""
        first, last = self.text.rfind(b"\n", 0, start) + 1, self.text.find(b"\n", end)
        lines = self.text[first:last], self.text[first:start] + new + self.text[end:last]
        return *(b" ".join(each.split()).decode() for each in lines), self.text[:start] + new + self.text[end:]


def changes(node, source: Source) -> Iterator[Change]:
    """Yield the changes that make a node wrong."""
    match node:
        case ast.Compare(left, ops, others):
            for one, op, other in zip([left, *others], ops, others, strict=False):
                old, *news = COMPARED.get(type(op).__name__, ("",))
                yield from (("comparison", *source.between(one, other, old, new)) for new in news)
        case ast.BinOp(left, op, right) if type(op).__name__ in COMPUTED:
            yield "arithmetic", *source.between(left, right, *COMPUTED[type(op).__name__])
        case ast.BoolOp(op, values):
            words = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            yield "and, or", *source.between(*values[:2], *words)
        case ast.UnaryOp(op, operand):
            yield "minus" if isinstance(op, ast.USub) else "not", *source.span(node), source.of(operand)
        case ast.Constant(bool() as value):
            yield "truth", *source.span(node), str(not value).encode()
        case ast.Constant(int() | float() as value):
            news = {0: [1], 1: [2]}.get(value, [2 * value, value / 10 if isinstance(value, float) else value + 1])
            yield from (("constant", *source.span(node), repr(new).encode()) for new in news)
        case ast.Call(func, args):
            name, end = getattr(func, "attr", getattr(func, "id", "")), source.span(func)[1]
            if name in SWAPPED:
                yield "extreme", end - len(name), end, SWAPPED[name].encode()
            if name in DROPPED and args:
                yield "dropped call", *source.span(node), b"(" + source.of(args[0]) + b")"
        case ast.If(test) | ast.IfExp(test):
            yield from (("condition", *source.span(test), word) for word in (b"True", b"False"))
        case ast.AugAssign() | ast.Assign(targets=[ast.Subscript()]) | ast.Expr(ast.Call()) | ast.Continue():
            yield "deletion", *source.span(node), b"pass"


def is_spared(node) -> bool:
    """Whether a node only says something to people, or guards: `zip(..., strict=True)`."""
    match node:
        case ast.Raise() | ast.JoinedStr() | ast.keyword("strict") | ast.Expr(ast.Call(ast.Attribute(ast.Name("log")))):
            return True
    return False


def walk(node, source: Source, function: str = "", lines: range = range(0)) -> Iterator[tuple[str, range, Change]]:
    """All changes below a node, each with its function and the lines of its statement."""
    if is_spared(node):
        return
    if isinstance(node, ast.FunctionDef):
        function = f"{function}.{node.name}".lstrip(".")
    if isinstance(node, ast.stmt):
        body = getattr(node, "body", None)
        lines = range(node.lineno, body[0].lineno if body else node.end_lineno + 1)
    yield from ((function, lines, change) for change in changes(node, source))
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and name not in ("annotation", "returns", "decorator_list"):
                yield from walk(child, source, function, lines)


def all_faults(only: str) -> Iterator[Fault]:
    """Yield the possible faults of all files whose path contains `only`."""
    for path in sorted((ROOT / "tolcontact").rglob("*.py")):
        file = path.relative_to(ROOT)
        if only in str(file) and not SPARED & {part.removesuffix(".py") for part in file.parts}:
            source, alike = Source(path), Counter()
            for function, lines, (operator, *change) in walk(ast.parse(source.text), source):
                before, after, text = source.changed(*change)
                key = (str(file), function, operator, before, after)
                yield Fault(*key, alike[key], lines, text)
                alike[key] += 1


def drawn(faults: list[Fault], count: int, seed: int) -> list[Fault]:
    """Return a sample of faults: packages get shares by WEIGHTS, and in a package the operators take turns."""
    shuffled, turns, places = random.Random(seed).sample(faults, len(faults)), Counter(), Counter()
    by_turn = []
    for number, fault in enumerate(shuffled):
        by_turn.append((turns[room_of(fault), fault.operator], number))
        turns[room_of(fault), fault.operator] += 1
    order = []
    for _, number in sorted(by_turn):
        room = room_of(shuffled[number])
        order.append((places[room] / WEIGHTS.get(room, 1), number))
        places[room] += 1
    return [shuffled[number] for _, number in sorted(order)[:count]]


def again(faults: list[Fault], records: list[dict]) -> Iterator[Fault]:
    """The survivors among some records, as far as they can still be made; their files may have other names by now."""
    keys = ("function", "operator", "before", "after", "nth")
    for record in records:
        alike = [fault for fault in faults if all(getattr(fault, key) == record[key] for key in keys)]
        if record["outcome"] == "survived" and alike:
            yield next((fault for fault in alike if fault.file == record["file"]), alike[0])


class Store:
    """The record of the first run, and copies of the repository for faults."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        if not (folder / "done").exists():
            print(f"first run of all tests, in {folder}", flush=True)
            shutil.rmtree(folder, ignore_errors=True)
            options = ["-n", "2", "--cov=tolcontact", "--cov-context=test", "--cov-report=", "tests"]
            run_tests(self.copy(0), folder, options, COVERAGE_FILE=str(folder / "coverage"))
            (folder / "done").touch()
        self.costs, failed = Counter(), set()
        for test, outcome, seconds in records_in(folder / "log.jsonl"):
            self.costs[test] += seconds
            failed |= {test} if outcome != "passed" else set()
        self._passed = self.costs.keys() - failed
        data = coverage.CoverageData(folder / "coverage")
        data.read()
        tests_of = {context: self._tests_of(*context.rsplit("|", 1)) for context in data.measured_contexts() if context}
        self._reached = {
            file[file.rindex("tolcontact/") :]: {
                line: set().union(*(tests_of[context] for context in contexts if context))
                for line, contexts in data.contexts_by_lineno(file).items()
            }
            for file in data.measured_files()
        }

    def _tests_of(self, test: str, phase: str) -> set[str]:
        """A test; or all of its file, where something was reached while a fixture was made, which they may share."""
        file = test[: test.index("::") + 2]
        return {test} if phase == "run" else {other for other in self.costs if other.startswith(file)}

    def copy(self, number: int) -> Path:
        to = self.folder / f"copy{number}"
        shutil.rmtree(to, ignore_errors=True)
        return Path(shutil.copytree(ROOT, to, ignore=shutil.ignore_patterns(".git", "__pycache__", ".*_cache", "*.nc")))

    def tests(self, fault: Fault, budget: float) -> list[str]:
        """Tests that reach a fault, as many as take `budget` seconds in all: cheapest first, files in turn."""
        here = self._reached.get(fault.file, {})
        found = set().union(*(here.get(line, ()) for line in fault.lines)) if fault.function else set()
        # What runs at import, or is compiled, is not seen: whoever uses the module reaches it.
        found = (found or set().union(*here.values()) | self._using(Path(fault.file).stem)) & self._passed
        turns, of_file = {}, Counter()
        for test in sorted(found, key=self.costs.__getitem__):
            of_file[test.split("::")[0]] += self.costs[test]
            turns[test] = of_file[test.split("::")[0]]
        ordered = sorted(found, key=turns.__getitem__)
        spent = itertools.accumulate(self.costs[test] for test in ordered)
        return [test for test, total in zip(ordered, spent, strict=True) if total < budget]

    def _using(self, module: str) -> set[str]:
        """Tests that reach a line with a name of a module; or where it is imported by names, a file that does so."""
        found, importers = set(), set()
        for file, reached in self._reached.items():
            for number, line in enumerate((ROOT / file).read_text().splitlines(), 1):
                found |= reached.get(number, set()) if re.search(rf"\b{module}\.\w", line) else set()
                importers |= {file} if re.search(rf"\.{module} import", line) else set()
        return found or set().union(*(tests for file in importers for tests in self._reached[file].values()))


def records_in(file: Path | None) -> list:
    return [json.loads(line) for line in file.read_text().splitlines()] if file and file.exists() else []


def run_tests(copy: Path, folder: Path, options: list[str], **environment: str) -> int:
    """Run tests in a copy, with this file as a plugin that writes into `folder`; their exit code."""
    known = {"PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1", "FAULTS": str(folder)}
    known |= {"NUMBA_CACHE_DIR": str(folder / "numba"), **environment}
    begun = FORKS.Process(target=_run_tests, args=(copy, folder, options, known))
    begun.start()
    begun.join()
    return begun.exitcode


def _run_tests(copy: Path, folder: Path, options: list[str], environment: dict[str, str]) -> None:
    """In a process that has imported all libraries already, but of the package nothing."""
    os.environ.update(environment)
    os.chdir(copy)
    for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
        del sys.modules[name]
    sys.path.insert(0, str(copy))
    sys.dont_write_bytecode, numba.config.CACHE_DIR = True, environment["NUMBA_CACHE_DIR"]
    with (folder / "output.txt").open("w") as output:
        for stream in (1, 2):
            os.dup2(output.fileno(), stream)
    sys.exit(int(pytest.main(["-p", "tests.faults", "-p", "no:cacheprovider", *options])))


def pytest_runtest_logstart(nodeid: str) -> None:
    """Stop a test that takes far too long (as a plugin of pytest)."""
    folder = Path(os.environ["FAULTS"])
    if (folder / "costs.json").exists():
        cost = json.loads((folder / "costs.json").read_text()).get(nodeid, 0.0)
        faulthandler.dump_traceback_later(PATIENCE + TIMES * cost, exit=True, file=(folder / "late.txt").open("w"))


def pytest_runtest_logreport(report) -> None:
    """Record the outcome of a test (as a plugin of pytest); of one in a worker the main process is told."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    with (Path(os.environ["FAULTS"]) / "log.jsonl").open("a") as log:
        print(json.dumps([report.nodeid, report.outcome, report.duration]), file=log)


def tried(store: Store, copy: Path, fault: Fault, tests: list[str]) -> dict:
    """Try a fault, and return its record."""
    if not tests:
        return fault.record(outcome="not reached", by="", tests=0)
    with tempfile.TemporaryDirectory() as name:
        folder, spoiled = Path(name), copy / fault.file
        (folder / "tests.txt").write_text("\n".join(tests))
        (folder / "costs.json").write_text(json.dumps(store.costs))
        spoiled.write_bytes(fault.source)
        # Numba's cache serves the functions of files that are as they were; others begin with an empty one.
        cache = {} if b"tolcontact.compiled" in fault.source else {"NUMBA_CACHE_DIR": str(store.folder / "numba")}
        failed = run_tests(copy, folder, ["-x", f"@{folder / 'tests.txt'}"], **cache)
        shutil.copy2(ROOT / fault.file, spoiled)
        reports, late = records_in(folder / "log.jsonl"), folder / "late.txt"
        outcome = "survived" if not failed else "timeout" if late.exists() and late.read_text() else "found"
    if failed and not reports:
        outcome = "not run"  # it may have broken an import, or the tests could not begin: look
    last = reports[-1][0] if reports else "no test could be run"
    return fault.record(outcome=outcome, by=last if failed else "", tests=len({test for test, *_ in reports}))


def row(record: dict) -> str:
    head = f"{record['outcome']:12}{record['operator']:14}{record['file']}: {record['function']}"
    return "\n".join([head, f"    - {record['before']}", f"    + {record['after']}", f"    {record['by']}"])


def summary(records: list[dict]) -> str:
    """Numbers of outcomes by room."""
    counts = Counter((room, r["outcome"]) for r in records for room in (room_of(r), "~ all"))
    rows = [[room, *(counts[room, outcome] for outcome in OUTCOMES)] for room in sorted({room for room, _ in counts})]
    return "\n".join(f"{name:<14}" + "".join(f"{count:>12}" for count in of) for name, *of in [["room", *OUTCOMES], *rows])


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=120, help="how many faults")
    parser.add_argument("--seed", type=int, default=1, help="of their choice")
    parser.add_argument("--only", default="", help="in files whose path has this in it")
    parser.add_argument("--survivors", type=Path, help="instead: the survivors of an earlier run's --out")
    parser.add_argument("--tests", nargs="+", help="instead of the tests that reach a fault: these files")
    parser.add_argument("--budget", type=float, default=120, help="seconds that the tests of a fault may take in all")
    parser.add_argument("--jobs", type=int, default=1, help="faults that are tried at once")
    parser.add_argument("--store", type=Path, help="folder of the first run, whatever has changed since")
    parser.add_argument("--out", type=Path, help="file for the records, one JSON object a line; goes on with those in it")
    arguments = parser.parse_args()
    faults = list(all_faults(arguments.only))
    before, known = records_in(arguments.survivors), records_in(arguments.out)
    chosen = list(again(faults, before)) if arguments.survivors else drawn(faults, arguments.count, arguments.seed)
    chosen = [fault for fault in chosen if not any(record == record | fault.record() for record in known)]
    sources = b"".join(path.read_bytes() for room in ("tolcontact", "tests") for path in sorted((ROOT / room).rglob("*.py")))
    digest = hashlib.sha256(sources).hexdigest()[:12]
    store = Store(arguments.store or Path(tempfile.gettempdir()) / f"tolcontact-faults-{digest}")
    copies: queue.Queue[Path] = queue.Queue()
    for number in range(arguments.jobs):
        copies.put(store.copy(number))

    def judged(fault: Fault) -> dict:
        copy = copies.get()
        record = tried(store, copy, fault, arguments.tests or store.tests(fault, arguments.budget))
        copies.put(copy)
        print(row(record), flush=True)
        if arguments.out:
            with arguments.out.open("a") as out:
                print(json.dumps(record), file=out)
        return record

    with ThreadPoolExecutor(arguments.jobs) as pool:
        print(summary(known + list(pool.map(judged, chosen))))


if __name__ == "__main__":
    main()
