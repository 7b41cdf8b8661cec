"""Set bodies on each other whose corners, edges and faces coincide, or nearly, and judge every certified realization.

`loose_stacks` and `mating_stacks` have the bodies, `placements` the assemblies, and `polyhedra` the judge, which shares no code
with the simulation.
"""

import argparse
import collections
import contextlib
import re
import sys
import time
import types
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from unittest import mock

import numpy as np

import tolcontact as tc
from studies.certificates.placements import FAMILIES, Scene, scene
from studies.certificates.polyhedra import ball_of_pairs, separation_of_pairs
from tolcontact import code_cache
from tolcontact.compilation.functions import named, native
from tolcontact.discretization import contact_points
from tolcontact.method import OBJECTIVES
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CORRECTED, RAW, Status
from tolcontact.workflow import models

ALLOWED, NOTICED = 5e-4, 1e-4  # radius of a ball in two bodies, as a share of the smallest tolerance range
TOUCHING = 1e-6  # mm
LIFTS = (0.0, 0.25, 0.5, 1, 2, 4)  # in tolerance ranges
UNANSWERED = 0.1  # share of the realizations of a scene
MIN_ARM = 0.03  # of the size of a body: root mean square distance of its contact points from the line closest to them
STIFF = "locator stiffness"
LISTED = 6  # wrong realizations of a scene
CONTRADICTIONS = ("inside", "noticed", "missed", "falsely touched", "lifted off", "not told", "falsely told")
WRONG = ("inside", "falsely touched", "crashed")  # which ends a run with exit code 1
UNCERTIFIED = ("not converged", "not assemblable", "doubtful")
OTHERS = ("liftable", "refused", "crashed", "seconds")
COLUMNS: tuple[str, ...] = ("scenes", "rows", "stiff", "overlapping", "certified", *CONTRADICTIONS, "undeclared", "told")
COLUMNS += ("without answer", *UNCERTIFIED, *OTHERS)


@dataclass
class Findings:
    """Numbers of realizations by finding, the largest ball [tolerance] in two bodies, and the realizations that are wrong."""

    counts: collections.Counter[str] = field(default_factory=collections.Counter)
    deepest: float = 0.0
    wrong: list[int] = field(default_factory=list)

    @property
    def are_remarkable(self) -> bool:
        """Whether a certificate is contradicted, many realizations have none, or the simulation crashed."""
        without = sum(self.counts[kind] for kind in UNCERTIFIED)
        return bool(self.wrong or without > UNANSWERED * self.counts["rows"] or self.counts["crashed"])

    def __str__(self) -> str:
        """Return what is found as one line."""
        depth = f"; deepest {self.deepest:.2g} tolerances" if self.deepest else ""
        listed = " ".join(map(str, self.wrong[:LISTED])) + (" ..." if len(self.wrong) > LISTED else "")
        return row(self.counts) + depth + (f"; realizations {listed}" if listed else "")


