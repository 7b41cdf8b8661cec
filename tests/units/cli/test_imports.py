"""Insides of `cli` under the claims of `tests/test_imports.py`."""

import pytest
import typer

from tolcontact.cli.app import COMMANDS, app, declared_command


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
