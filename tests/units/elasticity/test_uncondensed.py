"""Plates and covers on seats with form, against a contact problem over all freedoms of their meshes."""

import pytest

from studies.elastic.measure import cover
from studies.elastic.scenes import bolted_cover
from studies.elastic.whole import whole_part
from tests.helpers import compiled, nightly

pytest.importorskip("ngsolve")
SCENES = {"plate": lambda: cover(38), "cover": lambda: bolted_cover(81)}


@pytest.mark.parametrize(("scene", "count"), [("plate", 1), *nightly(("plate", 20), ("cover", 20))])
def test_a_cover_lies_on_its_seat_as_its_whole_mesh_does(scene, count):
    """Heights within 1e-5 mm and forces within 0.1 % of the convex problem over all freedoms."""
    *_, touching, heights, forces = whole_part(scene, compiled(SCENES[scene]()), count)
    assert int(touching.split()[0]) > 2
    assert float(heights) < 1e-5
    assert float(forces) < 1e-3