def judged(scene: Scene, samples: int, seed: int, solver: str) -> Findings:
    """Return what the judge finds in realizations of a scene."""
    program = tc.build(scene.assembly, solver=solver)
    is_stiff = leaves_rotations_free(program)
    if is_stiff:
        program = tc.build(scene.assembly, solver=solver, method=program.method.with_choices(objective=STIFF))
    blocks = list(simulate_blocks(program, samples=samples, seed=seed, threads=1))
    names = [part.name for part in program.nominal.parts]
    order = [names.index(f"body {k}") for k in range(len(scene.bodies))]
    poses = np.concatenate([block.poses for block in blocks])[:, :, order]
    status = np.concatenate([block.status for block in blocks])
    certified, touched = np.flatnonzero(status <= Status.RESOLVED), np.flatnonzero(status == Status.RESOLVED)
    final, least = poses[certified, CORRECTED], NOTICED * scene.tolerance
    radii = ball_of_pairs(scene.bodies, scene.pairs, final, least) / scene.tolerance
    aside = ball_of_pairs(scene.bodies, scene.undeclared, final, least) / scene.tolerance
    before = separation_of_pairs(scene.bodies, scene.pairs, poses[touched, RAW])
    after = separation_of_pairs(scene.bodies, scene.pairs, poses[touched, CORRECTED])
    told = np.concatenate([block.clashes for block in blocks]) > 0
    apart = separation_of_pairs(scene.bodies, scene.undeclared, poses[:, CORRECTED]) > 0
    at_rest = np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), (1, len(scene.bodies), 1))
    overlaps = ball_of_pairs(scene.bodies, scene.pairs, at_rest, 0)[0] > ALLOWED * scene.tolerance
    if program.method.minimizes.presses:  # forces also close gaps, and supports also hold
        before, after = np.zeros((2, touched.size))
    counts = {
        "rows": samples,
        "stiff": samples * is_stiff,
        "overlapping": samples * overlaps,
        "certified": certified.size,
        "without answer": (samples - certified.size) * (not overlaps),
        "inside": np.sum(radii > ALLOWED),
        "noticed": np.sum(radii > NOTICED),
        "missed": np.sum(radii[status[certified] == Status.UNTOUCHED] > ALLOWED),
        "falsely touched": np.sum(before > TOUCHING),
        "lifted off": np.sum(after > ALLOWED * scene.tolerance),
        "undeclared": np.sum(aside > ALLOWED),
        "told": np.sum(told),
        "not told": np.sum(aside[~told[certified]] > ALLOWED),
        "falsely told": np.sum(told & apart),
        "liftable": np.sum(liftable(scene, poses[status == Status.NOT_ASSEMBLABLE, CORRECTED])),
        **{kind: np.sum(status == Status[kind.replace(" ", "_").upper()]) for kind in UNCERTIFIED},
    }
    wrong = {*certified[radii > NOTICED], *touched[(before > TOUCHING) | (after > ALLOWED * scene.tolerance)]}
    numbers = collections.Counter({name: int(count) for name, count in counts.items()})
    return Findings(numbers, float(radii.max(initial=0.0)), sorted(map(int, wrong)))


def leaves_rotations_free(program: tc.Program) -> bool:
    """Return whether the contact points of a body that moves lie on a line, or close to one.

    A sum of their displacements does not hold the rotation about the line, or hardly, so that the pose of the body is not
    determined, or lies far from the raw pose. The package warns of such models, and recommends the stiffness of locators.
    """
    if not program.method.minimizes.counts_points:
        return False
    points: dict[int, list[np.ndarray]] = collections.defaultdict(list)
    for pair in program.nominal.pairs:
        points[pair.moving].append(pair.P_m)
        points[pair.moving if pair.reference is None else pair.reference].append(pair.P_r)
    for part, sets in points.items():
        centred = np.concatenate(sets) - np.concatenate(sets).mean(axis=0)
        axis = np.linalg.svd(centred)[2][0]  # of the line closest to the points
        distances = np.linalg.norm(centred - np.outer(centred @ axis, axis), axis=1)
        body = program.nominal.parts[part]
        if body.movers and np.sqrt((distances**2).mean()) < MIN_ARM * body.body.scale:
            return True
    return False


def liftable(scene: Scene, poses: np.ndarray) -> np.ndarray:
    """Return whether the bodies (n,) at poses (n, part, 12) come free if each is lifted off the one below, by a few ranges."""
    free = np.zeros(len(poses), dtype=bool)
    for lift in LIFTS:
        lifted = poses.copy()
        lifted[..., 9:] += lift * max(scene.ranges) * np.arange(len(scene.bodies))[:, None] * scene.up
        free |= separation_of_pairs(scene.bodies, scene.pairs, lifted) >= 0
    return free


