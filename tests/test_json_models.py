"""Models as JSON: exact round trips, by the published schema, and errors that state the place in the file."""

import json
import re

import numpy as np
import pytest
import trimesh
import xarray as xr
from jsonschema import Draft202012Validator

import tolcontact as tc
from tests import cases
from tests.cases import floating, toleranced
from tests.helpers import PAPER, assembly_of, call, compiled, json_schema, nightly
from tolcontact.errors import ScriptError
from tolcontact.testing import assert_same_run

PLAIN = {
    "name": "stand",
    "parts": [
        {"name": "table", "geometry": {"box": [100, 50, 10]}, "fixed": True},
        {"name": "block", "geometry": {"box": [50, 25, 10]}, "at": [50, 12.5, 10]},
    ],
    "locations": [
        {
            "part": "block",
            "tolerance": 1,
            "scheme": {"three_two_one": [{"part": "block", "select": [way]} for way in ("-z", "-y", "-x")], "inset": 5},
        }
    ],
    "pairs": [
        {
            "name": "interface",
            "moving": {"part": "block", "select": ["-z"]},
            "reference": {"part": "table", "select": ["+z", {"inside": [[0, 0, 9], [100, 50, 11]]}]},
        }
    ],
    "measures": [{"name": "height", "of": {"part": "block", "position": [50, 0, 10]}, "along": "z", "tolerance": 1}],
}


def written(model, path):
    tc.io.write_model(model, path)
    document = json.loads(path.read_text())
    Draft202012Validator(json_schema()).validate(document)
    return document


def test_the_schema_is_sound_and_defines_all_that_it_refers_to():
    schema = json.loads(json.dumps(json_schema()))
    Draft202012Validator.check_schema(schema)
    references = set(re.findall(r'"#/\$defs/([^"]*)"', json.dumps(schema)))
    assert references and references <= set(schema["$defs"])


def with_everything(folder):
    a = toleranced.block_with(
        "top",
        tc.Profile(0.3, "A|B", rule="6 sigma at the extremes", tangent=True),
        tc.Flatness(0.1, form=tc.Form("matern 3/2", 20)),
    )
    own = tc.Flatness(0.1, per=(25, 10), form=None)
    block = a.parts[0]
    block.feature("far", block.face("+x"), tc.Position(0.2, "A|B|C", cp=1.5, cpk=1.2), own)
    block.feature("deep", block.face("+y"), block.face("-y"), tc.Size(50, 0.1, -0.02, moves="first"))
    sides = block.pattern("X", block.features[0], block.features[1], datum="X")
    block.datum_targets("T", block.features[-2].point(100, 0, 0), sides.members[1].point(0, 0, 0))
    a.variable("warmth", tc.Tolerance(20, "uniform", shift=1), drives={"block.top.offset": 0.002}, units="K")
    a.correlate(["block.far.tilt y", "block.far.tilt z"], 0.5)
    a.population({"block.far.offset": [0.1, -0.2, 0.3]})
    shape = folder / "Stück 1.stl"
    trimesh.creation.annulus(5, 9, 6).export(shape)
    ring = a.part("ring", tc.Mesh(shape, units="mm"), at=(121, 45, 32))
    held = [tc.Locator(f"Z{k}", p, (0, 0, 1), 0.2, one_sided=k == 2) for k, p in enumerate([(0, 0, 0), (5, 0, 0), (0, 5, 0)])]
    a.locate(ring, held, floating=True, on=block)
    a.contact("beside", moving=ring.face(tc.select.Near(block, 9)), reference=block.face(lambda c, n: n[:, 0] > 0.9), within=9)
    a.force("weight", at=ring.point(0, 0, 3), vector=(0, 0, -2))
    a.measure("distance", ring.point(0, 0, 3), to=block.features[-1].point(100, 50, 10), along=(1, 2, 0))
    a.measure("turn", lambda poses: poses.rotation(ring)[0, 1], units="rad")
    return a


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plain", "everything", *nightly("shaft", "lid", "model")])
def test_models_come_back_exactly(name, tmp_path):
    models = {
        "everything": with_everything, "shaft": lambda _: floating.floating_shaft_in_a_v(),
        "lid": lambda _: cases.model("lid"), "model": lambda _: cases.model("ra1"),
    }  # fmt: skip
    if name == "plain":
        (tmp_path / "model.json").write_text(json.dumps(PLAIN))
        model = assembly_of(tmp_path / "model.json")
    else:
        model = models[name](tmp_path)
        for part in model.parts:  # of meshes JSON names the file
            if isinstance(part.geometry, tc.Mesh) and hasattr(part.geometry.source, "export"):
                file = tmp_path / f"{part.name}.stl"
                part.geometry.source.export(file)
                object.__setattr__(part.geometry, "source", file)
    document = written(model, tmp_path / "first.json")
    again = assembly_of(tmp_path / "first.json")
    assert written(again, tmp_path / "second.json") == document
    if name in ("plain", "model"):
        programs = [compiled(each, method={"resolution": "exact"}) for each in (model, again)]
        assert_same_run(*(tc.run(program, samples=200, surfaces=0) for program in programs))


