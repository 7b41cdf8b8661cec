"""Insides of `cli` under the claims of `tests/test_analyses.py`."""

import tolcontact as tc
from tolcontact.cli.analyses import COMMANDS
from tolcontact.vocabulary import ANALYSES


def test_every_analysis_is_public_has_a_command_and_tables():
    assert {command.record.name for command in COMMANDS} == set(ANALYSES)
    assert {command.analysis for command in COMMANDS} == set(tc.analyses.__all__) - {"Stopped"}
    for record in ANALYSES.values():
        assert len({variable.name for variable in record.variables}) == len(record.variables)
