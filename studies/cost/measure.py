"""What a realization costs by model, number of bodies, method and solver: rows of cost.csv, the table and the figure.

    python -m studies.cost.measure [--scenes tower ...] [--sizes 2 10 ...] [--solvers graph ...] [--to FOLDER]

The contenders of a case solve the same draws, take turns in one process and one thread, and have to agree; a cost is the median
of the turns, in CPU time. Rows of cost.csv that are not measured stay.
"""

import argparse
import csv
import time
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np

import tolcontact as tc
from models import ra1, ra2
from studies.cost.loop import Loop, has_qpsolvers
from studies.cost.scenes import AS1, AS1_BODIES, SCENES, scene, slab
from studies.tables import Table, write
from tolcontact.compilation import Program
from tolcontact.compilation.functions import named
from tolcontact.simulation import simulate_blocks
from tolcontact.variation.draws import draw
from tolcontact.vocabulary import CERTIFIED, CORRECTED

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
SIZES, LOOP = (2, 3, 6, 10, 30, 100), "loop"
STYLES = {"daqp": "--", "qpoases": ":", "graph": "-"}  # of solvers
DENSE: dict[str, Callable[[], tc.Assembly]] = {"ra1": ra1.assembly, "ra2": ra2.assembly, "slab": lambda: slab(3000, 200.0)}
PAPER = "linearized, active points"
METHODS = {  # all points: answers are unique, and so are the answers of solvers
    PAPER: tc.Method(resolution="linearized", objective="active points"),
    "linearized": tc.Method(resolution="linearized", objective="all points"),
    "exact": tc.Method(),
}
SHOWN = ("tower", AS1)  # scenes in the table of the page; the figure has all of them
MIN_SAMPLES, MAX_SAMPLES, PATIENCE = 20, 4096, 0.3  # realizations of a turn; seconds of a realization that is too slow
APART = 1e-6  # [mm] by which answers of solvers may differ
APART_LOOP = 1e-4  # [mm], of 90 %: its regularization is a simpler one, which decides where few points are active
Case = tuple[str, int, int, str]  # scene, free bodies, contact points, method
Costs = dict[Case, dict[str, float]]  # [us] by solver


