"""Files of shapes as strangers send them: none ends or stalls the process, and each fault is one message."""

import base64
import contextlib
import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.helpers import finish, run, script, start
from tests.step_files import Step, corners
from tolcontact.discretization import discretize
from tolcontact.discretization.faces import patch
from tolcontact.discretization.fault import GeometryFault
from tolcontact.discretization.shapes import shape

BLOCK = trimesh.creation.box(bounds=[[0, 0, 0], [10, 20, 30]])
STL, ASCII_STL = BLOCK.export(file_type="stl"), BLOCK.export(file_type="stl_ascii").encode()
PLY, ASCII_PLY = (BLOCK.export(file_type="ply", encoding=encoding) for encoding in ("binary", "ascii"))
GLB, OBJ = BLOCK.export(file_type="glb"), BLOCK.export(file_type="obj").encode()


def refusal(path, content=None):
    """What is said of a file, which may be made of some content first."""
    if content is not None:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(GeometryFault) as refused:
        shape(tc.Mesh(path))
    said = str(refused.value)
    assert path.name in said
    assert len(said) < 2500 and "\n" not in said
    return said


def gltf(uri=None):
    """A block whose first numbers are at a URI, and the rest in the file."""
    files = BLOCK.export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    for buffer in tree["buffers"]:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(files[buffer["uri"]]).decode()
    tree["buffers"][0]["uri"] = uri or tree["buffers"][0]["uri"]
    return json.dumps(tree)


def step(*items):
    """A STEP file of one product: `items` are names of methods of Step, and what they are called with."""
    made = Step()
    made.product("part", [getattr(made, method)(*arguments) for method, *arguments in items])
    return str(made)


def block():
    return step(("solid", (0, 0, 0), (10, 20, 30), "block"))


def crashing():
    """The direction of an edge is a vertex: its reader runs into memory that is not its own."""
    return re.sub(r"VECTOR\('',#\d+", "VECTOR('',#15", block(), count=1)


def stalling():
    """A coordinate that is no number: its reader goes on for ever."""
    return re.sub(r"CARTESIAN_POINT\('',\(0.0", "CARTESIAN_POINT('',(NaN", block(), count=1)


def alone(folder, *names):
    """What is said of an assembly of some files in a folder, by another process, which they may end or stall."""
    done = run(script("read_shapes", 2, *names), cwd=folder, timeout=60)
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert done.stderr == ""
    return done.stdout


def test_a_file_that_brings_its_reader_down_is_a_fault(tmp_path):
    (tmp_path / "rotten.step").write_text(crashing())
    said = alone(tmp_path, "rotten.step")
    assert "rotten.step" in said and "damaged" in said and "export it again" in said


def test_a_file_that_stalls_its_reader_is_a_fault(tmp_path):
    (tmp_path / "endless.step").write_text(stalling())
    said = alone(tmp_path, "endless.step")
    assert "endless.step" in said and "not read within 2 s" in said


def test_all_faults_are_said_at_once_though_the_reader_dies_twice(tmp_path):
    (tmp_path / "rotten.step").write_text(crashing())
    (tmp_path / "rotten too.step").write_text(crashing())
    (tmp_path / "empty.stl").touch()
    (tmp_path / "good.step").write_text(block())
    (tmp_path / "notes.obj").write_bytes(b"these are notes\n")
    said = alone(tmp_path, "rotten.step", "good.step", "rotten too.step", "empty.stl", "notes.obj")
    for name in ("rotten.step", "rotten too.step", "empty.stl", "notes.obj"):
        assert name in said
    assert "good.step" not in said


def test_a_file_that_takes_too_much_memory_is_a_fault(tmp_path, monkeypatch):
    trimesh.creation.icosphere(7).export(tmp_path / "fine.obj")
    monkeypatch.setattr("tolcontact.discretization.shape_files.reader.MEMORY", 350 * 2**20)
    assert "takes more than 0.342 GiB of memory" in refusal(tmp_path / "fine.obj")


def test_each_file_is_read_once_and_one_process_reads_them_all(tmp_path, monkeypatch):
    started, popen = [], subprocess.Popen

    def noting(command, **keywords):
        started.append(json.loads((Path(command[-1]) / "jobs.json").read_text())["files"])
        return popen(command, **keywords)

    monkeypatch.setattr(subprocess, "Popen", noting)
    a = tc.Assembly("many")
    for k, name in enumerate(("a.stl", "b.ply", "a.stl", "c.step")):
        if name == "c.step":
            (tmp_path / name).write_text(block())
        else:
            BLOCK.export(tmp_path / name)
        a.part(f"part {k}", tc.Mesh(tmp_path / name, units="mm" if name != "c.step" else None), fixed=True)
    a.measure("height", a.parts[0].point(0, 0, 30), along="z")
    with contextlib.suppress(tc.TolcontactError):
        discretize(a)
    ((*files,),) = started
    assert [Path(file["path"]).name for file in files] == ["a.stl", "b.ply", "c.step"]


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_the_reader_ends_with_an_interrupted_process(tmp_path):
    (tmp_path / "endless.step").write_text(stalling())
    process = start(script("read_shapes", 50, "endless.step"), cwd=tmp_path)
    try:
        end = time.monotonic() + 40
        while not (readers := children(process.pid)) and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(2)  # it is in the middle of it
        process.send_signal(signal.SIGINT)
        assert finish(process, timeout=10).returncode != 0
        assert readers and not any(Path(f"/proc/{reader}").exists() for reader in readers)
    finally:
        process.kill()
        process.wait()


