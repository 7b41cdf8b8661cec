"""Set random bodies down on each other, and judge every certified realization by an exact distance of polyhedra.

Bodies are convex, or unions of convex pieces that overlap. The judge is the separating-axis theorem: the signed distance of two
convex polyhedra is the largest gap between their shadows along a facet's normal, or along the common normal of two edges. It
shares no code with the simulation.
"""

import argparse
import collections
import itertools
import sys
import time

import numpy as np
import trimesh
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tolcontact.vocabulary import CORRECTED, RAW, Status

METHOD = tc.Method(resolution="exact", search="bounded", objective="all points")
RANGE = 0.5  # mm, of every locator: the smallest tolerance range
ALLOWED = RANGE / 2000
TOUCHING = 1e-7  # mm
ON_FACET = 1e-9
COUNTED = 100  # scenes, after which the counts are printed


class Convex:
    """A convex polyhedron: corners (v, 3), facet normals (f, 3), directions of edges (e, 3)."""

    def __init__(self, points):
        hull = ConvexHull(points)
        self.corners, self.normals = points[hull.vertices], distinct(hull.equations[:, :3])
        heights = points[hull.vertices] @ hull.equations[:, :3].T + hull.equations[:, 3]
        of_facet = np.abs(heights) < ON_FACET * np.ptp(points)  # (v, triangle)
        ends = {tuple(sorted(pair)) for triangle in hull.simplices for pair in itertools.combinations(triangle.tolist(), 2)}
        number = {vertex: k for k, vertex in enumerate(hull.vertices.tolist())}
        edges = []
        for a, b in ends:
            beside = of_facet[number[a]] & of_facet[number[b]]
            if len(distinct(hull.equations[beside, :3])) > 1:  # not a diagonal of one facet
                edges.append(points[a] - points[b])
        directions = np.array(edges) / np.linalg.norm(edges, axis=1)[:, None]
        self.directions = distinct(directions * np.sign(directions @ [1.0, 1e-3, 1e-6])[:, None])


def distinct(directions):
    """Return unit vectors (d, 3), each once."""
    return directions[np.unique(np.round(directions, 9), axis=0, return_index=True)[1]]


def separation(moving, reference, R, t):
    """Return the signed distance [mm] of a convex body, moved by R (3, 3) and t (3,), from another one."""
    across = np.cross((moving.directions @ R.T)[:, None], reference.directions[None]).reshape(-1, 3)
    length = np.linalg.norm(across, axis=1)
    across = across[length > ON_FACET] / length[length > ON_FACET, None]
    axes = np.concatenate([reference.normals, -moving.normals @ R.T, across, -across])
    corners = moving.corners @ R.T + t
    return float(((corners @ axes.T).min(axis=0) - (reference.corners @ axes.T).max(axis=0)).max())


def piece(rng, faces_up):
    """Return the points (point, 3) of a random convex piece whose top, or else whose underside, is at height 0."""
    width, depth = rng.uniform(3, 9, 2), 5.0
    corners = [(x, y, -depth) for x in (-width[0], width[0]) for y in (-width[1], width[1])]
    tops = {
        "rubble": lambda: rng.normal(size=(12, 3)) * (*width, 4),
        "box": lambda: corners + [(x, y, depth) for x, y, _ in corners],
        "pyramid": lambda: [*corners, (*rng.uniform(-1, 1, 2), depth)],
        "roof": lambda: [*corners, (-width[0], 0, depth), (width[0], 0, depth)],
        "chamfered": lambda: corners + [(s * x, s * y, z) for x, y, _ in corners for s, z in ((1, depth - 1), (0.8, depth))],
    }
    points = np.array(tops[str(rng.choice(sorted(tops)))](), dtype=float)
    points = points @ Rotation.from_rotvec([0, 0, rng.uniform(0, 2 * np.pi)]).as_matrix().T
    points[:, 2] -= points[:, 2].max()
    return points if faces_up else points * [1, 1, -1]


def body(rng, faces_up, is_convex):
    """Return the pieces (point, 3) of a random body, and its mesh."""
    pieces = []
    for _ in range(1 if is_convex else int(rng.integers(2, 4))):
        place = np.zeros(3) if is_convex else np.array([*rng.uniform(-9, 9, 2), (-1 if faces_up else 1) * rng.uniform(0, 0.3)])
        pieces.append(piece(rng, faces_up) + place)
    return pieces, trimesh.util.concatenate([trimesh.convex.convex_hull(points) for points in pieces])


