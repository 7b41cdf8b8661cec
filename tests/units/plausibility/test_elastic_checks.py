"""Checks of elastic parts: their figures of sound models, and a planted fault for each law."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import call, compiled
from tests.test_elastic_parts import block_of, loads_of, supported_beam, tips
from tolcontact.compilation.other_flexibility import stiffer, with_flexibility
from tolcontact.errors import NominalWarning
from tolcontact.mechanics.flexibility import elastic_bodies, part_flexibilities
from tolcontact.plausibility import elastic_remarks
from tolcontact.plausibility.elastic_checks import LAWS, law_remarks, limit_remark, loaded_parts, mesh_remarks
from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED

BAR = """
import tolcontact as tc


def assembly(tolerance=1.0):
    model = tc.Assembly("bar", method=tc.Method(objective="seating"))
    bar = model.part("bar", tc.Box(200, 20, 10))
    bar.elastic(E=210e3, nu=0.3)
    feet = [tc.Locator(f"A{x} {y}", (x, y, 0), "z", one_sided=True) for x in (10, 100, 190) for y in (5, 15)]
    sides = [tc.Locator("B1", (10, 0, 5), "y"), tc.Locator("B2", (190, 0, 5), "y"), tc.Locator("C", (0, 10, 5), "x")]
    model.locate(bar, [*feet, *sides], tolerance=0.1)
    for x in (50, 150):
        model.force(f"press {x}", at=bar.point(x, 10, 10), vector=(0, 0, -500))
    model.measure("quarter", bar.point(50, 10, 0), along="z", tolerance=tolerance)
    return model
"""


def bar(**options):
    pytest.importorskip("ngsolve")
    scope = {}
    exec(BAR, scope)
    return compiled(scope["assembly"](**options))


def checked(remarks):
    """Remarks as a list, and the warnings that they issue."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        texts = list(remarks)
    return texts, [str(warning.message) for warning in caught]


def under_load(program):
    """The nominal assembly, and seven draws of its locators."""
    deviations = program.draws(seed=1, start=0, stop=8)
    deviations[0] = 0
    return simulate_block(program, deviations)


def error_of(remarks, law):
    (text,) = (remark for remark in remarks if remark.startswith(law))
    return float(text.split("within ")[1].split()[0])


def unsymmetric(body):
    skew = np.random.default_rng(1).normal(size=(body.nodes.size,) * 2)
    return {"balanced": lambda forces: body.balanced(forces + 1e-4 * skew @ forces)}


def supported(body):
    """A spring to the ground at the first node."""
    return {"restoring": lambda u: body.restoring(u) + 1e3 * (np.arange(len(u)) == 2)[:, None] * u}


def stiffened(body):
    return {"restoring": lambda u: 1.001 * body.restoring(u)}


def softened(body):
    return {"balanced": lambda forces: 1.001 * body.balanced(forces)}


@pytest.mark.parametrize(
    ("fault", "laws"),
    [
        (unsymmetric, {"reciprocity", "energy", "superposition"}),
        (supported, {"rigid motions", "energy"}),
        (stiffened, {"energy"}),
        (softened, {"energy", "superposition"}),
    ],
)
def test_a_body_that_breaks_a_law_is_named_with_the_figure(tmp_path, fault, laws):
    program = compiled(supported_beam(tmp_path, 1000.0))
    bodies = {part: replace(body, **fault(body)) for part, body in elastic_bodies(program.nominal).items()}
    _, doubts = checked(law_remarks(loaded_parts(program, bodies, under_load(program))))
    assert all(doubt.startswith('[bending] part "beam": ') for doubt in doubts)
    broken = {law.name.split(" (")[0] for law in LAWS if any(f": {law.name} holds" in doubt for doubt in doubts)}
    assert broken >= laws and not broken & {"balance of forces", "balance of moments"}
    assert fault is unsymmetric or broken == laws


def grown(load):
    load[1] *= 1.001


def exchanged(load):
    load[1, [0, 2]] = load[1, [2, 0]]


@pytest.mark.parametrize(("fault", "laws"), [(grown, ["forces", "moments"]), (exchanged, ["moments"])])
def test_reactions_that_do_not_balance_are_named(tmp_path, fault, laws):
    program = compiled(supported_beam(tmp_path, 1000.0))
    block = under_load(program)
    fault(block.load)
    _, doubts = checked(law_remarks(loaded_parts(program, elastic_bodies(program.nominal), block)))
    assert [law for law in ("forces", "moments") if any(f"balance of {law} holds" in doubt for doubt in doubts)] == laws


