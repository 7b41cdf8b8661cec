"""Two-sided locators that give way under forces: a bar on springs by its stiffness matrix, and what the archive says."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled, simulate
from tolcontact.testing import assert_gaps_recompute
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating")
PLACES, STIFFNESS = np.array([20.0, 160.0, 290.0]), np.array([400.0, 150.0, 700.0])
LOAD, AT, LENGTH = 80.0, 350.0, 400.0  # beyond the last spring, so that the first one pulls


def scheme(stiffness=STIFFNESS, unit=1.0):
    """The locators of the bar: three springs in z, of which the middle one only pushes, and four that hold it otherwise."""
    springs = [
        tc.Locator(f"S{k}", (x * unit, 10 * unit, 0), "z", 0.6 * unit, one_sided=k == 1, stiffness=k_z and k_z / unit)
        for k, (x, k_z) in enumerate(zip(PLACES, stiffness, strict=True))
    ]
    sides = {"B1": ((50, 0, 0), "y"), "B2": ((350, 0, 0), "y"), "B3": ((200, 0, 10), "y"), "C": ((0, 10, 0), "x")}
    return [*springs, *(tc.Locator(name, np.multiply(p, unit), n, 1e-9 * unit) for name, (p, n) in sides.items())]


def bar_on_springs(*, unit=1.0, rotation=(0, 0, 0), stiffness=STIFFNESS):
    """A bar on three springs. All lengths are multiplied by `unit`."""
    model, turn = tc.Assembly("bar on springs", method=SEATED), Rotation.from_rotvec(rotation)
    bar = model.part("bar", tc.Box(LENGTH * unit, 20 * unit, 10 * unit), rotation=rotation)
    model.locate(bar, scheme(stiffness, unit))
    model.force("load", at=bar.point(AT * unit, 10 * unit, 0), vector=tuple(turn.apply([0, 0, -LOAD])))
    for name, x in (("start", 0), ("end", LENGTH)):
        model.measure(name, bar.point(x * unit, 10 * unit, 0), along=tuple(turn.apply([0, 0, 1])))
    return model


def by_stiffness_matrix(deviations, load=LOAD):
    """Return the heights of both ends (2,) [mm], and the forces of the springs (3,) [N], for their deviations (3,)."""
    for stiffness in (STIFFNESS, STIFFNESS * [1, 0, 1]):  # with the spring in the middle, and without
        X = np.column_stack([np.ones(3), PLACES])
        z, slope = np.linalg.solve((X.T * stiffness) @ X, X.T @ (stiffness * deviations) - load * np.array([1, AT]))
        forces = stiffness * (deviations - z - slope * PLACES)
        if forces[1] >= 0:
            break
    return np.array([z, z + slope * LENGTH]), forces


@pytest.mark.parametrize("solver", ["qpoases", "daqp", "graph"])
def test_a_bar_lies_on_its_springs_by_their_stiffness_matrix(solver):
    program, run = simulate(bar_on_springs(), samples=100, solver=solver)
    assert (run["status"] == Status.RESOLVED).all()
    ends, forces = zip(*map(by_stiffness_matrix, run["deviations"][:, :3]), strict=True)
    assert run["measured"][:, CORRECTED] == pytest.approx(np.array(ends), abs=1e-8)
    names = [pair.name for pair in program.nominal.pairs]
    assert names == ["supports of bar", "bar.S0", "bar.S2"]
    assert run["reaction"] == pytest.approx(np.array(forces)[:, [1, 0, 2]], abs=1e-5)
    pulled = np.array(forces)[:, 0] < 0
    assert 0 < pulled.mean() and (run["carrying"][:, 1:] == 1).all()


def test_turned_frames_and_other_units_change_nothing():
    plain, turned, metres = (
        simulate(bar_on_springs(**choices), samples=30)[1] for choices in ({}, {"rotation": (0.4, 0.1, -0.3)}, {"unit": 1e-3})
    )
    assert turned["measured"][:, CORRECTED] == pytest.approx(plain["measured"][:, CORRECTED], abs=1e-8)
    assert metres["measured"][:, CORRECTED] * 1e3 == pytest.approx(plain["measured"][:, CORRECTED], abs=1e-7)
    assert metres["reaction"] == pytest.approx(plain["reaction"], abs=1e-3)


def test_forces_follow_from_the_archive_alone(tmp_path):
    path = tmp_path / "bar.nc"
    tc.run(compiled(bar_on_springs()), samples=30, out=path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as tree:
        sample = tree["sample"].to_dataset()
        feet, stiffness = sample["locator_point"].values[:3], sample["stiffness"].values[:3]
        R, t = (tree[name].sel(part="bar", state="corrected").values for name in ("rotation", "translation"))
        heights = (feet @ R.swapaxes(1, 2) + t[:, None] - feet)[..., 2]
        forces = stiffness * (sample["deviation"].values[:, :3] - heights)
        assert tree["reaction"].sel(pair=["bar.S0", "bar.S2"]).values == pytest.approx(forces[:, [0, 2]], abs=1e-5)
        assert forces[:, [0, 2]].sum(axis=1) + np.maximum(forces[:, 1], 0) == pytest.approx(LOAD, rel=1e-6)
        rebuilt = tc.io.model_of(tree)
    assert [locator.stiffness for locator in rebuilt.locations[0].scheme] == [*STIFFNESS, None, None, None, None]


def test_stiff_springs_are_rigid_locators():
    stiff, rigid = (
        simulate(bar_on_springs(stiffness=stiffness), samples=50)[1]["measured"][:, CORRECTED]
        for stiffness in ([1e12, 1.0, 1e12], [None, 1.0, None])
    )
    assert stiff == pytest.approx(rigid, abs=1e-9)


def test_without_forces_locators_hold_as_ever():
    """The objective "all points" places the part by its locators, whatever their stiffness."""
    method = tc.Method(objective="all points")
    stated, left_out = (
        simulate(bar_on_springs(stiffness=stiffness), samples=20, method=method)[1]["measured"]
        for stiffness in ([400.0, None, 700.0], [None, None, None])
    )
    assert (stated == left_out).all()


def test_a_stiffness_of_a_fixed_part_is_refused():
    model = bar_on_springs()
    base = model.part("base", tc.Box(10, 10, 10), at=(500, 0, 0), fixed=True)
    places = {"S": ((0, 0, 0), "z"), "A2": ((10, 0, 0), "z"), "A3": ((0, 10, 0), "z"), "B1": ((0, 0, 0), "y")}
    places |= {"B2": ((10, 0, 0), "y"), "C": ((0, 5, 0), "x")}
    stiffness = dict.fromkeys(places) | {"S": 100}
    model.locate(base, [tc.Locator(name, p, n, 0.1, stiffness=stiffness[name]) for name, (p, n) in places.items()])
    with pytest.raises(tc.ModelError, match=r'locator "base.S": .*part "base" is fixed=True.*leave stiffness out'):
        tc.build(model)
