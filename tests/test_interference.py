"""The complete test whether bodies lie in each other, against linear programmes and closed forms."""

import numpy as np
import pytest
import scipy.ndimage
import trimesh
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled, nightly
from tolcontact.interference import Neighbours, solid
from tolcontact.poses import AT_REST

INSETS = (1e-4, 2e-4)
BOX = ((0, 0, 0), (10, 10, 10))


def box(lower, upper):
    return trimesh.creation.box(bounds=[lower, upper])


def pose(shift=(0, 0, 0), turn=(0, 0, 0)):
    return np.r_[Rotation.from_rotvec(turn).as_matrix().ravel(), shift]


def neighbours(A, B, reach=1.0):
    return Neighbours(solid(A), solid(B), INSETS, reach)


def common_ball(A, B, X):
    """The radius of the largest ball in two convex bodies, A at X; negative if they are apart."""
    rows = []
    for mesh, R, t in ((A, X[:9].reshape(3, 3), X[9:]), (B, np.eye(3), np.zeros(3))):
        planes = ConvexHull(mesh.vertices).equations
        normals = planes[:, :3] @ R.T
        rows.append(np.c_[normals, np.ones(len(normals)), normals @ t - planes[:, 3]])
    rows = np.concatenate(rows)
    bounds = [(None, None)] * 4
    best = linprog([0, 0, 0, -1], A_ub=rows[:, :4], b_ub=rows[:, 4], bounds=bounds, method="highs")
    return -best.fun if best.status == 0 else np.nan


@pytest.mark.parametrize(
    "A, B, shift, is_inside",
    [
        (BOX, BOX, (0, 0, 0), True),  # equal bodies
        (BOX, BOX, (0, 0, 9.99), True),  # flush, one sunk into the other
        (BOX, BOX, (0, 0, 10), False),  # one lies on the other
        (BOX, BOX, (10, 0, 0), False),  # side by side, flush
        (BOX, BOX, (10, 10, 0), False),  # edge along edge
        (BOX, BOX, (10, 10, 10), False),  # corner on corner
        (((3, 0, 0), (5, 1, 1)), ((0, 0, 0), (10, 1, 1)), (0, 0, 0), True),  # a slab in a bar of its section
        (((-20, -1, 0), (20, 1, 1)), ((-1, -20, 0), (1, 20, 1)), (0, 0, 0), True),  # bars of one height that cross
        (((-20, -1, 0), (2, 1, 1)), ((-1, -20, 0), (1, 2, 1)), (0.3, 0.4, 0), True),  # their centres are in neither
        (((3, 3, 3), (5, 5, 5)), BOX, (0, 0, 0), True),  # inside
        (((3, 3, 3), (5, 5, 5)), BOX, (40, 0, 0), False),
        (((33, 3, 3), (35, 5, 5)), BOX, (-30, 0, 0), True),  # moved inside
        (((0, 0, 10), (10, 10, 10.1)), BOX, (0, 0, -5), True),  # a sheet
        (((0, 0, 10), (10, 10, 10.1)), BOX, (0, 0, -10.2), False),  # a sheet that passed through
    ],
)
@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -1.1, 0.7)])
def test_flush_bodies(A, B, shift, is_inside, turn):
    R, moved = Rotation.from_rotvec(turn).as_matrix(), [box(*A), box(*B)]
    for mesh in moved:
        mesh.vertices = mesh.vertices @ R.T
    for first, second, way in ((*moved, R @ shift), (*moved[::-1], -R @ np.array(shift))):
        assert neighbours(first, second).interfere(pose(way)[None])[0] == is_inside


def test_bodies_of_cubes_and_octahedra_share_their_middle_though_no_edge_enters_the_other():
    cube, octahedron = box((-1, -1, -1), (1, 1, 1)), trimesh.convex.convex_hull(np.vstack([2 * np.eye(3), -2 * np.eye(3)]))
    assert neighbours(cube, octahedron).interfere(AT_REST[None])[0]


def test_random_convex_bodies_are_judged_as_a_linear_programme_judges_them():
    rng, judged, inside = np.random.default_rng(0), 0, 0
    for _ in range(60):
        points = [rng.choice([-10.0, -5.0, 0.0, 5.0, 10.0], size=(rng.integers(5, 9), 3)) for _ in range(2)]
        if any(np.linalg.matrix_rank(corners - corners[0]) < 3 for corners in points):
            continue
        A, B = (trimesh.convex.convex_hull(corners) for corners in points)
        pair = neighbours(A, B, reach=float(rng.choice([0.1, 5.0, 50.0])))
        shifts = rng.random((12, 1)) * (0, 0, 20) + rng.normal(size=(12, 3)) * rng.integers(0, 2)
        poses = np.array([pose(shift, rng.normal(size=3) * 0.1 * rng.integers(0, 2)) for shift in shifts])
        found, radii = pair.interfere(poses), np.array([common_ball(A, B, X) for X in poses])
        sure = (radii < INSETS[0]) | (radii > 2 * sum(INSETS))  # radii of balls in between depend on the corner
        np.testing.assert_array_equal(found[sure], radii[sure] > INSETS[0])
        depths = pair.measured(poses[found]).depths
        assert (depths > 0.5 * radii[found]).all()
        judged, inside = judged + sure.sum(), inside + found.sum()
    assert judged > 400 and 100 < inside < judged - 100


