"""Contact of features is resolved as that of other faces, whatever is minimized and however points are found."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
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


TURNED = 0.4, -1.1, 0.7


def cornered(order, rotation):
    """A block in the corner of an angle, whose wall tilts and whose floor does not; contact is declared in an order."""
    a, R = tc.Assembly("corner"), Rotation.from_rotvec(rotation).as_matrix()
    floor, wall = (trimesh.creation.box(bounds=bounds) for bounds in ([[0, 0, -10], [60, 60, 0]], [[0, -10, -10], [60, 0, 20]]))
    angle = a.part("angle", tc.Mesh(trimesh.boolean.union([floor, wall], engine="manifold")), fixed=True, rotation=rotation)
    block = a.part("block", tc.Box(40, 30, 15), at=R @ (10, 0, 0), rotation=rotation)
    angle.feature("A", angle.face("-z"), datum="A")
    angle.feature("B", angle.face("-y"), datum="B")
    inner = [angle.face(side, lambda c, n, axis=axis: abs(c[:, axis]) < 1e-6) for side, axis in (("+y", 1), ("+z", 2))]
    inner[0] = angle.feature("wall", inner[0], tc.Profile(0.4, "A|B"))
    scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2)
    a.locate(block, scheme, tolerance=0.4)
    for number in order:
        a.contact(("wall", "floor")[number], moving=block.face(("-y", "-z")[number]), reference=inner[number])
    for k, (x, z) in enumerate(((0, 0), (60, 0), (0, 20))):
        a.measure(f"wall {k}", inner[0].point(x, 0, z), along=R[:, 1])
    return a


@pytest.mark.slow
@pytest.mark.parametrize("rotation", [(0, 0, 0), *nightly((TURNED,))])
def test_bodies_are_compared_with_the_deviations_of_all_their_faces(rotation):
    """A wall that tilts takes no floor along, whichever contact is declared first; corners stand on the actual faces."""
    poses, R = [], Rotation.from_rotvec(rotation).as_matrix()
    for order in ((0, 1), (1, 0)):
        results = tc.run(compiled(cornered(order, rotation), solver="daqp"), samples=60, surfaces=0, fields="none", keep="all")
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
    """On the floor of the slot, whose walls move with its size, as those of the tab do."""
    a = tc.Assembly("slot")
    block, cut = (trimesh.creation.box(bounds=bounds) for bounds in ([[0, 0, 0], [60, 50, 20]], [[-1, 20, 10], [61, 30, 21]]))
    body = a.part("body", tc.Mesh(trimesh.boolean.difference([block, cut], engine="manifold")), fixed=True)
    tab = a.part("tab", tc.Box(40, 10, 15), at=(10, 20, 10))
    walls = [body.face(side, lambda c, n, at=at: abs(c[:, 1] - at) < 1e-6) for side, at in (("+y", 20), ("-y", 30))]
    walls = body.feature("slot", *walls, tc.Size(10, 0.2)).faces
    sides = tab.feature("tab", tab.face("-y"), tab.face("+y"), tc.Size(10, 0.0, -0.2)).faces
    a.locate(tab, tc.three_two_one(tab.face("-z"), sides[0], tab.face("-x"), inset=2), tolerance=0.2)
    for name, side, wall in zip(("near", "far"), sides, walls, strict=True):
        a.contact(name, moving=side, reference=wall)
    a.contact("floor", moving=tab.face("-z"), reference=body.face("+z", lambda c, n: abs(c[:, 2] - 10) < 1e-6))
    a.measure("across", tab.point(20, 5, 0), along="y")
    results = tc.run(compiled(a, solver="daqp"), samples=60, surfaces=0, fields="none", keep="all")
    width, clearance = (results["sample"].deviation.sel(contributor=f"{name}.size").values for name in ("tab.tab", "body.slot"))
    fits = clearance > width
    assert 30 < fits.sum() < 60
    np.testing.assert_array_equal(results["status"].values, np.where(fits, 1, 3))
