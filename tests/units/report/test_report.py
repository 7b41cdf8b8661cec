"""Insides of `report` under the claims of `tests/test_report.py`."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.test_report import data_of, page_of, unpacked
from tolcontact.report import grouped
from tolcontact.report.html import scene


@pytest.mark.slow
def test_bodies_of_many_triangles_are_drawn_with_fewer(tmp_path):
    a = tc.Assembly("ball")
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(subdivisions=6, radius=50)))
    small = a.part("small", tc.Box(10, 20, 10), at=(200, 0, 0), fixed=True)
    a.locate(ball, cases.translating(0.1))
    a.measure("height", ball.point(0, 0, 50), to=small.point(0, 0, 0), along="z")
    tc.run(a, samples=50, out=tmp_path / "ball.nc").close()
    page = page_of(tmp_path / "ball.nc", tmp_path / "ball.html")
    part = data_of(page)["scene"]["parts"][0]
    count = part["faces"]["shape"][0]
    assert count <= scene.MAX_TRIANGLES < part["triangles"] == 81_920
    assert f"fewer triangles than they have: ball {grouped(count)} of {grouped(81_920)}" in page
    vertices = unpacked(part["vertices"])
    assert np.abs(np.linalg.norm(vertices, axis=1) - 50).max() < 0.5
    field = unpacked(part["sixSigma"])
    assert field.shape == (2, len(vertices), 4) and np.ptp(field[0, :, 2]) < 1e-5  # it does not turn: all points go alike


@pytest.mark.slow
def test_a_plate_with_finely_divided_holes_is_drawn_with_fewer_triangles():
    """Slivers between far corners and short edges, which the first simplification leaves as they are."""
    ring = trimesh.creation.annulus(20, 2000, 10, sections=8000)
    vertices, faces, nearest = scene.coarser(np.asarray(ring.vertices), np.asarray(ring.faces), 3000)
    assert len(faces) <= 3000 and nearest.max() < len(ring.vertices)
    off = trimesh.Trimesh(vertices, faces, process=False)
    assert off.area == pytest.approx(ring.area, rel=1e-3) and np.abs(off.bounds - ring.bounds).max() < 0.5
