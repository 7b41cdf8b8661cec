"""From zones to spreads: the table of known factors, other rules, and populations that are measured back."""

import warnings

import numpy as np
import pytest
from scipy.stats import binom, norm

import tolcontact as tc
from tests.cases import Frame, toleranced
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.features import Freedom
from tolcontact.variation import Draws

MOVED = Frame(turn=(0.4, -1.1, 2.0), shift=(1000, -700, 300))
SAMPLES = 20_000
FACTORS = {  # t / s for 99.73 % inside; derived in the guide's chapter on zones, or counted in 4e6 draws
    "size": (lambda: toleranced.ring_with("bore", tc.Size(10, 0.5)), 6.000),
    "orientation, one tilt": (lambda: toleranced.block_with("far", tc.Perpendicularity(1, "A")), 6.000),
    "orientation": (lambda: toleranced.block_with("top", tc.Parallelism(1, "A")), 9.07),
    "location, rectangle": (lambda: toleranced.block_with("top", tc.Profile(1, "A")), 11.77),
    "location of lines": (lambda: toleranced.block_with("top", tc.LineProfile(1, "A")), 11.77),
    "location, disk": (lambda: toleranced.ring_with("top", tc.Profile(1, "A")), 10.02),
    "axis, tilt": (lambda: toleranced.ring_with("bore", tc.Perpendicularity(1, "A")), 6.88),
    "axis, tilt of a projected zone": (
        lambda: toleranced.ring_with("bore", tc.Perpendicularity(1, "A", projected=45)), 6.88 * 45 / 30  # the bore is 30 long
    ),
    "axis, shift": (lambda: toleranced.ring_with("bore", tc.Position(1, "A|B", rule="translation")), 6.88),
    "axis": (lambda: toleranced.ring_with("bore", tc.Position(1, "A|B")), 7.270 * np.sqrt(2)),  # ends, of shift and tilt
    "axis between planes": (
        lambda: toleranced.ring_with("bore", tc.Position(1, "A|B", zone="flat", along="y")), 6.42 * np.sqrt(2)
    ),
    "centre": (lambda: toleranced.ball_with(tc.Position(1, "A|B|C")), 7.53),
    "at the extremes, rectangle": (
        lambda: toleranced.block_with("top", tc.Profile(1, "A", rule="6 sigma at the extremes")), 10.39
    ),
    "at the extremes, axis": (
        lambda: toleranced.ring_with("bore", tc.Position(1, "A|B", rule="6 sigma at the extremes")), 6 * np.sqrt(2)
    ),
    "capable": (lambda: toleranced.block_with("top", tc.Parallelism(1, "A", cp=1.5)), 9.07 * 1.5),
}  # fmt: skip


@pytest.mark.parametrize("name", FACTORS)
def test_spreads_are_those_of_the_table(name):
    model, factor = FACTORS[name]
    contributors = Draws(discretize(model())).contributors
    spreads = [each.spread for each in contributors if each.geometric is not None] or [contributors[-1].tolerance.width / 6]
    assert spreads == pytest.approx([1 / factor] * len(spreads), rel=2e-3)


@pytest.mark.parametrize("name", toleranced.EVERY)
def test_a_population_is_inside_its_zones_as_stated_in_any_frame(name):
    found = measured_back(toleranced.EVERY[name](toleranced.STILL), SAMPLES, seed=3)
    assert len(found.tolerances)
    for zone, tolerance in enumerate(found.tolerances):
        stated, inside = found.stated_share[zone], found.share[zone] * SAMPLES
        low, high = binom.interval(0.9999, SAMPLES, stated if np.isfinite(stated) else 0.9973)
        assert low <= inside and (inside <= high or not np.isfinite(stated)), tolerance
    still, moved = (measured_back(toleranced.EVERY[name](frame), 2000, seed=3) for frame in (toleranced.STILL, MOVED))
    assert (moved.share == still.share).all()
    assert moved.needed_width == pytest.approx(still.needed_width, rel=1e-9)


def test_the_bonus_fills_the_zone_of_each_part():
    """Hole 10 +0.1/0, position 0.2 M: the spread grows by 25 %, with the part's own size."""
    size, zone = tc.Size(10, 0.1, 0), {"rule": "translation"}
    plain, filled = (
        Draws(discretize(toleranced.ring_with("bore", size, tc.Position(0.2, "A|B", material=material, **zone))))
        for material in ("", "M")
    )
    x, *_ = plain(seed=1, start=0, stop=SAMPLES).T
    wide, _, sizes = filled(seed=1, start=0, stop=SAMPLES).T
    assert wide.std() / x.std() == pytest.approx(1.25, rel=0.01)
    assert wide / (1 + np.maximum(sizes, 0) / 0.2) == pytest.approx(x, abs=1e-15)
    model = toleranced.ring_with("bore", size, tc.Position(0.2, "A|B", material="M", **zone))
    assert measured_back(model, SAMPLES).share[1] == pytest.approx(0.9973, abs=0.0015)


