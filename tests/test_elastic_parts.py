"""Elastic parts in contact: closed forms of beams, sheets and tips, the rigid limit, and what is refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import elastic as cases
from tests.helpers import compiled, nightly
from tolcontact.report import write_page
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, RAW, Status

L, B, H = 400.0, 20.0, 10.0
BENDING = 210e3 * B * H**3 / 12  # E I [N mm^2]
SOLVERS = ["qpoases", *nightly("daqp", "osqp", "piqp")]
FEET = [(x, y) for x in (0.5, 200, 399.5) for y in (5, 15)]
CLOSE = 1e-6  # of the closed form: all other deformations are 1e7 times as stiff as the stated one


def block_of(model, deviations, **options):
    """The realizations of a model for deviations by contributor."""
    program = compiled(model, **options)
    size = max(len(np.atleast_1d(values)) for values in deviations.values())
    rows = np.zeros((size, len(program.nominal.contributors)))
    for label, values in deviations.items():
        rows[:, program.nominal.contributors.index(label)] = values
    block = simulate_block(program, rows)
    assert (block.status == Status.RESOLVED).all(), block
    return program, block


def loads_of(program, block, name):
    """The reactions (n, point) [N] at the contact points of a pair."""
    pairs = [pair.name for pair in program.nominal.pairs]
    return block.load[:, program.nominal.loads[:, 0] == pairs.index(name)]


def supported_beam(folder, force, *, rotation=(0, 0, 0), at=(0, 0, 0)):
    """A beam on three pairs of one-sided supports, exactly 48 EI / l^3 stiff in the middle, with a force there."""
    stations = (10.0, 200.0, 390.0)
    nodes = np.array([(x, y, 0.0) for x in stations for y in (0.0, B)] + [(200.0, 10.0, H)])
    middle = [(1 / 3, 200, y) for y in (0, B, 10)]
    bend = cases.lifts(nodes, *middle, *((-0.25, x, y) for x in (10, 390) for y in (0, B)))
    K = cases.stiffness(nodes, bend, [48 * BENDING / 380**3])
    turned = Rotation.from_rotvec(rotation)
    model = tc.Assembly("supported beam", method=tc.Method(objective="seating"))
    part = model.part("beam", tc.Box(L, B, H), rotation=rotation, at=at)
    feet = [tc.Locator(f"A{k}", node, "z", one_sided=True) for k, node in enumerate(nodes[:6])]
    sides = [tc.Locator(f"B{k}", (x, 0, 0), "y") for k, x in enumerate((10, 390))]
    model.locate(part, [*feet, *sides, tc.Locator("C", (10, 20, 0), "x")], tolerance=0.6)
    model.force("press", at=part.point(200, 10, H), vector=turned.apply((0, 0, -force)))
    model.measure("middle", part.point(200, 0, 0), along=turned.apply((0, 0, 1)), tolerance=1)
    part.elastic(**cases.saved(folder, "beam", nodes, K))
    return model


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("place", [{}, {"rotation": (0.3, -1.1, 2.0), "at": (500, -80, 33)}])
def test_the_middle_support_of_a_beam_loses_48EI_of_its_load(tmp_path, solver, place):
    low, stiffness = np.array([0.0, 0.5, 1.0, 2.0, 4.0]), 48 * BENDING / 380**3
    model = supported_beam(tmp_path, 1000.0, **place)
    program, block = block_of(model, {"beam.A2": -low, "beam.A3": -low}, solver=solver)
    feet = loads_of(program, block, "supports of beam")
    middle = np.maximum(1000 - stiffness * low, 0)
    assert feet[:, 2:4].sum(axis=1) == pytest.approx(middle, abs=1000 * CLOSE)
    assert feet.sum(axis=1) == pytest.approx(1000, rel=1e-9)
    heights = np.where(middle > 0, -low, -1000 / stiffness)
    assert block.measured[:, CORRECTED, 0] == pytest.approx(heights, abs=4 * CLOSE)
    assert np.abs(loads_of(program, block, "beam.C")).max() < 1e-6


def test_a_sheet_on_four_corners_carries_by_its_twist(tmp_path):
    """One corner is low by c: it carries F/4 - 2D(1 - nu)c/a^2, until it is in the air; its neighbours carry as much more."""
    a, t, nu, force = 200.0, 1.0, 0.3, 10.0
    rigidity = 210e3 * t**3 / 12 / (1 - nu**2)
    corners = [(0, 0), (a, 0), (a, a), (0, a)]
    nodes = np.array([(x, y, 0.0) for x, y in corners] + [(a / 2, a / 2, 0.0)])
    twist = cases.lifts(nodes, *((sign / 4, x, y) for sign, (x, y) in zip((1, -1, 1, -1), corners, strict=True)))
    model = tc.Assembly("sheet")
    sheet = model.part("sheet", tc.Box(a, a, t))
    feet = [tc.Locator(f"A{k}", (x, y, 0), "z", one_sided=True) for k, (x, y) in enumerate(corners)]
    sides = [tc.Locator("B1", (0, 0, 0), "y"), tc.Locator("B2", (a, 0, 0), "y"), tc.Locator("C", (0, a, 0), "x")]
    model.locate(sheet, [*feet, *sides], tolerance=0.2)
    model.force("press", at=sheet.point(a / 2, a / 2, 0), vector=(0, 0, -force))
    model.measure("centre", sheet.point(a / 2, a / 2, 0), along="z", tolerance=1)
    sheet.elastic(**cases.saved(tmp_path, "sheet", nodes, cases.stiffness(nodes, twist, [32 * rigidity * (1 - nu) / a**2])))
    slope = 2 * rigidity * (1 - nu) / a**2
    low = np.array([0.0, 0.5, 1.0, force / 4 / slope + 0.5])
    program, block = block_of(model, {"sheet.A2": -low})
    feet = loads_of(program, block, "supports of sheet")
    assert feet[:, 2] == pytest.approx(np.maximum(force / 4 - slope * low, 0), abs=force * CLOSE)
    assert feet[:, 1] == pytest.approx(np.minimum(force / 4 + slope * low, force / 2), abs=force * CLOSE)
    assert feet[2, 2] == pytest.approx(1.82692, abs=1e-5)


PAD = 5.0 * np.array([(0, 0), (2, 0), (-1, 3**0.5), (-1, -(3**0.5))]) / 2  # the centre of a pad of 5 mm, and its three points


def strip(model, folder, name, stiffness, *, at, root, tip, height):
    """A strip of 100 x 20 mm, held at its root by six locators, whose tip is soft across, with the points of a pad there."""
    root = np.array([(*place, 0.0) for place in root])
    nodes = np.concatenate([root, np.column_stack([tip + PAD, np.full(4, height)])])
    shares = np.linalg.solve(np.column_stack([np.ones(3), root[:, :2]]).T, (1, *tip))  # of the plane of the root, at the tip
    weights = [(1, *tip), *((-share, *place) for share, place in zip(shares, root[:, :2], strict=True))]
    part = model.part(name, tc.Box(100, 20, 1), at=at)
    part.elastic(**cases.saved(folder, name, nodes, cases.stiffness(nodes, cases.lifts(nodes, *weights), [stiffness])))
    directions = [("A1", 0, "z"), ("A2", 1, "z"), ("A3", 2, "z"), ("B1", 0, "x"), ("B2", 1, "x"), ("C", 0, "y")]
    return part, [tc.Locator(label, root[k], direction) for label, k, direction in directions]


def tips(folder, *, at=((92, 10),), pad=5.0):
    """Two strips, 1.05 and 8.4 N/mm stiff, whose tips lap: each root varies in height as a whole."""
    model = tc.Assembly("tips", method=tc.Method(objective="seating"))
    left = strip(model, folder, "left", 1.05, at=(0, 0, 0), root=[(0, 0), (0, 20), (20, 10)], tip=(92, 10), height=1.0)
    right = strip(model, folder, "right", 8.4, at=(84, 0, 1), root=[(100, 20), (100, 0), (80, 10)], tip=(8, 10), height=0.0)
    weld = model.station("weld")
    for part, locators in (left, right):
        weld.locate(part, locators, tolerance=0)
        model.variable(f"{part.name} root", 0.01, drives={f"weld.{part.name}.A{k}": 1.0 for k in (1, 2, 3)})
    weld.measure("left tip", left[0].point(92, 10, 1), along="z", tolerance=1)
    weld.measure("right tip", right[0].point(8, 10, 0), along="z", tolerance=1)
    joint = weld.join("tips", left[0], right[0], at=[left[0].point(x, y, 1) for x, y in at], pad=pad)
    check = model.station("check")
    check.locate(joint, [tc.Locator(item.name, left[0].point(*item.point), item.direction) for item in left[1]], tolerance=0)
    check.measure("free tip", right[0].point(8, 10, 0), along="z", tolerance=1)
    return model


def test_two_tips_that_guns_close_meet_where_their_forces_balance(tmp_path):
    """(k1 d1 + k2 d2) / (k1 + k2) for tips off by 0.7 and -0.4 mm; released, the joint has no load.

    The closed form is linear; tips that rotate by a hundredth of a radian miss it by its square: so a hundredth of that.
    """
    raised = {f"weld.left.A{k}": 0.007 for k in (1, 2, 3)} | {f"weld.right.A{k}": -0.004 for k in (1, 2, 3)}
    program, block = block_of(tips(tmp_path), raised)
    assert 100 * block.measured[0, CORRECTED, :2] == pytest.approx(-0.277778, abs=1e-6)
    assert 100 * loads_of(program, block, "guns of weld.tips").sum() == pytest.approx(1.0266667, rel=2e-6)
    later = [k for k, pair in enumerate(program.nominal.pairs) if program.nominal.parts[pair.moving].station == "check"]
    assert np.abs(block.load[:, np.isin(program.nominal.loads[:, 0], later)]).max() < 1e-8


def test_guns_close_faces_with_form_and_the_released_joint_has_no_load(tmp_path):
    """Heights h of both faces at the gun are as if the tips were apart by them: (k1 d1 + k2 (d2 - h)) / (k1 + k2).

    Points of the features tell the heights, before parts meet.
    """
    model = tips(tmp_path)
    weld, _ = model.stations
    for part, side, point in zip(model.parts, ("+z", "-z"), ((92, 10, 1), (8, 10, 0)), strict=True):
        face = part.feature("lap", part.face(side), tc.Flatness(0.002))
        weld.measure(f"{part.name} face", face.point(*point), along="z", tolerance=1)
    program = compiled(model)
    deviations = program.draws(seed=1, start=0, stop=20)
    block = simulate_block(program, deviations)
    assert (block.status == Status.RESOLVED).all()
    left, right, left_face, right_face, _ = block.measured[:, RAW].T
    h = left_face - left + right - right_face
    assert np.abs(h).max() > 5e-4
    tip, _, left_closed, right_closed, _ = block.measured[:, CORRECTED].T
    assert left_closed == pytest.approx(right_closed, abs=1e-8)
    assert tip == pytest.approx((1.05 * left + 8.4 * (right - h)) / 9.45, abs=1e-6)
    later = [k for k, pair in enumerate(program.nominal.pairs) if program.nominal.parts[pair.moving].station == "check"]
    assert np.abs(block.load[:, np.isin(program.nominal.loads[:, 0], later)]).max() < 1e-8


def test_stiffer_and_stiffer_parts_are_rigid_in_the_end(tmp_path):
    """E to infinity: the beam on its supports as a rigid part, within 1e-9 mm at 1e12 times its stiffness."""
    model = supported_beam(tmp_path, 1000.0)
    matrix = np.load(tmp_path / "beam.npz")
    rigid = model.replaced(parts=[], locations=[])
    part = rigid.part("beam", tc.Box(L, B, H))
    rigid.locate(part, model.locations[0].scheme, tolerance=0.6)
    rigid = rigid.replaced(forces=[], measures=[])
    rigid.force("press", at=part.point(200, 10, H), vector=(0, 0, -1000))
    rigid.measure("middle", part.point(200, 0, 0), along="z", tolerance=1)
    program = compiled(rigid)
    deviations = program.draws(seed=1, start=0, stop=40)
    expected = simulate_block(program, deviations)
    for factor, within in ((1e6, 1e-4), (1e12, 1e-9)):
        np.savez(tmp_path / "beam.npz", K=factor * matrix["K"], nodes=matrix["nodes"])
        block = simulate_block(compiled(model), deviations)
        assert (block.status == Status.RESOLVED).all()
        assert np.abs(block.poses - expected.poses).max() < within


def test_a_heavy_beam_on_three_supports_rests_mostly_on_the_middle_one(tmp_path):
    """0.62325 of its weight by Timoshenko's theory, 5/8 without shear: from its own mesh of tetrahedra, within 1e-3."""
    pytest.importorskip("ngsolve")
    model = tc.Assembly("heavy beam")
    beam = model.part("beam", tc.Box(L, B, H), rotation=(0, 0, np.pi / 2))
    beam.elastic(E=210e3, nu=0.0, density=7850)
    model.gravity((0, 0, -9.81))
    feet = [tc.Locator(f"A{k}", (x, y, 0), "z", one_sided=True) for k, (x, y) in enumerate(FEET)]
    sides = [tc.Locator("B1", (1, 0, 5), "y"), tc.Locator("B2", (399, 0, 5), "y"), tc.Locator("C", (0, 10, 5), "x")]
    model.locate(beam, [*feet, *sides], tolerance=0.2)
    model.measure("middle", beam.point(200, 10, 0), along="z", tolerance=1)
    program, block = block_of(model, {"beam.A0": [0.0]})
    weight = 7850e-9 * 9.81 * L * B * H
    loads = loads_of(program, block, "supports of beam")[0]
    assert loads.sum() == pytest.approx(weight, rel=1e-6)
    assert loads[2:4].sum() / weight == pytest.approx(0.62325, rel=1e-3)


def test_fields_and_the_picture_of_the_page_show_bending(tmp_path):
    """A beam that a constant force bends between its feet: in the middle, its field is what is measured there."""
    with tc.run(compiled(supported_beam(tmp_path, 1000.0)), samples=40, seed=1) as results:
        write_page(results, tc.summarize(results), tmp_path / "page.html")
        field, measured = results["field/beam"].to_dataset(), results.measured.sel(state="corrected", measure="middle")
        k = np.abs(field.vertices.values - (200, 0, 0)).sum(axis=1).argmin()
        assert np.abs(field.vertices.values[k] - (200, 0, 0)).max() < 1e-9
        at = field.sel(state="corrected", component="z").isel(vertex=k)
        assert at["mean"].item() == pytest.approx(measured.mean().item(), abs=1e-5)  # the beam turns by 0.03, which is left out
        assert at["six_sigma"].item() == pytest.approx(6 * measured.std(ddof=1).item(), abs=1e-5)
        assert abs(field["mean"].sel(state="raw", component="z").isel(vertex=k).item() - measured.mean().item()) > 5e-3
    assert "beam" in (tmp_path / "page.html").read_text(encoding="utf-8")
