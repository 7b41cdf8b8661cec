"""Look for better poses than resolved ones, which would show that contact was not resolved with the least motion.

For each resolved realization, an interior-point solver looks for poses with a smaller objective (least_poses.py). One search
starts at the resolved pose, others at random ones. Of deviating faces it takes from the simulation how far corners move along
normals.
"""

import argparse
import collections
import json
import sys
import time
import warnings
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates import deviating, ends, placements
from studies.certificates.coincidences import leaves_rotations_free, quick_builds
from studies.certificates.least_poses import ACTIVE, ALL, FEASIBLE, SEATING, STIFF, Poses, Scene, Search, counted, split
from studies.certificates.pieces import convex_pieces
from studies.certificates.polyhedra import Polyhedron
from tests.cases import frames
from tolcontact.vocabulary import CORRECTED, RAW, Status

BETTER = 1e-3  # share of the objective
# Shares of the tolerance range
LEAST = 2e-4  # displacement that counts as none
NEAR = 0.1  # between two poses, at any corner of a body
ALLOWED = 5e-4  # penetration that is not contradicted by a certificate
SPREAD = 0.05, 1.0  # rad and ranges of random starts
MODELS = ("cells", "channel", "ra1", "tower", "ra2")
NO_BETTER = "none better"
TOUCHING = 1e-6  # mm


def ends_scene(seed: int, whole: bool = False) -> Scene:
    """Return a scene of `ends.py`."""
    assembly, bodies = ends.scene(seed, whole)
    return case_scene(assembly, bodies)


def case_scene(assembly: tc.Assembly, bodies: list[list[np.ndarray]], range_: float = ends.RANGE) -> Scene:
    """Return a scene whose first body is fixed, and may be touched by each of the others."""
    return Scene(
        assembly, [[Polyhedron(points) for points in body] for body in bodies], [(k, 0) for k in range(1, len(bodies))], range_
    )


def placed_scene(seed: int, objective: str) -> Scene:
    """Return a scene of `coincidences.py`: integer corners, free bodies on free bodies, whole surfaces, and any frame."""
    families = list(placements.FAMILIES)
    scene = placements.scene(seed, families[seed % len(families)], objective)
    return Scene(scene.assembly, scene.bodies, list(scene.pairs), min(scene.ranges))


def deviating_scene(seed: int, **options: bool) -> Scene:
    """Return a scene of `deviating.py`."""
    assembly, bodies = deviating.scene(seed, **options)
    return case_scene(assembly, [[corners] for corners in bodies], assembly.smallest_zone())._replace(deviates=True)


def model_scene(name: str) -> Scene:
    """Return a model whose faces do not deviate."""
    assembly = frames.model(name)
    nominal = tc.build(assembly, solver="daqp", method=tc.Method()).nominal
    sides = {(nominal.part_index(pair.moving.part), nominal.part_index(pair.reference.part)) for pair in assembly.pairs}
    meshes = [part.mesh.copy().apply_transform(homogeneous(*part.placement)) for part in nominal.parts]
    return Scene(assembly, [convex_pieces(mesh) for mesh in meshes], sorted(sides), assembly.smallest_zone())


