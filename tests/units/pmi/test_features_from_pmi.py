"""Insides of `pmi` under the claims of `tests/test_features_from_pmi.py`."""

from pathlib import Path

import pytest

import tolcontact as tc
from tests.pmi_records import Annotated
from tests.step_files import Step
from tests.test_cad import COVER
from tests.test_features_from_pmi import HOLE, ROUND, TOP, cover, datums, drawing, spreads, spreads_of
from tolcontact.geometry.shapes import shape
from tolcontact.pmi import OF_DATUMS, OF_TOLERANCES
from tolcontact.pmi.declared import declared_file
from tolcontact.pmi.drafts import declare_features
from tolcontact.pmi.reading import read_pmi
from tolcontact.pmi.script import script


def test_the_script_of_a_file_declares_the_same(tmp_path):
    part = cover(drawing, tmp_path)
    tc.io.features_from_pmi(part)
    path = part.geometry.source
    text = script(path, declared_file(path, tc.io.read_pmi(path)))
    namespace = {"__name__": "model"}
    exec(compile(text, "model.py", "exec"), namespace)
    model = namespace["assembly"]()
    (written,) = model.parts
    assert written.name == "COMPOUND" and [str(feature).replace("COMPOUND", "cover") for feature in written.toleranced] == [
        str(feature) for feature in part.toleranced
    ]
    expected = {label.split(".", 1)[1]: spread for label, spread in spreads(part).items()}
    actual = {label.split(".", 1)[1]: spread for label, spread in spreads_of(model).items()}
    assert {label: actual[label] for label in expected} == pytest.approx(expected, rel=1e-6)
    assert len(actual) == len(expected) + 6
    assert "not declared" not in text
    assert max(len(line) for line in text.splitlines() if str(path) not in line) <= 120  # a path is as long as it is


def test_each_body_of_a_file_gets_its_features(tmp_path):
    made = Step()
    made.product("pair", [made.solid((0, 0, 0), (10, 20, 30)), made.solid((40, 0, 0), (50, 20, 30))])
    file = Annotated(str(made))
    file.datum("A", 1)
    file.tolerance("surface_profile", 0.2, file.aspect(2, 8), "A")
    file.tolerance("flatness", 0.1, file.aspect(7))
    path = file.write(tmp_path / "pair.stp")
    declared = declared_file(path, tc.io.read_pmi(path))
    assert [[str(feature) for feature in part.toleranced] for part in declared.parts] == [
        [
            "feature A of body 1 (datum A): body 1 B-rep face 1",
            "feature plane 2 of body 1: body 1 B-rep face 2; profile 0.2 A",
        ],
        ["feature plane 1 of body 2: body 2 B-rep face 1; flatness 0.1"],
    ]  # fmt: skip
    assert [(one.features, one.reason) for one in declared.annotations] == [
        (("body 1.A",), ""), (("body 1.plane 2",), "body 2: datum A is not declared"), (("body 2.plane 1",), ""),
    ]  # fmt: skip


def test_a_body_whose_shape_cannot_be_used_is_left_out_with_the_reason(tmp_path):
    made, corners = Step(), [(60, 0, 0), (70, 0, 0), (70, 10, 0), (60, 10, 0), (80, 0, 0), (80, 10, 0)]
    solid = made.solid((0, 0, 0), (10, 20, 30))
    sheet = made.shell(corners, "OPEN_SHELL", [(0, 1, 2, 3), (1, 2, 5, 4)])  # one face is seen from below
    made.product("pair", [solid, made.add(f"SHELL_BASED_SURFACE_MODEL('',(#{sheet}))")])
    file = Annotated(str(made))
    file.tolerance("flatness", 0.1, file.aspect(5, 7))
    path = file.write(tmp_path / "pair.stp")
    declared = declared_file(path, tc.io.read_pmi(path))
    assert [(one.features, one.reason) for one in declared.annotations] == [
        (("plane 5",), "1 of its 2 faces are not on the part")
    ]
    (fault,) = declared.faults
    assert fault.startswith("body 2: mesh pair.stp 2: neighbouring triangles are oriented inconsistently at 1 edges")
    assert str(declared).endswith(fault) and "    # - body 2: mesh pair.stp 2: neighbouring" in script(path, declared)


def test_a_file_whose_annotations_have_no_faces_has_a_reason_for_each(tmp_path):
    file = Annotated(COVER.read_text())
    file.tolerance("flatness", 0.1, file.aspect())
    file.size(file.aspect(), 8.1, (-0.1, 0.1))
    path = file.write(tmp_path / "cover.stp")
    declared = declared_file(path, tc.io.read_pmi(path))
    assert declared.parts == () and [one.reason for one in declared.annotations] == ["the file states no face for it"] * 2


def test_each_modifier_is_declared_or_refused_with_its_standard_as_the_table_of_the_guide_has_it(tmp_path):
    """One hole for each modifier; what the table calls declared has the option, and what it does not has the reason."""
    guide = (Path(tc.__file__).parent / "guide" / "pmi.md").read_text()
    for table in (OF_TOLERANCES, OF_DATUMS):
        for word, entry in table.items():
            assert f"| {entry.sign} | {word} | {entry.standard} | {entry.outcome} |" in guide
    read = shape(cover(datums, tmp_path).geometry)  # once: the annotations alone differ
    for word, entry in OF_TOLERANCES.items():
        modifier, datum = word.upper().replace(" ", "_"), "(M)" if "simultaneous" in entry.declared else ""

        def annotate(file, modifier=modifier, datum=datum):
            datums(file)
            file.size(file.aspect(*HOLE), 8.1, (0, 0.03))
            kind, place = ("parallelism", TOP) if "TANGENT" in modifier else ("position", *HOLE)
            file.tolerance(
                kind, 0.2, file.aspect(place), f"A|B{datum}|C" if place != TOP else "A", zone=ROUND, modifier=modifier
            )

        part = cover(annotate, tmp_path)
        features, claims = declare_features(part, read_pmi(part.geometry.source), read)
        reasons = [claim.result.reason for claim in claims if claim.result.reason]
        if isinstance(entry.declared, str):
            assert reasons == [f"its modifier, {word} ({entry.sign}, {entry.standard}): {entry.declared}"]
        else:
            assert not reasons
            (stated,) = [tolerance for feature in features for tolerance in feature.geometric]
            assert {name: getattr(stated, name) for name in entry.declared} == entry.declared
