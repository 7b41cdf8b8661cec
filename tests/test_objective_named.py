"""Runs say what their objective assumes, what other objectives would give, and where it leaves parts that nothing explains."""

from io import StringIO

import numpy as np
import pytest
import trimesh
from rich.console import Console

import tolcontact as tc
from tests import cases
from tests.helpers import FIXED, PAPER, compiled
from tolcontact.report import summary_text

SAMPLES = 1000  # runs from this number on are compared with other objectives


def printed(summary):
    console = Console(width=400, file=StringIO(), highlight=False)
    console.print(summary_text(summary))
    return console.file.getvalue()


def weighed(method=None):
    """A block on a table, under its weight; its feet are supports."""
    a = tc.Assembly("weighed", method=method)
    table = a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Box(50, 25, 10), at=(20, 12.5, 10))
    sides = [
        tc.Locator("Y1", (5, 0, 5), "y", 0.2),
        tc.Locator("Y2", (45, 0, 5), "y", 0.2),
        tc.Locator("X", (0, 12, 5), "x", 0.2),
    ]
    a.locate(block, sides, floating=True)
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    a.force("weight", at=block.point(25, 12, 5), vector=(0, 0, -10))
    a.measure("height", block.point(0, 0, 10), along="z", limits=(-1, 1))
    return a


def pinned(*, seat: bool):
    """A lid in six locators, with two holes at dowels that fit badly; its seat may be forgotten."""
    a, places = tc.Assembly("pinned"), ((-30.0, 0.0), (30.0, 0.0))

    def plate(diameter):
        slab = trimesh.creation.box(bounds=[(-50, -30, 0), (50, 30, 8)])
        drills = [trimesh.creation.cylinder(diameter / 2, 30, sections=48).apply_translation((*place, 4)) for place in places]
        return tc.Mesh(trimesh.boolean.difference([slab, *drills], engine="manifold"))

    base, lid = a.part("base", plate(8), fixed=True), a.part("lid", plate(8.05), at=(0, 0, 8))
    for part in (base, lid):
        for letter, face in {"A": "-z", "B": "-y", "C": "-x"}.items():
            part.feature(letter, part.face(face), datum=letter)
    a.locate(lid, tc.three_two_one(lid.face("-z"), lid.face("-y"), lid.face("-x"), inset=5), tolerance=0.01)
    for k, (x, y) in enumerate(places):
        box = tc.select.Inside((x - 8, y - 8, -1), (x + 8, y + 8, 9))
        holes = [
            part.feature(f"H{k}", part.face(tc.select.Cylinder(inner=True), box), tc.Position(0.1, "A|B|C"))
            for part in (base, lid)
        ]
        tc.fasten(a, f"dowel {k}", 8, through=[holes[1]], into=holes[0])
    if seat:
        a.contact("seat", moving=lid.face("-z"), reference=base.face("+z"))
    a.measure("lid", lid.point(50, 30, 8), along="z", limits=(-0.1, 0.1))
    return a


def test_a_model_with_forces_is_seated_unless_it_has_a_method_and_says_so_if_it_uses_none():
    run = tc.run(compiled(weighed()), samples=20, surfaces=0)
    assert (run.attrs["objective"], run.attrs["method_from"]) == ("seating", "defaults")
    assert float(abs(run.measured.sel(state="corrected")).max()) < 1e-6  # it lies on the table
    with pytest.warns(tc.NominalWarning, match=r'\[force\] force "weight": without effect, since objective "all points"'):
        program = tc.build(weighed(tc.Method()))
    assert program.method == tc.Method()


def test_an_offset_is_the_largest_motion_along_a_locator():
    run = tc.run(compiled(cases.model("ra1")), samples=50, seed=3, surfaces=0)
    sample, top = run["sample"].to_dataset(), {"part": "top"}
    is_top = [str(label).startswith("top.") for label in sample.locator.values]
    points, directions = sample.locator_point.values[is_top], sample.locator_direction.values[is_top]
    R, t = run.rotation.sel(top).values, run.translation.sel(top).values
    moved = np.einsum("ksij,pj->kspi", R, points) + t[:, :, None]
    along = ((moved[:, 1] - moved[:, 0]) * directions).sum(axis=2)
    assert np.allclose(run.locator_offset.sel(top), abs(along).max(axis=1), atol=1e-9) and run.locator_offset.max() > 1
    assert run.locator_variation.sel(top) == 5


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    return tc.run(compiled(cases.model("ra1"), solver="daqp"), samples=SAMPLES, seed=1, fields="none", surfaces=0)


def test_the_first_draws_have_the_results_of_runs_with_the_other_objectives(compared):
    group = compared["objectives"].to_dataset()
    assert group.by_objective.values.tolist() == ["active points", "all points", "locator stiffness"]
    for objective in group.by_objective.values:
        program = compiled(cases.model("ra1"), solver="daqp", method={"objective": objective})
        alone = tc.run(program, samples=128, seed=1, surfaces=0)
        kept = group.sel(by_objective=objective)
        assert np.array_equal(kept.measured_by_objective, alone.measured.sel(state="corrected"))
        assert np.array_equal(kept.status_by_objective, alone.status)


@pytest.mark.parametrize(("count", "is_compared"), [(9, False), (10, True)])
def test_changes_by_objective_are_of_ten_realizations_or_more(count, is_compared, compared):
    few = compared.copy(deep=True)
    status = few["objectives"].status_by_objective
    certified = np.flatnonzero(np.isin(status, (0, 1)).all(axis=0))
    status[:, np.delete(np.arange(status.shape[1]), certified[:count])] = 2  # not converged
    assert tc.summarize(few).change_by_objective.notnull().any() == is_compared


def test_the_summary_names_the_convention_and_the_means_by_others(compared):
    text = printed(tc.summarize(compared))
    assert "convention: parts move as little as possible, measured where they penetrated" in text
    (line,) = [line for line in text.splitlines() if "corner height: mean" in line]
    assert 'by "all points"' in line and 'by "locator stiffness"; here 0.46' in line


def test_a_figure_without_an_interval_is_not_said_to_depend_on_the_convention(compared):
    summary = tc.summarize(compared)
    summary.statistic_value.loc[{"interval": ["lower", "upper"]}] = np.nan
    assert "corner height: mean" not in printed(summary)


def test_nothing_is_compared_where_forces_decide_or_a_run_is_short():
    assert "objectives" not in tc.run(compiled(weighed()), samples=20, surfaces=0).children
    short = tc.summarize(tc.run(compiled(cases.model("ra1"), method=PAPER), samples=100, surfaces=0))
    assert not short.compared_by_objective.any()


def test_a_lid_that_is_lifted_until_its_holes_clear_the_dowels_is_reported():
    """Without the seat nothing says that it cannot lie askew in the base; RA1's top goes no further than explained."""
    summary = tc.summarize(tc.run(compiled(pinned(seat=False), solver="daqp", method=FIXED), samples=40, surfaces=0))
    assert summary.offset_unexplained.sel(part="lid", interval="lower") > 0.1
    assert "contact moved parts far off their locators: lid" in " ".join(printed(summary).split())
    assert "advice: say what holds them" in printed(summary)
    usual = tc.summarize(tc.run(compiled(cases.model("ra1")), samples=100, surfaces=0))
    assert usual.offset_unexplained.sel(part="top", interval="estimate") == 0