def test_bodies_part_along_the_direction_in_which_they_share_least():
    pair = neighbours(box((0, 0, 10), (10, 10, 20)), box((-5, -5, 0), (15, 15, 10)))
    X = pose((0, 0, -0.3), (0.001, 0, 0))[None]
    way = pair.ways_out(X)
    np.testing.assert_allclose(way.normals[0], (0, 0, 1), atol=2e-3)
    np.testing.assert_allclose(way.widths[0], 0.3, atol=2e-3)
    moved = X + np.r_[np.zeros(9), way.widths[0] * way.normals[0]]
    assert pair.interfere(X)[0] and not pair.interfere(moved)[0]


def test_bodies_that_share_two_regions_part_at_the_deeper_one_or_along_a_given_direction():
    stepped = trimesh.boolean.union([box((0, 0, 0), (10, 10, 10)), box((9, 0, 0), (30, 10, 12))])
    table = trimesh.boolean.union([box((0, 0, 9.7), (5, 5, 20)), box((20, 0, 11.9), (25, 5, 20)), box((0, 0, 19), (25, 5, 22))])
    hook = trimesh.boolean.union([table, box((30, 1, 0), (32, 4, 22)), box((24, 1, 19), (32, 4, 22))])
    way = neighbours(hook, stepped).ways_out(AT_REST[None])
    np.testing.assert_allclose([way.widths[0], *way.normals[0]], [0.3, 0, 0, 1], atol=1e-3)
    X = pose(shift=(-0.05, 0, 0))[None]
    for direction, width in {(0, 0, 1): 0.3, (1, 0, 0): 0.05}.items():
        way = neighbours(hook, stepped).ways_out(X, directions=np.array([direction], dtype=float))
        np.testing.assert_allclose([way.widths[0], *way.normals[0]], [width, *direction], atol=1e-3)


def test_vertices_stay_on_planes_that_deviate():
    closed = solid(box(*BOX))
    top = np.flatnonzero(closed.normals[:, 2] > 0.5)
    side = np.flatnonzero(closed.normals[:, 0] > 0.5)
    motions = [closed.normals[triangles][:, None, :, None].repeat(3, axis=1) for triangles in (top, side)]
    faces = [(top, np.array([0]), motions[0]), (side, np.array([2]), motions[1])]
    vertices, motions = closed.deviating(faces, closed.bulges).motions
    expected = np.zeros((8, 3))
    expected[closed.vertices[:, 2] > 5, 2], expected[closed.vertices[:, 0] > 5, 0] = 0.3, -0.2
    moved = np.zeros((8, 3))
    moved[vertices] = motions @ (0.3, -0.2)
    np.testing.assert_allclose(moved, expected, atol=1e-12)


@pytest.mark.parametrize("sections", [24, 48, 64, 200])
def test_a_bore_that_shifts_keeps_its_shape_with_any_number_of_facets(sections):
    closed = solid(trimesh.creation.annulus(3, 10, 5, sections=sections))
    radii = np.hypot(*closed.vertices[:, :2].T)
    bore = np.flatnonzero((radii[closed.faces] < 4).all(axis=1))
    shift = np.eye(3)[:, :2]
    faces = [(bore, np.array([0, 1]), np.broadcast_to(shift, (len(bore), 3, 3, 2)))]
    vertices, motions = closed.deviating(faces, closed.bulges).motions
    assert set(vertices) == set(np.flatnonzero(radii < 4))
    np.testing.assert_allclose(motions, np.broadcast_to(shift, motions.shape), atol=1e-9)


ROOF = [(-12, 0, 0), (5, 0, 0), *[(x, y, -10) for x in (-12, 12) for y in (-10, 10)]]  # its ridge ends below the plate
PLATE = [(x, y, z) for x in (-10, 10) for y in (-10, 10) for z in (0, 8)]