def children(pid):
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return []


SEVERAL = {
    "solids apart": (
        step(("solid", (0, 0, 0), (10, 20, 30), r"Geh\X2\00E4\X0\use"), ("solid", (50, 0, 0), (51, 1, 1), "right")),
        ['1. "Gehäuse", 10 x 20 x 30 mm at (5, 10, 15)', '2. "right", 1 x 1 x 1 mm at (50.5, 0.5, 0.5)'],
    ),
    "solids that touch": (
        step(("solid", (0, 0, 0), (10, 10, 10), "left"), ("solid", (10, 0, 0), (20, 10, 10), "right")),
        ['1. "left", 10 x 10 x 10 mm at (5, 5, 5)', '2. "right", 10 x 10 x 10 mm at (15, 5, 5)'],
    ),
    "a solid in the cavity of another one, which it fills": (
        step(
            ("solid", (0, 0, 0), (30, 30, 30), "around", ((10, 10, 10), (20, 20, 20))),
            ("solid", (10, 10, 10), (20, 20, 20), "within"),
        ),
        ['1. "around", 30 x 30 x 30', '2. "within", 10 x 10 x 10 mm at (15, 15, 15)'],
    ),
    "a solid and a sheet": (
        step(("solid", (0, 0, 0), (10, 10, 10)), ("sheet", (20, 0, 0), 10)),
        ["10 x 10 x 10 mm", "2. open, ", "10 x 10 x 0 mm at (25, 5, 0)"],
    ),
}


@pytest.mark.parametrize("kind", SEVERAL)
def test_a_step_file_of_several_bodies_is_refused_with_their_list(kind, tmp_path):
    content, expected = SEVERAL[kind]
    said = refusal(tmp_path / "many.step", content)
    assert "holds 2 bodies" in said and "export each as a file of its own" in said
    for words in expected:
        assert words in said


def test_names_in_a_file_do_not_spoil_a_message(tmp_path):
    long = "\x1b[31m red\n" + 300 * "long "
    content = step(("solid", (0, 0, 0), (1, 1, 1), long), ("solid", (2, 0, 0), (3, 1, 1), long))
    said = refusal(tmp_path / "named.step", content)
    assert "\x1b" not in said and "[31m red long long" in said and len(said) < 500


def assembly(*places):
    made = Step()
    solids = {
        "pin": [((0, 0, 0), (5, 5, 5))],
        "set": [
            ((0, 0, 0), (10, 10, 10)),
            ((10, 0, 0), (20, 10, 10)),
            ((0, 0, 20), (30, 30, 50), "", ((10, 10, 30), (20, 20, 40))),
        ],
    }
    names = dict.fromkeys(name for name, _ in places)
    products = {name: made.product(name, [made.solid(*solid) for solid in solids[name]]) for name in names}
    whole = made.product("whole")
    for k, (name, at) in enumerate(places):
        made.place(products[name], whole, f"use {k}", at)
    return str(made)


def test_the_bodies_of_an_assembly_stand_in_their_places(tmp_path):
    said = refusal(tmp_path / "two.step", assembly(("pin", (0, 0, 0)), ("pin", (5, 0, 0))))
    assert "holds 2 bodies" in said
    assert '1. "pin", 5 x 5 x 5 mm at (2.5, 2.5, 2.5)' in said and '2. "pin", 5 x 5 x 5 mm at (7.5, 2.5, 2.5)' in said


def test_touching_solids_of_one_product_are_told_apart(tmp_path):
    said = refusal(tmp_path / "four.step", assembly(("set", (0, 0, 0)), ("pin", (50, 0, 0))))
    assert "holds 4 bodies" in said
    places = ("10 x 10 x 10 mm at (5, 5, 5)", "10 x 10 x 10 mm at (15, 5, 5)", "30 x 30 x 30 mm at (15, 15, 35)")
    for place in (*places, "5 x 5 x 5 mm at (52.5, 2.5, 2.5)"):
        assert place in said


