"""Faces that are not flat: seats, a seal and its leak, RA1 and RA2, and what modes and points change.

python studies/form/measure.py [--samples 1000] [--figure gaps.png]
"""

import argparse
import runpy
import time
from pathlib import Path

import manifold3d
import matplotlib.pyplot as plt
import numpy as np
import trimesh

import tolcontact as tc

MODELS = Path(__file__).parents[2] / "models"
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


def simulated(model: tc.Assembly, samples: int, first: int = 16) -> tuple[dict[str, np.ndarray], int, float]:
    """Return corrected measures by name, the number of contact points, and the processor time of a realization [us].

    The `first` realizations are not timed: functions are compiled in them.
    """
    program = tc.build(model, solver=SOLVER)
    list(tc.simulate_blocks(program, samples=first, seed=2))
    start = time.process_time()
    blocks = list(tc.simulate_blocks(program, samples=samples, seed=1))
    seconds = time.process_time() - start
    measured = np.concatenate([block.measured[:, 1] for block in blocks])
    points = sum(len(pair.P_m) for pair in program.nominal.pairs if not pair.is_supports)
    return {measure.name: measured[:, k] for k, measure in enumerate(model.measures)}, points, 1e6 * seconds / samples


def interval(values: np.ndarray, digits: int = 4) -> str:
    """Return the mean with its 95 % interval, as a text."""
    half = 1.96 * values.std(ddof=1) / np.sqrt(len(values))
    return f"{values.mean():.{digits}f} ± {half:.{digits}f}"


def row(*cells: object) -> None:
    print(f"| {' | '.join(map(str, cells))} |")


def heading(title: str, *columns: str) -> None:
    print(f"\n## {title}\n")
    row(*columns)
    row(*["---"] * len(columns))


def gaps_of(models: dict[str, tc.Assembly], samples: int) -> dict[str, np.ndarray]:
    """Print a row for each model, and return the largest gaps by its name."""
    largest = {}
    for name, model in models.items():
        measured, points, cost = simulated(model, samples)
        largest[name] = measured["largest gap"]
        quantile = np.quantile(measured["largest gap"], 0.99)
        row(name, points, interval(measured["largest gap"]), f"{quantile:.4f}", interval(measured["mean gap"]),
            interval(measured["height"]), f"{cost:.0f}")  # fmt: skip
    return largest


def draw(largest: dict[str, np.ndarray], path: str) -> None:
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
    parser.add_argument("--figure", default=str(Path(__file__).parent / "gaps.png"))
    options = parser.parse_args()
    samples, columns = options.samples, ("model", "points", "largest gap", "its 99 %", "mean gap", "height", "us")
    heading("A lid on its seal", *columns)
    draw(gaps_of({f"flatness {width}": lid(width) for width in FLATNESS}, samples), options.figure)
    heading("Flat on flat", *columns)
    gaps_of({"plate": plate(), "both": plate(both=True)}, samples)
    heading("Modes", *columns)
    gaps_of({f"{modes} modes": lid(modes=modes) for modes in (3, 6, 10, 20, 40)}, samples)
    heading("Points", *columns)
    gaps_of({f"spacing {spacing} mm": lid(spacing=spacing) for spacing in (12, 8, 4, 2)}, samples)
    heading("Correlation length", *columns)
    gaps_of({f"1/{k} of 120 mm": lid(share=1 / k) for k in (2, 3, 5)}, samples)
    heading("RA1 and RA2", "model", "flatness", "points", "mean", "6 sigma", "us")
    for name, pairs in (("ra1", 1), ("ra2", 1), ("ra2", 3)):
        for width in (0.0, 0.05, 0.5):
            measured, points, cost = simulated(with_form(name, width, pairs), 4 * samples, first=8 * samples)
            values = next(iter(measured.values()))
            row(f"{name}, {pairs} faces", width or "none", points, interval(values), f"{6 * values.std():.4f}", f"{cost:.0f}")


if __name__ == "__main__":
    main()
