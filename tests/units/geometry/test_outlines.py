"""Plates with holes: the least gap of all places is that of the overlap of the plates, cut by another library."""

import manifold3d
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.geometry.meeting import Meeting, Reach, meeting
from tolcontact.geometry.outlines import hole_clearances
from tolcontact.geometry.surface import Surface

THICKNESS = 10.0


def plate(rng: np.random.Generator, *, up: bool) -> tuple[trimesh.Trimesh, manifold3d.CrossSection]:
    """Return a plate with one to four holes, some near its rim, above or below z = 0, and its outline there."""
    outline = manifold3d.CrossSection([rng.uniform(0.8, 1.2, (4, 1)) * np.array([(-30, -20), (30, -20), (30, 20), (-30, 20)])])
    for _ in range(rng.integers(1, 5)):
        hole = manifold3d.CrossSection.circle(rng.uniform(2, 7), int(rng.integers(3, 24)))
        outline -= hole.translate((rng.uniform(-22, 22), rng.uniform(-12, 12)))
    solid = outline.extrude(THICKNESS).translate((0, 0, 0 if up else -THICKNESS)).to_mesh()
    return trimesh.Trimesh(solid.vert_properties[:, :3], solid.tri_verts), outline


def least_gap(upper: manifold3d.CrossSection, lower: manifold3d.CrossSection, R: np.ndarray, t: np.ndarray) -> float:
    """Return the least height of the upper plate's plane over the overlap, along z: it is linear between corners."""
    seen = upper.transform(np.column_stack([R[:2, :2], t[:2]]))
    corners = np.concatenate([np.zeros((0, 2)), *(seen ^ lower).to_polygons()])
    normal = R[:, 2]
    return float((t[2] - (corners - t[:2]) @ normal[:2] / normal[2]).min(initial=np.inf))


def between(upper: trimesh.Trimesh, lower: trimesh.Trimesh) -> Meeting:
    """Return where the lower face of a plate and the upper face of another one can touch."""
    bodies, faces = (upper, lower), list[Surface]()
    for body, sign in zip(bodies, (-1, 1), strict=True):
        faces.append(Surface(body.submesh([np.flatnonzero(sign * body.face_normals[:, 2] > 0.99)], append=True, repair=False)))
    return meeting(tuple(faces), bodies, Reach(travel=40.0, tilt=0.1, spread=20.0, overlap=0.0, clearance=0.0))


@pytest.mark.parametrize("far", [1.5, 25.0])
@pytest.mark.parametrize("seed", range(12))
def test_the_least_gap_is_that_of_the_overlap_wherever_the_holes_are(seed, far):
    rng = np.random.default_rng(seed)
    (moving, upper), (reference, lower) = plate(rng, up=True), plate(rng, up=False)
    places, poses, expected = between(moving, reference), [], []
    for _ in range(60):
        R = Rotation.from_rotvec(rng.normal(size=3) * [0.01, 0.01, 0.1]).as_matrix()
        t = np.array([*rng.uniform(-far, far, 2), rng.uniform(-0.3, 0.3)])
        poses.append(np.r_[R.ravel(), t])
        expected.append(least_gap(upper, lower, R, t))
    for ceiling in (np.inf, -0.1, 0.05):
        gaps = places.at(np.array(poses), ceilings=np.full(len(poses), ceiling)).gaps.min(axis=1, initial=np.inf)
        assert np.abs(gaps - expected).max() < 1e-5  # the library's solids have 32 bits


def test_a_hole_that_reaches_an_outline_counts_wherever_bodies_are():
    plates = [trimesh.creation.box(bounds=[(-30, -20, low), (30, 20, low + 10)]) for low in (0, -10)]
    cut = [trimesh.creation.cylinder(4, 40, sections=12).apply_translation((x, 0, 0)) for x in (0, 24, 28)]
    upper = trimesh.boolean.difference([plates[0], *cut[:2]], engine="manifold")
    lower = trimesh.boolean.difference([plates[1], cut[2]], engine="manifold")
    found = between(upper, lower)
    clearances = hole_clearances(found.moving, found.reference, found.candidates.facing)[:, 0]
    centre = found.moving.edges.mean(axis=1)
    around = np.hypot(*(centre[:, :2]).T) < 5
    assert (clearances[around] > 10).all() and around.any()
    assert not clearances[~around].any()  # that at x = 24 meets the hole of the other plate, which meets its rim