class Tally:
    """Counts of all scenes by family, the deepest ball of each, and the messages of refused scenes."""

    def __init__(self) -> None:
        self.counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
        self.deepest: dict[str, float] = collections.defaultdict(float)
        self.messages: collections.Counter[str] = collections.Counter()

    def add(self, family: str, findings: Findings) -> None:
        self.counts[family].update(findings.counts)
        self.deepest[family] = max(self.deepest[family], findings.deepest)

    def print(self) -> None:
        """Print a row for each family, with its counts that are not 0, and the total."""
        total: collections.Counter[str] = collections.Counter()
        for family, counts in sorted(self.counts.items()):
            total.update(counts)
            print(f"{family:18}", row(counts), f"deepest {self.deepest[family]:.2g}")
        print(f"{'all':18}", row(total), f"deepest {max(self.deepest.values(), default=0.0):.2g} tolerances")
        for message, count in self.messages.most_common():
            print(f"refused or crashed {count} times: {message}")


@contextlib.contextmanager
def quick_builds() -> Iterator[None]:
    """Leave out what takes most of a build and does not change it.

    That is the error between contact points and the check of the nominal assembly, which only warn, and to keep machine code
    that no other scene will need.
    """
    sample = contact_points._with_curvature

    def unchecked(moving_face, reference_face, P_m, *limits, is_open):
        return sample(moving_face, reference_face, P_m, *limits, is_open=True) if is_open else (P_m, None)

    forgetful = types.SimpleNamespace(load=code_cache.load, store=lambda *entry: None, write=lambda *entry: None)
    with (
        mock.patch.object(contact_points, "_with_curvature", unchecked),
        mock.patch.object(models, "warn_of_nominal", lambda program: None),
        mock.patch.object(named, "code_cache", forgetful),
        mock.patch.object(native, "code_cache", forgetful),
    ):
        yield


def row(counts: collections.Counter[str]) -> str:
    """Return counts that are not 0 as one line."""
    return ", ".join(f"{name} {counts[name]}" for name in COLUMNS if counts[name])


def message(error: Exception) -> str:
    """Return the last line of an error, without the numbers in it."""
    text = (str(error).splitlines() or [""])[-1].strip(" -")
    return f"{type(error).__name__}: {re.sub(r'[0-9][0-9.e+-]*', '#', text)[:150]}"


def simulated(tally: Tally, seed: int, family: str, options: argparse.Namespace) -> None:
    """Judge one scene, add it to the tally, and print it if a certificate is contradicted or many realizations have none."""
    start, findings, drawn = (
        time.perf_counter(),
        Findings(),
        scene(seed, family, options.objective, omits=options.omit),
    )
    try:
        findings = judged(drawn, options.samples, seed, options.solver)
    except tc.TolcontactError as error:
        findings.counts["refused"] = 1
        tally.messages[message(error)] += 1
    except Exception as error:  # a finding, too
        findings.counts["crashed"] = 1
        tally.messages[message(error)] += 1
    seconds = time.perf_counter() - start
    if findings.are_remarkable or options.verbose:
        print(f"{seed} {family}: {findings}; {drawn.choices}; {seconds:.1f} s", flush=True)
    findings.counts.update(scenes=1, seconds=round(seconds))
    tally.add(family, findings)


def main() -> int:
    """Judge scenes; return 1 if a certified realization is inside or falsely touched."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="seed of the first scene")
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--samples", type=int, default=40)
    parser.add_argument("--solver", default="daqp")
    parser.add_argument("--objective", choices=tuple(OBJECTIVES), default="all points")
    parser.add_argument("--omit", action="store_true", help="leave one contact pair of each scene out")
    parser.add_argument("--families", nargs="+", choices=tuple(FAMILIES), default=list(FAMILIES))
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin no scene after this time")
    parser.add_argument("--verbose", action="store_true", help="print every scene")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    tally, start = Tally(), time.perf_counter()
    with quick_builds():
        for seed in range(options.first, options.first + options.scenes):
            if time.perf_counter() - start > options.seconds:
                print(f"stopped before scene {seed}")
                break
            simulated(tally, seed, options.families[seed % len(options.families)], options)
    tally.print()
    print(f"{time.perf_counter() - start:.0f} s")
    return int(any(counts[wrong] for counts in tally.counts.values() for wrong in WRONG))


if __name__ == "__main__":
    sys.exit(main())
