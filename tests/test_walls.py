"""The walls of the house, read from the imports: one direction, and libraries kept in their rooms."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "tolcontact"
FILES = sorted(PACKAGE.rglob("*.py"))

# Who may import a library: folders and files, relative to the package.
ROOMS = {
    "casadi": ("mechanics/", "compilation/"),
    "matplotlib": ("plot/",),
    "jinja2": ("report/html/",),
    "fast_simplification": ("report/html/decimation.py",),
    "pyvista": ("plot/",),
    "numba": ("compiled.py",),
    "jaxtyping": ("arrays.py",),
    "llvmlite": ("compilation/functions/native.py",),
    "netCDF4": ("archive/",),
    "h5py": ("archive/raw_file.py",),
    "typer": ("cli/",),
    "trimesh": ("geometry/", "discretization/"),
    "igl": ("geometry/", "report/html/decimation.py"),
    "cascadio": ("geometry/files/worker.py",),
}
NOT_IN = {
    "xarray": (
        "declaration/", "geometry/", "features/", "discretization/", "variation/", "mechanics/", "compilation/", "contact/",
        "simulation/",
    )
}  # fmt: skip
# Rooms that a room does not import from, though they stand before it.
NEVER = {
    "statistics": ("contact", "simulation"),
    "archive": ("contact", "statistics"),
    "report": ("contact", "simulation", "archive"),
    "plot": ("contact", "simulation", "archive"),
}
# From the top of the flow to its end; a room imports from rooms that stand before it.
ORDER = (
    "version", "errors", "readable", "child", "vocabulary", "checksums", "realizations", "arrays", "method", "poses",
    "compiled", "declaration", "geometry", "features", "discretization", "variation", "mechanics", "compilation", "contact",
    "simulation", "recomputed", "statistics", "archive", "report", "plot", "workflow", "analyses", "testing", "cli", "__init__",
    "__main__",
)  # fmt: skip


def imports(file: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def room(name: str) -> str:
    return name.split("/", maxsplit=1)[0].removesuffix(".py")


@pytest.mark.parametrize("file", FILES, ids=lambda f: str(f.relative_to(PACKAGE)))
def test_imports_keep_to_the_walls(file):
    where = str(file.relative_to(PACKAGE))
    own = ORDER.index(room(where))
    for name in imports(file):
        library = name.split(".")[0]
        if library in ROOMS:
            assert where.startswith(ROOMS[library]) if ROOMS[library] else False, f"{where} imports {library}"
        if library in NOT_IN:
            assert not where.startswith(NOT_IN[library]), f"{where} imports {library}"
        if library == "tolcontact" and name != "tolcontact":
            other = name.split(".")[1]
            if other in ORDER:
                assert ORDER.index(other) <= own, f"{where} imports {name}, which stands below it"
                assert other not in NEVER.get(room(where), ()), f"{where} imports {name}"


def test_every_room_is_in_the_order():
    assert {room(str(f.relative_to(PACKAGE))) for f in FILES} == set(ORDER)


def test_no_import_is_hidden_in_a_function():
    for file in FILES:
        for function in ast.walk(ast.parse(file.read_text())):
            if isinstance(function, ast.FunctionDef):
                hidden = [n for n in ast.walk(function) if isinstance(n, ast.Import | ast.ImportFrom)]
                assert not hidden, f"{file}: {function.name}"
