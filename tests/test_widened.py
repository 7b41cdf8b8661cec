"""What if suppliers were worse: a copy of a model with wider tolerances."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests.cases import toleranced
from tolcontact.discretization import discretize
from tolcontact.variation import Draws


def model():
    a = tc.Assembly("two")
    for name, x in (("left", 0), ("right", 60)):
        block = a.part(name, tc.Box(50, 25, 10), at=(x, 0, 0))
        block.feature("A", block.face("-z"), datum="A")
        block.feature("top", block.face("+z"), tc.Profile(0.3, "A", cp=1.5, cpk=1.2, side="down"))
        block.feature("width", block.face("-x"), block.face("+x"), tc.Size(50, 0.1, -0.3))
        a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=(0, 0.2))
    a.variable("heat", tc.Tolerance(distribution=stats.gamma(4, 2, scale=3)), drives={"left.A1": 0.01}, units="K")
    a.measure("step", block.point(0, 12, 10), along="z", tolerance=1)
    return a


def deviations(assembly):
    draws = Draws(discretize(assembly))
    return draws.labels, draws(seed=1, start=0, stop=500)


@pytest.mark.parametrize("names", [(), ("right",), ("right.top", "heat"), ("left.width",)])
def test_deviations_of_chosen_tolerances_are_wider_about_their_centres_and_the_others_are_the_same(names):
    before, (labels, x) = model(), deviations(model())
    after, (_, wide) = before.widened(1.25, *names), deviations(before.widened(1.25, *names))
    assert np.array_equal(deviations(before)[1], x)  # the model itself is as it was
    chosen = np.array([not names or label.startswith(names) for label in labels])
    centres = np.select(
        [[label.endswith("width.size") for label in labels], [label.startswith("heat") for label in labels],
         [label.partition(".")[2] in ("A1", "A2", "A3", "B1", "B2", "C1") for label in labels]],
        [-0.1, stats.gamma(4, 2, scale=3).median(), 0.1], 0.0,
    )  # fmt: skip
    driven = np.array([label == "left.A1" for label in labels])
    own, own_wide = x.copy(), wide.copy()
    for values in (own, own_wide):
        values[:, driven] -= 0.01 * values[:, [labels.index("heat")]]
    expected = np.where(chosen, centres + 1.25 * (own - centres), own)
    assert np.allclose(own_wide, expected, rtol=0, atol=1e-12)
    assert chosen.any() and str(after) != str(before)


@pytest.mark.parametrize("outside", [0.0, 0.25, 0.4])
def test_unequally_disposed_zones_widen_about_their_centres(outside):
    model = toleranced.block_with("top", tc.Profile(0.4, "A", outside=outside))
    (labels, before), (_, after) = deviations(model), deviations(model.widened(1.5))
    chosen = np.array([label.startswith("block.top") for label in labels])
    centres = np.array([outside - 0.2 if label == "block.top.offset" else 0.0 for label in labels])
    assert centres.any() and np.allclose((after - centres)[:, chosen], 1.5 * (before - centres)[:, chosen], rtol=0, atol=1e-12)


def test_a_narrowed_zone_that_does_not_contain_the_nominal_surface_is_refused():
    one_sided = toleranced.block_with("top", tc.Profile(0.4, "A", outside=0.4))
    with pytest.raises(ValueError, match=r'"block.top" has profile 0.4 Ⓤ0.4 A; 0.8 times as wide about its centre, this zone'):
        one_sided.widened(0.8)
    uneven = toleranced.block_with("top", tc.Profile(0.4, "A", outside=0.3)).widened(0.8)
    assert deviations(uneven)[1].any()


def test_patterns_widen_with_their_members():
    a = tc.Assembly("pattern")
    block = a.part("block", tc.Box(50, 25, 10))
    block.feature("A", block.face("-z"), datum="A")
    ends = block.pattern("ends", block.face("-x"), block.face("+x"), tc.Perpendicularity(0.3, "A"))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0)
    a.measure("height", ends.members[1].point(50, 12, 10), along="z", tolerance=1)  # a member is used elsewhere, too
    before, after = deviations(a)[1], deviations(a.widened(2, "block.ends"))[1]
    assert np.abs(before).max() > 0 and np.allclose(after, 2 * before, atol=1e-15)


def test_worst_cases_and_stacks_widen_too():
    stack = tc.Stack("stack")
    stack.link("a", 10, "+0.1/-0.3")
    stack.link("b", 5, 0.2, sensitivity=-1)
    stack.gap("gap", tolerance=1)
    halves = [
        tc.analyses.stack_up(s, samples=3000).half_width.sel(approach="worst case").item()
        for s in (stack, stack.widened(2), stack.widened(2, "b"))
    ]
    assert halves == pytest.approx([0.3, 0.6, 0.4])


def test_names_that_nothing_has_are_refused():
    with pytest.raises(ValueError, match=r'"rigth" is no part, .*; the nearest name is "right"; .*left, '):
        model().widened(1.2, "rigth")
    for factor in (0, -1, "1.2"):
        with pytest.raises(ValueError, match="expected a number above 0"):
            toleranced.block_with("top", tc.Profile(0.3, "A")).widened(factor)