def test_many_bodies_are_counted_and_the_first_of_them_listed(tmp_path):
    said = refusal(tmp_path / "many.step", step(*[("solid", (2 * k, 0, 0), (2 * k + 1, 1, 1)) for k in range(15)]))
    assert "holds 15 bodies" in said and "12. without a name" in said and said.endswith("and 3 more")


ONE = {
    "a solid": (block(), 6000, True),
    "a cavity": (step(("solid", (0, 0, 0), (30, 30, 30), "", ((10, 10, 10), (20, 20, 20)))), 26000, True),
    "a sheet": (step(("sheet", (0, 0, 0), 10)), None, False),
    "sheets that are not sewn": (step(("sheet", (0, 0, 0), 10), ("sheet", (20, 0, 0), 10)), None, False),
    "an assembly of one": (assembly(("pin", (7, 0, 0))), 125, True),
}


@pytest.mark.parametrize("kind", ONE)
def test_one_body_is_read_whatever_it_consists_of(kind, tmp_path):
    content, volume, closed = ONE[kind]
    (tmp_path / "one.step").write_text(content)
    mesh = shape(tc.Mesh(tmp_path / "one.step")).mesh
    assert mesh.is_watertight == closed
    assert volume is None or mesh.volume == pytest.approx(volume)


def test_edges_shorter_than_can_be_resolved_do_no_harm(tmp_path):
    """The corners of a block of 1 m, each cut off by as little as CAD kernels leave by mistake."""
    made = Step()
    size, cut = 1000.0, 2e-6
    cornered, faces = cut_corner(size, cut)
    made.product("cut", [made.add(f"MANIFOLD_SOLID_BREP('',#{made.shell(cornered, faces=faces)})")])
    (tmp_path / "cut.step").write_text(str(made))
    mesh = shape(tc.Mesh(tmp_path / "cut.step")).mesh
    assert mesh.is_watertight and mesh.volume == pytest.approx(size**3)
    assert (mesh.area_faces > 0).all()


def cut_corner(size, cut):
    """Corners and faces of a block, whose corner at the top is cut off by a small triangle."""
    eight = corners((0, 0, 0), (size, size, size))
    own = [*eight[:6], (size - cut, size, size), eight[7], (size, size - cut, size), (size, size, size - cut)]
    faces = [(0, 3, 2, 1), (4, 5, 8, 6, 7), (0, 1, 5, 4), (1, 2, 9, 8, 5), (2, 3, 7, 6, 9), (3, 0, 4, 7), (6, 8, 9)]
    return own, faces


def test_a_solid_that_lost_a_face_is_not_taken_for_a_sheet(tmp_path):
    content = re.sub(r"PLANE\('',#\d+\)", "PLANE('',#1)", block(), count=1)
    said = refusal(tmp_path / "holed.step", content)
    assert "do not close" in said and "5 of 6 faces" in said


def external(name):
    made = Step()
    definition, _ = made.product("whole")
    kind = made.add("DOCUMENT_TYPE('geometry')")
    document = made.add(f"DOCUMENT_FILE('{name}','','',#{kind},'',$)")
    made.add(f"APPLIED_DOCUMENT_REFERENCE(#{document},'',(#{definition}))")
    return made


def test_shapes_in_other_files_are_named(tmp_path):
    said = refusal(tmp_path / "top.step", str(external("lid.stp")))
    assert '"lid.stp"' in said and "other files" in said
    part = external("lid.stp")
    part.product("part", [part.solid((0, 0, 0), (10, 10, 10))])
    assert '"lid.stp"' in refusal(tmp_path / "top and part.step", str(part))
    drawing = external("drawing.pdf")
    drawing.product("part", [drawing.solid((0, 0, 0), (10, 10, 10))])
    (tmp_path / "drawn.step").write_text(str(drawing))
    assert shape(tc.Mesh(tmp_path / "drawn.step")).mesh.is_watertight


