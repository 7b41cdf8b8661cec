"""Plates with holes: the least gap of all places is that of the overlap of the plates, cut by another library."""

import manifold3d
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.geometry.meeting import Meeting, Reach, meeting
from tolcontact.geometry.outlines import hole_clearances, outline
from tolcontact.geometry.places import Look
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
        gaps = places.at(np.array(poses), Look(ceilings=np.full(len(poses), ceiling))).gaps.min(axis=1, initial=np.inf)
        assert np.abs(gaps - expected).max() < 1e-5  # the library's solids have 32 bits


def drilled(width: float, places: list[float], *, up: bool, depth: float = 20.0) -> trimesh.Trimesh:
    """Return a plate up to x = width and y = depth, with holes of radius 4 at y = 8."""
    low = 0.0 if up else -THICKNESS
    box = trimesh.creation.box(bounds=[(-30, -20, low), (width, depth, low + THICKNESS)])
    holes = [trimesh.creation.cylinder(4, 40, sections=12).apply_translation((x, 8, 0)) for x in places]
    return trimesh.boolean.difference([box, *holes], engine="manifold") if holes else box


@pytest.mark.parametrize(
    ("width", "depth", "shift", "tilt"),
    [(30.0, 20.0, (9.0, 11.0), 0.02), (14.5, 8.0, (-2.2, 0.0), 0.002)],  # by ten distances, and by one and a half
)
def test_a_hole_counts_where_it_holds_a_corner_of_the_other_plate(width, depth, shift, tilt):
    upper, lower = drilled(30, [20], up=True), drilled(width, [], up=False, depth=depth)
    t = np.array([*shift, 0.0])  # the corner is in the hole
    R = Rotation.from_rotvec([-tilt, tilt, 0.0]).as_matrix()  # and is the lowest one
    plates = [manifold3d.CrossSection([[(-30, -20), (x, -20), (x, y), (-30, y)]]) for x, y in ((30, 20), (width, depth))]
    hole = manifold3d.CrossSection([4 * np.column_stack([np.cos(a := np.arange(12) * np.pi / 6), np.sin(a)]) + [20, 8]])
    expected, corner = least_gap(plates[0] - hole, plates[1], R, t), least_gap(*plates, R, t)
    assert expected > corner + tilt / 2
    assert between(upper, lower).at(np.r_[R.ravel(), t][None]).gaps.min() == pytest.approx(expected, abs=1e-5)


def test_a_hole_that_meets_an_outline_counts_wherever_bodies_are():
    found = between(drilled(27, [0, 20], up=True), drilled(30, [25], up=False))
    facing = found.candidates.facing
    outlines = [outline(body, facet) for body, facet in zip((found.moving, found.reference), facing[0], strict=True)]
    clearances = hole_clearances(found.moving, found.reference, facing, outlines)[:, 0]
    around = np.hypot(*(found.moving.edges.mean(axis=1)[:, :2] - [0, 8]).T) < 5
    assert around.any() and clearances[around] == pytest.approx(8, abs=1e-9)  # from its own outline
    assert not clearances[~around].any()  # the hole at x = 20 meets one of the other plate, which meets the rim at x = 27
