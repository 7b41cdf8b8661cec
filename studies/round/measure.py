"""Balls and shafts against walls: errors of round contact and of sampled points, compared with closed forms.

python -m studies.round.measure [--samples 1000] [--to FOLDER]
"""

import argparse
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import tolcontact as tc
from studies.tables import with_interval, write
from tests import cases
from tests.cases import round_contact
from tolcontact.simulation import simulate_blocks
from tolcontact.statistics import intervals
from tolcontact.vocabulary import CORRECTED, Status

SEATED = tc.Method(objective="seating", resolution="exact")
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


def row(make: Callable[[], tc.Assembly], errors: Errors, points: int | None, samples: int) -> tuple[str, str, str]:
    """Return the number of contact points, the share resolved, and the largest error of these as the next power of ten."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\[coarse\]")
        program = tc.build(sampled(make(), points), solver="daqp", method=SEATED)
    blocks = list(simulate_blocks(program, samples=samples, seed=1, threads=1))
    status = np.concatenate([block.status for block in blocks])
    poses = np.concatenate([block.poses for block in blocks])[:, CORRECTED]
    R, t = poses[..., :9].reshape(*poses.shape[:-1], 3, 3), poses[..., 9:]
    resolved = status == Status.RESOLVED
    bound = np.ceil(np.log10(np.abs(errors(R, t))[resolved].max())) if resolved.any() else np.nan
    count = sum(len(pair.P_m) for pair in program.nominal.pairs if not pair.is_supports)
    shares = with_interval(*(100 * share for share in intervals.proportion(resolved)))
    return str(count), f"{shares} %", "" if np.isnan(bound) else f"below 1e{bound:.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1000, help="with sampled points a 25th")
    parser.add_argument("--to", type=Path, help="folder of the page")
    arguments = parser.parse_args()
    rows: list[tuple[str, ...]] = [("case", "contact", "contact points", "resolved", "largest error [mm]")]
    for name, (make, errors) in CASES.items():
        for points, contact in ((None, "round"), (200, "200 points")):
            samples = arguments.samples if points is None else max(1, arguments.samples // 25)
            rows.append((name, contact, *row(make, errors, points, samples)))
            print(*rows[-1], flush=True)
    write(__file__, {"errors": rows}, arguments.to)


if __name__ == "__main__":
    main()
