"""Insides of `analyses` under the claims of `tests/test_worst_case.py`."""

import numpy as np
import pandas as pd
import pytest
import trimesh
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.cases import toleranced
from tests.cases.fasteners import fasteners
from tests.helpers import PAPER, compiled, nightly
from tests.test_datums import plate
from tests.test_worst_case import small_ra1, values
from tolcontact import vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.analyses.analysis import Analysis
from tolcontact.analyses.extreme_search import Evaluation, Searcher
from tolcontact.analyses.linear_model import farthest_poses, linear_model
from tolcontact.analyses.searches import Effort
from tolcontact.analyses.worst_case import search_worst_case


def evaluation_of(program, region):
    return Evaluation(Analysis(terms.WORST_CASE, program), region)


def searcher_of(program, region):
    spread = np.ones(len(program.nominal.measures))
    return Searcher(region, evaluation_of(program, region), spread, np.random.default_rng(1), Effort(best=1, random=2))


def few_searches(model, samples, method=None):
    """`worst_case` with two searches for each value, which end at coarse steps: enough where far ends are the answer."""
    analysis = Analysis(
        terms.WORST_CASE, model, samples=samples, seed=1, solver=None if isinstance(model, tc.Program) else "daqp",
        method=method, into=None, client=None, progress=None,
    )  # fmt: skip
    return search_worst_case(analysis, Effort(best=1, random=2, finest_step=0.1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("is_fixed", "pull", "end", "with_float", "without"),
    [(False, 3, 1, 54, 52), *nightly((True, -3, 0, 47, 48.5), (True, 3, 1, 53, 51.5), (False, -3, 0, 46, 48))],
)
def test_fasteners_have_the_documented_extremes(is_fixed, pull, end, with_float, without):
    """Fixed and floating fasteners: extremes by hand. Forces decide where the float goes; the bound is that of any float."""
    found = few_searches(compiled(fasteners(is_fixed, pull), solver="daqp"), 32)
    assert values(found)[end] == pytest.approx(with_float, abs=2e-6)
    assert values(found, measure=1)[end] == pytest.approx(without, abs=2e-6)
    assert values(found, 1, "raw", "bound") == pytest.approx([100 - without, without][:: 1 if end else -1], abs=1e-6)
    if is_fixed:
        assert values(found, of="bound") == pytest.approx([47, 53], abs=1e-6)


@pytest.mark.slow
def test_a_clutch_has_the_worst_cases_of_its_formula():
    """One-way clutch: the angle at its extremes is a closed form."""
    found = few_searches(cases.model("clutch"), 32)
    assert values(found) == pytest.approx([5.9574, 7.9385], abs=1e-4)
    last = found.deviations.isel(measure=0).sel(state="corrected", end="largest")
    labels = ["hub.flat.offset", "roller.barrel.size", "ring.bore.size"]
    assert last.sel(contributor=labels).values == pytest.approx([-0.05, -0.02, 0.025], abs=1e-9)
    assert not np.isfinite(values(found, of="bound")).any()


@pytest.mark.parametrize("slope", [1e-3, 4e-8, 1e-10])
def test_a_bound_does_not_depend_on_the_units_of_a_contributor(slope):
    """A pressure in Pa moves the locator by the same 0.04 mm as in MPa, in addition to its own 0.05 mm."""
    a = tc.Assembly("vessel")
    block = a.part("block", tc.Box(50, 30, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.1)
    a.variable("pressure", tc.Tolerance(0.08 / slope), drives={"block.C1": slope}, units="Pa")
    a.measure("place", block.point(0, 15, 5), along="x")
    program = compiled(a, solver="daqp")
    bounds = farthest_poses(program, AllowedRegion(program.draws, seed=1), linear_model(program))
    assert bounds == pytest.approx(np.array([[[-0.09, 0.09]] * 2]), abs=1e-9)


def test_what_is_found_is_what_the_engine_says_of_the_combination():
    program = compiled(small_ra1(), solver="daqp")
    found = few_searches(program, 64)
    assert few_searches(program, 64).equals(found)
    for state in (0, 1):
        own = found.deviations.isel(measure=0, state=state).values
        measured = evaluation_of(program, AllowedRegion(program.draws, seed=1)).corrected(own)
        assert measured[:, state, 0] == pytest.approx(found.worst.isel(measure=0, state=state).values, abs=1e-12)


def with_idle_parts(a, count):
    """The model with parts aside that touch nothing and are not measured."""
    for k in range(count):
        part = a.part(f"aside {k}", tc.Box(10, 10, 10), at=(200 + 20 * k, 0, 0))
        a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.1)
    return a


def influences_of(a, count=16):
    program, rng = compiled(a, solver="daqp"), np.random.default_rng(1)
    area = AllowedRegion(program.draws, seed=1)
    points = area.scattered(rng, count)
    influences = searcher_of(program, area)
    influences.explore(points, area.scattered(rng, count))
    return {label for label, is_active in zip(program.nominal.contributors, influences.is_active[0], strict=True) if is_active}


def test_contributors_without_influence_are_left_out_and_change_no_answer():
    plain, crowded = (few_searches(compiled(with_idle_parts(small_ra1(), count), solver="daqp"), 16) for count in (0, 4))
    assert crowded.sizes["contributor"] == plain.sizes["contributor"] + 24
    spread = np.ptp(values(plain))
    assert values(crowded) == pytest.approx(values(plain), abs=0.02 * spread)
    assert int(crowded.by_status.sum()) < 1.5 * int(plain.by_status.sum())


def test_influences_are_those_of_contact_too():
    active = influences_of(with_idle_parts(small_ra1(), 2))
    assert {"base.A1", "base.A2", "base.A3", "top.A1", "top.A2", "top.A3"} <= active
    assert not any(label.startswith("aside") for label in active)


def test_an_influence_that_shows_only_at_some_points_is_found_there():
    """The height max(0, z) does not change between two points below, and does between one below and one above."""
    program = compiled(cases.one_dimensional(0), solver="daqp", method=PAPER)
    area = AllowedRegion(program.draws, seed=1)
    influences = searcher_of(program, area)
    is_height = np.array([label == "block.Z" for label in program.nominal.contributors])
    low, lower, above = (np.where(is_height, z, area.middle)[None] for z in (-1.5, -2.5, 2.5))
    assert not influences.explore(low, lower).any() and not influences.is_active.any()
    assert influences.explore(low, above).all() and np.array_equal(influences.is_active[0], is_height)


def varied():
    """A plate with zones of all kinds, a cause that drives a locator, and measured parts."""
    a = tc.Assembly("varied")
    plate = a.part("plate", tc.Box(100, 50, 10))
    plate.feature("under", plate.face("-z"), datum="A")
    plate.feature("top", plate.face("+z"), tc.Profile(0.3, "A", outside=0.3), tc.Parallelism(0.1, "A"))
    a.locate(
        plate,
        [
            tc.Locator("A1", (5, 5, 0), "z", 0.2),
            tc.Locator("A2", (95, 5, 0), "z", stats.uniform(-1, 3)),
            tc.Locator("A3", (50, 45, 0), "z", stats.norm(0, 0.1)),
            tc.Locator("B1", (5, 0, 5), "y", tc.Tolerance(0.4, shift=1)),
            tc.Locator("B2", (95, 0, 5), "y", 0.2),
            tc.Locator("C1", (0, 25, 5), "x", 0),
        ],
    )
    a.variable("heat", 10, drives={"plate.A1": 0.01}, units="K")
    a.measure("corner", plate.point(100, 50, 10), along="z")
    return a


def region(a):
    program = compiled(a, solver="daqp")
    return AllowedRegion(program.draws, seed=1), list(program.nominal.contributors)


def test_every_contributor_has_the_range_of_its_drawing():
    found, labels = region(varied())
    of = dict(zip(labels, zip(found.lower, found.upper, strict=True), strict=True))
    assert of["plate.A1"] == (-0.1, 0.1) and of["plate.A2"] == (-1, 2)
    assert of["plate.A3"] == pytest.approx((-0.3, 0.3)) and of["plate.B1"] == pytest.approx((0.8, 1.2))
    assert of["plate.C1"] == (0, 0) and of["heat"] == (-5, 5)
    own = found.middle[None].copy()
    own[0, labels.index("heat")] = 5
    assert found.deviations(own)[0, labels.index("plate.A1")] == pytest.approx(found.middle[0] + 0.05)


def test_an_uneven_zone_is_where_the_drawing_has_it_and_a_tilt_is_within_its_own():
    found, labels = region(varied())
    top = [k for k, label in enumerate(labels) if label.startswith("plate.top")]
    offset = next(k for k in top if "offset" in labels[k])
    ends = []
    for sign in (1, -1):
        direction = np.zeros(len(labels))
        direction[offset] = sign
        ends.append(found.exactly_farthest(direction)[offset])
    assert ends == pytest.approx([0.3, 0.0], abs=1e-6)  # all of the 0.3 is outside, none inside
    tilted = found.exactly_farthest(np.isin(np.arange(len(labels)), top) * 1.0)
    tilts = [tilted[k] for k in top if k != offset]
    assert sum(map(abs, tilts)) == pytest.approx(0.05, abs=1e-6)  # half of the parallelism, at the corner


def test_a_zone_grows_with_the_size_that_it_is_left():
    a = tc.Assembly("ring")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(5, 20, 10, sections=64)), fixed=True)
    ring.feature("under", ring.face("-z"), datum="A")
    ring.feature("rim", ring.face(tc.select.Cylinder(radius=20)), datum="B")
    hole = ring.feature(
        "hole",
        ring.face(tc.select.Cylinder(radius=5)),
        tc.Size(10, 0.2, -0.2),
        tc.Position(0.1, "A|B", material="M", rule="translation"),
    )
    a.measure("place", hole.axis(0), along="x")
    found, labels = region(a)
    size = labels.index("ring.hole.size")
    shifts = [labels.index(f"ring.hole.shift {axis}") for axis in "xy"]
    direction = np.zeros(len(labels))
    direction[shifts] = 0.6, 0.8
    far = found.exactly_farthest(direction)
    assert far[size] == pytest.approx(0.2)  # an inner feature has its least material where it is largest
    assert far @ direction == pytest.approx((0.1 + 0.4) / 2, abs=1e-8)
    direction[size] = -10
    far = found.exactly_farthest(direction)
    assert far[size] == pytest.approx(-0.2) and far[shifts] @ (0.6, 0.8) == pytest.approx(0.1 / 2, abs=1e-8)


