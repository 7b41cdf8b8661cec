"""Faces that are not flat: seats against a linear programme on the same heights, archives, and one field for all uses."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from scipy.optimize import linprog
from scipy.stats import chi2

import tolcontact as tc
from tests import cases
from tests.cases.seats import PRESS, seat, sliding
from tests.helpers import SEATED, compiled, joined, nightly, simulate
from tolcontact.compilation import compile_program
from tolcontact.discretization import Offsets, discretize
from tolcontact.errors import ModelError
from tolcontact.features import FormField
from tolcontact.report import analysis_text
from tolcontact.simulation import simulate_blocks
from tolcontact.testing import assert_gaps_recompute, assert_resolved
from tolcontact.vocabulary import CORRECTED, WORST_CASE, Status


def modes_at(program, feature, places):
    """Heights (place, mode) of the form of a feature, from the formulae of the archive's documentation."""
    form = next(nominal.form for nominal in program.nominal.features if nominal.feature.name == feature)
    r = np.linalg.norm(places[:, None] - form.stations, axis=2) / form.lengths.across
    n = np.broadcast_to(form.associated.surface.axis, places.shape)
    displaced = np.column_stack([np.ones(len(places)), n, np.cross(places, n)])
    return np.exp(-(r**2) / 2) @ form.weights - displaced @ form.removed


def coefficients(program, run, feature):
    columns = [k for k, label in enumerate(program.nominal.contributors) if f".{feature}.form " in label]
    return run["deviations"][:, columns]


def seated(heights, places):
    """The lowest plane (constant, slopes) above all heights at places (place, 2) where the force presses: an LP."""
    rows = -np.column_stack([np.ones(len(places)), places])
    return linprog([1, *PRESS], A_ub=rows, b_ub=-heights, bounds=[(None, None)] * 3, method="highs").x


@pytest.mark.parametrize(("width", "error"), [(0.05, 5e-5), *nightly((0.005, 1e-6))])
def test_a_seat_is_the_one_of_a_linear_programme_on_all_heights_of_the_face(width, error):
    """The plane lies above all heights, but for a two-thousandth of the width, and where the force presses it is the lowest."""
    program, run = simulate(seat(width=width), samples=30, solver="daqp", method=SEATED)
    assert (run["status"] == Status.RESOLVED).all()
    assert (run["carrying"][:, 0] == 3).all()
    x, y = np.meshgrid(np.linspace(0, 100, 121), np.linspace(0, 50, 61))
    places = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    heights = coefficients(program, run, "under") @ modes_at(program, "under", places).T
    probes = np.array([(1, 0, 0), (1, 100, 0), (1, 50, 50)])
    planes = np.linalg.solve(probes, run["measured"][:, CORRECTED, :3].T).T
    above = planes @ np.column_stack([np.ones(x.size), places[:, :2]]).T - heights
    assert above.min() > -width / 2000 - error
    expected = np.array([seated(of_one, places[:, :2]) for of_one in heights]) @ (1, *PRESS)
    assert np.abs(run["measured"][:, CORRECTED, 3] - expected).max() < width / 2000 + error
    assert np.ptp(expected) > 0.2 * width
    # The measured point of the face moves with it, and stands out of it by its form.
    foot = np.array([[30.0, 20.0, 0.0]])
    form = coefficients(program, run, "under") @ modes_at(program, "under", foot).T
    np.testing.assert_allclose(run["measured"][:, CORRECTED, 4], planes @ [1, 30, 20] - form[:, 0], atol=error)


@dataclass(frozen=True, eq=False)
class OneMode(FormField):
    """A form of one mode, given by hand as a function of coordinates from -1 to 1 on the underside of the block."""

    shape: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def heights(self, points):
        return self.shape((points[..., 0] - 50) / 50, (points[..., 1] - 25) / 25)[..., None]

    def sums(self, points, row, coefficients):
        return (self.heights(points) * coefficients[row]).sum(axis=1)


