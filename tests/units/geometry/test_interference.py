"""Insides of `geometry` under the claims of `tests/test_interference.py`."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from tests.helpers import compiled
from tests.test_interference import PLATE, ROOF, radii, set_down, simulated
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.meeting import Meeting

PYRAMID = [(0, 0, 0), *[(x, y, 8) for x in (-10, 10) for y in (-10, 10)]]
POST = [(x, y, z) for x in (-0.2, 12) for y in (-12, 12) for z in (-10, 0)]  # its rim is below the tip of the pyramid
SPIRE = [(-9.9, 0, 0), *[(x, y, -10) for x in (-12, 12) for y in (-10, 10)]]


@dataclass(frozen=True, eq=False)
class LackingMeeting(Meeting):
    """A list of places without those of one kind."""

    lacks: int

    def at(self, *arguments, **options):
        places = super().at(*arguments, **options)
        is_left_out = (places.labels >= 0) & (self.kinds[np.maximum(places.labels, 0)] == self.lacks)
        places.gaps[is_left_out], places.labels[is_left_out] = np.inf, -1
        return places


@pytest.mark.parametrize(
    "kind, moving, fixed",
    [(CORNER_ON_FACET, PYRAMID, POST), (FACET_ON_CORNER, PLATE, SPIRE), (EDGE_ON_EDGE, PLATE, ROOF)],
    ids=["corner on facet", "facet on corner", "edge across edge"],
)
def test_a_kind_of_place_that_the_search_lacks_is_noticed(kind, moving, fixed, monkeypatch):
    model, bodies = set_down(moving, fixed)
    program = compiled(model, solver="daqp")
    meeting = program.meetings[0]
    lacking = LackingMeeting(**{field.name: getattr(meeting, field.name) for field in fields(Meeting)}, lacks=kind)
    program = replace(program, meetings={0: lacking})
    assert np.nanmax(radii(simulated(program, 30), bodies), initial=0) < 5e-4  # what is certified is true
    untested = replace(program, watch=replace(program.watch, allowed={(0, 1): np.inf}))
    assert (radii(simulated(untested, 30), bodies) > 0.01).sum() > 5  # without the test it would not be
