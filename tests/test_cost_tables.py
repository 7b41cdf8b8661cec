"""Tables of choices in an allocation: the cheapest of all, ISO 286-1 grades, what is refused."""

import itertools
import re

import numpy as np
import pytest
from scipy.stats import norm

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tests.test_allocate import pile

TABLES = [{0.1: 9.0, 0.2: 5.0, 0.3: 3.5, 0.6: 1.0}, {0.15: 4.0, 0.3: 2.0, 0.45: 1.5}, {0.2: 8.0, 0.4: 6.0, 0.8: 2.0, 1.2: 1.0}]


def least_cost_of_tables(tables, sigma):
    """Every combination of choices: the least cost with a sum of normal deviations of at most this sigma."""
    combinations = itertools.product(*(table.items() for table in tables))
    return min(sum(c for _, c in rows) for rows in combinations if sum(w**2 for w, _ in rows) <= (6 * sigma) ** 2)


def test_choices_of_tables_are_the_cheapest_of_all_combinations():
    names = [f"p{k}.Z" for k in range(3)]
    found = tc.analyses.allocate(
        pile(0.6, 0.3, 0.9), "top: ppm 20000", costs=dict(zip(names, TABLES, strict=True)), samples=8192, solver="daqp"
    )
    widths = found.range.sel(group=names, stage="after").values
    rows = [min(table.items(), key=lambda row, w=w: abs(row[0] - w)) for table, w in zip(TABLES, widths, strict=True)]
    assert [width for width, _ in rows] == pytest.approx(widths) and found.met.values.all()
    sigma = 0.5 / norm.isf(0.01)
    assert sum(width**2 for width, _ in rows) <= (6 * sigma) ** 2
    cost = float(found.cost.sel(stage="after").sum())
    assert cost == pytest.approx(sum(c for _, c in rows))
    assert cost <= least_cost_of_tables(TABLES, 0.97 * sigma)  # the bound of a fresh run keeps a margin


@pytest.mark.nightly
def test_grades_of_sizes_are_choices_and_others_keep_any_range(tmp_path):
    """A block of 20 mm on a table: ISO 286-1 has IT7 of 21, IT8 of 33, IT9 of 52 and IT10 of 84 micrometres for it."""
    a = tc.Assembly("graded")
    table, block = a.part("table", tc.Box(50, 25, 20), fixed=True), a.part("block", tc.Box(50, 25, 10), at=(0, 0, 20))
    thickness = table.feature("w", table.face("+z"), table.face("-z"), tc.Size(20, 0.05, moves="first"))
    a.locate(block, cases.translating(0.05), on=thickness)
    a.measure("top", block.point(5, 5, 10), along="z", tolerance=0.1)
    grades = {"IT7": 4.0, "IT8": 2.5, "IT9": 1.2, "IT10": 1.1}
    found = tc.analyses.allocate(
        a, "top: ppm 10000", costs={"table.w.size": grades, "block.Z": 1.0}, samples=4096, solver="daqp"
    )
    size, height = found.range.sel(group=["table.w.size", "block.Z"], stage="after").values
    # The cheapest of four by hand: IT9 leaves the block 6 sigma of 0.1011, at the cost 1.2 + 0.05 / 0.1011.
    sigma = 0.05 / norm.isf(0.005)
    costs = {width: cost + 0.05 / np.sqrt((6 * sigma) ** 2 - width**2)
             for width, cost in zip((0.021, 0.033, 0.052, 0.084), grades.values(), strict=True)}  # fmt: skip
    assert min(costs, key=costs.get) == 0.052 and size == pytest.approx(0.052)
    assert (
        0.92 * 0.1043 < height < 0.1043
        and found.met.values.all()
        and found.attrs["choices"] == "table.w.size: IT9 (+0.026 -0.026 mm)"
    )
    tc.io.write_model(a, tmp_path / "graded.json")
    done = call(
        tmp_path, "allocate", "graded.json", "--require", "top: ppm 10000", "--samples", "4096", "--solver", "daqp",
        "--cost", "table.w.size=IT7:4,IT8:2.5,IT9:1.2,IT10:1.1", "--cost", "block.Z=1",
    )  # fmt: skip
    assert done.returncode == 0 and "Choices: table.w.size: IT9 (+0.026 -0.026 mm)." in done.stdout


@pytest.mark.parametrize(
    ("declared", "limits", "choice"),
    [("h9", (-0.04, 0.01), "h8 (0 -0.039 mm)"), ("k8", (-0.01, 0.04), "k8 (+0.039 0 mm)"),
     ("js9", (-0.02, 0.02), "js8 (+0.0195 -0.0195 mm)"), ((-0.062, 0), (-0.051, -0.011), "IT8 (-0.0115 -0.0505 mm)")],
)  # fmt: skip
def test_a_grade_of_a_class_has_the_limits_of_its_letters(declared, limits, choice):
    """Without a class, its zone is about the middle."""
    a = tc.Assembly("classes")
    bar = a.part("bar", tc.Box(100, 50, 20), fixed=True)
    bar.feature("w", bar.face("+y"), bar.face("-y"), tc.Size(50, declared))
    a.measure("c", tc.Chain({"bar.w.size": 1}), limits=limits)
    costs = {"bar.w.size": {"IT7": 5.0, "IT8": 1.5, "IT9": 1.0}}
    found = tc.analyses.allocate(a, "c: ppm 10000", costs=costs, samples=2048, solver="daqp")
    assert found.attrs["choices"] == f"bar.w.size: {choice}" and found.met.values.all()
    lower, upper = sorted(float(x) for x in choice.partition("(")[2].split()[:2])
    spread = (upper - lower) / 6
    share = norm.cdf(limits[0], (lower + upper) / 2, spread) + norm.sf(limits[1], (lower + upper) / 2, spread)
    _, low, high = found.kept.sel(stage="after").values[0]
    assert low - 1e-3 < share < high + 1e-3


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"IT7": 1.0}, 'cost of "p0.Z" has "IT7"; grades are for sizes'),
        ({"H7": 1.0}, 'cost of "p0.Z" has "H7"; expected a grade of ISO 286-1, IT01 to IT18'),
        ({-0.1: 1.0}, 'cost of "p0.Z" has the range -0.1; expected a full width above 0 in mm'),
        ({0.1: 0.0}, "expected costs above 0 by range"),
        ({}, "expected costs above 0 by range"),
        ({0.1: True}, "expected costs above 0 by range"),
        (True, 'cost of "p0.Z" is True; expected a number above 0, a function of the factor of its range, or a table'),
    ],
)
def test_tables_that_state_no_choices_are_refused(table, said):
    with pytest.raises(tc.OptionError, match=re.escape(said)):
        tc.analyses.allocate(pile(0.6), "top: ppm 20000", costs={"p0.Z": table}, samples=1024, solver="daqp")
