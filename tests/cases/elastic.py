"""Elastic bodies with stiffness known in closed form, as files of matrices, and models of them."""

import itertools
from functools import cache

import numpy as np

import tolcontact as tc

STIFF = 1e7  # of the softest deformation: all deformations that are not stated


def rigid_motions(nodes):
    """Three translations and three rotations of nodes (node, 3), orthonormal columns (3 node, 6)."""
    arms = nodes - nodes.mean(axis=0)
    turns = [np.cross(axis, arms).ravel() for axis in np.eye(3)]
    moves = [np.tile(axis, len(nodes)) for axis in np.eye(3)]
    return np.linalg.qr(np.column_stack([*moves, *turns]))[0]


def stiffness(nodes, functionals, springs, stiff=None):
    """K (3 node, 3 node) of a body that is soft against `functionals` (deformation, 3 node) only: energy 1/2 f'Sf.

    springs   S (deformation,) or (deformation, deformation); stiff: the stiffness of all other deformations
    """
    Q, F, S = rigid_motions(nodes), np.atleast_2d(functionals), np.atleast_2d(springs)
    S = np.diag(S[0]) if S.shape[0] == 1 else S
    assert np.abs(F @ Q).max() < 1e-9 * np.abs(F).max()  # rigid motions deform nothing
    own = np.linalg.qr(F.T)[0]
    rest = np.eye(len(Q)) - Q @ Q.T - own @ own.T
    soft = F.T @ S @ F
    return soft + (STIFF * np.abs(soft).max() if stiff is None else stiff) * rest


def saved(folder, name, nodes, K):
    """The keywords of part.elastic for a matrix that is written into a folder."""
    path = folder / f"{name}.npz"
    np.savez(path, K=K, nodes=nodes)
    return {"stiffness": path, "nodes": path}


def lifts(nodes, *weighted):
    """A functional (3 node,) of heights: sums weights of (weight, x, y) at nodes."""
    f = np.zeros((len(nodes), 3))
    for weight, x, y in weighted:
        at = np.flatnonzero((np.abs(nodes[:, :2] - (x, y)) < 1e-9).all(axis=1))
        f[at, 2] += weight / len(at)
    return f.ravel()


def beam(length, width, stations):
    """Nodes (node, 3) of a flat beam at `stations` along x on both edges, and the second differences of its heights."""
    nodes = np.array([(x, y, 0.0) for x in stations for y in (0.0, width)])
    middle = [np.array([lifts(nodes, (0.5, x, 0.0), (0.5, x, width))]) for x in stations]
    heights = np.concatenate(middle)
    return nodes, heights[:-2] - 2 * heights[1:-1] + heights[2:]


SHEETS = {"front": (0.0, 1.0), "rear": (250.0, 1.5)}  # of 300 x 200 mm: place along x, and thickness [mm]
FLANGE = [(x, y) for x in (250.0, 275.0, 300.0) for y in (0.0, 50.0, 100.0, 150.0, 200.0)]
WELDED = [(250.0, 0.0), (300.0, 50.0), (250.0, 100.0), (300.0, 150.0), (250.0, 200.0)]
PLACED = {
    "front": [(0, 0, "z"), (0, 200, "z"), (225, 200, "z"), (225, 0, "z"), (0, 0, "y"), (225, 0, "y"), (0, 100, "x")],
    "rear": [(550, 0, "z"), (550, 200, "z"), (325, 200, "z"), (325, 0, "z"), (325, 0, "y"), (550, 0, "y"), (550, 100, "-x")],
}  # n-2-1: x, y in the assembly, and the direction
FREE = [
    ("front", 0, 0, "z"),
    ("front", 0, 200, "z"),
    ("rear", 550, 100, "z"),
    *(("front", *PLACED["front"][k]) for k in (4, 5, 6)),
]


@cache
def sheet_mesh(thickness, cells=(12, 8)):
    """Nodes (node, 3) and K (3 node, 3 node) of a steel sheet of 300 x 200 mm, of bricks with incompatible modes."""
    return bricks((300.0, 200.0, thickness), (*cells, 1), 210e3, 0.3)