def seat_of_one_mode(shape):
    """Measures (realization, measure) of a seat whose form is one mode, and its coefficients (realization,)."""
    nominal = discretize(seat(tc.Form(modes=1)))
    pair, *supports = nominal.pairs
    face = pair.deviating[0]
    values = {field.name: getattr(face.form, field.name) for field in fields(FormField)}
    by_hand = OneMode(**values, shape=shape)
    offsets = Offsets(face.form_columns, by_hand.heights(pair.P_m).T)
    pair = replace(pair, offsets=offsets, deviating=(replace(face, form=by_hand), None))
    program = compile_program(replace(nominal, pairs=(pair, *supports)), "daqp", SEATED)
    run = joined(simulate_blocks(program, samples=60, seed=1))
    assert (run["status"] == Status.RESOLVED).all() and run["gap_min"][:, CORRECTED].min() > -1e-9
    return run["measured"][:, CORRECTED], coefficients(program, run, "under")[:, 0]


def test_a_bowl_rests_on_its_rim():
    measured, c = seat_of_one_mode(lambda x, y: x**2 + y**2 - 2 / 3)
    bowls = c > 0
    np.testing.assert_allclose(measured[bowls, :4], 4 / 3 * np.outer(c[bowls], np.ones(4)), atol=1e-6)
    # A dome touches where it is pressed. Contact points lie at most 5 mm from there.
    x, y = (PRESS - [50, 25]) / [50, 25]
    pressed = c[~bowls] * (x**2 + y**2 - 2 / 3)
    assert (measured[~bowls, 3] <= pressed + 1e-6).all()
    assert (measured[~bowls, 3] >= pressed - np.abs(c[~bowls]) * (5 / 25) ** 2).all()


def test_a_saddle_rocks_onto_three_corners():
    """Above the saddle c x y the lowest plane that holds the force is c (1 - x + y), or -c (1 + x + y) if c is negative."""
    measured, c = seat_of_one_mode(lambda x, y: x * y)
    corners = np.array([(-1, -1), (1, -1), (0, 1), (PRESS - [50, 25]) / [50, 25]])
    x, y = corners.T
    expected = np.where(c[:, None] > 0, c[:, None] * (1 - x + y), -c[:, None] * (1 + x + y))
    np.testing.assert_allclose(measured[:, :4], expected, atol=1e-5)
    assert np.abs(c).max() > 0.01


def test_without_coefficients_a_face_is_flat():
    """The least form that is drawn makes no difference; nor do names of contributors, which draws depend on."""
    flat = seat(width=1e-9)
    for feature in flat.features:
        object.__setattr__(feature, "tolerances", (tc.Flatness(1e-9, form=None),))
    (_, plane), (program, run) = (
        simulate(model, samples=40, solver="daqp", method=SEATED) for model in (flat, seat(width=1e-9))
    )
    assert len(program.nominal.contributors) == plane["deviations"].shape[1] + 20
    np.testing.assert_allclose(run["measured"], plane["measured"], atol=2e-8)


