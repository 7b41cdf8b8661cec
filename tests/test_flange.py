"""A flange on a flange with four bolts in holes of 10.6 mm: an independent linear program decides which can be bolted."""

from io import StringIO

import numpy as np
import pytest
from rich.console import Console

import tolcontact as tc
from tests.cases.fastened import FOUR, held, hole, most_room, placed, plate, shifts
from tests.helpers import SEATED, compiled
from tolcontact.report import summary_text
from tolcontact.vocabulary import CERTIFIED, Status

HOLE, BOLT, POSITION = 10.6, 10.0, 2.2
SAMPLES = 12
SURE = 3e-4  # [mm] of a circle's polygon, and of second order


def flange(*, is_pressed: bool) -> tc.Assembly:
    """Return the flange in six locators with pins for bolts, or pressed on its seat by its weight with heads that bear."""
    model = tc.Assembly("flange", method=SEATED if is_pressed else None)
    base = plate(model, "base", 0, dict.fromkeys(FOUR, HOLE), fixed=True)
    cover = plate(model, "cover", 1, dict.fromkeys(FOUR, HOLE))
    model.locate(cover, [] if is_pressed else held(), floating=is_pressed)
    model.contact("seat", moving=cover.face("-z"), reference=base.face("+z"))
    for k, place in enumerate(FOUR):
        holes = [hole(part, f"H{k}", place, placed(POSITION)) for part in (cover, base)]
        tc.fasten(model, f"bolt {k + 1}", BOLT, through=holes, seat=cover.face("+z") if is_pressed else None)
    if is_pressed:
        model.force("weight", at=cover.point(0, 0, 4), vector=(0, 0, -50))
    model.measure("lift", cover.point(0, 0, 0), along="z")
    return model


def run_and_room(model: tc.Assembly):
    """Return a run, and the room [mm] of each realization in its holes by the linear program; below 0 no bolts go in."""
    run = tc.run(compiled(model, solver="daqp"), samples=SAMPLES, seed=1, fields="none", surfaces=0)
    offsets = shifts(run, "cover", 4) - shifts(run, "base", 4)
    return run, np.array([most_room(offset, np.full(4, HOLE - BOLT)) for offset in offsets])


@pytest.mark.slow
def test_a_flange_on_its_seat_is_refused_if_and_only_if_no_bolts_go_in():
    run, room = run_and_room(flange(is_pressed=True))
    is_sure = np.abs(room) > SURE
    refused = np.isin(run.status, (Status.NOT_CONVERGED, Status.NOT_ASSEMBLABLE))
    assert (refused == (room < 0))[is_sure].all() and is_sure.mean() > 0.9
    assert 0.3 < (room < 0).mean() < 0.6
    assert abs(run.measured.sel(state="corrected")[np.isin(run.status, CERTIFIED)]).max() < 1e-6  # it lies on its seat


@pytest.mark.slow
def test_a_flange_that_nothing_presses_is_lifted_until_pins_go_in_and_the_summary_warns():
    run, room = run_and_room(flange(is_pressed=False))
    is_lifted = np.isin(run.status, CERTIFIED) & (room < -SURE)
    assert is_lifted.sum() >= 5 and run.measured.sel(state="corrected").values[is_lifted].max() > 1
    console = Console(width=400, file=StringIO(), highlight=False)
    console.print(summary_text(tc.summarize(run)))
    text = console.file.getvalue()
    assert "contact moved parts off their locators" in text and "declare a force" in text
