"""Insides of `geometry` under the claims of `tests/test_step_files.py`."""

import pytest

import tolcontact as tc
from tests.shapes import shape
from tests.step_files import Step
from tolcontact.geometry.files import STATED_FACES


def test_a_face_on_a_part_of_a_spline_surface_is_read(tmp_path):
    """The face at the bottom of a block is stated on a part of a bilinear surface, which is a plane."""
    step = Step()
    block = step.solid((0, 0, 0), (10, 20, 30))
    rows = [f"(#{step.point((-50, y, 0))},#{step.point((50, y, 0))})" for y in (-50, 50)]
    ends = "(2,2),(2,2),(0.,1.),(0.,1.)"
    spline = step.add(f"B_SPLINE_SURFACE_WITH_KNOTS('',1,1,({','.join(rows)}),.UNSPECIFIED.,.F.,.F.,.F.,{ends},.UNSPECIFIED.)")
    plane = next(number for number, entity in enumerate(step.lines) if entity.startswith("PLANE("))
    step.lines[plane] = f"RECTANGULAR_TRIMMED_SURFACE('',#{spline},0.1,0.9,0.1,0.9,.T.,.T.)"
    step.product("block", [block])
    (tmp_path / "block.step").write_text(str(step))
    mesh = shape(tc.Mesh(tmp_path / "block.step"))
    assert mesh.volume == pytest.approx(6000)
    assert [face.surface.kind for face in mesh.metadata[STATED_FACES]] == ["plane"] * 6
