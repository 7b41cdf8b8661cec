"""Two parts at random poses, whose faces are measured; and models with measurements of faces."""

import functools

import numpy as np
import trimesh
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import compiled
from tolcontact import poses

PLANE, ROUND = tc.Box(40, 30, 10), tc.select.Cylinder()
N = 50


def shaft(radius=3.0, length=30.0):
    return tc.Mesh(trimesh.creation.cylinder(radius, length, sections=48))


def ring(hole=3.2, outer=9.0, height=12.0):
    return tc.Mesh(trimesh.creation.annulus(hole, outer, height, sections=48))


def hole(part, radius=3.2):
    return part.face(tc.select.Cylinder(inner=True, radius=radius))


def two(first, second, *, at=(0, 0, 0), rotation=(0, 0, 0), first_at=(5, -3, 7), first_rotation=(0.3, -0.2, 0.5)):
    """Two parts that nothing locates; `at` and `rotation` of the second are in the frame of the first."""
    assembly = tc.Assembly("two")
    R = Rotation.from_rotvec(first_rotation)
    turned = (R * Rotation.from_rotvec(rotation)).as_rotvec()
    return (
        assembly,
        assembly.part("first", first, at=first_at, rotation=first_rotation, fixed=True),
        assembly.part("second", second, at=R.apply(at) + first_at, rotation=turned, fixed=True),
    )


def motions(count=N, turn=0.05, shift=0.5, seed=1):
    """Motions R (n, part, 3, 3), t (n, part, 3) of two parts."""
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(rng.normal(0, turn, (2 * count, 3))).as_matrix().reshape(count, 2, 3, 3)
    return R, rng.normal(0, shift, (count, 2, 3))


@functools.lru_cache(maxsize=4)
def program_of(assembly, names):  # names of the measures: an assembly gets more of them
    return compiled(assembly, solver="daqp")


def observed(assembly, R, t):
    """Measures (n, measure) at poses, without deviations."""
    program = program_of(assembly, tuple(measure.name for measure in assembly.measures))
    X = poses.pose(R, t).reshape(len(R), -1)
    return program.observe(poses=X, deviations=np.zeros((len(X), len(program.nominal.contributors))))["measured"]


def placed(part, R, t, points, *, is_direction=False):
    """Points (k, 3) or directions of a part's own frame, at poses R (n, 3, 3), t (n, 3): (n, k, 3)."""
    own = Rotation.from_rotvec(part.rotation).as_matrix()
    nominal = np.atleast_2d(points) @ own.T + (0 if is_direction else np.array(part.at))
    return nominal @ R.swapaxes(1, 2) + (0 if is_direction else t[:, None])


def axis_of(part, R, t, length):
    ends = placed(part, R, t, [[0, 0, -length / 2], [0, 0, length / 2]])
    return ends[:, 0], ends[:, 1]


def segments_apart(first, second):
    """The shortest distance (n,) of segments, as a bounded least-squares problem."""
    apart = []
    for a, b, c, d in zip(*first, *second, strict=True):
        nearest = lsq_linear(np.column_stack([b - a, c - d]), c - a, bounds=(0, 1), tol=1e-14)
        apart.append(np.sqrt(2 * nearest.cost))
    return np.array(apart)


def moved_together(R, t, seed=7):
    """The same poses after one motion of everything in each realization."""
    rng = np.random.default_rng(seed)
    Q = Rotation.random(len(R), rng).as_matrix()[:, None]
    return Q @ R, (Q @ t[..., None])[..., 0] + rng.normal(0, 100, (len(R), 1, 3))


def check_invariance(assembly, R, t, tolerance=1e-9):
    np.testing.assert_allclose(observed(assembly, *moved_together(R, t)), observed(assembly, R, t), atol=tolerance)


def drilled():
    """A plate with two holes that its drawing tolerances, and a lid on it that is located by them."""
    model = tc.Assembly("plate")
    rings = [model.part(name, ring(), at=at) for name, at in (("left", (0, 0, 0)), ("right", (30, 0, 0)))]
    for part in rings:
        lower = part.feature("A", part.face("-z"), datum="A")
        rim = part.feature("B", part.face(tc.select.Cylinder(radius=9.0)), datum="B")
        part.feature("H", hole(part), tc.Size(6.4, 0.1), tc.Position(0.2, "A|B"))
        part.feature("top", part.face("+z"), tc.Profile(0.3, "A"))
        scheme = [tc.Locator(f"A{k}", (x, y, -6), "z", 0.1) for k, (x, y) in enumerate([(8, 0), (-8, 0), (0, 8)])]
        scheme += [tc.Locator(f"B{k}", (x, 0, -6), "y", 0.1) for k, x in enumerate((8, -8))] + [
            tc.Locator("C", (0, 0, -6), "x", 0.1)
        ]
        model.locate(part, scheme)
        assert lower.datum and rim.datum
    return model, *rings


def seated(**options):
    """A block on a table with a clearance that contact keeps."""
    model = tc.Assembly("seated", **options)
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=1)
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    model.measure("clearance", tc.Clearance(block.face("-z"), table.face("+z")), limits=(0, None))
    seam = tc.stations(block.point(50, 0, 0), block.point(50, 25, 0), 3)
    gaps = [model.measure(f"gap {k}", tc.Gap(point, table.face("+z"))) for k, point in enumerate(seam)]
    model.measure("least", tc.Minimum(*gaps, "clearance"))
    model.measure("turn", tc.Angle(block.face("-z"), table.face("+z"), about="y"), tolerance=0.05)
    model.measure("tilt", tc.Angle(block.face("-z"), table.face("+z")))
    return model
