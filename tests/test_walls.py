"""The walls of the house, read from the imports: one direction, and libraries kept in their rooms.

An import is a statement, also one for the type checker alone, the stub of a lazy package, or a call that names a module.
"""

import ast
import itertools
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.sources import FILES, PACKAGE, tree

# Who may import a library: folders and files, relative to the package.
ROOMS = {
    "casadi": ("mechanics/", "compilation/"),
    "clarabel": ("statics/critical_friction.py",),
    "matplotlib": ("plot/",),
    "jinja2": ("report/html/",),
    "markdown_it": ("report/html/guide.py",),
    "fast_simplification": ("report/html/scene.py",),
    "pyvista": ("plot/",),
    "numba": ("compiled.py",),
    "jaxtyping": ("arrays.py",),
    "llvmlite": ("compilation/functions/",),
    "netCDF4": ("archive/",),
    "typer": ("cli/",),
    "msgspec": ("declaration/",),
    "trimesh": ("geometry/", "discretization/", "interference/"),
    "igl": ("geometry/", "interference/", "report/html/scene.py"),
    "OCP": ("kernel/",),
    "netgen": ("elasticity/",),
    "ngsolve": ("elasticity/",),
}
NOT_IN = {
    "xarray": (
        "declaration/", "geometry/", "features/", "discretization/", "variation/", "mechanics/", "interference/",
        "compilation/", "contact/", "simulation/", "statics/",
    )
}  # fmt: skip
# Who may import a library by a call, when it is first needed: it is optional, or slow to import.
LAZY = {
    "cloudpickle": ("simulation/packing.py",),
    "dask": ("simulation/cluster.py", "simulation/lazy.py"),
    "dask.array": ("simulation/lazy.py",),
    "distributed": ("simulation/cluster.py",),
    "pandas": ("declaration/measured_table.py", "declaration/stack.py"),
    "trimesh": ("geometry/files/worker.py",),  # in a process that mostly reads STEP files
    "ngsolve": ("elasticity/meshed_body.py",),  # an extra
    "openpyxl": ("report/spreadsheet.py",),
    "psutil": ("system/",),  # where the system limits no process
    "ctypes": ("system/files.py",),  # for short names, on Windows
    "tolcontact.kernel.step_document": ("geometry/files/worker.py",),  # in a process of its own
    "tolcontact.fasteners": ("__init__.py",),  # when a script asks
    "tolcontact.pmi": ("__init__.py",),  # when a script asks
    "tolcontact.report.notebook": ("__init__.py",),  # when a notebook asks
    "tolcontact.analyses.rebuilt": ("cli/archives.py",),  # few reports need models
}
# Slow to import: "import scipy" is enough, and imports them when they are first used.
SLOW = ("scipy.optimize", "scipy.stats")
IMPORTERS = ("import_module", "__import__", "load")
# Rooms that a room does not import from, though they stand before it.
APART = {
    "statistics": ("contact", "simulation"),
    "archive": ("contact", "statistics"),
    "report": ("contact", "simulation", "archive"),
    "plot": ("contact", "simulation", "archive"),
}
# From the top of the flow to its end; a room imports from rooms that stand before it.
ORDER = (
    "version", "texts", "errors", "user_functions", "input_files", "tables", "system", "interrupts", "readable", "child",
    "stored_coordinates", "shape_worker", "kernel", "vocabulary", "realizations", "arrays", "method", "poses", "limits",
    "code_cache", "replacing", "temporary", "compiled", "declaration", "select", "geometry", "elasticity", "features",
    "fasteners", "pmi", "discretization", "interference", "variation", "mechanics", "compilation", "statics", "contact",
    "simulation", "plausibility", "statistics", "archive", "report", "plot", "workflow", "io", "analyses", "testing",
    "cli", "__init__",
    "__main__",
)  # fmt: skip


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(file) for file in FILES}


def trees(file: Path) -> Iterator[ast.AST]:
    """The source of a module, and its stub, if it has one."""
    yield tree(file)
    if file.with_suffix(".pyi").exists():
        yield ast.parse(file.with_suffix(".pyi").read_text())


def called(source: ast.AST) -> Iterator[str]:
    """Modules that are imported by a call: their names stand in it."""
    for node in ast.walk(source):
        if isinstance(node, ast.Call):
            function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            base = node.func.value if isinstance(node.func, ast.Attribute) else None
            if function in IMPORTERS and (function != "load" or getattr(base, "id", "") == "lazy_loader"):
                name = node.args[0]
                assert isinstance(name, ast.Constant), f"line {node.lineno}: the name of an imported module is no literal"
                yield name.value


