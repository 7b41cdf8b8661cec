"""Insides of `features` under the claims of `tests/test_round_forms.py`."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import linprog

import tolcontact as tc
from tests.cases.fits import shaft_in_a_bore
from tests.helpers import compiled, nightly
from tests.test_round_forms import form_of, radial_terms
from tolcontact.features.associated_features import AssociatedSurface, Lengths
from tolcontact.features.minimum_zone import minimum_widths
from tolcontact.geometry.analytic_surfaces import Sphere
from tolcontact.geometry.surface import Surface


def width_by_programme(terms, heights):
    """The least distance of two surfaces with these terms (place, term) around heights (place,)."""
    ones, size = np.ones((len(terms), 1)), terms.shape[1]
    rows = np.vstack([np.hstack([terms, 0 * ones]), np.hstack([-terms, -ones])])
    limits = np.concatenate([heights, -heights])
    return linprog(np.eye(size + 1)[-1], A_ub=rows, b_ub=limits, bounds=[(None, None)] * (size + 1), method="highs").fun


@pytest.mark.parametrize("tolerance", [tc.Cylindricity(0.05), *nightly(tc.Roundness(0.05), tc.Straightness(0.05))], ids=str)
def test_zones_of_cylinders_are_those_of_a_linear_programme(tolerance):
    program = compiled(shaft_in_a_bore(tolerance))
    field = form_of(program, "shaft")
    spread = program.draws.contributors[len(program.nominal.contributors) - 1].spread
    heights = np.random.default_rng(1).normal(0, spread, (8, field.modes)) @ field.heights(field.places).T
    x, y, z = field.places.T
    terms = radial_terms(np.arctan2(y, x), z)
    keys = {"cylindricity": 0 * z, "roundness": z.round(6), "straightness": np.arctan2(y, x).round(6) % (2 * np.pi - 1e-5)}
    columns = {"cylindricity": [0, 1, 2, 3, 4], "roundness": [0, 1, 2], "straightness": [0]}[tolerance.kind]
    key, expected = keys[tolerance.kind], np.zeros(len(heights))
    if tolerance.kind == "straightness":
        terms, columns = np.column_stack([np.ones(len(z)), z]), [0, 1]
    for value in np.unique(key):
        own = key == value
        widths = [width_by_programme(terms[own][:, columns], of_one[own]) for of_one in heights]
        expected = np.maximum(expected, widths)
    np.testing.assert_allclose(minimum_widths(field.zone, heights), expected, rtol=1e-6)
    assert 0.01 < expected.mean() < 0.05


def test_places_of_a_ball_lie_on_it_and_not_on_its_triangles():
    centre = np.array([3.0, -2, 5])
    mesh = trimesh.creation.icosphere(2, 10).apply_translation(centre)
    associated = AssociatedSurface.of(Sphere(centre, np.array([0.0, 0, 1]), radius=10.0), Surface(mesh))
    places, areas = associated.places(Surface(mesh), Lengths(6.0, 6.0))
    np.testing.assert_allclose(np.linalg.norm(places - centre, axis=1), 10, rtol=1e-12)
    assert areas.sum() == pytest.approx(4 * np.pi * 100, rel=0.03)
