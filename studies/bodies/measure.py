"""What a realization and a build cost by number of bodies, for every solver, on the same draws.

    python -m studies.bodies.measure [--scenes tower ...] [--sizes 2 3 ...] [--methods exact ...] [--solvers graph ...]

Contenders of a case take turns in one process and one thread; a cost is the median of the turns, in CPU time. "elements" are
functions per kind of contact pair, "whole" is one function of all bodies, as it is for few bodies. A build is that of a process
of its own, with its first realizations: "cold" if no function of the model was ever compiled, "warm" if all of them were.
Kernels that all models share are compiled once after an installation; their cost is stated apart.
"""

import argparse
import multiprocessing
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import matplotlib as mpl
import numpy as np

import tolcontact as tc
from studies.bodies.scenes import AS1, AS1_BODIES, SCENES, scene
from tolcontact import poses as pose
from tolcontact.compilation import ContactGroup, Program
from tolcontact.compilation.calls import Call, FunctionCalls, inline
from tolcontact.compilation.contact_qp import contact_qp
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.functions import named
from tolcontact.discretization import Nominal
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.vocabulary import CERTIFIED, CORRECTED

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
FEW_SAMPLES, MIN_SAMPLES, MAX_SAMPLES = 4, 20, 4096  # realizations: of a turn that warms up, and of one that counts
FUNCTIONS: dict[str, Callable[[], Call]] = {"elements": FunctionCalls, "whole": lambda: inline}
MIB = 1024  # KiB
METHODS = {  # all minimize the displacements of all points, so that answers are unique
    "linearized": tc.Method(resolution="linearized", objective="all points"),
    "planes": tc.Method(search="fixed"),  # exact, on planes without end
    "exact": tc.Method(),
}
Key = tuple[str, str]  # functions, solver


@dataclass(frozen=True)
class Case:
    """A scene of some size, and one of METHODS."""

    scene: str
    bodies: int
    method: str

    def program(self, functions: str, solver: str) -> Program:
        """Return the program with its QPs by one way and solver."""
        return resolved_by(tc.build(scene(self.scene, self.bodies), solver=solver, method=METHODS[self.method]), functions)


@dataclass
class Contender:
    """A program, with the blocks and the costs [us] of its turns."""

    program: Program
    samples: int = FEW_SAMPLES
    blocks: list[Block] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)

    def turn(self) -> None:
        """Simulate, and note the CPU time of a realization."""
        start = time.process_time()
        self.blocks = list(simulate_blocks(self.program, samples=self.samples, seed=1, threads=1, block=MAX_SAMPLES))
        self.costs.append(1e6 * (time.process_time() - start) / self.samples)

    def warm_up(self, seconds: float) -> None:
        """Compile all functions, then find out how many realizations a turn of some seconds has."""
        for _ in range(3):  # machine code is looked for in the first call of a function, and made in the second one
            self.turn()
        few, more = FEW_SAMPLES, MIN_SAMPLES
        spent = []
        for self.samples in (few, more):
            self.turn()
            spent.append(1e-6 * self.costs[-1] * self.samples)
        rate = (more - few) / max(spent[1] - spent[0], 1e-6)  # realizations a second, but for what a block takes anyway
        self.samples = int(np.clip(seconds * rate, MIN_SAMPLES, MAX_SAMPLES))
        self.costs.clear()

    @property
    def cost(self) -> float:
        """CPU time of a realization [us]."""
        return float(np.median(self.costs))

    @property
    def second_share(self) -> float:
        """Share of realizations in which another solver answered."""
        return float(np.mean(np.concatenate([block.second_answers for block in self.blocks]) > 0))


def resolved_by(program: Program, functions: str) -> Program:
    """Return a program whose QPs have their functions by one of FUNCTIONS."""
    groups = []
    for group in program.groups:
        call = FUNCTIONS[functions]()
        qp = contact_qp(program.nominal, group.group, program.gaps, program.method, group.qp.standing, call)
        groups.append(ContactGroup(group.group, qp, ContactSolver(qp, program.solver)))
    return replace(program, groups=tuple(groups))