def imports(file: Path) -> set[str]:
    names = set()
    for source in trees(file):
        names |= set(called(source))
        for node in ast.walk(source):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level <= (file.with_suffix(".pyi").exists()), f"{file}: relative import"
                module = ".".join(filter(None, [name_of(file) if node.level else "", node.module]))
                names |= {module, *(f"{module}.{alias.name}" for alias in node.names)}
    return names


def room(name: str) -> str:
    return name.split("/", maxsplit=1)[0].removesuffix(".py")


def breaches(file: Path) -> Iterator[str]:
    """Imports of a file that go through a wall."""
    place = str(file.relative_to(PACKAGE))
    position = ORDER.index(room(place))
    for name in imports(file):
        library = name.split(".")[0]
        if library in ROOMS and not place.startswith(ROOMS[library]):
            yield f"{place} imports {library}"
        if name in SLOW:
            yield f"{place} imports {name}, which scipy imports when it is used"
        if library in NOT_IN and place.startswith(NOT_IN[library]):
            yield f"{place} imports {library}"
        if library == "tolcontact" and name != "tolcontact":
            target = name.split(".")[1]
            if target in ORDER and ORDER.index(target) > position:
                yield f"{place} imports {name}, which stands below it"
            if target in APART.get(room(place), ()):
                yield f"{place} imports {name}"
    for name in called(tree(file)):
        if not place.startswith(LAZY.get(name, ("nowhere",))):
            yield f"{place} imports {name} by a call"


def test_imports_keep_to_the_walls():
    found = [text for file in FILES for text in breaches(file)]
    assert not found, "\n".join(found)


# A kind of contact is named in two files of its own, and in two tables; others ask its pairs what they do.
KINDS = {
    "RoundContact": {
        "discretization/__init__.py", "discretization/round_contact.py", "discretization/contact_points.py",
        "mechanics/round_gap.py", "mechanics/pair_gaps.py",
    }
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_contact_is_named_in_its_files_and_tables_alone(kind):
    assert {str(file.relative_to(PACKAGE)) for file in FILES if kind in file.read_text(encoding="utf-8")} == KINDS[kind]


def test_every_room_is_in_the_order():
    assert {room(str(f.relative_to(PACKAGE))) for f in FILES} == set(ORDER)


def test_no_import_is_hidden_in_a_function():
    for file in FILES:
        for function in ast.walk(tree(file)):
            if isinstance(function, ast.FunctionDef):
                hidden = [n for n in ast.walk(function) if isinstance(n, ast.Import | ast.ImportFrom)]
                assert not hidden, f"{file}: {function.name}"


# Names with an underscore that are public all the same: of named tuples, of notebooks, and of the system.
PUBLIC = ("_replace", "_repr_html_", "_exit")
SETTERS = ("setattr", "delattr", "setitem", "delitem", "__setattr__", "patch")


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and name not in PUBLIC


def intrusions(source: ast.AST) -> Iterator[str]:
    """Names of the package that begin with an underscore, and changes of what was imported from it, with their lines."""
    nodes = list(ast.walk(source))
    imported = [
        (alias.asname or alias.name.split(".")[0], f"{getattr(node, 'module', '')}.{alias.name}", node.lineno)
        for node in nodes
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    ]
    yield from (f"line {line}: {name}" for _, name, line in imported if any(map(is_private, name.split("."))))
    theirs = {bound for bound, name, _ in imported if name.lstrip(".").split(".")[0] in ("tolcontact", "models")}
    defined = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}
    defined |= {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    for node in nodes:
        if isinstance(node, ast.Attribute | ast.Subscript):
            name, is_stored = getattr(node, "attr", ""), not isinstance(node.ctx, ast.Load)
            base = ast.unparse(node.value) if is_stored or is_private(name) else ""
            is_own = base == "self" and name in defined
            is_changed = is_stored and base.split(".")[0] in theirs
            if (is_private(name) and not is_own) or is_changed:
                yield f"line {node.lineno}: {ast.unparse(node)}"
        elif isinstance(node, ast.Call) and node.args and getattr(node.func, "attr", getattr(node.func, "id", "")) in SETTERS:
            target = ast.unparse(node.args[0]).strip("'").split(".")[0]
            if target in {*theirs, "tolcontact"} and ast.unparse(node.func) not in theirs:
                yield f"line {node.lineno}: {ast.unparse(node)}"


def test_modules_import_no_private_name_of_another():
    for file in FILES:
        for node in ast.walk(tree(file)):
            names = [alias.name for alias in node.names if is_private(alias.name)] if isinstance(node, ast.ImportFrom) else []
            assert not names, f"{file.relative_to(PACKAGE)}: {', '.join(names)}"


def test_tests_reach_no_private_name_and_change_no_module():
    files = sorted(Path(__file__).parent.rglob("*.py"))
    found = [f"{file.name} {text}" for file in files for text in intrusions(tree(file))]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "source",
    [
        "from tolcontact.contact.scan import _leaves",
        "import tolcontact._version",
        "program.place._evaluate",
        "class A(B):\n    def f(self): self._write(0)",
        "from tolcontact.archive import writer\nwriter.Journal = None",
        "from tolcontact.archive import ArchiveWriter\nArchiveWriter.checkpoint_interval = 0.0",
        "from tolcontact.compilation.solvers import SOLVERS\nSOLVERS['daqp'] = 1",
        "from models import hinge\npatched.setattr(hinge, 'PLACE', 0)",
        "from tolcontact.compilation.solvers import SOLVERS\nmonkeypatch.setitem(SOLVERS, 'daqp', 1)",
        "monkeypatch.setattr('tolcontact.statistics.rare_events.REPLICATES', 3)",
    ],
)
def test_a_test_that_reaches_inside_is_found(source):
    assert len(list(intrusions(ast.parse(source)))) == 1


