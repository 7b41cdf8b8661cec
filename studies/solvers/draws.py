"""Resolve the same draws by every solver at the default method: poses, statuses and CPU time, as a figure and two tables.

    python -m studies.solvers.draws [--models ra1 ...] [--turns 3] [--draws 500] [--seconds 20] [--references 20] [--to FOLDER]

Solvers run in processes of their own, since they may crash or never return, and take turns; each turn has the same draws.
Reference poses are medians over the solvers. For stacks of boxes they are compared with an interior-point search that shares
no code with the simulation (studies.certificates.optima).
"""

import argparse
import multiprocessing
import os
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np

import tolcontact as tc
from models import ra1, ra2, tower
from studies.cad import as1_nine
from studies.certificates.least_poses import Search, counted
from studies.certificates.optima import case_scene
from studies.tables import Table, write
from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.compilation.functions import named
from tolcontact.compilation.solvers import usable_solvers
from tolcontact.simulation import simulate_blocks
from tolcontact.vocabulary import CERTIFIED, CORRECTED, STATUS_MEANINGS, Status

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
MODELS: dict[str, tuple[str, Callable[[], tc.Assembly]]] = {
    "ra1": ("RA1", ra1.assembly), "ra2": ("RA2", ra2.assembly), "tower": ("tower of 6", lambda: tower.assembly(6)),
    "as1": ("as1, 8 bodies", as1_nine.assembly),
}  # fmt: skip
BOXES = "ra1", "tower"  # models of convex bodies that stand on each other
WARM_UP, WARM_DRAWS = 3, 20  # turns that are not timed, and their draws: functions are loaded and compiled
PATIENCE, WAITING = 40.0, 600.0  # s of CPU time of a turn, and of waiting, after which a solver is stopped
APART = 1e-6  # mm: statuses are equal, but poses further apart than this differ
COLOURS = {"resolved": "C2", "untouched": "C8", "not_assemblable": "C1", "doubtful": "C4", "not_converged": "C3"}


class Answers(NamedTuple):
    """The answers of a solver to the first n draws, and its cost.

    poses   (n, part, 12)
    status  (n,)
    costs   (turn,): CPU time per realization [us]
    note    "does not return" or "crashes" in a later turn; otherwise ""
    """

    poses: np.ndarray
    status: np.ndarray
    costs: list[float]
    note: str


class Contender:
    """A solver in a process of its own, which answers the same draws in each turn; a slow one answers only the first ones."""

    def __init__(self, assembly: tc.Assembly, solver: str, draws: int, seconds: float) -> None:
        context = multiprocessing.get_context("fork")
        self._pipe, remote = context.Pipe()
        self._process = context.Process(target=_serve, args=(remote, assembly, solver), daemon=True)
        self._process.start()
        remote.close()
        self.turns, self.note, self._draws = list[tuple[np.ndarray, np.ndarray, float]](), "", WARM_DRAWS
        for _ in range(WARM_UP):  # before the next solver starts, which then finds the compiled functions
            self.take()
        if self.turns:
            self._draws = int(np.clip(1e6 * seconds / self.turns[-1][2], WARM_DRAWS, draws))
        self.turns = []

    def take(self) -> None:
        """Answer the draws once, unless the solver has stopped."""
        if self.note:
            return
        self._pipe.send(self._draws)
        begun, sent = self._cpu_time(), time.monotonic()
        try:
            while not self._pipe.poll(1.0):
                if self._cpu_time() - begun > PATIENCE or time.monotonic() - sent > WAITING:
                    raise TimeoutError
            poses, status, seconds = self._pipe.recv()
        except TimeoutError:
            self.note = "does not return"
        except EOFError:
            self.note = "crashes"
        else:
            self.turns.append((poses, status, 1e6 * seconds / self._draws))

    def _cpu_time(self) -> float:
        """Return the CPU time of the process [s], on Linux."""
        fields = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def finish(self) -> Answers:
        """Stop the process and return its answers."""
        self._process.kill()
        poses, status = self.turns[0][:2] if self.turns else (np.zeros((0, 0, 12)), np.zeros(0, dtype=int))
        return Answers(poses, status, [cost for *_, cost in self.turns], self.note)


def _serve(pipe: Connection, assembly: tc.Assembly, solver: str) -> None:
    program = tc.build(assembly, solver=solver, method=tc.Method())
    while True:
        samples = pipe.recv()
        begun = time.process_time()
        (block,) = simulate_blocks(program, samples=samples, seed=1, threads=1, block=samples)
        pipe.send((block.poses[:, CORRECTED], block.status, time.process_time() - begun))