def is_inside(region, points):
    """Whether points lie in the region: between its bounds, and on no tangent's wrong side."""
    slack = 1e-9 * (region.upper - region.lower)
    within = ((points >= region.lower - slack) & (points <= region.upper + slack)).all(axis=1)
    return within & np.array([not len(region.planes(point)[0]) for point in points])


@pytest.mark.parametrize("weight", [1.0, -1.0])
def test_a_zone_grows_with_the_size_that_a_cause_drives(weight):
    zone = tc.Position(0.1, "A|B", material="M", rule="translation")
    a = toleranced.ring_with("bore", tc.Size(10, 0.2, -0.2), zone)
    a.variable("wear", 0.1, drives={"ring.bore.size": weight})
    found, labels = region(a)
    direction = np.zeros(len(labels))
    direction[[labels.index(f"ring.bore.shift {axis}") for axis in "xy"]] = 0.6, 0.8
    far = found.exactly_farthest(direction)
    assert direction @ far == pytest.approx((0.1 + 0.4 + 0.05) / 2, abs=1e-6)
    assert far[labels.index("wear")] == pytest.approx(0.05 * weight, abs=1e-6)
    assert is_inside(found, found.farthest(np.random.default_rng(0).standard_normal((50, len(labels))))).all()


def test_the_shift_of_a_datum_is_bounded_with_what_causes_add_to_its_tilt():
    a = plate("outside")
    a.variable("warp", 0.2, drives={"plate.side.tilt z": 1.0})
    found, labels = region(a)
    shift = labels.index("plate.far.datum B of A|B|C")
    assert found.upper[shift] == pytest.approx(0.15 + 0.1)
    reached = found.deviations(found.scattered(np.random.default_rng(0), 500))[:, shift]
    assert 0.2 < reached.max() <= found.upper[shift] + 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hinge", "clutch", *nightly("lid")])
