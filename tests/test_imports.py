"""What a command imports: as little as it needs, since that takes longer than a small run."""

import sys

import numpy as np
import pytest
import typer
from scipy.stats import qmc

from tests.helpers import call, finish, start
from tolcontact.cli.app import app
from tolcontact.cli.commands import COMMANDS, declared_command
from tolcontact.variation.plans import MAX_DIMENSIONS, scrambled_points

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
    assert "casadi" in modules
    assert not {"distributed.client", "jaxtyping", "tolcontact.analyses", "tolcontact.pmi", "tolcontact.report.html"} & modules


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_says_what_each_does(name):
    command = declared_command(name)
    purpose = " ".join(command.help.split("\n\n")[0].split())
    assert command.name == name and purpose == COMMANDS[name][1]


def test_every_command_is_listed():
    for name in COMMANDS:
        declared_command(name)
    declared = typer.main.get_command(app)
    assert {info.name or info.callback.__name__ for info in app.registered_commands} == set(declared.commands)


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("dimensions", [1, 3, MAX_DIMENSIONS])
@pytest.mark.parametrize("count", [1, 2, 1000, 2048])
def test_scrambled_points_are_those_of_scipy(seed, dimensions, count):
    expected = qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random(2048)[:count]
    np.testing.assert_array_equal(scrambled_points(count, dimensions, np.random.default_rng(seed).spawn(1)[0]), expected)
