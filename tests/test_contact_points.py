"""Contact points on flat and curved faces, whatever their triangles are."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import ALL_POINTS, compiled, nightly, realizations, simulate
from tolcontact.discretization import discretize
from tolcontact.statistics import estimate_of


def tessellated(n):
    """The top of a block, 50 x 25 mm, as 2 n^2 triangles, turned so that no triangle's edge runs along the block's."""
    x, y = np.meshgrid(np.linspace(0, 50, n + 1), np.linspace(0, 25, n + 1), indexing="ij")
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.r_[np.c_[corner, corner + n + 1, corner + n + 2], np.c_[corner, corner + n + 2, corner + 1]]
    return trimesh.Trimesh(np.c_[x.ravel(), y.ravel(), np.zeros(x.size)], faces[:, ::-1])


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 10, 60, *nightly(3, 150)])
def test_contact_points_follow_the_spacing_and_not_the_tessellation(n):
    a = tc.Assembly("resampled")
    table = a.part("table", tc.Box(50, 25, 10), at=(0, 0, -10), fixed=True)
    sheet = a.part("sheet", tc.Mesh(tessellated(n)))
    points = [(5, 5, 0), (45, 5, 0), (25, 20, 0)]
    sides = [tc.Locator("B1", (5, 0, 0), "y"), tc.Locator("B2", (45, 0, 0), "y"), tc.Locator("C", (0, 10, 0), "x")]
    a.locate(sheet, [*(tc.Locator(f"A{k}", p, "z") for k, p in enumerate(points)), *sides], tolerance=1)
    a.contact("rest", moving=sheet.face("-z"), reference=table.face("+z"), spacing=2.5)
    a.measure("height", sheet.point(0, 0, 0), along="z")
    (pair,) = discretize(a).pairs
    apart = np.linalg.norm(pair.P_m[:, None] - pair.P_m, axis=2) + np.eye(len(pair.P_m)) * 99
    spots = np.random.default_rng(0).uniform([0, 0, 0], [50, 25, 0], (1000, 3))
    assert np.linalg.norm(spots[:, None] - pair.P_m, axis=2).min(axis=1).max() < 2.5 + 0.9
    assert apart.min() > 1.2
    assert 120 < len(pair.P_m) < 260
    for corner in ((0, 0), (50, 0), (0, 25), (50, 25)):
        assert np.abs(pair.P_m[:, :2] - corner).max(axis=1).min() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("solid", ["sphere", "cylinder"])
def test_points_on_curved_faces_lie_on_them_and_look_outward(solid):
    """A shell around a ball or a bar: its points are projected onto it."""
    inner, outer = (
        trimesh.creation.icosphere(4, r) if solid == "sphere" else trimesh.creation.cylinder(r, 40, sections=96)
        for r in (10, 10.5)
    )
    outer.invert()
    around = trimesh.util.concatenate([outer, trimesh.creation.box((60, 60, 60))])
    points, directions = [(5, 5, 0), (-5, 5, 0), (0, -5, 0), (0, 5, 0), (0, -5, 0), (5, 0, 0)], "zzzxxy"
    six = [tc.Locator(f"L{k}", p, n) for k, (p, n) in enumerate(zip(points, directions, strict=True))]
    a = tc.Assembly(solid)
    core = a.part("core", tc.Mesh(inner), fixed=True)
    shell = a.part("shell", tc.Mesh(around))
    a.locate(shell, six, tolerance=0.1)
    steep = 2 if solid == "sphere" else 0.1  # of the bar the barrel only
    inside = shell.face(
        lambda c, n: (np.linalg.norm(c, axis=1) < 23) & (abs(n[:, 2]) < steep), tc.select.Inside([-15] * 3, [15] * 3)
    )
    a.contact("around", moving=inside, reference=core.face(lambda c, n: abs(n[:, 2]) < steep), points=500)
    a.measure("height", shell.point(0, 0, 0), along="z")
    (pair,) = discretize(a).pairs
    assert len(pair.P_m) > 400
    true = pair.P_r * ([1, 1, 1] if solid == "sphere" else [1, 1, 0])
    radius = np.linalg.norm(true, axis=1)
    chord = 10 * (1 - np.cos(np.pi / 96)) if solid == "cylinder" else 10 - np.linalg.norm(inner.triangles_center, axis=1).min()
    assert 10 - radius.min() < chord + 1e-9 and radius.max() < 10 + 1e-9
    assert np.abs(pair.n_r - true / radius[:, None]).max() < 0.005


@pytest.mark.nightly
@pytest.mark.slow
def test_halving_the_spacing_moves_measures_on_curved_faces_by_less_than_their_interval():
    method = replace(ALL_POINTS, search="fixed")
    programs = [compiled(cases.bar_in_a_half_pipe(spacing), solver="daqp", method=method) for spacing in (6, 3)]
    few, many = (len(program.nominal.pairs[0].P_m) for program in programs)
    assert many > 3 * few
    coarse, fine = (realizations(program, samples=300) for program in programs)
    for measure in coarse["measure"].values:
        for statistic in ("mean", "standard deviation"):
            _, lower, upper = estimate_of(coarse, measure, statistic)
            assert lower < estimate_of(fine, measure, statistic).value < upper


@pytest.mark.parametrize("size", [(20, 20, 10), (50, 8, 10), (7, 90, 3)])
@pytest.mark.parametrize("points", [None, 12, 200])
def test_weighted_points_have_the_centroid_of_the_face(size, points):
    """In the exact resolution points count by the area that they stand for: a push alone does not tilt a plate."""
    a = tc.Assembly("plates")
    lower = a.part("lower", tc.Box(*size), fixed=True)
    upper = a.part("upper", tc.Box(*size), at=(0, 0, size[2]))
    locators = [tc.Locator(f"Z{k}", (x, y, 0), "z", 0) for k, (x, y) in enumerate([(1, 1), (6, 1), (3, 7)])]
    sides = [tc.Locator("Y1", (1, 0, 1), "y", 0), tc.Locator("Y2", (6, 0, 1), "y", 0), tc.Locator("X", (0, 3, 1), "x", 0)]
    a.locate(upper, [*locators, *sides])
    a.variable("lift", tc.Tolerance(1), drives={f"upper.Z{k}": 1 for k in range(3)})
    a.contact("seat", moving=upper.face("-z"), reference=lower.face("+z"), points=points)
    a.measure("height", upper.point(0, 0, 0), along="z", tolerance=1)
    program, run = simulate(a, samples=20, solver="daqp", method=tc.Method(search="fixed"))
    (pair,) = program.nominal.pairs
    spacing = np.sqrt(size[0] * size[1] / len(pair.P_m))
    centroid = pair.weights @ pair.P_m / pair.weights.sum()
    assert np.abs(centroid - [size[0] / 2, size[1] / 2, size[2]]).max() < 1e-9 * spacing and (pair.weights > 0).all()
    R = run["poses"][:, 1, 1, :9].reshape(-1, 3, 3)
    assert run["gap_min"][:, 0].min() < -0.1 and np.abs(R - np.eye(3)).max() < 1e-9