def homogeneous(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the matrix (4, 4) of a rigid motion."""
    return np.block([[R, t[:, None]], [np.zeros(3), 1.0]])


def judged(scene: Scene, *, samples: int, seed: int, objective: str = ALL, solver: str = "daqp", starts: int = 4) -> list[dict]:
    """Return what was found for each certified realization: its kind, and of resolved ones objectives and the way there."""
    program = tc.build(scene.assembly, solver=solver, method=tc.Method(objective=objective))
    if leaves_rotations_free(program):
        objective = STIFF
        program = tc.build(scene.assembly, solver=solver, method=tc.Method(objective=objective))
    run = tc.run(program, samples=samples, seed=seed, fields="none", surfaces=0)
    R, t, status = run.rotation.values, run.translation.values, run.status.values
    poses = np.concatenate([R.reshape(*R.shape[:3], 9), t], axis=-1)
    rng, found = np.random.default_rng(seed), []
    deviations = program.draws(seed=seed, start=0, stop=samples)
    for k in np.flatnonzero(status <= Status.RESOLVED):
        bodies = deviating.deviated(scene.bodies, program, deviations[k]) if scene.deviates else scene.bodies
        search = Search(scene._replace(bodies=bodies), program, objective, deviations[k])
        raw, ours = (search.centred(poses[k, state]) for state in (RAW, CORRECTED))
        before, after, is_touched = search.distance(raw), search.distance(ours), status[k] == Status.RESOLVED
        is_moved = is_touched and objective != SEATING  # where forces move bodies that are apart, too
        row = {"seed": seed, "realization": int(k), "objective": objective}
        wrong = "inside" if after < -ALLOWED * scene.range else "falsely touched" if is_moved and before > TOUCHING else ""
        if wrong or (objective != SEATING and (not is_touched or before > -FEASIBLE * scene.range)):
            found.append(row | {"kind": wrong or "untouched", "distances": [before / scene.range, after / scene.range]})
            continue
        sides = [] if objective == SEATING else counted(program, objective, poses[k, RAW])
        own = search.energy(raw, ours, sides)
        near = search.least(raw, ours, sides)
        others = [search.least(raw, at_random(rng, ours, search), sides) for _ in range(starts)]
        best = min((each for each in (near, *others) if each is not None), key=lambda each: each[0], default=None)
        limit = (LEAST * scene.range) ** search.power
        again = sum(each is not None and abs(each[0] - own) <= BETTER * abs(own) + limit for each in others)
        row |= {"ours": own, "found again": again} | compared(own, ours, near, best, search)
        found.append(row | {"kind": kind_of(row)})
    return found


def at_random(rng, poses: Poses, search: Search) -> Poses:
    """Return poses with a random rotation and shift of each mover."""
    turn, shift = SPREAD
    others = poses.copy()
    for k in search.movers:
        R, t = split(poses[k])
        centre = search.corners[k].mean(axis=0)
        turned = Rotation.from_rotvec(rng.normal(size=3) * turn).as_matrix() @ R
        others[k] = np.concatenate(
            [turned.ravel(), R @ centre + t - turned @ centre + rng.normal(size=3) * shift * search.scene.range]
        )
    return others


def compared(own: float, ours: Poses, near: Any, best: Any, search: Search) -> dict:
    """Return the least objectives found from the resolved pose and from anywhere, and the way [ranges] there."""
    found: dict[str, Any] = {}
    for name, other in (("near", near), ("best", best)):
        limit = BETTER * abs(own) + (LEAST * search.scene.range) ** search.power
        is_better = other is not None and other[0] < own - limit
        way = search.way(other[1], ours) / search.scene.range if other else 0.0
        found |= {name: other[0] if other else None, f"{name} is better": is_better, f"way to {name}": way}
    return found


def kind_of(row: dict) -> str:
    """Return whether a better pose is near, far away or nowhere, or no search ended."""
    if row["near is better"] and row["way to near"] < NEAR:
        return "better near"
    if row["best is better"]:
        return "better far"
    return NO_BETTER if row["best"] is not None else "no search ended"


def scene_of(kind: str, seed: int, objective: str) -> Scene:
    """Return a scene of a kind; of models, `seed` is the place in the list."""
    if kind == "models":
        return model_scene(MODELS[seed % len(MODELS)])
    if kind in ("blocks", "frusta"):
        return deviating_scene(seed, slanted=kind == "frusta", pressed=objective == SEATING)
    return placed_scene(seed, objective) if kind == "coincidences" else ends_scene(seed, kind == "whole")


def main() -> int:
    """Judge scenes; return 1 if a better pose is near a resolved one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes-of", choices=("ends", "whole", "coincidences", "blocks", "frusta", "models"), default="ends")
    parser.add_argument("--objective", choices=(ALL, ACTIVE, STIFF, SEATING), default=ALL)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--samples", type=int, default=5)
    parser.add_argument("--starts", type=int, default=4, help="random ones, of each realization")
    parser.add_argument("--solver", default="daqp")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    counts: collections.Counter = collections.Counter()
    began = time.perf_counter()
    for seed in range(options.first, options.first + options.scenes):
        try:
            scene = scene_of(options.scenes_of, seed, options.objective)
            with quick_builds():
                rows = judged(
                    scene,
                    samples=options.samples,
                    seed=seed,
                    objective=options.objective,
                    solver=options.solver,
                    starts=options.starts,
                )
        except tc.ModelError as error:
            counts["refused"] += 1
            print(f"scene {seed} is refused: {str(error).splitlines()[-1][:100]}")
            continue
        counts["scenes"] += 1
        for row in rows:
            counts[row["kind"]] += 1
            counts["found again from a random start"] += row.get("found again", 0)
            if row["kind"] not in (NO_BETTER, "untouched"):
                print(json.dumps(row), flush=True)
        if seed % 20 == 19:
            print(seed, dict(counts), f"{time.perf_counter() - began:.0f} s", flush=True)
    print(dict(counts), f"{time.perf_counter() - began:.0f} s")
    return int(any(counts[kind] for kind in ("better near", "inside", "falsely touched")))


if __name__ == "__main__":
    sys.exit(main())
