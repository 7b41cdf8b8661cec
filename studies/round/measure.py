"""Balls and shafts beside walls: how far off, and how long a realization takes, exact and on sampled points.

python -m studies.round.measure            both, as round faces and with points=200 and points=1000
"""

import statistics
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import tolcontact as tc
from tests import cases
from tests.cases import round_contact
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating", resolution="exact")
SAMPLES, REPEATS = 1000, 3
Errors = Callable[[np.ndarray, np.ndarray], np.ndarray]


def of_peg(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    return (t[:, 1] - t[:, 0])[:, :2] @ [1, -2] / np.sqrt(5) - 0.05


def of_cone(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    apex, axis = R[:, 0] @ [0, 0, -12.0] + t[:, 0], R[:, 0] @ [0, 0, 1.0]
    return np.linalg.norm(R[:, 1] @ [0, 0, 10 * np.sqrt(2) - 12] + t[:, 1] - apex - 10 * np.sqrt(2) * axis, axis=1)


def of_jammed(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    axes = R @ [0, 0, 1.0]
    angle = np.arcsin(np.linalg.norm(np.cross(axes[:, 0], axes[:, 1]), axis=1))
    return 15 * (angle - round_contact.jamming_angle())


def of_shaft(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Distance of the axis from both plates, less the radius; the plates' tops pass through their points (0, 0, 0)."""
    found = []
    for k, turn in enumerate((-np.pi / 4, np.pi / 4)):
        normal = R[:, k] @ [np.sin(turn), 0, np.cos(turn)]
        found.append(((R[:, 2] @ [0, 0, 10 * np.sqrt(2)] + t[:, 2] - t[:, k]) * normal).sum(axis=1) - 10)
    return np.abs(found).max(axis=0)


def of_slot(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    axis, edge = R[:, 2] @ [0, 0, 1.0], R[:, 0] @ [1.0, 0, 0]
    across = np.cross(edge, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    apart = [np.abs(((t[:, 2] - R[:, 0] @ [0, 4.1, z] - t[:, 0]) * across).sum(axis=1)) for z in (-4, 4)]
    return np.min(apart, axis=0) - 4


CASES: dict[str, tuple[Callable[[], tc.Assembly], Errors]] = {
    "shaft in a V": (lambda: cases.shaft_in_a_v(720), of_shaft),
    "peg pushed aside in its hole": (cases.peg_in_a_hole, of_peg),
    "peg jammed in its hole": (lambda: round_contact.jammed_peg(sections=720), of_jammed),
    "pin pushed aside in a slot": (lambda: round_contact.cylinder_in_a_slot(720), of_slot),
    "ball in a cone": (cases.ball_in_a_cone, of_cone),
}


def sampled(model: tc.Assembly, points: int | None) -> tc.Assembly:
    """Return the model with this number of points in each pair."""
    return model.replaced(pairs=[replace(pair, points=points) for pair in model.pairs])


def measured(make: Callable[[], tc.Assembly], errors: Errors, points: int | None, samples: int) -> str:
    """Return a row of the table."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\[coarse\]")
        program = tc.build(sampled(make(), points), solver="daqp", method=SEATED)
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        blocks = list(simulate_blocks(program, samples=samples, seed=1, threads=1))
        seconds.append((time.perf_counter() - start) / samples)
    status = np.concatenate([block.status for block in blocks])
    poses = np.concatenate([block.poses for block in blocks])[:, CORRECTED]
    R, t = poses[..., :9].reshape(*poses.shape[:-1], 3, 3), poses[..., 9:]
    resolved = status == Status.RESOLVED
    error = np.abs(errors(R, t))[resolved].max() if resolved.any() else np.nan
    rows = sum(len(pair.P_m) for pair in program.nominal.pairs if not pair.is_supports)
    return f"{rows} | {resolved.mean():.1%} | {error:.1e} | {1e6 * statistics.median(seconds):.0f}"


def main() -> None:
    """Measure all cases, with as many realizations as the command line says."""
    realizations = int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES
    print("| case | contact | contact points | resolved | largest error [mm] | us a realization |")
    print("|---|---|---|---|---|---|")
    for name, (make, errors) in CASES.items():
        for points, said in ((None, "round"), (200, "200 points"), (1000, "1000 points")):
            samples = realizations if points is None else max(1, realizations // 25)
            print(f"| {name} | {said} | {measured(make, errors, points, samples)} |", flush=True)


if __name__ == "__main__":
    main()
