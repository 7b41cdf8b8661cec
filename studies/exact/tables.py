"""What one linear step leaves, and what repeated steps change: the tables of this folder's README.

python -m studies.exact.tables [--samples N] [--to FOLDER]
"""

import argparse
import runpy
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np

import tolcontact as tc
from studies.tables import Table, with_interval, write
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.statistics import intervals
from tolcontact.vocabulary import CORRECTED, Status

HERE = Path(__file__).resolve().parent
LINEARIZED = tc.Method(resolution="linearized")
EXACT = tc.Method(search="fixed", objective="active points")
REGULARIZATIONS: tuple[Literal["identity", "points"], ...] = ("identity", "points")
FAR = (1000.0, 0.0, 0.0)


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name}.py"))["assembly"](*choices)


def simulate(assembly: tc.Assembly, samples: int, *, method: tc.Method = LINEARIZED, solver: str = "daqp"):
    """Return arrays of all realizations by name."""
    program = tc.build(assembly, solver=solver, method=method)
    return vars(Block.joined(list(simulate_blocks(program, samples=samples, seed=1))))


def shifted(assembly: tc.Assembly, by=FAR) -> tc.Assembly:
    """Move the assembly to another place."""
    for part in assembly.parts:
        object.__setattr__(part, "at", tuple(np.add(part.at, by)))
    return assembly


def spread(x: np.ndarray) -> str:
    return with_interval(*intervals.standard_deviation(x, times=6))


def ratio(after: dict, before: dict, measure: int) -> str:
    """Return the ratio of the standard deviations on the same draws."""
    values = intervals.variance_ratio(*(run["measured"][:, CORRECTED, measure] for run in (after, before)))
    return with_interval(*np.sqrt(values))


def linearized_against_exact(samples: int) -> Table:
    """Return both resolutions on the same draws."""
    columns = ("model, measure", "6 sigma, linearized", "6 sigma, exact", "exact / linearized", "difference, median", "largest",
               "penetration left by linearized, exact", "steps of exact, median and most")  # fmt: skip
    rows: list[tuple[object, ...]] = [columns]
    models = {"RA1": model("ra1"), "RA2": model("ra2"), "channel": model("channel"), "channel, open": model("channel", 15)}
    for name, assembly in models.items():
        linear, exact = simulate(assembly, samples), simulate(assembly, samples, method=EXACT)
        differences = np.abs(exact["measured"] - linear["measured"])[:, CORRECTED]
        left = [max(0.0, -run["gap_min"][:, CORRECTED].min()) for run in (linear, exact)]
        steps = exact["iterations"][exact["status"] != Status.UNTOUCHED]
        for k, measure in enumerate(assembly.measures):
            spreads = [spread(run["measured"][:, CORRECTED, k]) for run in (linear, exact)]
            change = f"{np.median(differences[:, k]):.3f}", f"{differences[:, k].max():.2f}"
            depths, counts = f"{left[0]:.2g}, {left[1]:.0e}", f"{np.median(steps):g}, {steps.max()}"
            rows.append((f"{name}: {measure.name}", *spreads, ratio(exact, linear, k), *change, depths, counts))
    return rows


def opposed_faces(samples: int) -> Table:
    """Return how the channel without clearance is resolved."""
    rows: list[tuple[object, ...]] = [
        ("resolution", "constrained points", "solver", "not converged", "resolved", "least gap [mm]", "steps, median and most")
    ]
    initial = tc.Method(resolution="linearized", active_set="initial")
    for method, points in ((initial, "active at first"), (LINEARIZED, "all"), (EXACT, "all")):
        for solver in ("qpoases", "daqp"):
            run = simulate(model("channel"), samples, method=method, solver=solver)
            shares = [
                with_interval(*(100 * value for value in intervals.proportion(run["status"] == status)))
                for status in (Status.NOT_CONVERGED, Status.RESOLVED)
            ]
            least, steps = run["gap_min"][:, CORRECTED].min(), run["iterations"]
            counts = f"{np.median(steps):g}, {steps.max()}"
            rows.append((method.resolution, points, solver, *(f"{share} %" for share in shares), f"{least:.2g}", counts))
    return rows


def moved_assembly(samples: int) -> Table:
    """Return the results of the same assembly, and of the assembly 1 m away."""
    rows: list[tuple[object, ...]] = [
        ("model", "resolution", "regularization", "6 sigma", "6 sigma, 1 m away", "largest difference [mm]")
    ]
    for name, method, regularization in product(("ra1", "ra2"), (LINEARIZED, EXACT), REGULARIZATIONS):
        choice = replace(method, regularization=regularization)
        near, far = (simulate(assembly, samples, method=choice) for assembly in (model(name), shifted(model(name))))
        values = [run["measured"][:, CORRECTED, 0] for run in (near, far)]
        largest = f"{np.abs(values[1] - values[0]).max():.0e}"
        rows.append((name.upper(), choice.resolution, regularization, *map(spread, values), largest))
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--to", type=Path, help="folder of the page")
    arguments = parser.parse_args()
    tables = {"steps": linearized_against_exact, "opposed": opposed_faces, "moved": moved_assembly}
    write(__file__, {name: table(arguments.samples) for name, table in tables.items()}, arguments.to)
