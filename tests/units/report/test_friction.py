"""Insides of `report` under the claims of `tests/test_friction.py`."""

import tolcontact as tc
from studies.benchmarks.problems import friction_on_an_incline as incline
from tests.helpers import call, compiled
from tolcontact.report.html.page import tables_of


def test_the_command_prints_seats_and_what_holds_them_and_keeps_them_for_the_page(tmp_path):
    program = compiled(incline.assembly(), solver="daqp")
    tc.run(program, samples=4, surfaces=0, fields="none", out=tmp_path / "run.nc").close()
    done = call(tmp_path, "seating", tmp_path / "run.nc", "--into", tmp_path / "run.nc")
    assert done.returncode == 0, done.stderr
    with tc.open_archive(tmp_path / "run.nc") as results:
        (table,) = tables_of(results)
    assert table.title == "Seating" and ["block.stop", "0.364", "-", "plane 100 %"] in table.rows
    rows = [line.split() for line in done.stdout.splitlines()]
    assert ["block.stop", "0.364", "-", "plane", "100", "%"] in rows
