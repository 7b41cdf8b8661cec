"""Table 1 and figures 3 to 7 of the paper, from our simulation of its two assemblies.

python -m studies.paper.reproduce [--large N] [--to FOLDER]
"""

import argparse
import runpy
from pathlib import Path

import numpy as np
import xarray as xr

import tolcontact as tc
from studies.paper import figures, table
from studies.tables import Table, write

HERE = Path(__file__).resolve().parent
METHODS = {
    "linearized": {"resolution": "linearized"},
    "to the letter": vars(tc.Method.paper()),
    "exact": {"search": "fixed", "objective": "active points"},
}


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name.lower()}.py"))["assembly"](*choices)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--large", type=int, default=100_000, help="realizations of the large runs")
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the figures and the page")
    arguments = parser.parse_args()
    runs: dict[str, list[xr.DataTree]] = {}
    large: dict[str, xr.DataTree] = {}
    tables: dict[str, Table] = {}
    penetration: list[tuple[str, ...]] = [("model", "method", "largest penetration left [mm]", "deeper than 1 um")]
    for name in ("RA1", "RA2"):
        program = tc.build(model(name))
        runs[name] = [tc.run(program, samples=1000, seed=seed) for seed in table.SEEDS]
        measured: dict[str, np.ndarray] = {}
        for method, options in METHODS.items():
            run = table.simulate(model(name), arguments.large, 1, "daqp", **options)
            measured[method] = table.heights(run)
            penetration.append((name, method, *table.penetration_left(run)))
            large.setdefault(name, run)
        tables[name] = list(table.table_1(name, runs[name], measured))
        print(name, "simulated", flush=True)
    tables |= {"penetration": penetration, "claims": list(table.claims(runs, large))}
    write(__file__, tables | {"first order": list(table.first_order(large["RA1"]))}, arguments.to)
    figures.draw({name: seeds[0] for name, seeds in runs.items()}, arguments.to)


if __name__ == "__main__":
    main()
