"""Simulate random assemblies with two solvers, and look for a certified realization that anything else contradicts.

What is looked at is computed from poses and deviations alone, by formulae that share no code with the simulation.
"""

import argparse
import collections
import sys
import time
import warnings

import igl
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.scenes import scene
from tolcontact.compilation import Program
from tolcontact.contact.acceptance import MAX_TURN
from tolcontact.discretization import ContactPoints, Nominal, RoundContact, RoundPoints
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.testing.referee import ArchivedPoint
from tolcontact.vocabulary import CORRECTED, RAW, Status

SOLVERS = ("daqp", "qpoases")
LOOKED_AT = 4  # realizations whose surfaces are looked at


def simulate(program: Program, samples: int) -> dict[str, np.ndarray]:
    """All blocks joined."""
    return vars(Block.joined(simulate_blocks(program, samples=samples, seed=7)))


def contradictions(program: tc.Program, run: dict[str, np.ndarray]) -> collections.Counter:
    """Count the certified realizations that are contradicted, by the reason.

    Gaps at contact points are those of pairs whose points are fixed; `ends.py` judges the others.
    """
    nominal, method = program.nominal, program.method
    found: collections.Counter = collections.Counter()
    poses = run["poses"]
    R, t = poses[..., :9].reshape(*poses.shape[:3], 3, 3), poses[..., 9:]
    certified = np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED])
    size = max(part.mesh.scale for part in nominal.parts)
    # Rotations, and how far they turned from the raw ones.
    if method.resolution == "exact":
        found["no rotation"] += int((np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max(axis=(1, 2, 3, 4))[certified] > 1e-9).sum())
    cosine = (np.einsum("nspij,nspij->nsp", R[:, [CORRECTED]], R[:, [RAW]])[:, 0] - 1) / 2
    found["turned"] += int((np.arccos(np.clip(cosine, -1, 1)).max(axis=1)[certified] > MAX_TURN + 1e-3).sum())
    # Gaps at the contact points, paper (2) to (5).
    for k, pair in enumerate(nominal.pairs):
        (R_m, t_m, h_m), (R_r, t_r, h_r) = faces(pair, R[:, CORRECTED], t[:, CORRECTED], run["deviations"])
        x_m = np.einsum("nij,pj->npi", R_m, pair.P_m) + t_m[:, None]
        x_r = np.einsum("nij,pj->npi", R_r, pair.P_r) + t_r[:, None]
        n = np.einsum("nij,pj->npi", R_r, pair.n_r)
        gap = ((x_m - x_r) * n).sum(axis=2) - h_m[:, None] * pair.facing - h_r[:, None]
        if isinstance(pair, RoundContact):
            turn = R_r.swapaxes(1, 2)
            apart = np.einsum("nij,nj->ni", turn, t_m - t_r)
            gap = np.stack([point.gaps(turn @ R_m, apart, h_m, h_r) for point in as_archived(pair.round)], axis=1)
        if pair.is_supports:
            gap = gap - run["deviations"] @ heights(pair, run["deviations"].shape[1])
        here = certified & ~run["searched"].astype(bool) & (k not in program.meetings)
        found["archived gap"] += int(
            (np.abs(gap.min(axis=1) - run["gap_min"][:, CORRECTED, k])[here] > 1e-9 * size + 1e-9).sum()
        )
        if method.resolution == "exact":
            found["penetration at points"] += int((gap.min(axis=1)[here] < -1e-7 - 1e-12 * size).sum())
    # The surfaces themselves: points of the moving face in the other body.
    if method.resolution == "exact":
        rng = np.random.default_rng(0)
        rows = np.flatnonzero(certified & (run["carrying"].sum(axis=1) > 0))
        for row in rng.permutation(rows)[:LOOKED_AT]:
            for pair in nominal.pairs:
                if pair.moving_face is not None and pair.reference_face is not None:
                    sides = faces(pair, R[[row], CORRECTED], t[[row], CORRECTED], run["deviations"][[row]])
                    inside = depth(nominal, pair, sides)
                    limit = (
                        0.01 * nominal.assembly.smallest_zone()
                        + pair.facets
                        + pair.moving_face.chord_height
                        + pair.reference_face.chord_height
                        + 1e-6 * size
                        + shifted(sides, pair)
                    )
                    found["penetration of surfaces"] += int(inside > limit)
    return found


Sides = tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]  # R, t and height of the moving and the reference face


def faces(pair: ContactPoints, R: np.ndarray, t: np.ndarray, deviations: np.ndarray) -> Sides:
    """Where the two faces of a pair are (n, 3, 3), (n, 3), and how much farther out (n,), in parts at R, t (n, part, ...)."""
    found = []
    for part, face in zip((pair.moving, pair.reference), pair.deviating, strict=True):
        R_p = np.broadcast_to(np.eye(3), (len(R), 3, 3)) if part is None else R[:, part]
        t_p = np.zeros((len(R), 3)) if part is None else t[:, part]
        height = np.zeros(len(R))
        if face is not None:
            own = deviations[:, face.columns]
            moved = own @ face.twist.T
            turn = Rotation.from_rotvec(moved[:, 3:]).as_matrix()
            t_p = np.einsum("nij,nj->ni", R_p, moved[:, :3] + face.centre - turn @ face.centre) + t_p
            R_p, height = R_p @ turn, own @ face.height
        found.append((R_p, t_p, height))
    return tuple(found)


