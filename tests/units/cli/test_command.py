"""Insides of `cli` under the claims of `tests/test_command.py`."""

import re
import time

import pytest
from typer.testing import CliRunner

from tolcontact.cli.app import app
from tolcontact.cli.progress import shown_progress


def test_help_states_values_only_of_options_that_take_one():
    printed = CliRunner().invoke(app, ["run", "--help"], terminal_width=100).stdout
    assert re.search("--samples +<int>", printed)
    assert all(re.search(f"--{name}  +[A-Z]", printed) for name in ("overwrite", "resume", "quiet")), printed


@pytest.mark.parametrize(("interval", "quiet", "lines"), [(0.0, False, 4), (0.0, True, 0), (1e9, False, 0)])
def test_without_a_terminal_a_line_says_at_intervals_how_far_a_run_is(interval, quiet, lines, capsys):
    with shown_progress("ra1", 20_000, quiet=quiet, interval=interval) as show:
        for done in (4096, 8192, 12_288, 16_384):
            show(done, 20_000)
            time.sleep(0.01)
    said = capsys.readouterr().err.splitlines()
    assert len(said) == lines
    assert (
        said[:3] == ["ra1: 4 096 of 20 000", "ra1: 8 192 of 20 000", "ra1: 12 288 of 20 000"][:lines]
    )  # too early to forecast
    assert not lines or re.fullmatch(r"ra1: 16 384 of 20 000, [\d ]+ a second, \d+ s left", said[3])


@pytest.mark.parametrize(("long_wait", "quiet", "lines"), [(0.0, False, 1), (0.0, True, 0), (1e6, False, 0)])
def test_a_long_run_is_told_once_what_takes_less_time(long_wait, quiet, lines, capsys):
    with shown_progress("ra1", 20_000, quiet=quiet, interval=1e9, long_wait=long_wait) as show:
        for done in range(1000, 9000, 1000):
            show(done, 20_000)
            time.sleep(0.01)
    said = capsys.readouterr().err.splitlines()
    assert len(said) == lines
    assert not lines or re.fullmatch(r"ra1: about \d+ s left; fewer --samples take less time, with wider intervals", said[0])


def test_every_command_has_examples_that_name_it():
    for command in app.registered_commands:
        name = command.name or command.callback.__name__
        assert command.epilog.startswith("Examples:") and f"tolcontact {name} " in f"{command.epilog} "
