"""Supports that give way: a rigid table on four springy legs, against its closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled, nightly, simulate
from tolcontact.testing import assert_gaps_recompute
from tolcontact.vocabulary import CORRECTED, Status

SIGMA, LOAD = 0.1, 100.0
SEATED = tc.Method(objective="seating")


def springy_table(stiffness, *, rotation=(0, 0, 0)):
    """A square table on four legs of this stiffness [N/mm] at its corners, with its load in the middle."""
    model = tc.Assembly("springy table", method=SEATED)
    top = model.part("top", tc.Box(400, 400, 20), rotation=rotation)
    corners = [(0, 0, 0), (400, 0, 0), (400, 400, 0), (0, 400, 0)]
    legs = [tc.Locator(f"L{k}", p, "z", 6 * SIGMA, one_sided=True, stiffness=stiffness) for k, p in enumerate(corners)]
    sides = [tc.Locator("B1", (100, 0, 0), "y", 1e-9), tc.Locator("B2", (300, 0, 0), "y", 1e-9)]
    model.locate(top, [*legs, *sides, tc.Locator("C1", (0, 200, 0), "x", 1e-9)])
    up = tuple(Rotation.from_rotvec(rotation).apply([0, 0, 1]))
    model.force("load", at=top.point(200, 200, 0), vector=tuple(-LOAD * c for c in up))
    model.measure("height", top.point(200, 200, 0), along=up)
    return model


def closed_height(legs, stiffness, load=LOAD):
    """Return the height of the middle [mm] for heights of the legs (realization, leg)."""
    sink, twist = load / (4 * stiffness), legs @ [1, -1, 1, -1] / 4
    return legs.mean(axis=1) - sink + np.maximum(0, np.abs(twist) - sink)


@pytest.mark.parametrize(
    ("stiffness", "solver"), [(1000.0, "qpoases"), (10.0, "daqp"), *nightly((1000.0, "daqp"), (1000.0, "graph"))]
)
def test_a_table_sinks_into_its_legs_by_the_closed_form(stiffness, solver):
    _, run = simulate(springy_table(stiffness), samples=300, solver=solver)
    assert (run["status"] == Status.RESOLVED).all()
    height, legs = run["measured"][:, CORRECTED, 0], run["deviations"][:, :4]
    assert height == pytest.approx(closed_height(legs, stiffness), abs=1e-8)
    assert run["reaction"][:, 0] == pytest.approx(LOAD, rel=1e-5)


@pytest.mark.parametrize("solver", ["qpoases", *nightly("daqp", "graph")])
def test_very_stiff_legs_are_the_rigid_ones(solver):
    """Two legs that carry alone sink by F/2k: 5e-8 mm at 1e9 N/mm, so that the rigid table is reached at 1e12."""
    stiff, stiffer, rigid = (
        simulate(springy_table(k), samples=200, solver=solver)[1]["measured"][:, CORRECTED, 0] for k in (1e9, 1e12, None)
    )
    assert np.abs(stiffer - rigid).max() < 1e-9
    assert 4e-8 < np.abs(stiff - rigid).max() < LOAD / 2e9 + 1e-9


def test_soft_legs_all_carry_and_the_middle_is_their_mean():
    _, run = simulate(springy_table(10.0), samples=200, solver="daqp")
    assert (run["carrying"] == 4).all()
    assert run["measured"][:, CORRECTED, 0] == pytest.approx(run["deviations"][:, :4].mean(axis=1) - LOAD / 40, abs=1e-8)


def test_mean_variance_and_share_agree_with_a_quadrature():
    count, stiffness = 4000, 1000.0
    _, run = simulate(springy_table(stiffness), samples=count, solver="daqp")
    sink, twist = LOAD / (4 * stiffness), stats.norm(scale=SIGMA / 2)
    first, second = (
        2 * integrate.quad(lambda w, power=power: (w - sink) ** power * twist.pdf(w), sink, np.inf)[0] for power in (1, 2)
    )
    height = run["measured"][:, CORRECTED, 0]
    variance = SIGMA**2 / 4 + second - first**2
    assert height.mean() == pytest.approx(first - sink, abs=4 * np.sqrt(variance / count))
    assert height.var() == pytest.approx(variance, abs=4 * np.sqrt(3 / count) * variance)
    share = 2 * twist.cdf(sink) - 1
    assert (run["carrying"][:, 0] == 4).mean() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / count))


def test_forces_follow_from_the_archive_alone(tmp_path):
    """Compressions of the legs, from archived poses and deviations, times their stiffness are the archived reaction."""
    path = tmp_path / "springs.nc"
    tc.run(compiled(springy_table(1000.0)), samples=50, out=path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as tree:
        assert tree["reaction"].attrs["units"] == "N"
        sample = tree["sample"].to_dataset()
        feet, stiffness = sample["locator_point"].values[:4], sample["stiffness"].values[:4]
        R, t = (tree[name].sel(part="top", state="corrected").values for name in ("rotation", "translation"))
        gaps = (feet @ R.swapaxes(1, 2) + t[:, None] - feet)[..., 2] - sample["deviation"].values[:, :4]
        forces = stiffness * np.maximum(-gaps, 0)
        assert tree["reaction"].values[:, 0] == pytest.approx(forces.sum(axis=1), rel=1e-6)
        assert forces.sum(axis=1) == pytest.approx(LOAD, rel=1e-5)
        rebuilt = tc.io.model_of(tree)
    assert [locator.stiffness for locator in rebuilt.locations[0].scheme] == [1000.0] * 4 + [None] * 3


@pytest.mark.parametrize("choices", [{"objective": "all points"}, {"resolution": "linearized"}])
def test_a_method_without_springs_is_refused(choices):
    with pytest.raises(tc.ModelError, match=r"supports of top: a support has a stiffness.*seating.*exact.*stiffness out"):
        tc.build(springy_table(1000.0), method=SEATED.with_choices(**choices))


def test_rigid_and_springy_supports_share_a_table():
    """Legs 0 and 2 are rigid: the table stands on them, unless the springy diagonal holds the load higher."""
    model = springy_table(1000.0)
    (location,) = model.locations
    scheme = list(location.scheme)
    for k in (0, 2):
        leg = scheme[k]
        scheme[k] = tc.Locator(leg.name, leg.point, leg.direction, leg.tolerance, one_sided=True)
    model = model.replaced(locations=[replace(location, scheme=tuple(scheme))])
    for solver in ("qpoases", "daqp", "graph"):
        _, run = simulate(model, samples=100, solver=solver)
        legs = run["deviations"][:, :4]
        rigid, springy = legs[:, [0, 2]].mean(axis=1), legs[:, [1, 3]].mean(axis=1) - LOAD / 2000
        assert run["measured"][:, CORRECTED, 0] == pytest.approx(np.maximum(rigid, springy), abs=1e-8)


def test_a_table_springs_back_when_a_clamp_is_released():
    line = tc.Assembly("line", method=SEATED)
    clamped = springy_table(1000.0)
    top = line.part("top", tc.Box(400, 400, 20))
    scheme = clamped.locations[0].scheme
    for name, load in (("clamp", 400.0), ("release", 100.0)):
        station = line.station(name)
        station.locate(top, scheme)
        station.force(f"load of {name}", at=top.point(200, 200, 0), vector=(0, 0, -load))
        station.measure(f"height in {name}", top.point(200, 200, 0), along="z")
    _, run = simulate(line, samples=100, solver="daqp")
    for k, load in enumerate((400.0, 100.0)):
        legs = run["deviations"][:, 7 * k : 7 * k + 4]
        assert run["measured"][:, CORRECTED, k] == pytest.approx(closed_height(legs, 1000.0, load), abs=1e-8)
