"""Round faces that are not round: fits in closed form and against a linear programme, zones by another method, archives."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases import toleranced
from tests.cases.fits import CLEARANCE, LENGTH, PULL, RADIUS, shaft_in_a_bore, shaft_on_a_table
from tests.helpers import SEATED, compiled, simulate
from tests.population_referee import measured_back
from tests.test_form import coefficients
from tolcontact.discretization import discretize
from tolcontact.testing import assert_gaps_recompute, assert_resolved
from tolcontact.variation import Draws
from tolcontact.vocabulary import CORRECTED, Status

TWO_LOBES = tc.Form(lobes=2, length=1e5)


def form_of(program, feature):
    return next(nominal.form for nominal in program.nominal.features if nominal.feature.name == feature)


def heights_on(program, run, feature, radius, along, azimuths):
    """Heights (realization, along * azimuth) of the form of a face around the z axis, on a grid."""
    z, angle = (grid.ravel() for grid in np.meshgrid(along, azimuths, indexing="ij"))
    places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return coefficients(program, run, feature) @ form_of(program, feature).heights(places).T


@pytest.mark.nightly
def test_a_two_lobed_shaft_in_a_two_lobed_bore_by_closed_form():
    """In a direction the shaft goes as far as the clearance there less both forms, since all such limits are touched."""
    model = shaft_in_a_bore(tc.Cylindricity(0.02, form=TWO_LOBES), tc.Cylindricity(0.02, form=TWO_LOBES), clearance=0.1)
    program, run = simulate(model, samples=40, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    turn = float(np.arctan2(*PULL[::-1]))
    shaft = heights_on(program, run, "shaft", RADIUS, [-13.0, 7.0], np.arange(12) * np.pi / 6)
    waves = np.column_stack([np.cos(np.arange(12) * np.pi / 3), np.sin(np.arange(12) * np.pi / 3)])
    amplitudes = np.linalg.lstsq(waves, shaft[:, :12].T, rcond=None)[0]
    np.testing.assert_allclose(shaft, np.tile((waves @ amplitudes).T, 2), atol=1e-7)
    assert 0.001 < np.linalg.norm(amplitudes, axis=0).max() < 0.033  # a third of the clearance, up to which the limit is convex
    other = heights_on(program, run, "bore", RADIUS + 0.1, [0.0], [turn])
    own = heights_on(program, run, "shaft", RADIUS, [0.0], [turn])
    far = run["measured"][:, CORRECTED, :2] @ PULL / np.linalg.norm(PULL)
    np.testing.assert_allclose(far, 0.1 - (own + other)[:, 0], atol=2e-4)
    assert np.ptp(far) > 0.01


@pytest.mark.nightly
def test_a_lobed_shaft_lies_on_its_highest_line(tmp_path):
    """Beside its lowest line the shaft rises as its radius does, and with the cosine of the angle from there."""
    model = shaft_on_a_table(tc.Form(lobes=3, length=1e5))
    program, run = simulate(model, samples=20, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    angles = np.linspace(-0.1, 0.1, 401)
    places = np.column_stack([RADIUS * np.sin(angles), 0 * angles, -RADIUS * np.cos(angles)])
    radii = RADIUS + coefficients(program, run, "barrel") @ form_of(program, "barrel").heights(places).T
    expected = (radii * np.cos(angles)).max(axis=1) - RADIUS
    np.testing.assert_allclose(run["measured"][:, CORRECTED], expected[:, None] * [1, 1], atol=3e-4)
    assert np.ptp(expected) > 0.01
    path = tmp_path / "roller.nc"
    tc.run(compiled(model, solver="daqp", method=SEATED), samples=5, surfaces=1, out=path).close()
    assert_gaps_recompute(path)


@pytest.mark.nightly
def test_gaps_of_sections_and_lines_with_form_follow_from_the_archive_alone(tmp_path):
    path = tmp_path / "fit.nc"
    rough, lobed = tc.Form("matern 5/2", length=12, modes=6), tc.Form("matern 3/2", lobes=3, modes=4)
    model = shaft_in_a_bore(tc.Roundness(0.02, form=rough), tc.Straightness(0.02, form=lobed))
    tc.run(compiled(model, solver="daqp", method=SEATED), samples=5, surfaces=1, out=path).close()
    assert_resolved(path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as archive:
        form = archive["contact"].to_dataset()
        assert sorted(form["form_associated"].values) == ["circles", "lines"]
        assert sorted(form["form_lobes"].values) == [0, 3]


def radial_terms(azimuths, along):
    """Radii for a size, two shifts and two tilts of a cylinder."""
    n = np.column_stack([np.cos(azimuths), np.sin(azimuths)])
    return np.column_stack([np.ones(len(n)), n, n * along[:, None] / LENGTH])


def test_a_roundness_displaces_no_section_and_a_straightness_no_line():
    program = compiled(shaft_in_a_bore(tc.Roundness(0.02), tc.Straightness(0.02)))
    azimuths = np.arange(60) * 2 * np.pi / 60
    for feature, radius in (("shaft", RADIUS), ("bore", RADIUS + CLEARANCE)):
        z, angle = (grid.ravel() for grid in np.meshgrid(np.linspace(-20, 20, 41), azimuths, indexing="ij"))
        places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
        heights = form_of(program, feature).heights(places).reshape(41, 60, -1)
        size = np.abs(heights).max()
        if feature == "shaft":
            moments = np.einsum("zam,at->ztm", heights, radial_terms(azimuths, 0 * azimuths)[:, :3]) / 60
        else:
            weights = np.concatenate([[1], np.tile([4, 2], 20)[:-1], [1]]) / 3 / 40  # Simpson's rule
            moments = np.einsum("zam,zt->atm", heights, weights[:, None] * np.vander(np.linspace(-1, 1, 41), 2))
        assert np.abs(moments).max() < 1e-5 * size


def test_form_and_place_of_a_bore_share_the_zone_around_them():
    spreads = []
    for inner in ((), (tc.Cylindricity(0.05),)):
        model = toleranced.ring_with("bore", tc.TotalRunout(0.1, "B"), *inner)
        spreads.append({c.label: c.spread for c in Draws(discretize(model)).contributors}["ring.bore.tilt x"])
    assert 0.7 < spreads[1] / spreads[0] < 0.95
    with pytest.raises(tc.ModelError, match=r"cylindricity 0\.2 is wider than total run-out 0\.1, which contains it"):
        tc.build(toleranced.ring_with("bore", tc.TotalRunout(0.1, "B"), tc.Cylindricity(0.2)))


@pytest.mark.nightly
@pytest.mark.parametrize(
    "tolerances",
    [
        (tc.TotalRunout(0.1, "B"), tc.Cylindricity(0.05)),
        (tc.Profile(0.1, "A|B"), tc.Roundness(0.05)),
        (tc.Position(0.1, "A|B"), tc.Straightness(0.05)),
    ],
)
def test_populations_of_bores_are_measured_with_their_form(tolerances):
    population = measured_back(toleranced.ring_with("bore", *tolerances), 4000)
    assert (population.lower <= 0.9973).all() and (population.upper >= 0.9973).all()
    assert population.needed_width == pytest.approx([0.05, 0.1], rel=0.05)


def test_a_surface_and_a_locator_against_it_stand_out_by_the_form_of_a_shaft():
    a = tc.Assembly("shaft")
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(RADIUS, LENGTH, sections=48)))
    barrel = pin.feature("shaft", pin.face(tc.select.Cylinder(inner=False)), tc.Cylindricity(0.05))
    ends = [
        tc.Locator(f"{axis}{k}", (RADIUS * (axis == "x"), RADIUS * (axis == "y"), z), f"-{axis}", 0, on=barrel)
        for axis in "xy"
        for k, z in enumerate((-15, 15))
    ]
    a.locate(pin, [*ends, tc.Locator("Z", (0, 0, -20), "z", 0), tc.Locator("T", (RADIUS, 0, 0), "y", 0)])
    for z in (-15, 15):
        a.measure(f"held {z}", barrel.point(RADIUS, 0, z), along="x")
        a.measure(f"axis {z}", pin.point(0, 0, z), along="x")
    program, run = simulate(a, samples=20)
    height = heights_on(program, run, "shaft", RADIUS, [-15.0, 15.0], [0.0])
    held, axis = run["measured"][:, CORRECTED, ::2], run["measured"][:, CORRECTED, 1::2]
    np.testing.assert_allclose(held, 0, atol=1e-5)
    np.testing.assert_allclose(axis, -height, atol=1e-5)
    assert np.abs(height).max() > 0.005