def test_all_uses_of_a_face_share_one_field():
    """A face that two pairs, locators and a measure use: heights of contact points and pushes of locators agree."""
    a = tc.Assembly("shared")
    table = a.part("table", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
    shelf = a.part("shelf", tc.Box(100, 50, 10), at=(100, 0, -10), fixed=True)
    block = a.part("block", tc.Box(180, 50, 10), at=(10, 0, 0))
    under = block.feature("under", block.face("-z"), tc.Flatness(0.05))
    a.contact("table", moving=under, reference=table.face("+z"))
    a.contact("shelf", moving=under, reference=shelf.face("+z"))
    location = a.locate(block, tc.three_two_one(under, block.face("-y"), block.face("-x"), inset=5), tolerance=0.01)
    assert location
    a.measure("foot", under.point(5, 5, 0), along="z")
    program = compiled(a)
    nominal, count = program.nominal, len(program.nominal.contributors)
    assert count == 6 + 20
    assert nominal.pairs[0].deviating[0] is nominal.pairs[1].deviating[0] is nominal.locators.faces[0]
    for pair in nominal.pairs:
        assert pair.offsets.columns.tolist() == list(range(6, 26))
        np.testing.assert_allclose(pair.offsets.matrix.T, modes_at(program, "under", pair.P_m - [10, 0, 0]), atol=1e-12)
    columns, factors = nominal.locators.pushes(0)
    assert columns.tolist() == list(range(6, 26))
    np.testing.assert_allclose(factors, modes_at(program, "under", nominal.locators.points[:1] - [10, 0, 0])[0], atol=1e-12)
    # The locator holds the face itself: at its point the material stands where the locator says, without contact.
    deviations = np.zeros((1, count))
    deviations[0, 6:] = np.random.default_rng(0).normal(size=20) * 0.01
    raw = program.place(deviations=deviations)["poses"]
    foot = program.observe(poses=raw, deviations=deviations)["measured"][0, 0]
    assert foot == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("covariance", ["squared exponential", "matern 3/2"])
def test_gaps_of_faces_with_form_follow_from_the_archive_alone(tmp_path, covariance):
    path = tmp_path / "seat.nc"
    program = compiled(seat(tc.Form(covariance, modes=8)), solver="daqp", method=SEATED)
    tc.run(program, samples=12, out=path, surfaces=0).close()
    assert_resolved(path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as archive:
        assert archive["gap_min"].sel(state="corrected").min() > -1e-9
        form = archive["contact"].to_dataset()
        assert form["form_covariance"].values.tolist() == [covariance]
        assert form["form_length"].values == pytest.approx([100 / 3])
        assert tc.io.model_of(archive).features[0].tolerances[0].form == tc.Form(covariance, modes=8)
        archive["contact"]["station_weight"].values[:] *= 1.5
        with pytest.raises(AssertionError, match="is not the smallest gap"):
            assert_gaps_recompute(archive)


def test_faces_with_form_that_end_do_not_penetrate_each_other(tmp_path):
    path = tmp_path / "sliding.nc"
    tc.run(compiled(sliding(), solver="daqp"), samples=30, out=path, surfaces=30).close()
    assert_resolved(path)
    assert_gaps_recompute(path)
    with tc.open_archive(path) as archive:
        assert archive["contact"]["bounded"].values.all()
        assert archive["gap_min"].sel(state="corrected").min() > -1e-9
        assert archive["surface"]["surface_penetration"].max() < 2e-3


def refused(make):
    a = tc.Assembly("refused")
    block, base = a.part("block", tc.Box(100, 50, 10)), a.part("base", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
    make(a, block, base)
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.1)
    a.measure("end", block.point(0, 0, 10), along="z")
    with pytest.raises(ModelError) as error:
        tc.build(a)
    return str(error.value)


def test_what_cannot_be_drawn_is_refused_in_one_message():
    fault = refused(lambda a, block, base: block.feature("f", block.face("-z"), tc.Straightness(0.1)))
    assert "form of straightness of a plane cannot be drawn" in fault and "form=None" in fault
    fault = refused(lambda a, block, base: block.feature("f", block.face("-z"), tc.Flatness(0.1, form=tc.Form("white"))))
    assert "covariance is 'white'; expected one of" in fault


def test_a_correlation_length_far_beyond_the_face_has_points_by_the_size_of_the_face_and_one_with_nothing_left_is_refused():
    pair, *_ = discretize(seat(tc.Form(length=250))).pairs
    assert pair.form_spacing == pytest.approx(0.71 * 50 / 5)  # a fifth of half of the face
    fault = refused(lambda a, block, base: block.feature("f", block.face("-z"), tc.Flatness(0.1, form=tc.Form(length=1e4))))
    assert (
        'feature "f"' in fault
        and "correlation length of its form, 1e+04 mm" in fault
        and "three times its extent, 100 mm" in fault
    )


def test_contact_points_too_far_apart_for_a_form_are_refused():
    def sparse(a, block, base):
        a.contact("c", moving=block.feature("f", block.face("-z"), tc.Flatness(0.1)), reference=base.face("+z"), points=8)

    assert "correlation length of 33.3 mm; expected at most half of that" in refused(sparse)


def test_a_worst_case_leaves_form_out_and_names_its_features():
    """The block touches the table with its form, and a profile contains the form of its top: values are as with form=None."""
    found = []
    for form in (tc.Form(), None):
        a = tc.Assembly("block")
        table = a.part("table", tc.Box(60, 60, 10), at=(0, 0, -10), fixed=True)
        block = a.part("block", tc.Box(40, 40, 10), at=(10, 10, 0))
        under = block.feature("under", block.face("-z"), tc.Flatness(0.05, form=form), datum="A")
        top = block.feature("top", block.face("+z"), tc.Profile(0.2, "A"), tc.Flatness(0.1, form=form))
        a.locate(block, tc.three_two_one(under, block.face("-y"), block.face("-x"), inset=5), tolerance=0.4)
        a.contact("seat", moving=under, reference=table.face("+z"))
        a.measure("top", top.point(20, 20, 10), along="z")
        found.append(tc.analyses.worst_case(a, samples=64, solver="daqp"))
    assert found[0].attrs["without_form"] == "block.under, block.top"
    assert "without_form" not in found[1].attrs
    assert found[0]["worst"].values == pytest.approx(found[1]["worst"].values, abs=1e-4)
    raw = [dataset["bound"].sel(state="raw").values for dataset in found]
    assert raw[0] == pytest.approx(raw[1], abs=1e-6)
    with Console(width=200, file=StringIO()) as console, console.capture() as printed:
        console.print(analysis_text(WORST_CASE, found[0]))
    assert "Without the form deviations of block.under, block.top: these faces keep their shape." in printed.get()


def test_the_gap_of_a_station_over_a_face_with_form_counts_its_height_there():
    a = tc.Assembly("over")
    base = a.part("base", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Box(100, 50, 10), at=(0, 0, 5))
    top = base.feature("top", base.face("+z"), tc.Flatness(0.05))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0)
    a.measure("gap", tc.Gap(block.point(30, 20, 0), base.face("+z")))
    assert top
    program, run = simulate(a, samples=20)
    place = np.array([[30.0, 20.0, 10.0]])
    heights = coefficients(program, run, "top") @ modes_at(program, "top", place).T
    np.testing.assert_allclose(run["measured"][:, CORRECTED, 0], 5 - heights[:, 0], atol=1e-12)
    a.measure("clearance", tc.Clearance(block.face("-z"), base.face("+z")))
    with pytest.raises(ModelError, match="which has form, cannot be measured"):
        tc.build(a)


@pytest.mark.nightly
def test_four_times_as_many_points_tell_the_same():
    """Points count by the areas that they stand for, so that 6 sigma stays within its interval of 95 %."""
    spreads, count = [], 2000
    for points in ((400, 200, 200), (1600, 800, 800)):
        ra2 = cases.model("ra2")
        for pair, of_pair in zip(ra2.pairs, points, strict=True):
            face = pair.moving
            face.part.feature(f"under {pair.name}", face, tc.Flatness(0.05))
            object.__setattr__(pair, "points", of_pair)
        _, run = simulate(ra2, samples=count, solver="daqp")
        spreads.append(6 * run["measured"][:, CORRECTED, 0].std())
    lower, upper = spreads[0] * np.sqrt(count / chi2.ppf([0.975, 0.025], count - 1))
    assert lower < spreads[1] < upper and abs(spreads[1] - spreads[0]) < (upper - lower) / 4
