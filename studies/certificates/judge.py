"""Simulate random assemblies with two solvers, and look for a certified realization that anything else contradicts.

What is looked at is computed from poses and deviations alone, by formulae that share no code with the simulation.
"""

import argparse
import collections
import time
import warnings

import igl
import numpy as np
import trimesh

import tolcontact as tc
from studies.certificates.scenes import scene
from tolcontact.compilation import Program
from tolcontact.discretization import ContactPoints, Nominal, RoundPoints
from tolcontact.discretization.curvature import chord_height
from tolcontact.recomputed import ArchivedPoint
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW, Status

SOLVERS = ("daqp", "qpoases")
LOOKED_AT = 4  # realizations whose surfaces are looked at


def simulate(program: Program, samples: int) -> dict[str, np.ndarray]:
    """All blocks joined."""
    return vars(Block.joined(simulate_blocks(program, samples=samples, seed=7)))


def contradictions(nominal: Nominal, method: tc.Method, run: dict[str, np.ndarray]) -> collections.Counter:
    """What certified realizations are contradicted by, and how many."""
    found: collections.Counter = collections.Counter()
    poses = run["poses"]
    R, t = poses[..., :9].reshape(*poses.shape[:3], 3, 3), poses[..., 9:]
    certified = np.isin(run["status"], [Status.UNTOUCHED, Status.RESOLVED])
    size = max(part.mesh.scale for part in nominal.parts)
    # Rotations, and how far they turned from the raw ones.
    if method.resolution == "exact":
        found["no rotation"] += int((np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max(axis=(1, 2, 3, 4))[certified] > 1e-9).sum())
    cosine = (np.einsum("nspij,nspij->nsp", R[:, [CORRECTED]], R[:, [RAW]])[:, 0] - 1) / 2
    found["turned"] += int((np.arccos(np.clip(cosine, -1, 1)).max(axis=1)[certified] > method.near_turn + 1e-3).sum())
    # Gaps at the contact points, paper (2) to (5).
    for k, pair in enumerate(nominal.pairs):
        x_m = np.einsum("nij,pj->npi", R[:, CORRECTED, pair.moving], pair.P_m) + t[:, None, CORRECTED, pair.moving]
        x_r, n = np.broadcast_to(pair.P_r, x_m.shape), np.broadcast_to(pair.n_r, x_m.shape)
        if pair.reference is not None:
            x_r = np.einsum("nij,pj->npi", R[:, CORRECTED, pair.reference], pair.P_r) + t[:, None, CORRECTED, pair.reference]
            n = np.einsum("nij,pj->npi", R[:, CORRECTED, pair.reference], pair.n_r)
        gap = ((x_m - x_r) * n).sum(axis=2)
        if pair.round:
            turn = R[:, CORRECTED, pair.reference].swapaxes(1, 2)
            apart = np.einsum("nij,nj->ni", turn, t[:, CORRECTED, pair.moving] - t[:, CORRECTED, pair.reference])
            gap = np.stack(
                [point.gaps(turn @ R[:, CORRECTED, pair.moving], apart) for point in as_archived(pair.round)], axis=1
            )
        if pair.is_supports:
            gap = gap - run["deviations"][:, pair.offsets.columns]
        here = certified & ~run["searched"].astype(bool)
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
                if pair.own is not None and pair.reference is not None:
                    inside = depth(nominal, pair, R[row, CORRECTED], t[row, CORRECTED])
                    limit = (
                        0.01 * nominal.assembly.finest()
                        + pair.facets
                        + chord_height(pair.own)
                        + chord_height(pair.surface)
                        + 1e-6 * size
                        + shifted(R[row, CORRECTED], t[row, CORRECTED], pair)
                    )
                    found["penetration of surfaces"] += int(inside > limit)
    return found


def as_archived(points: RoundPoints) -> list[ArchivedPoint]:
    """Contact points of round faces, as what computes gaps another way than the simulation does it."""
    both = points.walls, points.points
    return [ArchivedPoint(*({name: values[k] for name, values in of.items()} for of in both)) for k in range(len(points))]


def shifted(R: np.ndarray, t: np.ndarray, pair: ContactPoints) -> float:
    """How much deeper than contact points, which are where faces overlapped nominally, rims may lie: shift times turn [mm]."""
    m, r = pair.moving, pair.reference
    turn, centre = R[r].T @ R[m], pair.P_m.mean(axis=0)
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    return float(angle * np.linalg.norm(R[r].T @ (R[m] @ centre + t[m] - t[r]) - centre))


def depth(nominal: Nominal, pair: ContactPoints, R: np.ndarray, t: np.ndarray) -> float:
    """How deep points of the moving face lie in the reference body, below its face [mm]."""
    m, r = pair.moving, pair.reference
    points = trimesh.sample.sample_surface(pair.own.mesh, 2000, seed=1)[0]
    points = np.vstack([points, pair.own.mesh.vertices])
    places = (points @ R[m].T + t[m] - t[r]) @ R[r]
    body = nominal.parts[r].body
    V, F = np.array(body.vertices), np.array(body.faces, dtype=np.int64)
    distance, *_ = igl.signed_distance(np.ascontiguousarray(places), V, F)
    return float(max(0.0, -distance.min()))


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--scenes", type=int, default=1000)
    options.add_argument("--samples", type=int, default=500)
    said = options.parse_args()
    warnings.simplefilter("ignore")
    total: collections.Counter = collections.Counter()
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
            round_ = any(pair.own.curvature > 0 for pair in program.nominal.pairs if pair.own is not None)
            run = simulate(program, said.samples // 10 if round_ else said.samples)
            runs[solver] = run
            statuses.update((solver, Status(status).name) for status in run["status"])
            found = contradictions(program.nominal, method, run)
            for what, count in found.items():
                total[what] += count
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


if __name__ == "__main__":
    main()
