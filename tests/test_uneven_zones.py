"""Zones that a profile disposes unevenly: by every rule features are drawn about the middle of their zone, and inside it."""

import netCDF4
import numpy as np
import pytest
from scipy.stats import binom

import tolcontact as tc
from tests.cases import toleranced
from tests.helpers import compiled
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.variation import Draws

SAMPLES = 4000
LOWER, UPPER = -0.05, 0.25  # of a zone of 0.3, 0.25 of which is outside
RULES = ("99.73 % inside", "6 sigma at the extremes", "translation")


def corner_heights(model, samples=SAMPLES):
    """Heights (n, corner) of the top of a block of 100 x 50, from its offset and the tilts of its edges."""
    drawn = dict(zip(Draws(discretize(model)).labels, Draws(discretize(model))(seed=4, start=0, stop=samples).T, strict=True))
    offset, *tilts = [values for label, values in drawn.items() if "block.top" in label]
    signs = [(x, y)[: len(tilts)] for x in (-1, 1) for y in (-1, 1)]
    return np.stack([offset + sum(s * t for s, t in zip(sign, tilts, strict=True)) for sign in signs], axis=1)


@pytest.mark.parametrize("kind", [tc.Profile, tc.LineProfile])
@pytest.mark.parametrize("rule", RULES)
def test_features_are_drawn_inside_an_uneven_zone_by_every_rule(rule, kind):
    model = toleranced.block_with("top", kind(0.3, "A", outside=UPPER, rule=rule))
    heights = corner_heights(model)
    deviation = heights.mean(axis=1).std() / np.sqrt(SAMPLES)
    assert heights.mean() == pytest.approx(0.1, abs=5 * deviation)
    inside = ((heights >= LOWER - 1e-12) & (heights <= UPPER + 1e-12)).all(axis=1).sum()
    if rule == "99.73 % inside":
        low, high = binom.interval(0.9999, SAMPLES, 0.9973)
        assert low <= inside <= high
    measured = measured_back(model, SAMPLES, seed=4)
    assert measured.share[0] * SAMPLES == pytest.approx(inside, abs=0.5)


def test_each_member_of_a_pattern_is_drawn_in_its_uneven_zone():
    """Their datum lets the members deviate each alone, so that the shares of features and of members are equal."""
    population = measured_back(toleranced.rails_with(tc.Profile(0.3, "A", outside=UPPER)), SAMPLES)
    low, high = binom.interval(0.9999, SAMPLES, 0.9973)
    assert low <= population.share[0] * SAMPLES <= high


def test_the_middle_of_a_zone_has_no_effect_if_datums_leave_its_place_free():
    """Datum A leaves the end of the block free to shift: the zone then follows it."""
    shares = [
        measured_back(toleranced.block_with("far", tc.Profile(0.3, "A", outside=outside)), SAMPLES).share
        for outside in (None, 0.3)
    ]
    assert (shares[0] == shares[1]).all() and shares[0][0] > 0.99


def test_widened_zones_keep_their_middle():
    draws = Draws(discretize(toleranced.block_with("top", tc.Profile(0.3, "A", outside=UPPER))))
    usual, wide = (d(seed=1, start=0, stop=50) for d in (draws, draws.scaled(np.full(len(draws.labels), 3.0))))
    middle = np.array([0.1 if "offset" in label else 0.0 for label in draws.labels])
    assert wide - middle == pytest.approx(3 * (usual - middle), abs=1e-12)


def test_the_worst_case_is_an_end_of_an_uneven_zone():
    worst = tc.analyses.worst_case(toleranced.block_with("top", tc.Profile(0.3, "A", outside=UPPER)))
    assert worst.worst.sel(state="raw").values == pytest.approx(np.tile([LOWER, UPPER], (3, 1)), abs=1e-6)


def test_a_worst_case_lies_in_an_uneven_zone_and_in_the_narrower_one_within_it():
    """Datum A locates the top within -0.05 to 0.05, and all datums locate both faces within 0 to 0.3."""
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(100, 50, 30), fixed=True)
    for letter, face in {"A": "-z", "B": "-y", "C": "-x"}.items():
        block.feature(letter, block.face(face), datum=letter)
    profiles = tc.Profile(0.3, "A|B|C", outside=0.3), tc.Profile(0.1, "A")
    top, end = block.pattern("faces", block.face("+z"), block.face("+x"), *profiles).members
    a.measure("top", top.point(50, 25, 30), along="z")
    a.measure("end", end.point(100, 25, 15), along="x")
    worst = tc.analyses.worst_case(a, samples=64).worst.sel(state="raw").values
    assert worst == pytest.approx(np.array([[0.0, 0.05], [0.0, 0.3]]), abs=1e-6)


def test_an_archive_says_how_much_of_a_zone_is_outside(tmp_path):
    """So a run that was begun when such zones were drawn about the nominal surface is not resumed."""
    model, path = toleranced.block_with("top", tc.Profile(0.3, "A", outside=UPPER)), tmp_path / "block.nc"
    tc.run(compiled(model), samples=20, seed=1, surfaces=0, out=path).close()
    with netCDF4.Dataset(path, "r+") as file:
        texts = file["sample"]["distribution"]
        assert "profile 0.3 mm, 0.25 mm of it outside, to A; 99.73 % inside" in list(texts[:])
        for number, text in enumerate(texts[:]):
            texts[number] = text.replace(", 0.25 mm of it outside,", "")
    with pytest.raises(
        tc.TolcontactError, match=r'was drawn as "profile 0.3 mm to A; 99.73 % inside", now as "profile 0.3 mm, 0'
    ):
        tc.run(model, samples=30, seed=1, surfaces=0, out=path, resume=True)
