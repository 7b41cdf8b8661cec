"""Contact of features is resolved as that of other faces, whatever is minimized and however points are found."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.several_pairs import corner, tab_in_a_slot
from tests.helpers import compiled, nightly
from tolcontact.method import OBJECTIVES
from tolcontact.testing import assert_gaps_recompute, assert_resolved


@pytest.mark.slow
@pytest.mark.parametrize("search", [*nightly("fixed"), "bounded"])
@pytest.mark.parametrize("objective", sorted(OBJECTIVES))
def test_faces_of_features_are_resolved_by_every_objective(objective, search, tmp_path):
    """A block on a table, both faces of which deviate; its supports may be left: two of them, or all if it is pressed."""
    a = tc.Assembly("table", method=tc.Method(resolution="exact", objective=objective, search=search))
    table, block = a.part("table", tc.Box(100, 60, 10), fixed=True), a.part("block", tc.Box(50, 30, 20), at=(25, 15, 10))
    table.feature("foot", table.face("-z"), datum="A")
    top = table.feature("top", table.face("+z"), tc.Profile(0.3, "A"), tc.Parallelism(0.15, "A"))
    block.feature("lid", block.face("+z"), datum="A")
    under = block.feature("under", block.face("-z"), tc.Profile(0.2, "A"))
    a.contact("interface", moving=under, reference=top)
    feet = [(5, 5), (45, 5), (25, 25)]
    held = [
        tc.Locator(f"Z{k}", (x, y, 0), "z", 0.2, one_sided=k > 0 or objective == "seating", on=under)
        for k, (x, y) in enumerate(feet)
    ]
    held += [
        tc.Locator("X", (0, 15, 10), "x", 0.1),
        tc.Locator("Y1", (5, 0, 10), "y", 0.1),
        tc.Locator("Y2", (45, 0, 10), "y", 0.1),
    ]
    a.locate(block, held)
    a.force("weight", at=block.point(25, 15, 10), vector=(0, 0, -1))
    a.measure("height", under.point(50, 30, 0), along="z", tolerance=0.2)
    program = compiled(a, solver="daqp")
    results = tc.run(program, samples=20, seed=5, surfaces=20, out=tmp_path / "table.nc")
    assert set(results["status"].values.tolist()) <= {0, 1} and (results["status"].values == 1).any()
    assert_resolved(tmp_path / "table.nc")
    assert_gaps_recompute(tmp_path / "table.nc")


@pytest.mark.slow
@pytest.mark.parametrize("rotation", [(0, 0, 0), *nightly(((0.4, -1.1, 0.7),))])
def test_bodies_are_compared_with_the_deviations_of_all_their_faces(rotation):
    """A wall that tilts takes no floor along, whichever contact is declared first; corners stand on the actual faces."""
    poses, R = [], Rotation.from_rotvec(rotation).as_matrix()
    for order in ((0, 1), (1, 0)):
        results = tc.run(compiled(corner(order, rotation), solver="daqp"), samples=60, surfaces=0, fields="none", keep="all")
        assert set(results["status"].values.tolist()) <= {0, 1}
        turned = results["rotation"].sel(part="block", state="corrected").values
        shift = results["translation"].sel(part="block", state="corrected").values
        poses.append(np.concatenate([turned.reshape(-1, 9), shift], axis=1))
    np.testing.assert_allclose(*poses, atol=1e-9)
    at = results["measured"].sel(state="raw").values  # of the wall: heights at (0, 0), (60, 0) and (0, 20)
    corners = R @ np.array([(x, y, z) for x in (10, 50) for y in (0, 30) for z in (0, 15)], dtype=float).T
    x, y, z = (R.T @ (turned @ corners + shift[..., None])).swapaxes(0, 1)
    over_wall = y - (at[:, [0]] + (at[:, [1]] - at[:, [0]]) * x / 60 + (at[:, [2]] - at[:, [0]]) * z / 20)
    gaps = np.stack([z.min(axis=1), over_wall.min(axis=1)], axis=1)
    assert gaps.min() > -1e-5
    assert (gaps.min(axis=1)[results["status"].values == 1] < 1e-5).all() and (gaps < 1e-5).any(axis=0).all()


@pytest.mark.slow
def test_a_tab_that_is_narrower_than_its_slot_fits():
    results = tc.run(compiled(tab_in_a_slot(), solver="daqp"), samples=60, surfaces=0, fields="none", keep="all")
    width, clearance = (results["sample"].deviation.sel(contributor=f"{name}.size").values for name in ("tab.tab", "body.slot"))
    fits = clearance > width
    assert 30 < fits.sum() < 60
    np.testing.assert_array_equal(results["status"].values, np.where(fits, 1, 3))