def test_capability_and_shifts():
    size = tc.Size(10, 0.1, -0.02, cp=1.33, cpk=1.0)
    drawn = Draws(discretize(toleranced.ring_with("bore", size)))(seed=1, start=0, stop=SAMPLES)[:, -1]
    sigma = 0.12 / 6 / 1.33
    assert drawn.std() == pytest.approx(sigma, rel=0.02)
    assert (0.1 - drawn.mean()) / 3 / sigma == pytest.approx(1.0, abs=0.02)  # Cpk itself
    shifted = tc.Tolerance(0.6, "uniform", shift=0.25)
    assert str(shifted) == "uniform, full width 0.6 mm, shifted by 0.25 mm"
    other = tc.Size(10, 0.1, -0.02, distribution=norm(0.03, 0.01))
    drawn = Draws(discretize(toleranced.ring_with("bore", other)))(seed=1, start=0, stop=SAMPLES)[:, -1]
    assert drawn.mean() == pytest.approx(0.03, abs=3e-4) and drawn.std() == pytest.approx(0.01, rel=0.02)


def test_a_capability_off_centre_shifts_the_place_of_a_face_and_not_its_tilts():
    block = toleranced.block_with("top", tc.Profile(0.3, "A", cp=1.5, cpk=1.2))
    place, *tilts = [each for each in Draws(discretize(block)).contributors if each.geometric is not None]
    assert place.mean_shift == pytest.approx(3 * place.spread * 1.5 * (1 - 1.2 / 1.5), rel=1e-12) and len(tilts) == 2
    assert [tilt.mean_shift for tilt in tilts] == [0, 0]


def test_one_rule_for_a_tail_is_enough_that_no_share_is_stated():
    """Tolerances of one feature share its freedoms: spreads are then those of the stricter one, whatever its rule is."""

    def shares(**rule):
        a = tc.Assembly("plate")
        block = a.part("block", tc.Box(40, 30, 20), fixed=True)
        block.feature("base", block.face("-z"), datum="A")
        top = block.feature("top", block.face("+z"), tc.Profile(0.4, "A"), tc.Parallelism(0.1, "A", **rule))
        a.measure("height", top.point(0, 0, 20), along="z")
        return measured_back(a, 200).stated_share

    assert shares() == pytest.approx([0.9973, 0.9973], abs=1e-4)
    assert np.isnan(shares(cp=1.5)).all()


def test_a_tangent_plane_and_form_per_length_are_stated_and_draw_as_the_plane_does():
    rigid = toleranced.block_with("top", tc.Profile(0.3, "A"), tc.Parallelism(0.1, "A"))
    flatness = tc.Flatness(0.02, per=(25, 25), form=None), tc.Straightness(0.01, per=10, form=None)
    tangent = toleranced.block_with("top", tc.Profile(0.3, "A"), tc.Parallelism(0.1, "A", tangent=True), *flatness)
    spreads = [[each.spread for each in Draws(discretize(model)).contributors] for model in (rigid, tangent)]
    assert spreads[0] == spreads[1] and len(spreads[0]) == 3
    top = next(feature for feature in tangent.features if feature.name == "top")
    assert list(map(str, top.tolerances))[1:] == [
        "parallelism 0.1 Ⓣ A", "flatness 0.02/25×25", "straightness 0.01/10",
    ]  # fmt: skip


def two_blocks(**options):
    """Two equal blocks side by side, each with a foot off its centre; the measure is the difference of their heights."""
    a = tc.Assembly("two")
    blocks = [a.part(name, tc.Box(50, 25, 10), at=(x, 0, 0)) for name, x in (("left", 0), ("right", 60))]
    places = {"Z1": (20, 12, 0), "Z2": (30, 12, 0), "Z3": (25, 22, 0), "Y1": (0, 0, 5), "Y2": (50, 0, 5), "X": (0, 12, 5)}
    for block, side in zip(blocks, (options, {}), strict=True):
        foot = tc.Tolerance(0.2, cp=1.33, cpk=1.0, **side)
        zones = {name: foot if name == "Z3" else 0 for name in places}
        a.locate(block, [tc.Locator(name, point, name[0].lower(), zones[name]) for name, point in places.items()])
    left, right = (block.point(25, 22, 0) for block in blocks)
    a.measure("step", right, to=left, along="z", absolute=False)
    return a


