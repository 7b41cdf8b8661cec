"""Insides of `simulation` under the claims of `tests/test_features.py`."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases.round_contact import BARREL
from tests.test_features import EXACT
from tolcontact.simulation.surfaces import check_surfaces


def test_surfaces_are_checked_as_large_as_they_are():
    """A pin that outgrows its hole lies in it as deep as it is too large, and one that shrank does not, whatever the shapes."""
    a = tc.Assembly("fit")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5, 20, 10, sections=64)), fixed=True)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=64)))
    barrel = pin.feature("barrel", pin.face(BARREL), tc.Size(10, 0.1))
    points = [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)]
    held = [tc.Locator(f"{n}{k}", p, n.lower(), 0) for k, (n, p) in enumerate(zip("ZZZXYY", points, strict=True))]
    a.locate(pin, held)
    a.contact("fit", moving=barrel, reference=plate.face(tc.select.Cylinder(radius=5)))
    a.measure("x", pin.point(0, 0, 0), along="x")
    program = tc.build(a, method=EXACT)
    deviations = np.zeros((2, len(program.nominal.contributors)))
    deviations[:, -1] = 0.04, -0.04
    rest = np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), (2, 2, 1))
    depth = check_surfaces(program, rest, deviations).penetration[:, 0]
    assert depth == pytest.approx([0.02, 0.0], abs=1e-6)