@pytest.mark.parametrize("place", [{}, {"rotation": (0, 0, np.pi / 2), "at": (500, -80, 33)}])
def test_the_weight_of_a_tilted_part_acts_at_its_centre_of_mass(place):
    """Feet 180 mm apart below a bar of height h, tilted by t: the upper one carries 1/2 - h tan(t)/360 of the weight."""
    pytest.importorskip("ngsolve")
    model = tc.Assembly("tilted bar")
    bar = model.part("bar", tc.Box(200, 20, 30), **place)
    bar.elastic(E=210e3, nu=0.3, density=7850)
    model.gravity((0, 0, -9.81))
    feet = [tc.Locator(f"A{k}", point, "z", one_sided=True) for k, point in enumerate([(10, 3, 0), (10, 17, 0), (190, 10, 0)])]
    sides = [tc.Locator("B1", (10, 0, 15), "y"), tc.Locator("B2", (190, 0, 15), "y"), tc.Locator("C", (0, 10, 15), "x")]
    model.locate(bar, [*feet, *sides], tolerance=1)
    model.measure("top", bar.point(100, 10, 30), along="z", tolerance=1)
    rises = np.array([0.0, 2.0, 6.0])
    program, block = block_of(model, {"bar.A2": rises})
    loads, tangent = loads_of(program, block, "supports of bar"), rises / np.sqrt(180**2 - rises**2)
    assert loads.sum(axis=1) == pytest.approx(7850e-9 * 9.81 * 200 * 20 * 30, rel=1e-9)
    assert loads[:, 2] / loads.sum(axis=1) == pytest.approx(1 / 2 - 30 * tangent / 360, abs=1e-7)
    (moments,) = (law for law in LAWS if law.name == "balance of moments")
    assert max(map(moments.error, loaded_parts(program, elastic_bodies(program.nominal), block))) < 1e-9


def test_sound_parts_obey_all_laws_to_rounding_and_a_file_has_no_mesh(tmp_path):
    for model in (supported_beam(tmp_path, 1000.0, rotation=(0.3, -1.1, 2.0), at=(500, -80, 33)), tips(tmp_path)):
        remarks, doubts = checked(elastic_remarks(compiled(model)))
        assert not doubts
        assert max(error_of(remarks, law.name) for law in LAWS) < 1e-8
        assert any("none, its stiffness is a file; refine the mesh in the program that wrote it" in text for text in remarks)
    assert any(text.startswith('rigid limit: none, since "weld.left.A1" and 12 more hold parts by more') for text in remarks)


def test_the_rigid_limit_is_the_limit_and_a_limit_that_is_none_is_doubted(tmp_path):
    """The middle of the beam is off by what it bends, 0.36 mm, over the factor."""
    program = compiled(supported_beam(tmp_path, 1000.0))
    (text,) = (remark for remark in elastic_remarks(program) if remark.startswith("rigid limit"))
    assert 1e-10 < float(text.split("by ")[1].split()[0]) < 1e-8
    with pytest.warns(NominalWarning, match="stiffer and stiffer parts are not placed as rigid ones"):
        limit_remark(under_load(program), under_load(stiffer(program, 10.0)))


@pytest.mark.nightly
def test_the_uncertainty_by_the_mesh_contains_what_a_third_of_the_edges_changes():
    program = bar()
    remarks, doubts = checked(elastic_remarks(program))
    (text,) = (remark for remark in remarks if remark.startswith("quarter: "))
    uncertainty, share = float(text.split()[3]), float(text.split(", ")[1].split()[0])
    assert not doubts and share == pytest.approx(uncertainty, rel=0.05)  # the tolerance is 1 mm
    assert any(text.startswith("finer mesh of part bar: ") and " nodes in place of " in text for text in remarks)
    bodies = {part: body.finer(0.35) for part, body in elastic_bodies(program.nominal).items()}
    finest = with_flexibility(program, part_flexibilities(program.nominal, bodies))
    at_rest = np.zeros((1, len(program.nominal.contributors)))
    own, fine = (simulate_block(variant, at_rest).measured[0, CORRECTED, 0] for variant in (program, finest))
    assert 0.3 * uncertainty < abs(fine - own) < uncertainty


def test_too_coarse_a_mesh_is_doubted_and_one_too_fine_to_refine_is_left_out():
    _, (doubt,) = checked(elastic_remarks(bar(tolerance=1e-3)))
    assert 'measurement "quarter"' in doubt
    assert "of its tolerance of elastic parts (at most 0.05 is expected); give a smaller element_size, or import" in doubt
    program = bar()
    bodies = {part: replace(body, nodes=np.zeros((20_000, 3))) for part, body in elastic_bodies(program.nominal).items()}
    remarks = mesh_remarks(TrialDraws.of(program), bodies, np.zeros((1, len(program.nominal.contributors))))
    assert list(remarks) == ["finer mesh of part bar: none, it has 20000 nodes, and a finer one would have more than 40000"]


def test_the_command_prints_all_figures_and_none_for_rigid_parts(tmp_path):
    pytest.importorskip("ngsolve")
    (tmp_path / "bar.py").write_text(BAR)
    done = call(tmp_path, "check", "bar.py")
    assert done.returncode == 0, done.stderr
    for law in (*(law.name for law in LAWS), "rigid limit", "finer mesh of part bar", "quarter: uncertain by"):
        assert f"\n    {law}" in done.stdout
    (tmp_path / "bar.py").write_text(BAR.replace("    bar.elastic(E=210e3, nu=0.3)\n", ""))
    assert "balance" not in call(tmp_path, "check", "bar.py").stdout
    assert not tc.build(tmp_path / "bar.py").bending
