"""What one linear step leaves, and what repeated steps cost: the tables of this folder's README.

Usage: python studies/exact/tables.py [--samples N]
"""

import argparse
import runpy
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.statistics import intervals
from tolcontact.vocabulary import CORRECTED, Status

HERE = Path(__file__).resolve().parent
LINEARIZED = tc.Method(resolution="linearized")
EXACT = tc.Method(search="fixed", objective="active points")
FAR = (1000.0, 0.0, 0.0)


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name}.py"))["assembly"](*choices)


def simulate(assembly: tc.Assembly, samples: int, *, method: tc.Method | None = None, solver: str = "daqp"):
    """Arrays of all realizations by name, and the time [s] from draws to measures."""
    program = tc.build(assembly, solver=solver, method=method or LINEARIZED)
    start = time.perf_counter()
    blocks = list(simulate_blocks(program, samples=samples, seed=1))
    taken = time.perf_counter() - start
    return vars(Block.joined(blocks)), taken


def shifted(assembly: tc.Assembly, by=FAR) -> tc.Assembly:
    """Move the assembly to another place."""
    for part in assembly.parts:
        object.__setattr__(part, "at", tuple(np.add(part.at, by)))
    return assembly


def spread(x: np.ndarray) -> str:
    estimate, lower, upper = intervals.standard_deviation(x, times=6)
    return f"{estimate:.4f} [{lower:.4f}, {upper:.4f}]"


def ratio(after: dict, before: dict, measure: int) -> str:
    """Of the standard deviations, from the same draws."""
    values = intervals.variance_ratio(*(run["measured"][:, CORRECTED, measure] for run in (after, before)))
    return "{:.4f} [{:.4f}, {:.4f}]".format(*np.sqrt(values))


def linearized_against_exact(samples: int) -> None:
    print(
        "| model, measure | 6 sigma, linearized | 6 sigma, exact | exact / linearized | difference, median | largest "
        "| penetration left | steps |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, assembly in {
        "RA1": model("ra1"),
        "RA2": model("ra2"),
        "channel": model("channel"),
        "channel, flanges open by 15 degrees": model("channel", 15),
    }.items():
        linear, _ = simulate(assembly, samples)
        exact, _ = simulate(assembly, samples, method=EXACT)
        apart = np.abs(exact["measured"] - linear["measured"])[:, CORRECTED]
        left = [max(0.0, -run["gap_min"][:, CORRECTED].min()) for run in (linear, exact)]
        steps = exact["iterations"][exact["status"] != Status.UNTOUCHED]
        for k, measure in enumerate(assembly.measures):
            print(
                f"| {name}, {measure.name} | {spread(linear['measured'][:, CORRECTED, k])} | "
                f"{spread(exact['measured'][:, CORRECTED, k])} | {ratio(exact, linear, k)} | "
                f"{np.median(apart[:, k]):.4f} | {apart[:, k].max():.3f} | "
                f"{left[0]:.2g}, {left[1]:.1g} | {np.median(steps):g}, {steps.max()} |"
            )


def opposed_faces(samples: int) -> None:
    print("| channel | constrained points | solver | without slack infeasible | resolved | least gap (mm) | steps |")
    print("|---|---|---|---|---|---|---|")
    initial = tc.Method(resolution="linearized", active_set="initial")
    for method, points in ((initial, "active at first"), (LINEARIZED, "all"), (EXACT, "all")):
        for solver in ("qpoases", "daqp"):
            run, _ = simulate(model("channel"), samples, method=method, solver=solver)
            infeasible = intervals.proportion(run["status"] == Status.NOT_CONVERGED)
            resolved = (run["status"] == Status.RESOLVED).mean()
            print(
                f"| {method.resolution} | {points} | {solver} | {100 * infeasible[0]:.1f} % "
                f"[{100 * infeasible[1]:.1f}, {100 * infeasible[2]:.1f}] | {100 * resolved:.2f} % | "
                f"{run['gap_min'][:, CORRECTED].min():.2g} | {np.median(run['iterations']):g}, {run['iterations'].max()} |"
            )


def where_it_stands(samples: int) -> None:
    print("| model, measure | regularization | resolution | largest difference (mm) | 6 sigma | 6 sigma, 1 m away |")
    print("|---|---|---|---|---|---|")
    for name in ("RA1", "RA2"):
        for method in (
            replace(LINEARIZED, regularization="identity"), LINEARIZED, replace(EXACT, regularization="identity"), EXACT,
        ):  # fmt: skip
            still, _ = simulate(model(name.lower()), samples, method=method)
            moved, _ = simulate(shifted(model(name.lower())), samples, method=method)
            apart = np.abs(moved["measured"] - still["measured"])[:, CORRECTED]
            for k, measure in enumerate(model(name.lower()).measures):
                print(
                    f"| {name}, {measure.name} | {method.regularization} | {method.resolution} | {apart[:, k].max():.2g} | "
                    f"{spread(still['measured'][:, CORRECTED, k])} | {spread(moved['measured'][:, CORRECTED, k])} |"
                )


if __name__ == "__main__":
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--samples", type=int, default=10_000)
    samples = arguments.parse_args().samples
    for title, table in (
        ("Linearized against exact", linearized_against_exact),
        ("Opposed faces", opposed_faces),
        ("The same assembly 1 m away", where_it_stands),
    ):
        print(f"\n## {title}, N = {samples}\n")
        table(samples)
