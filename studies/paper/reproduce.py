"""Table 1 and figures 3 to 7 of the paper, from our simulation of its two assemblies.

Usage: python studies/paper/reproduce.py [--large N] [--to FOLDER]
"""

import argparse
import runpy
from pathlib import Path

import figures
import numpy as np
import table
import xarray as xr

import tolcontact as tc

HERE = Path(__file__).resolve().parent
METHODS = {
    "linearized": {"resolution": "linearized"},
    "to the letter": vars(tc.Method.paper()),
    "exact": {"search": "fixed", "objective": "active points"},
}


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name.lower()}.py"))["assembly"](*choices)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--large", type=int, default=100_000, help="realizations of the large runs")
    options.add_argument("--to", type=Path, default=HERE, help="folder of the pictures")
    chosen = options.parse_args()

    runs: dict[str, list[xr.DataTree]] = {}
    large: dict[str, dict[str, np.ndarray]] = {}
    for name in ("RA1", "RA2"):
        program = tc.build(model(name))
        runs[name] = [tc.run(program, samples=1000, seed=seed) for seed in table.SEEDS]
        measured, penetration = {}, []
        for method, words in METHODS.items():
            run = table.simulate(model(name), chosen.large, 1, "daqp", **words)
            measured[f"{method}, N = {chosen.large}"] = table.heights(run)
            penetration.append(f"{name}, {method}: penetration left {table.left(run)}")
            large.setdefault(name, run)
        print(*table.table_1(name, runs[name], measured), "", *penetration, "", sep="\n", flush=True)
    print(*table.claims(runs, large), "", sep="\n")
    print(*table.first_order(large["RA1"]), "", sep="\n")
    figures.draw({name: of[0] for name, of in runs.items()}, chosen.to)


if __name__ == "__main__":
    main()
