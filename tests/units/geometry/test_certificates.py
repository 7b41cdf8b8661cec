"""Insides of `geometry` under the claims of `tests/test_certificates.py`."""

import numpy as np

import tolcontact as tc
from tests.shapes import patch, shape
from tolcontact.discretization import discretize
from tolcontact.geometry.overlap import overlap_corners


def test_flat_faces_have_points_where_their_rims_cross():
    """A bar across a bar: the corners of the square in which they lie over each other; and a small plate under a large one."""
    a = tc.Assembly("cross")
    beam = a.part("beam", tc.Box(100, 10, 10), at=(0, 45, -10), fixed=True)
    bar = a.part("bar", tc.Box(10, 100, 10), at=(45, 0, 0))
    foot = a.part("foot", tc.Box(3, 3, 3), at=(80, 48, -13), fixed=True)
    a.locate(bar, tc.three_two_one(bar.face("-z"), bar.face("-y"), bar.face("-x"), inset=1), tolerance=1)
    a.locate(beam, tc.three_two_one(beam.face("-z"), beam.face("-y"), beam.face("-x"), inset=1), tolerance=0)
    a.contact("across", moving=bar.face("-z"), reference=beam.face("+z"))
    a.contact("told", moving=bar.face("-z"), reference=beam.face("+z"), points=200)
    a.measure("z", bar.point(0, 0, 0), along="z", tolerance=1)
    across, said = discretize(a).pairs
    corners = {(45.0, 45.0, 0.0), (45.0, 55.0, 0.0), (55.0, 45.0, 0.0), (55.0, 55.0, 0.0)}
    assert corners <= {tuple(p) for p in across.P_m.round(9)}
    assert not corners <= {tuple(p) for p in said.P_m.round(9)}  # points that were asked for are left as they are
    below = overlap_corners(_patch_of(beam, "-z"), _patch_of(foot, "+z"))
    assert {tuple(p) for p in below.round(9)} == {(x, y, -10.0) for x in (80.0, 83.0) for y in (48.0, 51.0)}


def _patch_of(part, direction):
    mesh = shape(part.geometry)
    return patch(part.face(direction), {part: mesh}).placed(np.eye(3), np.array(part.at))
