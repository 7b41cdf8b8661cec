"""Files of meshes as strangers send them: each fault is one message."""

import base64
import json
import os

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.helpers import posix_only
from tests.shapes import BLOCK, refusal, shape
from tests.step_files import step_block
from tolcontact.errors import GeometryFault

STL, ASCII_STL = BLOCK.export(file_type="stl"), BLOCK.export(file_type="stl_ascii").encode()

PLY, ASCII_PLY = (BLOCK.export(file_type="ply", encoding=encoding) for encoding in ("binary", "ascii"))

GLB, OBJ = BLOCK.export(file_type="glb"), BLOCK.export(file_type="obj").encode()


def gltf(uri=None):
    """A block whose first numbers are at a URI, and the rest in the file."""
    files = BLOCK.export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    for buffer in tree["buffers"]:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(files[buffer["uri"]]).decode()
    tree["buffers"][0]["uri"] = uri or tree["buffers"][0]["uri"]
    return json.dumps(tree)


WEB, ZIP = b"<!DOCTYPE html><html><body>404: not found</body></html>", b"PK\x03\x04" + bytes(200)

WRONG = {
    "empty.stl": (b"", ["is empty"]),
    "empty.step": (b"", ["is empty"]),
    "cut.stl": (STL[:400], ["cut off", "12 triangles", "684 bytes", "400"]),
    "cut.ascii.stl": (ASCII_STL[:-50], ["cut off", "endsolid"]),
    "counted.stl": (STL[:80] + b"\xff" * 4 + STL[84:], ["4294967295 triangles"]),
    "step.stl": (step_block().encode(), ["STEP", "rename it to .step"]),
    "stl.step": (ASCII_STL, ["STL", "rename it to .stl"]),
    "page.step": (WEB, ["web page", "download"]),
    "page.stl": (WEB, ["web page", "download"]),
    "page.obj": (WEB, ["web page", "download"]),
    "zip.step": (ZIP, ["ZIP", "unpack"]),
    "zip.glb": (ZIP, ["ZIP", "unpack"]),
    "noise.step": (bytes(range(256)) * 9, ["not a STEP file"]),
    "noise.obj": (b"v \xff\xfe\xfd 1 1\nf 1 1 1\n" * 9, ["cannot be read as a mesh"]),
    "noise.ply": (bytes(range(256)) * 9, ["not a PLY file"]),
    "noise.gltf": (bytes(range(256)) * 9, ["not a glTF file"]),
    "nested.gltf": (b'{"a":' * 100_000, ["not a glTF file"]),
    "counted.ply": (PLY.replace(b"vertex 8", b"vertex 4000000000"), ["4000000012", "bytes"]),
    "cut.ply": (ASCII_PLY[:-25], ["cut off", "20 lines"]),
    "cut.glb": (GLB[:-100], ["cut off", str(len(GLB))]),
    "garbled.glb": (GLB[:20] + b"\xff" * 8 + GLB[28:], ["does not contain text where it should"]),
    "counted.gltf": (gltf().replace('"count": 36', '"count": 1099511627776'), ["cannot be read as a mesh"]),
    "above.gltf": (gltf("../numbers.bin"), ['"../numbers.bin"', "is outside its folder"]),
    "elsewhere.gltf": (gltf("/etc/hostname"), ['"/etc/hostname"', "is outside its folder"]),
    "remote.gltf": (gltf("http://127.0.0.1:9/a.bin"), ['"http://127.0.0.1:9/a.bin"', "is outside its folder"]),
    "missing.gltf": (gltf("numbers.bin"), ['"numbers.bin"', "does not exist"]),
    "far.obj": (OBJ.replace(b"30.00000000", b"1e150"), ["reaches as far as 1e+150 mm"]),
    "index.obj": (OBJ + b"f 1 2 99999999\n", ["cannot be read as a mesh"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_one_message(name, tmp_path):
    content, expected = WRONG[name]
    said = refusal(tmp_path / name, content)
    for words in expected:
        assert words in said, said
    assert "charset" not in said


def test_a_folder_is_no_file(tmp_path):
    (fault,) = tc.Mesh(tmp_path).faults()
    assert "is a folder" in fault


def test_a_gltf_file_finds_its_numbers_beside_it(tmp_path):
    for name, content in BLOCK.export(file_type="gltf").items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "model.gltf").rename(tmp_path / "block.gltf")
    assert shape(tc.Mesh(tmp_path / "block.gltf", units="mm")).volume == pytest.approx(6000)


@posix_only
def test_materials_of_an_obj_file_are_left_alone(tmp_path):
    os.mkfifo(tmp_path / "endless.mtl")
    named = b"mtllib endless.mtl\nmtllib /etc/hostname\no Geh\xe4use\nusemtl a\n" + OBJ
    (tmp_path / "block.obj").write_bytes(named)
    assert shape(tc.Mesh(tmp_path / "block.obj")).volume == pytest.approx(6000)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["glb", "stl"])
def test_bodies_that_touch_in_one_mesh_file_are_read(suffix, tmp_path):
    scene = trimesh.Scene()
    for at in ((0, 0, 0), (10, 0, 0), (0, 0, -30), (10, 20, 0)):
        scene.add_geometry(BLOCK, transform=trimesh.transformations.translation_matrix(at))
    scene.export(tmp_path / f"touching.{suffix}")
    mesh = shape(tc.Mesh(tmp_path / f"touching.{suffix}", units="mm"))
    assert mesh.volume == pytest.approx(4 * 6000)
    assert suffix == "stl" or mesh.body_count == 4


def test_colours_do_not_part_a_body(tmp_path):
    scene = trimesh.Scene()
    for side in (True, False):
        half = trimesh.Trimesh(BLOCK.vertices, BLOCK.faces[(BLOCK.face_normals[:, 2] > 0.5) == side])
        scene.add_geometry(half)
    scene.export(tmp_path / "coloured.glb")
    mesh = shape(tc.Mesh(tmp_path / "coloured.glb", units="mm"))
    assert mesh.is_watertight and len(mesh.vertices) == 8


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["stl", "ply"])
def test_files_with_corners_that_are_no_numbers_are_refused(suffix, tmp_path):
    bad = trimesh.Trimesh(BLOCK.vertices * np.where(np.arange(8) == 3, np.nan, 1)[:, None], BLOCK.faces, process=False)
    bad.export(tmp_path / f"bad.{suffix}")
    with pytest.raises(GeometryFault, match="not finite"):
        shape(tc.Mesh(tmp_path / f"bad.{suffix}"))


def test_words_in_a_ply_header_are_not_its_counts(tmp_path):
    text = "ply\nformat ascii 1.0\ncomment front face 2000000 x\nelement vertex 3\nproperty float x\nproperty float y\n"
    text += (
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    (tmp_path / "one.ply").write_text(text)
    assert len(shape(tc.Mesh(tmp_path / "one.ply")).faces) == 1


def test_the_bodies_of_a_scene_stand_in_their_places(tmp_path):
    scene = trimesh.Scene()
    for k in range(3):
        scene.add_geometry(BLOCK, transform=trimesh.transformations.translation_matrix((20 * k, 0, 5 * k)))
    scene.export(tmp_path / "three.glb")
    mesh = shape(tc.Mesh(tmp_path / "three.glb", units="mm"))
    assert mesh.body_count == 3
    assert mesh.bounds.tolist() == [[0, 0, 0], [50, 20, 40]]
    assert mesh.volume == pytest.approx(3 * BLOCK.volume)
