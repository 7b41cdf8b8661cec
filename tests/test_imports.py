"""What a command imports: as little as it needs, since that takes longer than a small run."""

import sys

from tests.helpers import call, finish, start

LISTING = "import sys; from tolcontact.cli import command_line\ntry: command_line({})\nexcept SystemExit: print(*sys.modules)"


def imported(folder, *arguments):
    """The modules that a process has imported after a command."""
    done = finish(start([sys.executable, "-c", LISTING.format(list(arguments))], cwd=folder))
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_help_imports_no_numbers(tmp_path):
    modules = imported(tmp_path, "--help")
    assert "rich" in modules and not {"numpy", "scipy", "xarray", "numba"} & modules


def test_a_run_imports_what_it_needs(tmp_path):
    call(tmp_path, "new", "small")
    modules = imported(tmp_path, "run", "small.py", "--samples", "20")
    needless = {"distributed.client", "jaxtyping", "scipy.stats"}
    needless |= {f"tolcontact.{room}" for room in ("analyses", "pmi", "report.html")}
    assert "casadi" in modules and not needless & modules


def test_a_summary_imports_nothing_that_simulates(archive):
    modules = imported(archive.parent, "summary", archive.name)
    assert "xarray" in modules
    assert not {"casadi", "numba", "trimesh", "scipy.spatial", "scipy.stats", "tolcontact.declaration.assembly"} & modules