def apart(nominal: Nominal, left: Contender, right: Contender) -> tuple[float, int]:
    """Return the largest distance [mm] between two answers of a part's corners, and the number of statuses that differ.

    The distance is that of realizations that are certified by both.
    """
    count = min(left.samples, right.samples)
    status, poses = ([np.concatenate([getattr(block, name) for block in contender.blocks])[:count]
                      for contender in (left, right)] for name in ("status", "poses"))  # fmt: skip
    certified = np.isin(status, CERTIFIED).all(axis=0)
    R, t = (f(poses[0][:, CORRECTED]) - f(poses[1][:, CORRECTED]) for f in (pose.rotation, pose.translation))
    corners = np.array([part.body.bounding_box.vertices for part in nominal.parts])
    moved = np.linalg.norm(np.einsum("npij,pcj->npci", R, corners) + t[:, :, None], axis=-1)
    return float(moved[certified].max(initial=0.0)), int((status[0] != status[1]).sum())


def compete(case: Case, keys: list[Key], seconds: float, turns: int) -> dict[Key, Contender]:
    """Let the contenders of a case take turns, and print a row for each of them."""
    contenders = {key: Contender(case.program(*key)) for key in keys}
    for contender in contenders.values():
        contender.warm_up(seconds)
    for _ in range(turns):
        for contender in contenders.values():
            contender.turn()
    reference = next(iter(contenders.values()))
    nominal = reference.program.nominal
    for (functions, solver), contender in contenders.items():
        distance, unequal = apart(nominal, reference, contender)
        print(
            f"| {case.scene} | {free_bodies(contender.program)} | {case.method} | {functions} | {solver} |"
            f" {contender.samples} | {contender.cost:.1f} | {contender.cost / reference.cost:.2f} |"
            f" {100 * contender.second_share:.2g} % | {distance:.1g} | {unequal} |",
            flush=True,
        )
    return contenders


def free_bodies(program: Program) -> int:
    """Return the number of parts that contact moves."""
    return sum(len(group.group.free) for group in program.groups)


def costs(cases: list[Case], arguments: argparse.Namespace) -> dict[tuple[str, str, str], dict[int, float]]:
    """Print the costs of all cases; return those of the elements by scene, method and solver, by number of bodies [us]."""
    print("| scene | bodies | method | functions | solver | realizations of a turn | CPU [us] | times the first", end="")
    print(" | second solver | apart [mm] | other statuses |\n|---|---:|---|---|---|---:|---:|---:|---:|---:|---:|")
    curves: dict[tuple[str, str, str], dict[int, float]] = {}
    for case in cases:
        keys = [("elements", solver) for solver in arguments.solvers]
        keys += [("whole", solver) for solver in arguments.whole_solvers if case.bodies <= arguments.whole]
        keys = keys[:1] + [key for key in keys[1:] if expected(curves, case, key) <= arguments.patience]
        for (functions, solver), contender in compete(case, keys, arguments.seconds, arguments.turns).items():
            if functions == "elements":
                curve = curves.setdefault((case.scene, case.method, solver), {})
                curve[free_bodies(contender.program)] = contender.cost
    return curves


def expected(curves: dict[tuple[str, str, str], dict[int, float]], case: Case, key: Key) -> float:
    """Return the seconds of a realization that the cost at the last size leads to, if it grows with the cube of the bodies."""
    curve = curves.get((case.scene, case.method, key[1]), {})
    bodies = max(curve, default=0)
    return 1e-6 * curve[bodies] * (case.bodies / bodies) ** 3 if curve else 0.0


def build_cost(case: Case, functions: str, solver: str) -> tuple[float, float]:
    """Return the CPU time [s] of a build with its first realizations, and the largest memory [MB] of this process."""
    named.MIN_COMPILED_CALLS = 0
    start = time.process_time()
    program = case.program(functions, solver)
    for _ in range(2):
        list(simulate_blocks(program, samples=FEW_SAMPLES, seed=1, threads=1))
    seconds = time.process_time() - start
    # Not getrusage: its largest memory is that of the parent, if the parent was larger when it started this process.
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return seconds, int(status["VmHWM"].split()[0]) / MIB


def in_a_process(cache: Path, case: Case, functions: str, solver: str) -> tuple[float, float]:
    """Return the cost of a build in a process of its own that keeps machine code in a folder."""
    os.environ["XDG_CACHE_HOME"] = str(cache)
    try:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            return pool.submit(build_cost, case, functions, solver).result()
    finally:
        del os.environ["XDG_CACHE_HOME"]


