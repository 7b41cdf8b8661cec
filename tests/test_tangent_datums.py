"""Planes that touch datum features with form outside of the material (ISO 5459), against linear programmes and closed forms."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from scipy.optimize import linprog

import tolcontact as tc
from tests.helpers import assembly_of, compiled, realizations
from tests.population_referee import measured_back
from tolcontact.discretization import discretize
from tolcontact.features import FormField
from tolcontact.testing import assert_datums_recompute, assert_same_run
from tolcontact.variation import Draws

TIGHT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def block(association="outside", form: tc.Form | None = tc.Form(), systems=("A|B|C", "A|B|C"), turn=(0.3, -0.2, 0.5)):  # noqa: B008
    """A block with three datums; without `form` all of them are flat."""
    a = tc.Assembly("block")
    part = a.part("block", tc.Box(100, 50, 30), at=(5, -3, 2), rotation=turn, fixed=True)
    part.feature("foot", part.face("-z"), tc.Flatness(0.05, form=form), datum="A", association=association)
    side = tc.Perpendicularity(0.1, "A"), tc.Flatness(0.03, form=form)
    part.feature("side", part.face("-y"), *side, datum="B", association=association)
    part.feature("end", part.face("-x"), tc.Flatness(0.02, form=form), datum="C", association=association)
    tops = [part.feature(f"top {k}", part.face(way), tc.Profile(0.01, system)) for k, (way, system) in enumerate(
        zip(("+z", "+y", "+x"), systems, strict=False)
    )]  # fmt: skip
    a.measure("height", tops[0].point(0, 0, 30), along="z")
    return a


def plate(form: tc.Form | None = tc.Form(), association="outside"):  # noqa: B008
    """A block with one datum."""
    a = tc.Assembly("plate")
    part = a.part("plate", tc.Box(100, 50, 30), fixed=True)
    part.feature("foot", part.face("-z"), tc.Flatness(0.05, form=form), datum="A", association=association)
    top = part.feature("top", part.face("+z"), tc.Profile(0.01, "A"))
    a.measure("height", top.point(0, 0, 30), along="z")
    return a


@pytest.fixture(scope="module")
def program():
    return compiled(block())


def tangents(program):
    planes = {plane.columns.start: plane for pattern in program.nominal.patterns for plane in pattern.shifts}
    return {program.nominal.contributors[column]: (column, plane) for column, plane in planes.items()}


def programme(heights, rows, fixed=None, sense=None, width=None):
    """The least distance of planes with `rows` (place, freedom) above heights, in units of these; or an extreme coordinate."""
    freedom, ones = rows.shape[1], np.ones((len(rows), 1))
    A, b = np.block([[-rows, 0 * ones], [rows, -ones]]), np.concatenate([-heights, heights])
    cost = np.append(np.zeros(freedom), 1.0)
    bounds = [(None, None)] * freedom + [(0, width)]
    if sense is not None:
        cost = np.append(sense * np.eye(freedom)[fixed], 0.0)
    return linprog(cost, A_ub=A, b_ub=b, bounds=bounds, method="highs-ds", options=TIGHT).x


@pytest.mark.parametrize("label", ["top 0.datum A of A|B|C: offset", "top 1.datum B of A|B|C: offset"])
def test_the_plane_is_that_of_a_linear_programme_on_the_same_heights(program, label):
    column, plane = tangents(program)[f"block.{label}"]
    deviations, unique = program.draws(seed=3, start=0, stop=16), 0
    rows = plane.heights @ plane.free
    assert rows.shape[1] == (3 if "A of" in label else 2)  # a secondary datum tilts about one direction
    planes = plane.shifts(deviations, {})
    np.testing.assert_array_equal(planes, deviations[:, column : column + planes.shape[1]])
    whole = replace(plane, coordinates=(0, 1, 2)).shifts(deviations, {})
    for deviation, coordinates in zip(deviations, whole, strict=True):
        leaning = plane.residuals @ deviation[: plane.residuals.shape[1]]
        form = plane.form.heights(plane.form.places) @ deviation[plane.datum.form_columns]
        heights = plane.heights @ leaning + form
        scale = np.abs(heights).max()
        least = programme(heights / scale, rows)
        above = plane.heights @ coordinates - heights
        assert above.min() > -1e-15 and above.max() == pytest.approx(scale * least[-1], abs=1e-12)
        ends = [
            [programme(heights / scale, rows, k, sense, least[-1] + 1e-12)[k] for sense in (1, -1)]
            for k in range(len(least) - 1)
        ]
        if np.ptp(ends, axis=1).max() < 1e-9:
            unique += 1
            np.testing.assert_allclose(coordinates, plane.free @ least[:-1] * scale, atol=1e-9)
        ends = np.sort(ends, axis=1) * scale
        mine = plane.free.T @ coordinates
        assert (ends[:, 0] - 1e-9 <= mine).all() and (mine <= ends[:, 1] + 1e-9).all()
    assert unique > 10


@dataclass(frozen=True, eq=False)
class OneMode(FormField):
    """A form of one mode, given by hand as a function of coordinates from -1 to 1 on the foot of the block."""

    shape: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def heights(self, points):
        return self.shape((points[..., 0] - 50) / 50, (points[..., 1] - 25) / 25)[..., None]


@pytest.mark.parametrize(
    ("shape", "out", "inverted"),
    [
        (lambda x, y: x**2 + y**2 - 2 / 3, 4 / 3, 2 / 3),  # a bowl rests on its corners, a dome on its middle
        (lambda x, y: x * y, 1.0, 1.0),  # a saddle on two corners, about which it could rock
        (lambda x, y: x**2 - y**2, 1.0, 1.0),
        (lambda x, y: x**2 - 1 / 3, 2 / 3, 1 / 3),  # a gutter
    ],
    ids=["bowl", "saddle", "saddle along the edges", "gutter"],
)
def test_simple_forms_are_touched_where_closed_forms_say(shape, out, inverted):
    program = compiled(plate(tc.Form(modes=1)))
    ((_, plane),) = tangents(program).values()
    fields_of_form = {field.name: getattr(plane.form, field.name) for field in fields(FormField)}
    by_hand = replace(plane, datum=replace(plane.datum, form=OneMode(**fields_of_form, shape=shape)))
    deviations = np.zeros((2, len(program.nominal.contributors)))
    deviations[:, plane.datum.form_columns.start] = 0.02, -0.03
    expected = [[0.02 * out, 0, 0], [0.03 * inverted, 0, 0]]
    np.testing.assert_allclose(by_hand.shifts(deviations, {}), expected, atol=1e-12)


def test_without_coefficients_datums_lie_where_those_of_flat_faces_do_to_the_last_bit(program):
    nominal = discretize(block(form=None))
    draws = Draws(nominal)
    formed, names = list(program.nominal.contributors), list(nominal.contributors)
    free = [label for label in names if "datum" not in label]
    values, expected = np.zeros((50, len(formed))), np.zeros((50, len(names)))
    expected[:, [names.index(label) for label in free]] = np.random.default_rng(0).normal(size=(50, len(free)))
    values[:, [formed.index(label) for label in free]] = expected[:, [names.index(label) for label in free]]
    draws.add_shifts(expected)
    program.draws.add_shifts(values)
    shifts = [label for label in names if "datum" in label]
    assert shifts
    for label in shifts:
        np.testing.assert_array_equal(values[:, formed.index(f"{label}: offset")], expected[:, names.index(label)])
    tilts = [k for k, label in enumerate(formed) if "datum" in label and "tilt" in label]
    assert tilts and not values[:, tilts].any()


def test_least_squares_ignores_the_form_of_datums():
    formed, flat = (realizations(compiled(plate(form, "least squares")), samples=50, seed=2) for form in (tc.Form(), None))
    np.testing.assert_array_equal(formed.measured, flat.measured)


def test_populations_lie_in_their_zones_from_the_planes_that_touch_their_datums():
    inside = measured_back(block(systems=("B|A", "C><|A><")), 1500)
    assert (inside.upper > 0.9973).all() and (inside.share > 0.994).all()


def test_archives_state_the_planes_and_recompute_them(program, tmp_path):
    path = tmp_path / "block.nc"
    tc.run(program, samples=8, seed=4, out=path).close()
    assert_datums_recompute(path)
    with tc.open_archive(path) as archive:
        sample = archive["sample"].to_dataset()
        rules = sample["distribution"].values[sample["source"].values == "datum"]
        assert set(rules) == {"follows from the form of the datum feature; minimax plane outside of the material"} and len(
            rules
        ) == len(sample["contributor"][["datum" in str(label) for label in sample["contributor"].values]])
        column = list(sample["contributor"].values).index("block.top 0.datum A of A|B|C: offset")
        archive["sample"]["deviation"].values[3, column] += 1e-6
        with pytest.raises(AssertionError, match="in realization 3 is"):
            assert_datums_recompute(archive)


def test_a_model_of_json_has_the_same_datums(tmp_path):
    tc.io.write_model(plate(), tmp_path / "plate.json")
    read = assembly_of(tmp_path / "plate.json")
    assert_same_run(*(tc.run(compiled(model), samples=8) for model in (read, plate())))


def test_contributions_count_a_plane_with_the_form_that_it_follows():
    program = compiled(plate())
    found = tc.analyses.contributions(program, samples=64).sel(measure="height", state="raw")
    name = "plate.foot.form + plate.top.datum A of A: offset + plate.top.datum A of A: tilt x + plate.top.datum A of A: tilt y"
    assert name in found["group"].values
    assert float(found["linear"].sum()) == pytest.approx(1)
    assert float(found["total"].sel(group=name, interval="estimate")) > 0.5
    assert "foot" in tc.analyses.worst_case(program, samples=256).attrs["without_form"]


def test_features_that_refer_to_one_datum_share_its_plane(program):
    deviations, names = program.draws(seed=1, start=0, stop=20), list(program.nominal.contributors)
    first, second = (
        names.index(f"block.{feature}.datum A of {system}: tilt y") for feature, system in (("side", "A"), ("top 1", "A|B|C"))
    )
    np.testing.assert_array_equal(deviations[:, first], deviations[:, second])
    assert program.nominal.faces[0].form is not None  # archives hold the faces that datums touch