def test_steps_end_where_the_region_ends(name):
    found, labels = region(cases.model(name))
    rng = np.random.default_rng(2)
    inside = found.scattered(rng, 400)
    assert is_inside(found, inside).all()
    steps = rng.standard_normal(inside.shape) * (found.upper - found.lower)
    reach = found.reach(inside, steps)[:, None]
    assert is_inside(found, inside + reach * steps).all()
    stopped = reach[:, 0] < 0.99
    assert not is_inside(found, inside + (reach + 0.01) * steps)[stopped].any() and stopped.mean() > 0.9
    planes, ends = found.planes()
    assert (inside @ planes.T <= ends + 1e-9).all()
    goal = rng.standard_normal(len(labels))
    assert found.exactly_farthest(goal) @ goal >= (inside @ goal).max() - 1e-9


def test_measured_parts_are_one_of_their_rows():
    a = cases.one_dimensional(6)
    a.population(pd.DataFrame({"z": [-1.0, 0.25, 2.0]}), {"block.Z": "z"})
    found = few_searches(a, 16)
    assert set(np.unique(found.deviations.sel(contributor="block.Z"))) <= {-1.0, 0.25, 2.0}
    assert found.worst.sel(state="raw").values.ravel() == pytest.approx([-1, 2], abs=1e-9)


@pytest.mark.nightly
@pytest.mark.slow
def test_what_cannot_be_assembled_does_not_count():
    a = cases.square_pins("rotations")
    found = few_searches(a, 32, tc.Method(resolution="exact", objective="seating"))
    assert int(found.by_status.sel(status_meaning="not_assemblable")) > 0
    assert np.isfinite(found.worst.values).all()
