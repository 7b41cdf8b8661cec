"""Surfaces fitted to triangles: those that the vertices lie on, exact or noisy."""

import numpy as np
import pytest
import trimesh

from tests.cases import Frame
from tolcontact.geometry.fitting import fit_surface

MOVED = Frame(turn=(0.4, -1.1, 2.0), shift=(30, -20, 10))
SHAPES = {
    "cylinder": (lambda: trimesh.creation.revolve([(5.5, 0), (5.5, 8)], sections=48).triangles, "radius", 5.5),
    "cone": (lambda: trimesh.creation.revolve([(6, 0), (3, 6)], sections=48).triangles, "angle", np.arctan(0.5)),
    "sphere": (lambda: trimesh.creation.icosphere(subdivisions=2, radius=4).triangles, "radius", 4.0),
}


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize(("noise", "error"), [(0.0, 1e-13), (1e-5, 1e-4)])
def test_a_surface_is_fitted_to_exact_and_to_noisy_vertices(kind, noise, error):
    triangles, size, expected = SHAPES[kind]
    corners, corner_of = np.unique(np.asarray(triangles()).reshape(-1, 3), axis=0, return_inverse=True)
    corners = MOVED.R.apply(corners) + MOVED.shift + np.random.default_rng(0).uniform(-noise, noise, size=corners.shape)
    surface = fit_surface(corners[corner_of.ravel()].reshape(-1, 3, 3), 1e-3)
    assert surface.kind == kind
    assert getattr(surface, size) == pytest.approx(expected, rel=error)
    assert surface.residual <= max(2 * noise, 2e-14)
    assert np.abs(surface.distance(corners)[0]).max() <= max(2 * noise, 2e-14)


@pytest.mark.parametrize("seed", range(10))
def test_few_facets_are_no_round_face(seed):
    """A cone has six numbers, so that one passes through most hills of five facets, which have six vertices."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi / 5, 5) + 2 * np.pi / 5 * np.arange(5))
    rim = np.column_stack([np.cos(angles), np.sin(angles), rng.uniform(-0.2, 0.2, 5)])
    triangles = np.stack([rim, np.roll(rim, -1, axis=0), np.broadcast_to((0.1, 0.0, 0.4), (5, 3))], axis=1)
    assert fit_surface(triangles, 1e-3) is None