def set_down(moving, fixed):
    """A convex body on another one, of these corners."""
    model = tc.Assembly("set down")
    bodies = [trimesh.convex.convex_hull(np.array(corners, dtype=float)) for corners in (moving, fixed)]
    upper, lower = model.part("upper", tc.Mesh(bodies[0])), model.part("lower", tc.Mesh(bodies[1]), fixed=True)
    feet = [tc.Locator(f"A{k}", foot, "z") for k, foot in enumerate([(-8, -8, 8), (8, -8, 8), (0, 8, 8)])]
    sides = [tc.Locator("B1", (-8, 0, 8), "y"), tc.Locator("B2", (8, 0, 8), "y"), tc.Locator("C", (0, 0, 8), "x")]
    model.locate(upper, [*feet, *sides], tolerance=1)
    model.contact("seat", moving=upper.face(), reference=lower.face())
    model.measure("z", upper.point(0, 0, 8), along="z", tolerance=1)
    return model, bodies


def simulated(model, samples):
    return tc.run(model, samples=samples, seed=1, fields="none", surfaces=0)


def radii(run, bodies, part="upper"):
    """The radii of the largest balls that the bodies share in certified realizations."""
    certified = np.flatnonzero(np.isin(run.status, [0, 1]))
    R = run.rotation.sel(state="corrected", part=part).values[certified].reshape(-1, 9)
    t = run.translation.sel(state="corrected", part=part).values[certified]
    return np.array([common_ball(*bodies, X) for X in np.hstack([R, t])])


@pytest.mark.parametrize("start", [-12, *nightly(-10)])
def test_a_ridge_that_ends_below_a_plate_is_in_no_certified_plate(start):
    model, bodies = set_down(PLATE, [(start, 0, 0), *ROOF[1:]])
    depths = radii(simulated(compiled(model, solver="daqp"), 150), bodies)
    assert len(depths) == 150 and np.nanmax(depths) < 1e-6


@pytest.mark.parametrize("at", [(10, 10, 0), (10, 10, 10), (10, 0, 0)], ids=["edge", "corner", "face"])
def test_blocks_that_touch_are_one_closed_body(at):
    """Where they touch, an edge has four triangles, or a corner two fans."""
    both = trimesh.util.concatenate([box(*BOX), box(at, np.add(at, 10))])
    both.merge_vertices()
    touching = solid(both)
    assert touching is not None and len(touching.components) == 2 and len(touching.edges) == 24
    X = np.array([pose((-4, 0, 0)), pose((-3, 0, 0)), pose((12, 12, 2))])  # beside a block, touching it, in another one's place
    cube = solid(box((0, 0, 0), (3, 3, 3)))
    found = Neighbours(cube, touching, INSETS, 1.0).interfere(X)
    assert found.tolist() == [False, False, at == (10, 10, 0)]


@pytest.mark.parametrize("heights", [(2, 1, 1, 0), (4, 2, 4, 0), (3, 1, 2, 4)], ids=["walls", "pinched", "staircase"])
def test_planes_that_oppose_each_other_all_move_inwards(heights):
    """Four blocks of some heights around a corner: walls that face opposite ways share a vertex, or touch along an edge."""
    at, depth, size = [(-3, -3), (0, -3), (0, 0), (-3, 0)], 0.25, 12
    blocks = [box((x, y, -2), (x + 3, y + 3, height)) for (x, y), height in zip(at, heights, strict=True)]
    whole = solid(trimesh.boolean.union(blocks, engine="manifold"))
    shifts = whole.inset(depth).vertices - whole.vertices
    heights_of_corners = (shifts[whole.faces] * whole.normals[:, None]).sum(axis=2)
    np.testing.assert_allclose(heights_of_corners, -depth, rtol=1e-9)
    cells = np.zeros((2 * size, 2 * size, 4 * size), dtype=bool)  # of the width `depth`
    for (x, y), height in zip(at, heights, strict=True):
        i, j, top = (round(length / depth) for length in (x + 3, y + 3, height + 2))
        cells[i : i + size, j : j + size, 8 : 8 + top] = True
    left = scipy.ndimage.binary_erosion(cells, np.ones((3, 3, 3)))
    inner = trimesh.Trimesh(whole.vertices + shifts, whole.faces, process=False)
    assert inner.is_watertight and inner.volume == pytest.approx(left.sum() * depth**3, rel=1e-12)


def test_facets_are_flat_or_known_not_to_be():
    """A union whose smaller surface is not flat any more: its triangles are compared one by one."""
    blocks = [box((0, 0, 0), (4, 4, 4)), box((2, 2, 2), (6, 6, 6)), box((-2, 1, 1), (5, 3, 3))]
    union = trimesh.boolean.union(blocks, engine="manifold")
    rng = np.random.default_rng(3)
    post = box((-0.4, -0.4, -9), (0.4, 0.4, 9))
    for turn in rng.normal(size=(4, 3)):
        X = np.array([pose(shift, turn) for shift in rng.uniform(-3, 7, (200, 3))])
        found = neighbours(post, union, 20.0).interfere(X)
        expected = [any(common_ball(post, block, one) > 1e-3 for block in blocks) for one in X]
        assert (found >= np.array(expected)).all() and found.sum() - np.sum(expected) <= 2
