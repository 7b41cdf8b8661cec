"""Contact of features is resolved as that of other faces, whatever is minimized and however points are found."""

import pytest

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