def turns_of(program: Program, seconds: float, turns: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the CPU time of a realization [us], and measurements and statuses of the last turn."""
    costs: list[float] = []
    samples = MIN_SAMPLES
    for number in range(3 + turns):  # machine code is loaded in the first call of a function, and made in the second one
        start = time.process_time()
        blocks = list(simulate_blocks(program, samples=samples, seed=1, threads=1, block=MAX_SAMPLES))
        costs.append((time.process_time() - start) / samples)
        if number == 2:
            samples = int(np.clip(seconds / costs[-1], MIN_SAMPLES, MAX_SAMPLES))
    measured, status = (np.concatenate([getattr(block, name) for block in blocks]) for name in ("measured", "status"))
    return 1e6 * float(np.median(costs[3:])), measured[:, CORRECTED], status


def loop_cost(program: Program, samples: int, turns: int) -> tuple[float, np.ndarray]:
    """Return the CPU time of a realization [us] by the loop, and the first measurement where it has no penetration left."""
    loop, costs = Loop(program), []
    deviations = draw(program.nominal, seed=1, start=0, stop=samples)
    for _ in range(1 + turns):
        start = time.process_time()
        measured, is_closed = loop.measure(deviations)
        costs.append((time.process_time() - start) / samples)
    return 1e6 * float(np.median(costs[1:])), np.where(is_closed, measured, np.nan)


def costs_of(assembly: tc.Assembly, method: str, solvers: list[str], seconds: float, turns: int) -> dict[str, float]:
    """Return the costs of a case by solver [us], and compare their answers. Raises ValueError if they differ."""
    costs: dict[str, float] = {}
    reference: tuple[np.ndarray, np.ndarray] | None = None
    for solver in solvers:
        program = tc.build(assembly, solver=solver, method=METHODS[method])
        costs[solver], measured, status = turns_of(program, seconds, turns)
        reference = reference or (measured, status)
        count = min(len(status), len(reference[1]))
        is_certified = np.isin(status[:count], CERTIFIED) & np.isin(reference[1][:count], CERTIFIED)
        apart = np.abs(measured[:count] - reference[0][:count])[is_certified].max(initial=0.0)
        if apart > APART:
            raise ValueError(f"{assembly.name}, {method}: {solver} and {solvers[0]} are {apart:.2g} mm apart")
    if method == PAPER and reference is not None and has_qpsolvers:
        costs[LOOP], looped = loop_cost(program, min(512, len(reference[1])), turns)
        apart = np.nanquantile(np.abs(looped - reference[0][: len(looped), 0]), 0.9)
        if apart > APART_LOOP:
            raise ValueError(f"{assembly.name}: 10 % of the loop's answers are more than {apart:.2g} mm off")
    return costs


def cases_of(scenes: list[str], sizes: list[int]) -> Iterator[tuple[str, tc.Assembly, str]]:
    """Yield scene, assembly and method of each case."""
    for name in scenes:
        if name in DENSE:
            yield name, DENSE[name](), PAPER
            continue
        bodies = [AS1_BODIES] if name == AS1 else [size for size in sizes if size >= SCENES[name][0]]
        yield from ((name, scene(name, size), method) for method, size in product(("linearized", "exact"), bodies))


def measured(arguments: argparse.Namespace) -> Costs:
    """Measure all cases. Solvers whose last case of a scene was too slow for the next one are left out."""
    costs: Costs = {}
    slow: dict[tuple[str, str, str], float] = {}  # [s] of the next size, if costs grow with the cube of the bodies
    for name, assembly, method in cases_of(arguments.scenes, sorted(arguments.sizes)):
        nominal = tc.build(assembly).nominal
        bodies = sum(bool(part.movers) for part in nominal.parts)
        points = sum(len(pair.P_m) for pair in nominal.pairs if not pair.is_supports)
        solvers = [s for s in arguments.solvers if slow.get((name, method, s), 0.0) * bodies**3 <= PATIENCE]
        case = costs[name, bodies, points, method] = costs_of(assembly, method, solvers, arguments.seconds, arguments.turns)
        slow |= {(name, method, solver): 1e-6 * cost / bodies**3 for solver, cost in case.items()}
        print(name, bodies, method, case, flush=True)
    return costs


def read(path: Path) -> Costs:
    """Return the costs in a CSV file."""
    costs: Costs = {}
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            case = row["scene"], int(row["bodies"]), int(row["contact points"]), row["method"]
            costs.setdefault(case, {})[row["solver"]] = float(row["CPU time [us]"])
    return costs


def store(costs: Costs, path: Path) -> None:
    """Write costs as CSV."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["scene", "bodies", "contact points", "method", "solver", "CPU time [us]"])
        writer.writerows([*case, solver, f"{cost:.4g}"] for case, by in costs.items() for solver, cost in by.items())


def table(costs: Costs) -> Table:
    """Return the cases of the page, with a column for each solver."""
    solvers = (*STYLES, LOOP)
    rows: list[tuple[str, ...]] = [("model", "method", *(f"{solver} [us]" for solver in solvers))]
    for (name, bodies, points, method), by_solver in costs.items():
        if name in (*DENSE, *SHOWN):
            cells = (f"{by_solver[solver]:,.4g}" if solver in by_solver else "" for solver in solvers)
            rows.append((f"{name}: {bodies} free, {points} points", method, *cells))
    return rows


def draw_costs(costs: Costs, path: Path) -> None:
    """Draw cost against number of bodies, a panel for each resolution."""
    fig, axes = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained", sharey=True)
    for axis, method in zip(axes, ("linearized", "exact"), strict=True):
        for (k, name), (solver, style) in product(enumerate((*SCENES, AS1)), STYLES.items()):
            curve = [(case[1], by[solver]) for case, by in costs.items() if case[::3] == (name, method) and solver in by]
            axis.loglog(*zip(*sorted(curve), strict=True) if curve else ([], []), style, color=f"C{k}", marker=".")
        axis.set(xlabel="free bodies", title=method)
        axis.set_xticks(SIZES, labels=map(str, SIZES))
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("CPU time of a realization [us]")
    colours = [plt.Line2D([], [], color=f"C{k}", marker=".", label=name) for k, name in enumerate((*SCENES, AS1))]
    lines = [plt.Line2D([], [], color="k", linestyle=style, label=solver) for solver, style in STYLES.items()]
    axes[0].legend(handles=colours + lines, frameon=False, fontsize=8)
    fig.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="*", choices=[*DENSE, *SCENES, AS1], default=[*DENSE, *SCENES, AS1])
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES, help="free bodies; as1 has its own")
    parser.add_argument("--solvers", nargs="+", choices=STYLES, default=[*STYLES])
    parser.add_argument("--seconds", type=float, default=0.3, help="CPU time of a turn")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--to", type=Path, default=HERE, help="folder of cost.csv, the figure and the page")
    arguments = parser.parse_args()
    named.MIN_COMPILED_CALLS = 0  # what counts is the cost of many realizations, so functions are compiled at once
    costs = read(HERE / "cost.csv") | measured(arguments)
    store(costs, arguments.to / "cost.csv")
    draw_costs(costs, arguments.to / "cost.png")
    write(__file__, {"cost": table(costs)}, arguments.to)


if __name__ == "__main__":
    main()
