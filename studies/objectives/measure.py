"""Mean and 6 sigma of six models by each objective, and seated by the forces that a person would name.

Usage: python -m studies.objectives.measure [--samples N] [--models NAME ...] [--to FOLDER]
"""

import argparse
import runpy
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

import tolcontact as tc
from studies.tables import Table, markdown, with_interval, write
from tolcontact.discretization import discretize
from tolcontact.method import OBJECTIVES

HERE = Path(__file__).resolve().parent
MODELS = ("ra1", "ra2", "door", "cover", "tower", "lid")
FACTORS = {"ra1": 10, "tower": 0.3}  # of the number of realizations: a tower takes long
RESOLUTIONS = {"ra1": ("linearized", "exact"), "ra2": ("linearized",)}  # of others, their own
PINNED = ("cover", "lid")  # pins hold them sideways, and their other locators are left out when forces press them
SEATED = "seating"


class Result(NamedTuple):
    """A measure by one objective: mean and 6 sigma with their intervals, and the share of certified realizations."""

    model: str
    measure: str
    objective: str
    mean: np.ndarray
    spread: np.ndarray
    certified: float


def model(name: str) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name}.py"))["assembly"]()


def pressed(assembly: tc.Assembly, *, is_pinned: bool) -> tc.Assembly:
    """Return the model with supports as primary locators of each free part, and a force that presses it onto them.

    If pins hold a part sideways (`is_pinned`), the part has no other locators. The force acts along the primary locators, at
    their centre, as a weight does on a part that lies on them.
    """
    nominal, locations, forces = discretize(assembly), [], []
    for location in assembly.locations:
        part = nominal.parts[nominal.part_index(location.part)]
        if not part.movers or location.floating:
            locations.append(location)
            continue
        R, t = part.placement
        points, directions = (part.locators.points - t) @ R, part.locators.directions @ R
        primary = [k for k in range(len(points)) if np.dot(directions[k], directions[0]) > 0.99]
        scheme = [
            tc.Locator(label.rpartition(".")[2], tuple(p), tuple(n), tolerance, one_sided=k in primary)
            for k, (label, p, n, tolerance) in enumerate(
                zip(part.locators.labels, points, directions, part.locators.tolerances, strict=True)
            )
            if k in primary or not is_pinned
        ]
        locations.append(replace(location, scheme=tuple(scheme), tolerance=None, floating=is_pinned))
        forces.append((part, points[primary].mean(axis=0), -10 * part.locators.directions[0]))
    seated = assembly.replaced(locations=locations)
    for part, point, vector in forces:
        seated.force(f"weight of {part.name}", at=part.part.point(*point), vector=tuple(vector))
    return seated


def results(name: str, samples: int) -> list[Result]:
    """Return the results of the last measure of a model by each objective."""
    rows = []
    assembly = model(name)
    for resolution in RESOLUTIONS.get(name, (assembly.effective_method.resolution,)):
        for objective in OBJECTIVES:
            choices = {"resolution": resolution, "objective": objective}
            if resolution == "exact" and name == "ra1":
                choices["search"] = "bounded"
            declared = pressed(assembly, is_pinned=name in PINNED) if objective == SEATED else assembly
            run = tc.run(declared, samples=samples, seed=1, solver="daqp", method=choices, surfaces=0, fields="none")
            summary = tc.summarize(run)
            certified = float(np.isin(run.status.values, (0, 1)).mean())
            values = summary.statistic_value.isel(measure=-1).sel(state="corrected")
            mean, spread = (values.sel(statistic=statistic).values for statistic in ("mean", "6 sigma"))
            rows.append(Result(f"{name}, {resolution}", str(values.measure.values), objective, mean, spread, certified))
            print(*rows[-1], flush=True)
    return rows


def table(rows: list[Result]) -> Table:
    """Return a row for each result, with intervals."""
    columns = ("model, measure", "objective", "mean", "6 sigma", "certified")
    return [columns] + [
        (f"{row.model}: {row.measure}", row.objective, with_interval(*row.mean), with_interval(*row.spread),
         f"{100 * row.certified:.4g} %")
        for row in rows
    ]  # fmt: skip


def draw(rows: list[Result], path: Path) -> None:
    """Draw mean and 6 sigma of each model, as multiples of 6 sigma by all points."""
    names = list(dict.fromkeys(row.model for row in rows))
    figure, axes = plt.subplots(1, 2, figsize=(9, 0.6 + 0.45 * len(names)), sharey=True, layout="constrained")
    for number, name in enumerate(names):
        of_model = [row for row in rows if row.model == name]
        shown = {row.objective: row for row in of_model if row.measure == of_model[0].measure}
        unit = shown["all points"].spread[0]
        for k, (objective, row) in enumerate(shown.items()):
            for axis, value in zip(axes, (row.mean, row.spread), strict=True):
                errors = np.abs(value[1:, None] - value[0]) / unit
                label = objective if number == 0 and axis is axes[0] else None
                y = number + 0.15 * (k - 1.5)
                axis.errorbar(value[0] / unit, y, xerr=errors, fmt="osD^"[k], color=f"C{k}", label=label, markersize=4)
    axes[0].set_yticks(range(len(names)), [f"{name}: {next(r.measure for r in rows if r.model == name)}" for name in names])
    axes[0].invert_yaxis()
    axes[0].set_xlabel("mean / 6 sigma by all points")
    axes[1].set_xlabel("6 sigma / 6 sigma by all points")
    figure.legend(loc="outside upper center", ncols=4, frameon=False)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1000, help="realizations by each objective (see FACTORS)")
    parser.add_argument("--models", nargs="+", default=MODELS, choices=MODELS)
    parser.add_argument("--to", type=Path, help="folder of the figure, and of a README with the table: by default the study's")
    options = parser.parse_args()
    rows = [row for name in options.models for row in results(name, max(20, int(options.samples * FACTORS.get(name, 1))))]
    if options.to is None and len(options.models) < len(MODELS):  # the page of the study has all models
        print(markdown(table(rows)))
        return
    draw(rows, (options.to or HERE) / "objectives.png")
    write(__file__, {"objectives": table(rows)}, options.to)


if __name__ == "__main__":
    main()
