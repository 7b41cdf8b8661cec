"""Files as other systems write them: names in old encodings, and mirrored nodes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.helpers import ROOT
from tolcontact.discretization import discretize

COVER = ROOT / "models" / "cover.step"
NAME = b"PRODUCT('COMPOUND','COMPOUND'"
NAMES = {
    "gb18030": "左车门", "shift_jis": "ドア左", "latin-1": "Türgriff", "utf-8": "Größe 左 ドア", "gb2312": "后保险杠（右）",
    "iso8859-1": "Äußere Übergröße", "ascii": "door",
}  # fmt: skip


def renamed(path: Path, name: bytes) -> Path:
    text = COVER.read_bytes()
    assert text.count(NAME) == 1
    path.write_bytes(text.replace(NAME, b"PRODUCT('%b','%b'" % (name, name)))
    return path


@pytest.mark.parametrize(("encoding", "name"), NAMES.items(), ids=NAMES)
def test_names_of_bodies_are_read_in_the_encoding_that_they_were_written_in(encoding, name, tmp_path):
    bodies = list(tc.io.bodies_in(renamed(tmp_path / "part.step", name.encode(encoding))))
    assert [body.name for body in bodies] == [name]


@pytest.mark.parametrize("written", [rb"T\S\|r", rb"T\X\FCr", rb"T\X2\00FC\X0\r"])
def test_names_in_the_codes_of_the_norm_are_read(written, tmp_path):
    assert [body.name for body in tc.io.bodies_in(renamed(tmp_path / "part.step", written))] == ["Tür"]


@pytest.mark.parametrize(("angle", "around"), [(0.0, (1, 1)), (0.7, (1, 1)), (0.7, (-1, 1))])
def test_a_mirrored_node_is_a_body_with_its_normals_outward(angle, around, tmp_path):
    """A wedge without a mirror plane is the wedge mirrored before; two mirrors, one around the other, are a rotation."""
    wedge = trimesh.convex.convex_hull([(0, 0, 0), (40, 0, 0), (0, 20, 0), (0, 0, 10), (5, 5, 8)])
    mirror = trimesh.transformations.rotation_matrix(angle, [1, 2, 3]) @ np.diag([-1.0, 1, 1, 1])
    scene = trimesh.Scene()
    outer = np.diag([1.0, *around, 1])
    scene.graph.update(frame_to="around", matrix=outer)
    scene.add_geometry(wedge, node_name="left", geom_name="door", parent_node_name="around", transform=mirror)
    scene.export(tmp_path / "left.glb")
    a = tc.Assembly("door")
    part = a.part("left", tc.Mesh(tmp_path / "left.glb", units="mm"), fixed=True)
    a.measure("x", part.point(0, 0, 0), along="x")
    body = discretize(a).parts[0].body
    corners = trimesh.transform_points(wedge.vertices, outer @ mirror)
    assert body.volume == pytest.approx(wedge.volume, rel=1e-6)
    np.testing.assert_allclose(np.sort(body.vertices, axis=0), np.sort(corners, axis=0), atol=1e-5)
