"""Elastic parts as a script declares them: their document, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import assembly_of, compiled
from tests.test_elastic_parts import supported_beam, tips
from tolcontact.errors import ArchiveError, ModelError, OptionError


def plain(**elastic):
    model = tc.Assembly("plain")
    part = model.part("bar", tc.Box(100, 20, 10))
    model.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2), tolerance=0.1)
    model.measure("end", part.point(100, 0, 0), along="z", tolerance=1)
    if elastic:
        part.elastic(**elastic)
    return model


@pytest.mark.parametrize(
    ("elastic", "fault"),
    [
        ({"E": 0, "nu": 0.3}, r'part "bar" .*: elastic E is 0; expected a modulus in MPa above 0'),
        ({"E": 70e3, "nu": 0.5}, r"elastic nu is 0.5; expected a Poisson's ratio between -1 and 0.5"),
        ({"E": 70e3, "nu": -1}, r"elastic nu is -1"),
        ({"E": float("nan"), "nu": 0.3}, "elastic E is nan"),
        ({"E": 70e3}, "elastic needs E and nu"),
        ({"density": 2700}, "elastic needs E and nu"),
        ({"E": 70e3, "nu": 0.3, "density": -1}, "elastic density is -1; expected a density"),
        ({"E": 70e3, "nu": 0.3, "pad": 0}, "elastic pad is 0; expected a length"),
        ({"E": 70e3, "nu": 0.3, "element_size": 0}, "elastic element_size is 0; expected a length"),
        ({"E": 70e3, "nu": 0.3, "element_size": 60}, 'part "bar".*element_size is 60 mm, .*give at most 50 mm'),
        ({"stiffness": "K.npz", "nodes": "n.csv", "element_size": 2}, "elastic has an element_size and a stiffness"),
        ({"stiffness": "K.npz"}, "elastic has a stiffness without nodes"),
        ({"stiffness": "K.npz", "nodes": "n.csv", "E": 1, "nu": 0}, "elastic has E or nu and a stiffness"),
        ({"stiffness": "missing.npz", "nodes": "missing.npz"}, 'part "bar".*missing.npz'),
    ],
)
def test_a_bad_declaration_names_the_part_and_says_what_is_expected(elastic, fault):
    with pytest.raises(ModelError, match=fault):
        compiled(plain(**elastic))


def test_an_elastic_part_is_declared_once_and_not_fixed():
    model = tc.Assembly("fixed")
    part = model.part("bar", tc.Box(100, 20, 10), fixed=True)
    part.elastic(E=70e3, nu=0.3)
    part.elastic(E=70e3, nu=0.3)
    faults = "\n".join(model.faults())
    assert "it is elastic and fixed=True; leave fixed out" in faults
    assert "it is declared elastic 2 times; declare it once" in faults


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda model: model.gravity((0, 0, 0)), r"gravity is \(0.0, 0.0, 0.0\); expected a nonzero acceleration"),
        (lambda model: model.gravity((0, 0, -9.81)), "it has gravity, which acts on elastic parts alone"),
    ],
)
def test_gravity_needs_an_acceleration_and_a_mass(change, fault):
    model = plain()
    change(model)
    with pytest.raises(ModelError, match=fault):
        compiled(model)


def test_documents_state_elasticity_and_those_of_rigid_models_do_not(tmp_path):
    model = plain(E=70e3, nu=0.33, density=2700, pad=2.5, element_size=3)
    model.gravity((0, 0, -9.81))
    rigid, elastic = tmp_path / "rigid.json", tmp_path / "elastic.json"
    tc.io.write_model(plain(), rigid)
    tc.io.write_model(model, elastic)
    assert '"elastic"' not in rigid.read_text()
    assert "gravity" not in rigid.read_text()
    again = assembly_of(elastic)
    read = again.parts[0].elasticity
    assert (read.E, read.nu, read.density, read.pad, read.element_size) == (70e3, 0.33, 2700, 2.5, 3)
    assert again.acceleration == (0, 0, -9.81)
    tc.io.write_model(again, rigid)
    assert json.loads(rigid.read_text()) == json.loads(elastic.read_text())


def test_smaller_elements_are_more_nodes_of_another_body_in_the_archive(tmp_path):
    pytest.importorskip("ngsolve")
    hashes, out = [], tmp_path / "run.nc"
    for size in (None, 20.0, 10.0):
        program = compiled(plain(E=70e3, nu=0.33, **({} if size is None else {"element_size": size})))
        (bar,) = program.bending.parts.values()
        with tc.run(program, samples=4, seed=1, out=out, overwrite=True) as results:
            hashes.append((results["elastic"].elastic_hash.item(), bar.nodes))
            assert tc.io.model_of(results).parts[0].elasticity.element_size == size
            assert ("elements of 20 mm" in results["elastic"].elastic_source.item()) == (size == 20.0)
    (_, usual), (_, coarse), (_, fine) = hashes
    assert coarse < fine < usual
    assert len({digest for digest, _ in hashes}) == 3
    with pytest.raises(ArchiveError, match="contains another model"):
        tc.run(compiled(plain(E=70e3, nu=0.33, element_size=20.0)), samples=8, seed=1, out=out, resume=True)


@pytest.mark.parametrize(
    ("choices", "fault"),
    [
        ({"objective": "all points"}, 'part "beam" is elastic, which needs the objective "seating" and the resolution "exact"'),
        ({"resolution": "linearized"}, 'here they are "seating" and "linearized"'),
    ],
)
def test_other_methods_are_refused(tmp_path, choices, fault):
    with pytest.raises(ModelError, match=fault):
        tc.build(supported_beam(tmp_path, 10.0), method=tc.Method(objective="seating").with_choices(**choices))


def test_analyses_of_rigid_parts_are_refused(tmp_path):
    model = supported_beam(tmp_path, 10.0)
    for analysis in (tc.analyses.worst_case, tc.analyses.seating):
        with pytest.raises(
            OptionError, match='part "beam" of "supported beam" is elastic, and this analysis is of rigid parts'
        ):
            analysis(model)


def test_measures_that_do_not_see_bending_are_refused(tmp_path):
    model = tips(tmp_path)
    left, right = model.parts
    (weld, _) = model.stations
    weld.measure("own", lambda poses: poses.translation(left)[2])
    weld.measure("angle", tc.Angle(left.face("+z"), right.face("-z")))
    with pytest.raises(ModelError) as error:
        compiled(model)
    assert 'measurement "own"' in str(error.value)
    assert "it is a function of poses, which do not tell how parts bend" in str(error.value)
    assert 'measurement "angle"' in str(error.value)
    assert 'it measures faces of part "left", which is elastic' in str(error.value)


def test_a_force_off_the_nodes_of_a_matrix_names_the_part_and_the_distance(tmp_path):
    model = supported_beam(tmp_path, 10.0)
    part = model.parts[0]
    model.force("aside", at=part.point(300, 10, 10), vector=(0, 0, -1))
    with pytest.raises(ModelError, match=r'part "beam".*no node at \(300, 10, 10\).*mm away'):
        compiled(model)


def test_joints_of_elastic_parts_need_points_that_are_no_hinge(tmp_path):
    model = tips(tmp_path)
    (joint,) = model.joints
    with pytest.raises(ModelError, match=r'joint "tips".*part "left" is elastic, so parts are joined at points'):
        compiled(model.replaced(joints=[replace(joint, at=())]))
    with pytest.raises(ModelError, match=r'joint "tips".*part "right" turns on part "left" as on a hinge'):
        compiled(tips(tmp_path, at=((92, 0), (92, 20), (92, 10)), pad=None))
    aside = (model.parts[0].point(20, 10, 1),)
    with pytest.raises(ModelError, match=r'joint "tips".*its point left \(20, 10, 1\) is 64 mm from part "right"'):
        compiled(model.replaced(joints=[replace(joint, at=aside)]))


def test_sensitivities_and_contributions_of_tips_are_those_of_their_stiffness(tmp_path):
    """The height is (k1 d1 + k2 d2) / (k1 + k2) of the roots' heights d; a hundredth of a mm leaves squares of 1e-5."""
    causes, slopes = ["left root", "right root"], np.array([1.05, 8.4]) / 9.45
    program = compiled(tips(tmp_path))
    found = tc.analyses.sensitivities(program, samples=40)["sensitivity"]
    where = {"measure": "left tip", "state": "corrected", "interval": "estimate"}
    assert found.sel(contributor=causes, **where).values == pytest.approx(slopes, abs=1e-4)
    first = tc.analyses.contributions(program, samples=2048)["first"].sel(measure="left tip", state="corrected", group=causes)
    exact = slopes**2 / (slopes**2).sum()
    assert (first.sel(interval="lower").values <= exact).all()
    assert (first.sel(interval="upper").values >= exact).all()
