"""Measured forms with known waves: what stands on them, their zones, and what scans show too little of."""

import re
import warnings

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.helpers import SEATED, nightly, realizations
from tolcontact.discretization import discretize

LENGTH, WIDTH, AMPLITUDE = 100.0, 10.0, 0.03


def write_scans(folder, heights, x, y, noise=0.0):
    """Write the points of three parts whose undersides have heights (point,) over the nominal plane, and scatter."""
    rng = np.random.default_rng(5)
    for number, scale in enumerate((0.99, 1.0, 1.01)):
        z = -scale * heights - rng.normal(0, noise, len(x))
        np.savetxt(folder / f"{number}.csv", np.column_stack([x, y, z]), delimiter=",")
    return tc.Form(measured=str(folder / "*.csv"))


def grid(step_x, step_y):
    places = np.meshgrid(np.arange(0, LENGTH + 1e-9, step_x), np.arange(0, WIDTH + 1e-9, step_y))
    return [values.ravel() for values in places]


def waves_of(count, x):
    return AMPLITUDE * np.cos(2 * np.pi * count * x / LENGTH)


def plate(form, trough=50.0, flatness=0.0615, spacing=None):
    """A plate that is pressed onto a table by a force through its middle; its trough is measured above the table."""
    a = tc.Assembly("plate")
    table = a.part("table", tc.Box(LENGTH + 20, WIDTH + 20, 10), at=(-10, -10, -10), fixed=True)
    block = a.part("block", tc.Box(LENGTH, WIDTH, 10))
    under = block.feature("under", block.face("-z"), tc.Flatness(flatness, form=form))
    guides = [
        tc.Locator("X", (0, WIDTH / 2, 0), "x", 0),
        tc.Locator("Y1", (0, 0, 0), "y", 0),
        tc.Locator("Y2", (LENGTH, 0, 0), "y", 0),
    ]
    a.locate(block, guides, floating=True)
    a.contact("seat", moving=under, reference=table.face("+z"), spacing=spacing)
    a.force("weight", at=block.point(LENGTH / 2 + 1.3, WIDTH / 2 - 0.7, 5), vector=(0, 0, -100))
    a.measure("lift", block.point(LENGTH / 2, WIDTH / 2, 10), along="z")
    a.measure("gap", under.point(trough, WIDTH / 2, 0), along="z")
    return a


def program_and_warnings(model, **options):
    """The program of a model, and what the check of its nominal assembly says of measured forms."""
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        program = tc.build(model, **options)
    return program, [str(record.message) for record in records if "[form]" in str(record.message)]


def form_warnings(model):
    program, sentences = program_and_warnings(model)
    return program.nominal.features[0].form, sentences


@pytest.mark.parametrize("count", [4, *nightly(2, 6, 8, 10)])
def test_a_plate_stands_on_the_crests_of_measured_waves(count, tmp_path):
    """Crests a high lift it by a, and leave a gap of 2 a at troughs; the zone is as wide."""
    x, y = grid(1, 2)
    model = plate(write_scans(tmp_path, waves_of(count, x), x, y), trough=LENGTH / 2 / count)
    program, sentences = program_and_warnings(model, solver="daqp", method=SEATED)
    form = program.nominal.features[0].form
    assert not sentences and form.left_out < 1e-5
    assert list(form.scans.values()) == pytest.approx([0.0594, 0.06, 0.0606], rel=5e-3)
    assert min(form.scales) == pytest.approx(LENGTH / (2 * np.pi * count), rel=0.1)
    run = realizations(program, samples=10, seed=1)
    lift, gap = run["measured"].sel(state="corrected").mean("realization").values
    assert lift == pytest.approx(AMPLITUDE, rel=0.02) and gap == pytest.approx(2 * AMPLITUDE, rel=0.02)


def test_contact_points_must_resolve_measured_waves(tmp_path):
    x, y = grid(1, 2)
    with pytest.raises(tc.ModelError, match=r"correlation length of (1\.9|2\.0)\d* mm; expected at most half"):
        discretize(plate(write_scans(tmp_path, waves_of(8, x), x, y), spacing=1.5))


@pytest.mark.parametrize("count", [25, 40])
def test_waves_too_short_for_the_stations_or_the_points_are_refused(count, tmp_path):
    x, y = grid(1, 5)
    with pytest.raises(tc.ModelError) as error:
        discretize(plate(write_scans(tmp_path, waves_of(count, x), x, y)))
    assert 'feature "under"' in str(error.value) and '0.csv": its form changes over too short lengths' in str(error.value)
    assert re.search(
        r"leaves out 0\.0[12]\d* mm of its 0\.0[12]\d* mm", str(error.value)
    ) and "filter short waves out of the points" in str(error.value)


def bowl(x, y):
    return AMPLITUDE * ((x / 50 - 1) ** 2 - 0.5 * (2 * y / WIDTH - 1) * (x / 50 - 1))


def test_scatter_widens_no_zone(tmp_path):
    x, y = np.random.default_rng(3).uniform(0, 1, (2, 1000)) * [[LENGTH], [WIDTH]]
    exact = list(form_warnings(plate(write_scans(tmp_path, bowl(x, y), x, y)))[0].scans.values())
    form, sentences = form_warnings(plate(write_scans(tmp_path, bowl(x, y), x, y, noise=0.002)))
    assert list(form.scans.values()) == pytest.approx(exact, abs=0.0015) and not sentences


def test_few_points_show_a_smooth_form(tmp_path):
    x, y = grid(100 / 7, WIDTH / 3)
    assert len(x) == 32
    form, sentences = form_warnings(plate(write_scans(tmp_path, bowl(x, y), x, y)))
    u, v = grid(2.5, 2.5)
    terms = np.vstack([u**0, u, v]).T
    expected = bowl(u, v) - terms @ np.linalg.lstsq(terms, bowl(u, v), rcond=None)[0]
    heights = form.means @ form.heights(np.column_stack([u, v, 0 * u])).T
    heights -= terms @ np.linalg.lstsq(terms, heights, rcond=None)[0]
    assert not sentences and np.abs(heights - expected).max() < 0.02 * np.ptp(expected)


@pytest.mark.nightly
def test_lobes_of_measured_cylinders_are_kept(tmp_path):
    """Six lobes of a bore of radius 10, with three waves along it."""
    azimuths, z = (values.ravel() for values in np.meshgrid(np.arange(72) * np.pi / 36, np.linspace(0, 30, 31)))
    lobes = 0.02 * np.cos(6 * azimuths) * np.cos(2 * np.pi * z / 10)
    for number, scale in enumerate((0.9, 1.0, 1.1)):
        radii = 10 - scale * lobes
        points = np.column_stack([radii * np.cos(azimuths), radii * np.sin(azimuths), z - 15])
        np.savetxt(tmp_path / f"{number}.csv", points)
    a = tc.Assembly("ring")
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(10, 20, 30, sections=96)), fixed=True)
    form = tc.Form(measured=str(tmp_path / "*.csv"))
    bore = ring.feature("bore", ring.face(tc.select.Cylinder(inner=True)), tc.Cylindricity(0.05, form=form))
    a.measure("wall", bore.point(10, 0, 0), along="x")
    field, sentences = form_warnings(a)
    assert not sentences and list(field.scans.values()) == pytest.approx([0.036, 0.04, 0.044], rel=0.01)
    assert field.scales == pytest.approx((10 / 6, 10 / (2 * np.pi)), rel=0.08)
    points = np.column_stack([10 * np.cos(azimuths), 10 * np.sin(azimuths), z - 15])
    np.testing.assert_allclose(field.means @ field.heights(points).T, lobes, atol=4e-4)