def answers(assembly: tc.Assembly, solvers: list[str], arguments: argparse.Namespace) -> dict[str, Answers]:
    """Return the answers of all solvers that gave any."""
    contenders = {solver: Contender(assembly, solver, arguments.draws, arguments.seconds) for solver in solvers}
    for _ in range(arguments.turns):
        for contender in contenders.values():
            contender.take()
    answered = {solver: contender.finish() for solver, contender in contenders.items()}
    for solver in [solver for solver, answer in answered.items() if not answer.costs]:
        print(f"{assembly.name}: {solver} {answered.pop(solver).note}")
    return answered


def reference(found: dict[str, Answers]) -> np.ndarray:
    """Return the medians (n, part, 12) of the poses that solvers certified; NaN where fewer than three did."""
    count = max(len(answer.status) for answer in found.values())
    stacked = np.full((len(found), count, *next(iter(found.values())).poses.shape[1:]), np.nan)
    for row, answer in zip(stacked, found.values(), strict=True):
        is_certified = np.isin(answer.status, CERTIFIED)
        row[: len(answer.status)][is_certified] = answer.poses[is_certified]
    few = (~np.isnan(stacked[:, :, 0, 0])).sum(axis=0) < 3
    stacked[:, few] = np.nan
    medians = np.full(stacked.shape[1:], np.nan)
    medians[~few] = np.nanmedian(stacked[:, ~few], axis=0)
    return medians


def differences(program: Program, found: dict[str, Answers], medians: np.ndarray) -> dict[str, np.ndarray]:
    """Return how far [mm] any corner of a part lies from its reference in certified answers; NaN for others."""
    corners = [part.vertices for part in program.nominal.parts]
    apart = {}
    for solver, answer in found.items():
        change = answer.poses - medians[: len(answer.poses)]
        moved = [np.linalg.norm(pose.apply(change[:, k], points), axis=2).max(axis=1) for k, points in enumerate(corners)]
        apart[solver] = np.where(np.isin(answer.status, CERTIFIED), np.max(moved, axis=0), np.nan)
    return apart


def searched(program: Program, medians: np.ndarray, status: np.ndarray, count: int) -> list[float]:
    """Return how far [mm] an interior-point search that starts at reference poses ends from them, for `count` draws."""
    nominal = program.nominal
    scene = case_scene(nominal.assembly, [[part.vertices] for part in nominal.parts], nominal.assembly.smallest_zone())
    scene = scene._replace(pairs=[(pair.moving, pair.reference) for pair in nominal.pairs if pair.reference is not None])
    search, ways = Search(scene, program, "all points"), list[float]()
    rows = np.flatnonzero((status == Status.RESOLVED) & np.isfinite(medians[: len(status), 0, 0]))[:count]
    placed = program.place(deviations=program.draws(seed=1, start=0, stop=len(status)))["poses"].reshape(medians.shape)
    for row in rows:
        raw, ours = search.centred(placed[row]), search.centred(medians[row])
        answer = search.least(raw, ours, counted(program, "all points", placed[row]))
        ways.append(search.way(answer[1], ours) if answer else np.nan)
    return ways


def tables(results: dict[str, Any]) -> dict[str, Table]:
    """Return the table of all solvers, and that of the interior-point search."""
    rows: list[tuple[object, ...]] = [
        ("model", "solver", "draws", *(word.replace("_", " ") for word in STATUS_MEANINGS), "other status", "pose, median [mm]",
         "pose, largest [mm]", f"further than {APART:g} mm", "CPU time / fastest", "")
    ]  # fmt: skip
    second: list[tuple[object, ...]] = [
        ("model", "draws", "reference to search, median [mm]", "largest [mm]", "no search ended")
    ]
    for name, (found, apart, ratios, ways) in results.items():
        common = _common_status(found)
        for solver, answer in found.items():
            counts = np.bincount(answer.status, minlength=len(STATUS_MEANINGS))
            distances = apart[solver][np.isfinite(apart[solver])]
            others = int((answer.status != common[: len(answer.status)]).sum())
            cells = (f"{np.median(distances):.0e}", f"{distances.max():.0e}") if distances.size else ("-", "-")
            far = int((distances > APART).sum())
            rows.append((name, solver, len(answer.status), *counts, others, *cells, far, f"{ratios[solver]:.3g}", answer.note))
        if ways is not None:
            ended = np.array(ways)[np.isfinite(ways)]
            second.append((name, len(ways), f"{np.median(ended):.0e}", f"{ended.max():.0e}", len(ways) - len(ended)))
    return {"draws": rows, "search": second}