def heights(pair: ContactPoints, contributors: int) -> np.ndarray:
    """Return the heights of supports for deviations of 1 (contributor, point)."""
    found = np.zeros((contributors, len(pair.P_m)))
    found[pair.offsets.columns] = pair.offsets.matrix
    return found


def as_archived(points: RoundPoints) -> list[ArchivedPoint]:
    """Contact points of round faces, as what computes gaps another way than the simulation does it."""
    both = points.walls, points.points
    return [ArchivedPoint(*({name: values[k] for name, values in of.items()} for of in both)) for k in range(len(points))]


def shifted(sides: Sides, pair: ContactPoints) -> float:
    """How much deeper than contact points, which are where faces overlapped nominally, rims may lie: shift times turn [mm]."""
    (R_m, t_m, _), (R_r, t_r, _) = ((each[0] for each in side) for side in sides)
    turn, centre = R_r.T @ R_m, pair.P_m.mean(axis=0)
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    return float(angle * np.linalg.norm(R_r.T @ (R_m @ centre + t_m - t_r) - centre))


def depth(nominal: Nominal, pair: ContactPoints, sides: Sides) -> float:
    """How deep points of the moving face, as it has grown, lie in the reference body, below its face [mm]."""
    face, r = pair.moving_face, pair.reference
    assert face is not None and r is not None
    (R_m, t_m, h_m), (R_r, t_r, h_r) = sides
    points = trimesh.sample.sample_surface(face.mesh, 2000, seed=1)[0]
    points = np.vstack([points, face.mesh.vertices])
    triangle, nearest = face.nearest(points)
    points = points + (h_m[0] + h_r[0]) * face.normals(triangle, nearest)
    places = (points @ R_m[0].T + t_m[0] - t_r[0]) @ R_r[0]
    body = nominal.parts[r].body
    V, F = np.array(body.vertices), np.array(body.faces, dtype=np.int64)
    distance, *_ = igl.signed_distance(np.ascontiguousarray(places), V, F)
    return float(max(0.0, -distance.min()))


def main() -> int:
    """Judge scenes; return 1 if a certificate is contradicted."""
    options = argparse.ArgumentParser()
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--scenes", type=int, default=1000)
    options.add_argument("--samples", type=int, default=500)
    said = options.parse_args()
    warnings.simplefilter("ignore")
    total: collections.Counter = collections.Counter()
    contradicted = 0
    statuses: collections.Counter = collections.Counter()
    begin = time.perf_counter()
    for seed in range(said.first, said.first + said.scenes):
        runs = {}
        for solver in SOLVERS:
            assembly, method = scene(seed)
            try:
                program = tc.build(assembly, solver=solver, method=method)
            except tc.TolcontactError:
                total["refused"] += 1
                break
            round_ = any(pair.moving_face.curvature > 0 for pair in program.nominal.pairs if pair.moving_face is not None)
            run = simulate(program, said.samples // 10 if round_ else said.samples)
            runs[solver] = run
            statuses.update((solver, Status(status).name) for status in run["status"])
            found = contradictions(program, run)
            for what, count in found.items():
                total[what] += count
                contradicted += count
                if count:
                    print(f"scene {seed} {solver} {method.resolution} {method.objective}: {what} in {count}", flush=True)
        if len(runs) == len(SOLVERS):
            one, other = (runs[solver] for solver in SOLVERS)
            both = np.isin(one["status"], [0, 1]) & np.isin(other["status"], [0, 1])
            size = max(part.mesh.scale for part in program.nominal.parts)
            apart = np.abs(one["measured"] - other["measured"])[both].max(axis=(1, 2), initial=0) > 1e-5 * size
            total["compared"] += int(both.sum())
            total["solvers apart"] += int(apart.sum())
            total["other status"] += int((one["status"] != other["status"]).sum())
            if apart.any() or (one["status"] != other["status"]).any():
                rows = np.flatnonzero(one["status"] != other["status"])
                print(
                    f"scene {seed} {method.resolution} {method.objective}: {apart.sum()} apart, {len(rows)} other statuses "
                    f"{collections.Counter(zip(one['status'][rows].tolist(), other['status'][rows].tolist(), strict=True))}",
                    flush=True,
                )
    print(dict(total))
    print({f"{solver} {status}": count for (solver, status), count in sorted(statuses.items())})
    print(f"{sum(statuses.values())} realizations in {time.perf_counter() - begin:.0f} s")
    return int(contradicted > 0)


if __name__ == "__main__":
    sys.exit(main())