TESTS = Path(__file__).parent
UNITS = TESTS / "units"
# Helpers that look inside a room, so that a room that is rebuilt changes them, and no test of another room.
INSIDERS = {
    "helpers.py": "programs without the check of the nominal assembly, which resolves 128 realizations; the schema of models",
    "shapes.py": "the triangles of a geometry and of a face, which no public name returns without a whole model",
    "kernel_annotations.py": "a second reader of a STEP file keeps to the limits of the first, and numbers its records alike",
    "population_referee.py": "it measures drawn parts back by the zones that the tolerances have",
    "scripts/kill_at_each_write.py": "no public name writes an archive with a checkpoint after each block",
    "scripts/read_shapes.py": "no public name limits the seconds that a file may take",
}


@cache
def exports(room: str) -> set[str]:
    """Names that a room offers to others: what its first file, or the stub of it, imports from its modules."""
    file = PACKAGE / room.removeprefix("tolcontact.") / "__init__.py"
    nodes = itertools.chain.from_iterable(map(ast.walk, trees(file))) if file.exists() else ()
    imported = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return {alias.asname or alias.name for node in imported for alias in node.names}


def reaches(source: ast.AST) -> Iterator[tuple[str, str]]:
    """Modules of rooms that are imported, each with its room, though the room itself is what others may import."""
    for node in ast.walk(source):
        if isinstance(node, ast.Import):
            names = {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            offered = exports(node.module) if node.module in MODULES and node.module.count(".") == 1 else set()
            inner = {f"{node.module}.{alias.name}" for alias in node.names if alias.name not in offered}
            names = {node.module, *(name for name in inner if name in MODULES)}
        else:
            continue
        yield from ((name.split(".")[1], name) for name in names if name.startswith("tolcontact.") and name.count(".") > 1)


def test_only_tests_of_a_room_reach_into_it():
    """Tests of a room stand in `tests/units/ROOM`; they may reach into rooms that stand before it, too."""
    found, insiders = [], set()
    for file in sorted(TESTS.rglob("*.py")):
        place, reached = file.relative_to(TESTS), list(reaches(tree(file)))
        if UNITS in file.parents:
            own = ORDER.index(place.parts[1]) if len(place.parts) > 2 else -1
            found += [f"{place} imports {name}" for target, name in reached if ORDER.index(target) > own]
        elif str(place) in INSIDERS:
            insiders |= {str(place)} if reached else set()
        else:
            found += [f"{place} imports {name}" for _, name in reached]
    assert not found, "\n".join(found)
    assert insiders == set(INSIDERS)


def test_no_other_test_needs_the_tests_of_a_room():
    for file in {*TESTS.rglob("*.py")} - {*UNITS.rglob("*.py")}:
        for node in ast.walk(tree(file)):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None) or ""]
            assert not [name for name in names if name.startswith("tests.units")], f"{file}: line {node.lineno}"


@pytest.mark.parametrize(
    ("source", "count"),
    [
        ("from tolcontact.geometry.shapes import shape", 1),
        ("import tolcontact.geometry.shapes", 1),
        ("from tolcontact.statistics import intervals", 1),
        ("from tolcontact.report.html import page_of", 1),
        ("from tolcontact.cli import app", 1),
        ("from tolcontact.statistics import summarize", 0),
        ("from tolcontact.analyses import contributions", 0),
        ("from tolcontact.geometry import preview", 0),
        ("from tolcontact import geometry, poses", 0),
        ("import tolcontact.geometry", 0),
    ],
)
def test_a_test_that_imports_the_module_of_a_room_is_found(source, count):
    assert len(list(reaches(ast.parse(source)))) == count