def test_a_mean_shift_has_a_side():
    up, down = (tc.Tolerance(0.2, cp=1.33, cpk=1.0, side=side) for side in ("up", "down"))
    shift = 0.1 * (1 - 1 / 1.33)
    assert (up.mean_shift, down.mean_shift) == (shift, -shift) == (tc.Tolerance(0.2, cp=1.33, cpk=1.0).mean_shift, -shift)
    assert str(down) == "normal, full width 0.2 mm, cp 1.33, cpk 1 (mean down by 0.02481 mm)"
    assert tc.Size(10, 0.1, side="down", cp=1.33, cpk=1.0).tolerance.mean_shift == pytest.approx(-shift)
    for side, sign in (("up", 1), ("down", -1)):
        block = toleranced.block_with("top", tc.Profile(0.3, "A", cp=1.5, cpk=1.2, side=side))
        means = [freedom.mean for freedom in Draws(discretize(block)).contributors if freedom.mean]
        assert len(means) == 1 and means[0] * sign > 0
    assert "side is 'left'; expected up, down or either" in list(tc.Tolerance(0.2, cp=1, cpk=0.9, side="left").faults())
    assert any("side is given without cpk" in fault for fault in tc.Tolerance(0.2, side="up").faults())


EITHER = tc.Tolerance(0.2, cp=1.33, cpk=1.0, side="either")
EITHER_SIDE = Freedom("part", "variable", EITHER)


def test_a_mean_on_either_side_is_a_mixture_of_two_normal_distributions():
    sd, shift, z = 0.2 / 6 / 1.33, 0.1 * (1 - 1 / 1.33), np.linspace(-0.25, 0.25, 201)
    shares = (norm.cdf(z, shift, sd) + norm.cdf(z, -shift, sd)) / 2
    inside = (shares > 1e-12) & (shares < 1 - 1e-6)  # above, shares round to 1
    assert inside.sum() > 100
    assert np.abs(EITHER_SIDE.deviations(shares[inside]) - z[inside]).max() < 1e-10
    u = np.array([2.0**-40, 0.25, 0.375])
    assert np.array_equal(EITHER_SIDE.deviations(u), -EITHER_SIDE.deviations(1 - u))
    centred, plain = tc.Tolerance(0.2, cp=1.33, cpk=1.33, side="either"), tc.Tolerance(0.2, cp=1.33)
    assert np.array_equal(*(Freedom("part", "variable", tolerance).deviations(u) for tolerance in (centred, plain)))


def test_lots_on_either_side_widen_a_measure_and_stack_up_arithmetically():
    a = tc.Stack("play")
    a.link("left", 10, EITHER)
    a.link("right", 10, EITHER, sensitivity=-2)
    a.gap("step", tolerance=0.5)
    variance, shift = 5 * (0.2 / 6 / 1.33) ** 2, 0.1 * (1 - 1 / 1.33)
    figures = tc.analyses.stack_up(a, samples=3000)
    assert figures.lots.values == pytest.approx([3 * shift])
    assert figures.half_width.sel(approach="worst case").values == pytest.approx([0.3])
    measured = Draws(discretize(a))(seed=2, start=0, stop=40_000) @ [1, -2]
    assert abs(measured.mean()) < 5 * measured.std() / 200
    assert measured.var() == pytest.approx(variance + 5 * shift**2, rel=0.03)  # its own error is 0.4 %


def test_the_side_of_a_feature_may_be_unknown():
    known, either = (
        Draws(discretize(toleranced.block_with("top", tc.Profile(0.3, "A", cp=1.5, cpk=1.2, side=side)))).contributors
        for side in ("up", "either")
    )
    moved = [(one, other) for one, other in zip(known, either, strict=True) if one.mean]
    assert [other.lot for _, other in moved] == [pytest.approx(0.9)]  # 3 (1.5 - 1.2)
    for one, other in moved:
        assert other.lot_distance == pytest.approx(one.mean) and other.mean == 0
        assert other.variance == pytest.approx(one.spread**2 + one.mean**2)
    words = Draws(discretize(toleranced.block_with("top", tc.Profile(0.3, "A", cp=1.5, cpk=1.2, side="either")))).in_words
    assert words == ["means off centre by cpk: block.top.offset up or down"]


def test_sides_that_are_assumed_are_told_where_shifts_cancel():
    with pytest.warns(
        tc.NominalWarning,
        match=r'\[side\] measurement "step" .* of 2 contributors .* moves it by 0 mm; if their .* up to ±0.0496;',
    ):
        tc.build(two_blocks())
    with warnings.catch_warnings():
        warnings.simplefilter("error", tc.NominalWarning)
        tc.build(two_blocks(side="down"))
