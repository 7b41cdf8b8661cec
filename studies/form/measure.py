"""Faces that are not flat: seats, a seal and its leak, RA1 and RA2, and what modes and points change.

python -m studies.form.measure [--samples 1000] [--to FOLDER]
"""

import argparse
import runpy
from pathlib import Path

import manifold3d
import matplotlib.pyplot as plt
import numpy as np
import trimesh

import tolcontact as tc
from studies.tables import Table, with_interval, write
from tolcontact.statistics import intervals

HERE = Path(__file__).resolve().parent
MODELS = HERE.parents[1] / "models"
SOLVER = "daqp"
FLATNESS = (0.02, 0.05, 0.1)


def lid(flatness: float = 0.05, modes: int = 20, share: float = 1 / 3, spacing: float | None = None) -> tc.Assembly:
    """Return a lid of 120 x 80, whose underside is not flat, pressed onto the 10 mm wide rim of a box, off its middle.

    modes, share   of its form; the correlation length is this share of 120 mm
    spacing        of contact points [mm]
    """
    model = tc.Assembly("lid", method=tc.Method(objective="seating"))
    outer, inner = (manifold3d.Manifold.cube(size) for size in ((120, 80, 30), (100, 60, 40)))
    rim = (outer - inner.translate((10, 10, -5))).to_mesh64()
    mesh = tc.Mesh(trimesh.Trimesh(rim.vert_properties[:, :3], rim.tri_verts))
    box = model.part("box", mesh, at=(0, 0, -30), fixed=True)
    cover = model.part("lid", tc.Box(120, 80, 6))
    form = tc.Form(length=120 * share, modes=modes)
    under = cover.feature("under", cover.face("-z"), tc.Flatness(flatness, form=form))
    sides = [tc.Locator(f"B{x}", (x, 0, 3), "y", 0.1) for x in (20, 100)]
    model.locate(cover, [*sides, tc.Locator("C", (0, 40, 3), "x", 0.1)], floating=True)
    model.contact("seal", moving=under, reference=box.face("+z"), spacing=spacing)
    model.force("screws", at=cover.point(55, 37, 6), vector=(0, 0, -100))
    model.measure("largest gap", tc.LargestGap(box.face("+z"), cover.face("-z")))
    model.measure("mean gap", tc.MeanGap(box.face("+z"), cover.face("-z")))
    model.measure("height", cover.point(60, 40, 6), along="z")
    return model


def plate(flatness: float = 0.05, modes: int = 20, both: bool = False) -> tc.Assembly:
    """Return a plate of 100 x 50 on a table, pressed off its middle; the form is that of the plate, or of both faces."""
    model = tc.Assembly("plate", method=tc.Method(objective="seating"))
    table = model.part("table", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
    block = model.part("block", tc.Box(100, 50, 20))
    under = block.feature("under", block.face("-z"), tc.Flatness(flatness, form=tc.Form(modes=modes)))
    if both:
        table.feature("top", table.face("+z"), tc.Flatness(flatness, form=tc.Form(modes=modes)))
    sides = [tc.Locator(f"B{x}", (x, 0, 10), "y", 0) for x in (20, 80)]
    model.locate(block, [*sides, tc.Locator("C", (0, 25, 10), "x", 0)], floating=True)
    model.contact("seat", moving=under, reference=table.face("+z"))
    model.force("weight", at=block.point(46.3, 21.7, 20), vector=(0, 0, -10))
    model.measure("largest gap", tc.LargestGap(block.face("-z"), table.face("+z")))
    model.measure("mean gap", tc.MeanGap(block.face("-z"), table.face("+z")))
    model.measure("height", block.point(50, 25, 20), along="z")
    return model


def with_form(name: str, flatness: float, pairs: int) -> tc.Assembly:
    """Return RA1 or RA2 with form on the moving faces of its first pairs."""
    model = runpy.run_path(str(MODELS / f"{name}.py"))["assembly"]()
    for pair in model.pairs[:pairs] if flatness else ():
        pair.moving.part.feature(f"face of {pair.name}", pair.moving, tc.Flatness(flatness))
    return model


def simulated(model: tc.Assembly, samples: int) -> tuple[dict[str, np.ndarray], int]:
    """Return corrected measures by name, and the number of contact points."""
    program = tc.build(model, solver=SOLVER)
    measured = np.concatenate([block.measured[:, 1] for block in tc.simulate_blocks(program, samples=samples, seed=1)])
    points = sum(len(pair.P_m) for pair in program.nominal.pairs if not pair.is_supports)
    return {measure.name: measured[:, k] for k, measure in enumerate(model.measures)}, points


def gaps_of(models: dict[str, tc.Assembly], samples: int) -> tuple[Table, dict[str, np.ndarray]]:
    """Return a table with a row for each model, and the largest gaps by its name."""
    largest: dict[str, np.ndarray] = {}
    rows: list[tuple[str, ...]] = [("form", "contact points", "largest gap", "its 99 %", "mean gap", "height")]
    for name, model in models.items():
        measured, points = simulated(model, samples)
        largest[name] = measured["largest gap"]
        means = (with_interval(*intervals.mean(measured[measure])) for measure in ("largest gap", "mean gap", "height"))
        gap, mean_gap, height = means
        rows.append((name, f"{points}", gap, f"{np.quantile(largest[name], 0.99):.3f}", mean_gap, height))
    return rows, largest


def references(samples: int) -> Table:
    """Return RA1 and RA2 with form on one or three faces."""
    rows: list[tuple[str, ...]] = [("model", "flatness", "mean", "6 sigma")]
    for name, faces in (("ra1", 1), ("ra2", 1), ("ra2", 3)):
        for width in (0.0, 0.05, 0.5):
            measured, _ = simulated(with_form(name, width, faces), samples)
            values = next(iter(measured.values()))
            estimates = intervals.mean(values), intervals.standard_deviation(values, times=6)
            rows.append((f"{name.upper()}, {faces} of its faces", f"{width:g}", *(with_interval(*e) for e in estimates)))
    return rows


def draw(largest: dict[str, np.ndarray], path: Path) -> None:
    """Draw the distribution of the largest gap at the seal for each flatness."""
    figure, axes = plt.subplots(figsize=(7, 3.5))
    bins = np.linspace(0, max(values.max() for values in largest.values()), 50)
    for name, values in largest.items():
        axes.hist(values, bins=list(bins), histtype="step", label=name, density=True)
    axes.set(xlabel="largest gap at the seal [mm]", ylabel="density")
    axes.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=1000)
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the figure and the page")
    arguments = parser.parse_args()
    cases = {
        "seal": {f"flatness {width}": lid(width) for width in FLATNESS},
        "plates": {"form of the plate": plate(), "form of plate and table": plate(both=True)},
        "modes": {f"{modes} modes": lid(modes=modes) for modes in (3, 6, 10, 20, 40)}
        | {f"spacing {spacing}": lid(spacing=spacing) for spacing in (12, 8, 4, 2)}
        | {f"length 120 / {k}": lid(share=1 / k) for k in (2, 3, 5)},
    }
    results = {name: gaps_of(models, arguments.samples) for name, models in cases.items()}
    draw(results["seal"][1], arguments.to / "gaps.png")
    tables = {name: table for name, (table, _) in results.items()}
    write(__file__, tables | {"references": references(4 * arguments.samples)}, arguments.to)


if __name__ == "__main__":
    main()
