"""Insides of `geometry` under the claims of `tests/test_shape_files.py`."""

import pytest

import tolcontact as tc
from tests.shapes import shape
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import ReadingLimits


def test_ten_million_triangles_are_refused_with_their_number_before_they_are_read(tmp_path):
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.write(b"\0" * 80 + (10_000_000).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10_000_000)
    with pytest.raises(GeometryFault, match=f"10000000 triangles, more than the limit of {ReadingLimits().triangles}"):
        shape(tc.Mesh(path))
    (tmp_path / "huge.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 10000000\nend_header\n")
    with pytest.raises(GeometryFault, match="10000000 triangles"):
        shape(tc.Mesh(tmp_path / "huge.ply"))