WEB, ZIP = b"<!DOCTYPE html><html><body>404: not found</body></html>", b"PK\x03\x04" + bytes(200)
WRONG = {
    "empty.stl": (b"", ["is empty"]),
    "empty.step": (b"", ["is empty"]),
    "cut.stl": (STL[:400], ["cut off", "12 triangles", "684 bytes", "400"]),
    "cut.ascii.stl": (ASCII_STL[:-50], ["cut off", "endsolid"]),
    "counted.stl": (STL[:80] + b"\xff" * 4 + STL[84:], ["4294967295 triangles"]),
    "step.stl": (block().encode(), ["STEP", "rename it to .step"]),
    "stl.step": (ASCII_STL, ["STL", "rename it to .stl"]),
    "page.step": (WEB, ["web page", "download"]),
    "page.stl": (WEB, ["web page", "download"]),
    "page.obj": (WEB, ["web page", "download"]),
    "zip.step": (ZIP, ["ZIP", "unpack"]),
    "zip.glb": (ZIP, ["ZIP", "unpack"]),
    "noise.step": (bytes(range(256)) * 9, ["no STEP file"]),
    "noise.obj": (b"v \xff\xfe\xfd 1 1\nf 1 1 1\n" * 9, ["cannot be read as a mesh"]),
    "noise.ply": (bytes(range(256)) * 9, ["no PLY file"]),
    "noise.gltf": (bytes(range(256)) * 9, ["no glTF file"]),
    "nested.gltf": (b'{"a":' * 100_000, ["no glTF file"]),
    "counted.ply": (PLY.replace(b"vertex 8", b"vertex 4000000000"), ["4000000012", "bytes"]),
    "cut.ply": (ASCII_PLY[:-25], ["cut off", "20 lines"]),
    "cut.glb": (GLB[:-100], ["cut off", str(len(GLB))]),
    "garbled.glb": (GLB[:20] + b"\xff" * 8 + GLB[28:], ["where it should hold words"]),
    "counted.gltf": (gltf().replace('"count": 36', '"count": 1099511627776'), ["cannot be read as a mesh"]),
    "above.gltf": (gltf("../numbers.bin"), ['"../numbers.bin"', "not lie in its folder"]),
    "elsewhere.gltf": (gltf("/etc/hostname"), ['"/etc/hostname"', "not lie in its folder"]),
    "remote.gltf": (gltf("http://127.0.0.1:9/a.bin"), ['"http://127.0.0.1:9/a.bin"', "not lie in its folder"]),
    "missing.gltf": (gltf("numbers.bin"), ['"numbers.bin"', "not there"]),
    "far.obj": (OBJ.replace(b"30.00000000", b"1e150"), ["reaches as far as 1e+150 mm"]),
    "index.obj": (OBJ + b"f 1 2 99999999\n", ["cannot be read as a mesh"]),
}


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
    assert shape(tc.Mesh(tmp_path / "block.gltf", units="mm")).mesh.volume == pytest.approx(6000)


@pytest.mark.skipif(os.name != "posix", reason="a pipe with a name")
def test_materials_of_an_obj_file_are_left_alone(tmp_path):
    os.mkfifo(tmp_path / "endless.mtl")
    named = b"mtllib endless.mtl\nmtllib /etc/hostname\no Geh\xe4use\nusemtl a\n" + OBJ
    (tmp_path / "block.obj").write_bytes(named)
    assert shape(tc.Mesh(tmp_path / "block.obj")).mesh.volume == pytest.approx(6000)


@pytest.mark.parametrize("suffix", ["glb", "stl"])
def test_bodies_that_touch_in_one_mesh_file_are_read(suffix, tmp_path):
    scene = trimesh.Scene()
    for at in ((0, 0, 0), (10, 0, 0), (0, 0, -30), (10, 20, 0)):
        scene.add_geometry(BLOCK, transform=trimesh.transformations.translation_matrix(at))
    scene.export(tmp_path / f"touching.{suffix}")
    mesh = shape(tc.Mesh(tmp_path / f"touching.{suffix}", units="mm")).mesh
    assert mesh.volume == pytest.approx(4 * 6000)
    assert suffix == "stl" or mesh.body_count == 4


def test_colours_do_not_part_a_body(tmp_path):
    scene = trimesh.Scene()
    for side in (True, False):
        half = trimesh.Trimesh(BLOCK.vertices, BLOCK.faces[(BLOCK.face_normals[:, 2] > 0.5) == side])
        scene.add_geometry(half)
    scene.export(tmp_path / "coloured.glb")
    mesh = shape(tc.Mesh(tmp_path / "coloured.glb", units="mm")).mesh
    assert mesh.is_watertight and len(mesh.vertices) == 8


def test_coloured_faces_of_a_step_file_are_still_faces(tmp_path):
    made = Step()
    shell = made.shell(corners((0, 0, 0), (10, 20, 30)))
    made.product("painted", [made.add(f"MANIFOLD_SOLID_BREP('',#{shell})")])
    made.paint(shell, red=1.0)
    (tmp_path / "painted.step").write_text(str(made))
    part = tc.Assembly("painted").part("block", tc.Mesh(tmp_path / "painted.step"))
    meshes = {part: shape(part.geometry).mesh}
    for at, area in (((5, 10, 0), 200), ((5, 10, 30), 200), ((0, 10, 15), 600), ((5, 0, 15), 300)):
        assert patch(part.face(tc.Brep(at)), meshes).mesh.area == pytest.approx(area)


def test_nothing_is_printed_and_nothing_left_behind(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    refusal(tmp_path / "rotten.step", block().replace("VERTEX_POINT", "VERTEX_PINT"))
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == ["rotten.step"]
    assert np.isfinite(shape(tc.Mesh(BLOCK)).mesh.vertices).all()
