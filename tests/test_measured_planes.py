"""A plane from a few measured points, with the uncertainty of its offset and tilts."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests.helpers import compiled, realizations

CORNERS = np.array([(5, 5), (45, 5), (45, 20), (5, 20), (25, 12.5)], dtype=float)


def block(*tolerances):
    a = tc.Assembly("block")
    part = a.part("block", tc.Box(50, 25, 10), at=(100, -70, 3))
    part.feature("A", part.face("-z"), datum="A")
    top = part.feature("top", part.face("+z"), *(tolerances or (tc.Profile(0.3, "A"),)))
    part.pattern("ends", part.face("-x"), part.face("+x"), tc.Perpendicularity(0.3, "A"))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5), tolerance=0)
    for k, (x, y) in enumerate(CORNERS):
        a.measure(f"m{k}", top.point(x, y, 10), along="z")
    return a


def points(heights, xy=CORNERS):
    return np.column_stack([xy, 10 + np.asarray(heights, dtype=float)])


def test_a_model_moves_its_plane_as_the_points_say():
    """Points on planes that are shifted and tilted: the population measures their heights."""
    rng = np.random.default_rng(1)
    planes = rng.normal(scale=0.02, size=(4, 3))
    heights = planes[:, :1] + planes[:, 1:] @ ((CORNERS - CORNERS.mean(axis=0)) / 25).T
    model = block()
    measured = tc.io.measured_planes(model, "block.top", [points(h) for h in heights])
    assert list(measured.values) == ["block.top.offset", "block.top.tilt x", "block.top.tilt y"]
    assert np.abs(list(measured.uncertainties.values())).max() < 1e-12 and measured.freedoms.tolist() == [2] * 4
    model.population(measured.values)
    run = realizations(compiled(model), samples=60, seed=1).measured.sel(state="raw").values
    nearest = np.abs(run[:, None] - heights).max(axis=2)
    assert nearest.min(axis=1).max() < 1e-4  # a small turn is not quite a displacement
    assert set(nearest.argmin(axis=1)) == set(range(4))


def test_three_points_have_no_uncertainty_and_five_have_students():
    model, rng, sigma = block(), np.random.default_rng(2), 0.003
    parts = [points(sigma * rng.standard_normal(5)) for _ in range(400)]
    measured = tc.io.measured_planes(model, "block.top", parts)
    for label, values in measured.values.items():  # the true plane is the nominal one
        covered = np.abs(values) < stats.t(2).ppf(0.95) * measured.uncertainties[label]
        assert covered.mean() == pytest.approx(0.9, abs=0.05)
    three = tc.io.measured_planes(model, "block.top", [parts[0][:3]])
    assert np.isnan(list(three.uncertainties.values())).all() and three.freedoms == [0]


def test_only_what_a_tolerance_controls_is_a_deviation():
    tilted = [points(0.01 * (CORNERS[:, 0] - 25) / 25 + 0.004)]
    labels = tc.io.measured_planes(block(tc.Parallelism(0.1, "A")), "block.top", tilted).values
    assert not [label for label in labels if label.endswith("offset")] and len(labels) == 2
    assert max(np.abs(list(labels.values()))) == pytest.approx(0.01)


def test_points_that_show_no_plane_are_refused():
    line = np.column_stack([np.linspace(5, 45, 5), np.full(5, 12.0), np.full(5, 10.0)])
    faults = {
        'part 1 of "block.top" has 2 x 3 numbers; expected x, y, z of 3 points or more': points([0] * 5)[:2],
        "its points lie along a line": line,
        "point 2 is 9.99 mm away from the plane": points([0, -9.99, 0, 0, 0]),
    }
    for fault, measured in faults.items():
        with pytest.raises(tc.OptionError, match=fault):
            tc.io.measured_planes(block(), "block.top", [measured])
    with pytest.raises(tc.OptionError, match=r'"block.tops" is no feature; the nearest name is "block.top"'):
        tc.io.measured_planes(block(), "block.tops", [line])
    with pytest.raises(tc.OptionError, match=r'"block.ends" is a plane; expected one plane'):
        tc.io.measured_planes(block(), "block.ends", [line])