def bricks(size, cells, young, poisson):
    """Nodes and stiffness of a block of bricks with nine incompatible modes (Wilson, Taylor), which bend without locking."""
    edges = np.array(size) / cells
    counts = [cell + 1 for cell in cells]
    axes = [np.linspace(0, length, count) for length, count in zip(size, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame

    def strains(slopes):
        B = np.zeros((6, 3 * len(slopes)))
        for k, (x, y, z) in enumerate(slopes):
            B[:, 3 * k : 3 * k + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [0, z, y], [z, 0, x], [y, x, 0]]
        return B

    block = np.zeros((33, 33))  # 24 nodal freedoms, nine internal ones
    for point in itertools.product((-(3**-0.5), 3**-0.5), repeat=3):
        f = 1 + corners * point
        shapes = np.stack([corners[:, k] * f[:, (k + 1) % 3] * f[:, (k + 2) % 3] for k in range(3)], 1) / 8
        B = np.hstack([strains(shapes * 2 / edges), strains(np.diag(-2.0 * np.array(point)) * 2 / edges)])
        block += B.T @ law @ B * edges.prod() / 8
    element = block[:24, :24] - block[:24, 24:] @ np.linalg.solve(block[24:, 24:], block[24:, :24])
    indices, K = np.arange(len(nodes)).reshape(counts), np.zeros((3 * len(nodes),) * 2)
    for offset in itertools.product(*map(range, cells)):
        own = (3 * indices[tuple((((corners + 1) / 2).astype(int) + offset).T)][:, None] + np.arange(3)).ravel()
        K[np.ix_(own, own)] += element
    return nodes, K


def condensed(nodes, K, kept):
    """The nodes (k, 3) nearest to points, each once, and K condensed to them."""
    chosen = np.unique([((nodes - point) ** 2).sum(axis=1).argmin() for point in np.array(kept, dtype=float)])
    own = (3 * chosen[:, None] + np.arange(3)).ravel()
    others = np.setdiff1d(np.arange(len(K)), own)
    S = K[np.ix_(own, own)] - K[np.ix_(own, others)] @ np.linalg.solve(K[np.ix_(others, others)], K[np.ix_(others, own)])
    return nodes[chosen], (S + S.T) / 2


def welded_sheets(folder, *, tolerance=0.05, contact=True, measured=((150, 100), (550, 200))):
    """Two flanged sheets, each on seven locators, welded at five points and released on six."""
    model, parts = tc.Assembly("welded sheets"), {}
    for name, (x0, thickness) in SHEETS.items():
        top = thickness if name == "front" else 0.0  # the face of the flange
        points = [(x - x0, y, 0.0) for x, y, _ in PLACED[name]] + [(x - x0, y, top) for x, y in FLANGE]
        points += [(x - x0, y, 0.0) for part, x, y, _ in FREE if part == name]
        points += [(x - x0, y, 0.0) for x, y in measured if x0 <= x <= x0 + 300]
        parts[name] = model.part(name, tc.Box(300, 200, thickness), at=(x0, 0, float(x0 > 0)))
        parts[name].elastic(**saved(folder, name, *condensed(*sheet_mesh(thickness), points)))
    front, rear = parts.values()

    def locator(k, name, x, y, direction):
        return tc.Locator(f"L{k}", parts[name].point(x - SHEETS[name][0], y, 0), direction)

    weld = model.station("weld")
    for name, part in parts.items():
        weld.locate(part, [locator(k, name, *place) for k, place in enumerate(PLACED[name])], tolerance=tolerance)
    rail = weld.join("rail", front, rear, at=[front.point(x, y, 1) for x, y in WELDED])
    check = model.station("check")
    check.locate(rail, [locator(k, *place) for k, place in enumerate(FREE)], tolerance=0)
    for station in (weld, check) if contact else ():
        station.contact(f"flange in {station.name}", moving=rear.face("-z"), reference=front.face("+z"), within=0.5)
    for station in (weld, check):
        for k, (x, y) in enumerate(measured):
            name = "front" if x < 300 else "rear"
            place = parts[name].point(x - SHEETS[name][0], y, 0)
            station.measure(f"{station.name} {k}", place, along="z", tolerance=1)
    return model