def builds(cases: list[Case], arguments: argparse.Namespace) -> None:
    """Print what builds cost, with and without machine code on disk."""
    solver = arguments.solvers[0]
    print(f"\n| scene | bodies | method | functions ({solver}) | cold [s] | warm [s] | memory [MB] |")
    print("|---|---:|---|---|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        kernels = Path(folder) / "kernels"
        kernels.mkdir(mode=0o700)
        for method in dict.fromkeys(case.method for case in cases):
            seconds, memory = in_a_process(kernels, Case("tower", 1, method), "whole", solver)
            print(f"| kernels, tower | 1 | {method} | whole | {seconds:.1f} | | {memory:.0f} |", flush=True)
        for number, (case, functions) in enumerate(product(cases, FUNCTIONS)):
            if functions == "whole" and case.bodies > arguments.whole:
                continue
            cache = shutil.copytree(kernels, Path(folder) / str(number))
            (cold, memory), (warm, _) = (in_a_process(cache, case, functions, solver) for _ in range(2))
            print(
                f"| {case.scene} | {case.bodies} | {case.method} | {functions} | {cold:.1f} | {warm:.1f} | {memory:.0f} |",
                flush=True,
            )


def draw(curves: dict[tuple[str, str, str], dict[int, float]], figure: Path) -> None:
    """Draw cost against number of bodies, a panel for each method."""
    scenes, methods, solvers = (list(dict.fromkeys(names)) for names in zip(*curves, strict=True))
    fig, axes = plt.subplots(1, len(methods), figsize=(4.6 * len(methods), 3.8), layout="constrained", squeeze=False)
    for (name, method, solver), curve in curves.items():
        style = {"color": f"C{scenes.index(name)}", "linestyle": ("-", "--", ":", "-.")[solvers.index(solver) % 4]}
        axes[0, methods.index(method)].loglog(*zip(*curve.items(), strict=True), marker=".", **style)
    sizes = sorted({size for curve in curves.values() for size in curve})
    for ax, method in zip(axes[0], methods, strict=True):
        ax.set(xlabel="free bodies", title=method)
        ax.set_xticks(sizes, labels=map(str, sizes))
        ax.minorticks_off()
        ax.grid(alpha=0.3)
    axes[0, 0].set_ylabel("CPU time of a realization [us]")
    colours = [plt.Line2D([], [], color=f"C{k}", marker=".", label=name) for k, name in enumerate(scenes)]
    lines = [
        plt.Line2D([], [], color="k", linestyle=("-", "--", ":", "-.")[k % 4], label=name) for k, name in enumerate(solvers)
    ]
    axes[0, -1].legend(handles=colours + lines, frameon=False, fontsize=8)
    fig.savefig(figure, dpi=110)


def cases_of(arguments: argparse.Namespace) -> Iterator[Case]:
    """Yield all cases, the smaller ones first."""
    for name, method in product(arguments.scenes, arguments.methods):
        if name == AS1:
            yield Case(AS1, AS1_BODIES, method)
        else:
            yield from (Case(name, size, method) for size in sorted(arguments.sizes) if size >= SCENES[name][0])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--scenes", nargs="+", choices=[*SCENES, AS1], default=[*SCENES, AS1])
    options.add_argument("--sizes", nargs="+", type=int, default=[2, 3, 6, 10, 30, 100], help="free bodies; as1 has its own")
    options.add_argument("--methods", nargs="+", choices=METHODS, default=[*METHODS])
    options.add_argument("--solvers", nargs="+", default=["graph", "daqp", "qpoases"], help="of the elements")
    options.add_argument("--whole-solvers", nargs="*", default=["daqp"], help="of the function of all bodies")
    options.add_argument("--whole", type=int, default=10, help="the most bodies with one function: it compiles for minutes")
    options.add_argument("--seconds", type=float, default=0.3, help="CPU time of a turn")
    options.add_argument("--turns", type=int, default=5)
    options.add_argument(
        "--patience",
        type=float,
        default=0.3,
        help="seconds of a realization: solvers but the first that may be slower are left out",
    )
    options.add_argument("--only", choices=["costs", "builds"], help="one of the two tables")
    options.add_argument("--figure", type=Path, default=HERE / "cost.png")
    arguments = options.parse_args()
    cases = list(cases_of(arguments))
    parts: dict[str, Callable[[], None]] = {
        "costs": lambda: draw(costs(cases, arguments), arguments.figure),
        "builds": lambda: builds(cases, arguments),
    }
    named.MIN_COMPILED_CALLS = 0  # what counts is the cost of many realizations, so functions are compiled at once
    load = os.getloadavg()[0]
    for name, work in parts.items():
        if arguments.only in (None, name):
            work()
    print(f"\nload of the machine before and after: {load:.1f}, {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