@pytest.mark.slow
def test_what_is_left_out_has_the_value_that_a_script_would_have(tmp_path):
    (tmp_path / "stand.json").write_text(json.dumps(PLAIN))
    done = call(tmp_path, "run", "stand.json", "--samples", "50")
    assert done.returncode == 0 and "height (mm): displacement, limits -0.5 to 0.5" in done.stdout
    checked = call(tmp_path, "check", "stand.json")
    assert "no faults found" in checked.stdout


def changed(**words):
    return {**PLAIN, **words}


@pytest.mark.parametrize(
    ("document", "said"),
    [
        (changed(parts=[{**PLAIN["parts"][0], "geometri": 1}]), "parts[0]: unknown name 'geometri'"),
        (changed(parts=[{"name": "a", "geometry": {"box": [1, 2]}}]), "parts[0].geometry"),
        (changed(measures=[{"name": "x", "of": {"part": "Block", "position": [0, 0, 0]}, "along": "z"}]),
         "measures[0].of.part: expected"),
        (changed(locations=[{**PLAIN["locations"][0], "tolerance": -1}]), "locations[0].tolerance"),
        (changed(pairs=[{**PLAIN["pairs"][0], "points": 0}]), "pairs[0].points"),
        (changed(method={"resolution": "precise"}), "method.resolution"),
        ([1, 2], "expected named values, got a list"),
        (changed(forces=[{"name": "w", "at": {"part": "block", "position": [0, 0, 0], "on": "top"}, "vector": [0, 0, 1]}]),
         'forces[0].at.on: expected the name of a feature of part "block"'),
    ],
)  # fmt: skip
def test_errors_state_the_place(document, said, tmp_path):
    path = tmp_path / "odd, größer.json"
    path.write_text(json.dumps(document))
    with pytest.raises(ScriptError) as refused:
        assembly_of(path)
    assert said in str(refused.value) and "odd, größer.json" in str(refused.value)


@pytest.mark.slow
def test_what_is_no_json_is_said(tmp_path):
    path = tmp_path / "model.json"
    path.write_text('{"name": ')
    done = call(tmp_path, "check", path)
    assert done.returncode == 2 and "cannot be read as JSON" in done.stderr and "Traceback" not in done.stderr


def test_a_mesh_without_a_file_cannot_be_named(tmp_path):
    a = tc.Assembly("ring")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(5, 9, 6)), fixed=True)
    a.measure("x", ring.point(0, 0, 0), along="x")
    with pytest.raises(ScriptError, match='part "ring": its mesh is no file'):
        tc.io.write_model(a, tmp_path / "ring.json")
    assert not (tmp_path / "ring.json").exists()


def test_an_archive_does_not_name_files():
    """Of strangers' archives no file is read: shapes are in them."""
    results = tc.run(compiled(cases.ra1(), method=PAPER), samples=5, surfaces=0)
    document = json.loads(str(results["model"].declaration.values))
    document["parts"][0]["geometry"] = {"file": "/etc/hostname"}
    results["model"]["declaration"] = xr.DataArray(json.dumps(document))
    with pytest.raises(tc.errors.ArchiveError, match="a part with a mesh, or with a box"):
        tc.io.model_of(results)


def test_numbers_of_numpy_are_written_as_plain_ones(tmp_path):
    def model(number, vector):
        a = tc.Assembly("block on a table")
        table, block = a.part("table", tc.Box(number(100), 50, 10)), a.part("block", tc.Box(50, 25, 10), at=vector(50, 12, 10))
        for part in (table, block):
            scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=number(5))
            a.locate(part, scheme, tolerance=number(1))
        a.contact("seat", moving=block.face("-z"), reference=table.face("+z"), points=50)
        a.measure("height", block.point(number(50), 0, 10), along=vector(0, 0, 1), tolerance=number(1))
        return a

    def written(assembly, path):
        tc.io.write_model(assembly, path)
        return json.loads(path.read_text())

    plain = written(model(float, lambda *values: values), tmp_path / "plain.json")
    for number in (np.float64, np.float32, np.int64):
        document = written(model(number, lambda *values: np.array(values, dtype=float)), tmp_path / "numpy.json")
        assert document == plain
