"""Displacement fields of whole runs, against the archived poses."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly


def pile(sections: int) -> tc.Assembly:
    """A round block with many vertices on a square one."""
    a = tc.Assembly("pile")
    base = a.part("base", tc.Box(40, 40, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Mesh(trimesh.creation.cylinder(15, 20, sections=sections)), at=(20, 20, 10))
    feet = [tc.Locator(f"Z{k}", (x, y, -10), "z", 1) for k, (x, y) in enumerate([(10, 0), (-10, 0), (0, 10)])]
    sides = [("X", (-15, 0, 0), "x"), ("Y1", (0, -15, 0), "y"), ("Y2", (9, -12, 0), "y")]
    a.locate(block, [*feet, *(tc.Locator(name, point, along, 1) for name, point, along in sides)])
    a.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=40)
    a.measure("top", block.point(0, 0, 10), along="z", tolerance=1)
    return a


@pytest.mark.slow
@pytest.mark.parametrize("sections", [200, *nightly(8, 700)])
def test_the_field_of_a_part_with_any_number_of_vertices_is_that_of_its_poses(sections):
    tree = tc.run(compiled(pile(sections), solver="daqp"), samples=300, surfaces=0)
    field = tree["field/block"].to_dataset()
    v = field["vertices"].values
    assert len(v) >= 2 * sections
    for state in ("raw", "corrected"):
        R, t = (tree[name].sel(part="block", state=state).values for name in ("rotation", "translation"))
        u = np.einsum("kij,vj->kvi", R, v) + t[:, None] - v
        u = np.concatenate([u, np.linalg.norm(u, axis=2, keepdims=True)], axis=2)
        assert np.abs(field["mean"].sel(state=state).values - u.mean(axis=0)).max() < 1e-12
        assert np.abs(field["six_sigma"].sel(state=state).values - 6 * u.std(axis=0, ddof=1)).max() < 1e-11
        spread = field["magnitude_six_sigma_interval"].sel(state=state).values
        size = field["six_sigma"].sel(state=state, component="magnitude").values
        assert (spread[:, 0] < size).all() and (size < spread[:, 1]).all()


def test_fields_do_not_depend_on_the_blocks_they_are_summed_up_in():
    """Moments that are put together block by block, against those of the poses of all realizations."""
    samples = 3 * 4096 + 17
    tree = tc.run(compiled(cases.one_dimensional(6), solver="daqp"), samples=samples, keep="poses", surfaces=0)
    for part in ("base", "block"):
        field = tree[f"field/{part}"].to_dataset()
        height = tree["translation"].sel(part=part, axis="z").values
        for state in (0, 1):
            assert field["mean"].values[state, :, 2] == pytest.approx(height[:, state].mean(), abs=1e-12)
            assert field["six_sigma"].values[state, :, 2] == pytest.approx(6 * height[:, state].std(ddof=1), rel=1e-10)
            assert field["mean"].values[state, :, 3] == pytest.approx(np.abs(height[:, state]).mean(), rel=1e-6)
        assert int(field["realizations"]) == samples
