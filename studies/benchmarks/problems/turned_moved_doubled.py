"""Three plates in another frame, twice as large, and declared in reverse."""

import numpy as np
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
PLATES = (("bottom", 0, 60, 40), ("middle", 10, 50, 40), ("upper", 20, 30, 30))  # name, height, length, width


def solution():
    return 0.0, 0.0, 0.0


def check():
    corners = np.array([(x, y, z) for _, z, length, width in PLATES for x in (0, length) for y in (0, width)], dtype=float)

    def distances(points):
        return np.linalg.norm(points[:, None] - points, axis=2)

    moved = Rotation.from_rotvec((N.rx, N.ry, N.rz)).apply(corners) + np.array([N.dx, N.dy, N.dz])
    others = distances(moved), distances(2 * corners) / 2, distances(corners[::-1])[::-1, ::-1]
    return [np.round(np.abs(other - distances(corners)).max(), 9) for other in others]


def assembly(turn=(0, 0, 0), shift=(0, 0, 0), scale=1.0, reverse=False):
    model = tc.Assembly("plates", method=tc.Method(resolution="exact", objective="all points"))
    frame = Rotation.from_rotvec(turn)
    made = {}
    for name, z, length, width in PLATES[::-1] if reverse else PLATES:
        at = frame.apply((0, 0, scale * z)) + shift
        shape = tc.Box(scale * length, scale * width, scale * 10)
        made[name] = model.part(name, shape, at=at, rotation=turn, fixed=name == "bottom")
    for part in made.values():
        scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=4 * scale)
        model.locate(part, scheme, tolerance=scale * N.t)
    pairs = [("middle", "bottom"), ("upper", "middle")]
    for moving, reference in pairs[::-1] if reverse else pairs:
        model.contact(f"{moving} joint", moving=made[moving].face("-z"), reference=made[reference].face("+z"), points=60)
    up = frame.apply((0, 0, 1))
    model.measure("top", made["upper"].point(15 * scale, 15 * scale, 10 * scale), along=up)
    return model


def answers():
    def heights(**change):
        return an.values(an.simulated(assembly(**change), 200, solver="qpoases"), "top")

    still = heights()
    motion = {"turn": (N.rx, N.ry, N.rz), "shift": (N.dx, N.dy, N.dz)}
    others = heights(**motion), heights(scale=2.0) / 2, heights(reverse=True)
    return an.Answers([an.within(np.abs(other - still).max(), 1e-8) for other in others], 4 * len(still))