def located(assembly, part, on=None):
    """Locate a part by six locators with the same range."""
    feet = (((-9, -9, 0), "z"), ((9, -9, 0), "z"), ((0, 9, 0), "z"), ((-9, 0, 0), "y"), ((9, 0, 0), "y"), ((0, 0, 0), "x"))
    assembly.locate(part, [tc.Locator(f"L{k}", p, along, RANGE) for k, (p, along) in enumerate(feet)], on=on)


def scene(seed, whole=False):
    """Return an assembly of two or three random bodies, whose faces, or whole surfaces, may touch; and the pieces of each."""
    rng = np.random.default_rng(seed)
    is_convex, count = seed % 2 == 0, 3 if seed % 5 == 0 else 2
    assembly = tc.Assembly(f"scene {seed}", method=METHOD)
    base_pieces, base_mesh = body(rng, True, is_convex)
    base, bodies = assembly.part("base", tc.Mesh(base_mesh), fixed=True), [base_pieces]
    for k in range(1, count):  # the third body stands beside the second one, on the same base
        pieces, mesh = body(rng, False, is_convex)
        shift = np.array([0.0, 0.0, 0.0]) if k == 1 else np.array([6.0, -5.0, 0.0])
        part = assembly.part(f"body {k}", tc.Mesh(mesh), at=tuple(shift))
        located(assembly, part)
        down, up = () if whole else (lambda c, n: n[:, 2] < -0.05,), () if whole else (lambda c, n: n[:, 2] > 0.05,)
        assembly.contact(f"joint {k}", moving=part.face(*down), reference=base.face(*up), within=50)
        assembly.measure(f"height {k}", part.point(0, 0, 0), along="z", tolerance=1)
        bodies.append([points + shift for points in pieces])
    return assembly, bodies


def judged(assembly, bodies, samples, seed, solver):
    """Return the numbers of realizations that are certified and that are wrong, by the fault; and the deepest penetration."""
    run = tc.run(assembly, samples=samples, seed=seed, solver=solver, fields="none", surfaces=0)
    R, t, status = run.rotation.values, run.translation.values, run.status.values
    counts, deepest = collections.Counter(realizations=samples), 0.0
    convex = [[Convex(points) for points in pieces] for pieces in bodies]
    for k in range(samples):
        distances = {
            state: min(
                separation(a, b, R[k, state, 0].T @ R[k, state, m], R[k, state, 0].T @ (t[k, state, m] - t[k, state, 0]))
                for m in range(1, len(bodies)) for a in convex[m] for b in convex[0]
            )
            for state in (RAW, CORRECTED)
        }  # fmt: skip
        is_certified = status[k] in (Status.UNTOUCHED, Status.RESOLVED)
        counts["certified"] += is_certified
        counts["false contact"] += bool(status[k] != Status.UNTOUCHED and distances[RAW] > TOUCHING)
        counts["missed contact"] += bool(status[k] == Status.UNTOUCHED and distances[RAW] < -ALLOWED)
        counts["lifted off"] += bool(status[k] == Status.RESOLVED and distances[CORRECTED] > ALLOWED)
        counts["inside"] += bool(is_certified and distances[CORRECTED] < -ALLOWED)
        if is_certified:
            deepest = max(deepest, -distances[CORRECTED])
    return counts, deepest


def main():
    """Judge scenes; return 1 if a certificate is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--samples", type=int, default=10)
    parser.add_argument("--solver", default="daqp")
    parser.add_argument("--whole", action="store_true", help="whole surfaces may touch")
    options = parser.parse_args()
    total: collections.Counter = collections.Counter()
    deepest, refused, start = 0.0, 0, time.perf_counter()
    for seed in range(options.first, options.first + options.scenes):
        assembly, bodies = scene(seed, options.whole)
        try:
            counts, depth = judged(assembly, bodies, options.samples, seed, options.solver)
        except tc.ModelError as error:
            refused += 1
            print(f"scene {seed} is refused: {str(error).splitlines()[-1][:100]}")
            continue
        total, deepest = total + counts, max(deepest, depth)
        wrong = {name: n for name, n in counts.items() if n and name not in ("realizations", "certified")}
        if wrong or counts["certified"] < options.samples:
            print(f"scene {seed}: {counts['certified']} of {options.samples} certified", wrong, flush=True)
        if seed % COUNTED == COUNTED - 1:
            print(f"up to scene {seed}: {dict(total)}, deepest {deepest:.2g} mm", flush=True)
    print(dict(total), f"refused scenes: {refused}, deepest {deepest:.2g} mm, {time.perf_counter() - start:.0f} s")
    return int(any(total[name] for name in ("false contact", "missed contact", "lifted off", "inside")))


if __name__ == "__main__":
    sys.exit(main())
