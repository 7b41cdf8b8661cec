"""Table 1 of the paper, RA1: the paper's figures beside ours, and what the second order of rotations adds.

Usage: python studies/paper/table.py [--large N] [--figure FILE.png]
"""

import argparse
import importlib.util
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.simulation import simulate_blocks
from tolcontact.statistics import intervals

HERE = Path(__file__).resolve().parent
STATES = ("contactless", "contact")
PAPER = {"contactless": (0.0632, 16.1173, 7.2158), "contact": (0.2734, 9.8223, 2.6799)}
FIGURES = {
    "mean": intervals.mean,
    "6 sigma": lambda x: intervals.standard_deviation(x, times=6),
    "variance": intervals.variance,
}
SEEDS = range(1, 21)
# RA1's A locators (x, y), the corners of the contact area, and the measured corner, in the assembly frame.
BASE, TOP = [(5, 5), (95, 5), (50, 45)], [(55, 32.5), (95, 32.5), (75, 17.5)]
CORNERS, MEASURED = [(50, 12.5), (100, 12.5), (50, 37.5), (100, 37.5)], (100, 12.5)


def program(solver: str):
    spec = importlib.util.spec_from_file_location("ra1", HERE.parents[1] / "models" / "ra1.py")
    ra1 = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(ra1)
    return tc.build(ra1.assembly(), solver=solver)


def heights(built, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Measured heights (realization, state) [mm] and the first-order prediction of them, on the same draws."""
    blocks = list(simulate_blocks(built, samples=samples, seed=seed))
    labels = [f"{part}.A{k}" for part in ("base", "top") for k in (1, 2, 3)]
    columns = [built.nominal.locator_labels.index(label) for label in labels]
    d = np.concatenate([block.deviations for block in blocks])[:, columns]
    return np.concatenate([block.measured[..., 0] for block in blocks]), first_order(d)


def first_order(d: np.ndarray) -> np.ndarray:
    """The base's plane where the two faces cut each other within the contact area, else the top's own height."""

    def height(deviations, triangle, x):
        return deviations @ np.linalg.solve(np.vstack([np.transpose(triangle), np.ones(3)]), [*x, 1.0])

    base, top = d[:, :3], d[:, 3:]
    gap = np.min([height(top, TOP, x) - height(base, BASE, x) for x in CORNERS], axis=0)
    raw = height(top, TOP, MEASURED)
    return np.stack([raw, np.where(gap < 0, height(base, BASE, MEASURED), raw)], axis=1)


def row(name: str, values: object) -> str:
    estimate, lower, upper = values
    return f"{name:<34}{estimate:10.4f}  [{lower:.4f}, {upper:.4f}]"


def draw_figure(x: np.ndarray, path: Path) -> None:
    import matplotlib  # noqa: PLC0415

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(figsize=(6.4, 2.6), layout="constrained")
    bins = np.linspace(-10, 10, 101)
    for k, (state, colour) in enumerate(zip(STATES, ("#9aa7b5", "#c8443a"), strict=True)):
        label = f"{state}: mean {x[:, k].mean():.2f} mm, 6 sigma {6 * x[:, k].std():.1f} mm"
        axes.hist(x[:, k], bins, density=True, histtype="stepfilled", alpha=0.65, color=colour, label=label)
    axes.set(xlabel="height of RA1's corner above nominal [mm]", ylabel="density [1/mm]", xlim=(-10, 10), ylim=(0, 0.36))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="upper center")
    figure.savefig(path, dpi=110)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--large", type=int, default=100_000, help="realizations of the large run")
    options.add_argument("--figure", type=Path, help="write the histogram of the large run")
    chosen = options.parse_args()

    qpoases = program("qpoases")
    runs = [heights(qpoases, 1000, seed)[0] for seed in SEEDS]
    large, linear = heights(program("daqp"), chosen.large, 1)
    for k, state in enumerate(STATES):
        print(f"\nRA1, {state}{'':<14}{'paper':>10}  {'ours, N = 1000, seed 1':<28}{'20 seeds: least to largest'}")
        for (name, estimate), paper in zip(FIGURES.items(), PAPER[state], strict=True):
            first = estimate(runs[0][:, k])
            scatter = [estimate(run[:, k])[0] for run in runs]
            ours = f"{first[0]:.3f} [{first[1]:.3f}, {first[2]:.3f}]"
            print(f"  {name:<24}{paper:>14.4f}  {ours:<28}{min(scatter):.3f} to {max(scatter):.3f}")
        print(row(f"  N = {chosen.large}: mean", intervals.mean(large[:, k])))
        print(row("    6 sigma", FIGURES["6 sigma"](large[:, k])))
        print(row("    variance", intervals.variance(large[:, k])))
        print(row("    first order: mean", intervals.mean(linear[:, k])))
        print(row("    first order: variance", intervals.variance(linear[:, k])))
        print(row("    second order adds to the mean", intervals.mean(large[:, k] - linear[:, k])))
        print(row("    variance / first order", intervals.variance_ratio(large[:, k], linear[:, k])))
    print()
    print(row("6 sigma, contact / contactless", np.sqrt(intervals.variance_ratio(large[:, 1], large[:, 0]))))
    if chosen.figure:
        draw_figure(large, chosen.figure)


if __name__ == "__main__":
    main()