def _common_status(found: dict[str, Answers]) -> np.ndarray:
    """Return the most frequent status (n,) over solvers."""
    count = max(len(answer.status) for answer in found.values())
    votes = np.zeros((len(STATUS_MEANINGS), count), dtype=int)
    for answer in found.values():
        votes[answer.status, np.arange(len(answer.status))] += 1
    return votes.argmax(axis=0)


def draw_figure(results: dict[str, Any], path: Path) -> None:
    """Draw the largest and median differences, statuses and costs of all solvers, a row of each model."""
    solvers = list(dict.fromkeys(solver for found, *_ in results.values() for solver in found))
    size = 9, 1.75 * len(results)
    fig, axes = plt.subplots(len(results), 3, figsize=size, layout="constrained", sharey=True, sharex="col", squeeze=False)
    for (name, (found, apart, ratios, _)), (pose_axis, status_axis, cost_axis) in zip(results.items(), axes, strict=True):
        for place, solver in enumerate(solvers):
            if solver not in found:
                continue
            distances = np.maximum(apart[solver][np.isfinite(apart[solver])], 1e-16)
            if distances.size:
                pose_axis.plot([np.median(distances), distances.max()], [place] * 2, color="C0")
                pose_axis.plot(np.median(distances), place, "o", color="C0", markerfacecolor="w")
                pose_axis.plot(distances.max(), place, "o", color="C0")
            left, status = 0.0, found[solver].status
            for word, colour in COLOURS.items():
                share = 100 * float((status == STATUS_MEANINGS.index(word)).mean())
                status_axis.barh(place, share, left=left, color=colour)
                left += share
            cost_axis.barh(place, ratios[solver], color="0.6")
            cost_axis.text(ratios[solver], place, f" {ratios[solver]:.3g}", va="center", fontsize=8)
        pose_axis.set_yticks(range(len(solvers)), solvers)
        pose_axis.set(xscale="log", ylabel=name)
        pose_axis.axvline(1e-8, color="0.7", linewidth=1)
        cost_axis.set(xscale="log")
        cost_axis.set_xlim(0.8, 3 * max(max(row[2].values()) for row in results.values()))
    axes[0, 0].invert_yaxis()
    for axis, title in zip(axes[0], ("pose from the reference [mm]", "status [%]", "CPU time / fastest"), strict=True):
        axis.set_title(title, fontsize=10)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour, label=word.replace("_", " ")) for word, colour in COLOURS.items()]
    handles += [plt.Line2D([], [], color="C0", marker="o", markerfacecolor="w", label="median of draws"),
                plt.Line2D([], [], color="C0", marker="o", label="largest")]  # fmt: skip
    fig.legend(handles=handles, loc="outside lower center", ncol=7, frameon=False, fontsize=8)
    fig.savefig(path, dpi=100)


def main() -> None:
    """Resolve the draws, and write figure and tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", choices=MODELS, default=[*MODELS])
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--draws", type=int, default=500, help="of a turn")
    parser.add_argument("--seconds", type=float, default=20.0, help="CPU time of a turn: slow solvers answer fewer draws")
    parser.add_argument("--references", type=int, default=20, help="draws whose reference is compared with a search")
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the figure and of the page")
    arguments = parser.parse_args()
    named.MIN_COMPILED_CALLS = 0  # functions are compiled at once
    results: dict[str, Any] = {}
    for key in arguments.models:
        name, make = MODELS[key]
        assembly = make()
        found = answers(assembly, usable_solvers(), arguments)
        program, medians = tc.build(assembly, method=tc.Method()), reference(found)
        least = min(found, key=lambda solver: float(np.median(found[solver].costs)))
        costs = {solver: np.array(answer.costs) / found[least].costs[: len(answer.costs)] for solver, answer in found.items()}
        ratios = {solver: float(np.median(cost)) for solver, cost in costs.items()}
        ways = searched(program, medians, _common_status(found), arguments.references) if key in BOXES else None
        results[name] = found, differences(program, found, medians), ratios, ways
        draw_figure(results, arguments.to / "draws.png")
        write(__file__, tables(results), arguments.to)


if __name__ == "__main__":
    main()
