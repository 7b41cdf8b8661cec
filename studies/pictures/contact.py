"""The picture of the README: a dowel pin in the hole of `models/cover.py`, without contact and with it, and both distributions.

python studies/pictures/contact.py FILE.svg
"""

import sys
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

import tolcontact as tc

MODEL = Path(__file__).parents[2] / "models" / "cover.py"
SCALE = 5  # of deviations and clearance in the picture
PIN, HOLE, PLACE, MEASURE = 4.0, 4.0 + SCALE * 0.05, (15.0, 15.0), "near edge, y"  # radii, place of the round pin
MATERIAL, METAL, CLASH = "#b9cbe0", "#8f9aa8", "#d01c1c"
VIEW = 6.8


def section(axes: Axes, title: str, hole: tuple[float, float], pin: tuple[float, float]) -> None:
    """Draw the cover around its hole, and the pin; red where they lie in each other."""
    axes.set_facecolor(MATERIAL)
    opening = Circle(hole, HOLE, facecolor="white", edgecolor="#35618f")
    for patch in (opening, Circle(pin, PIN, facecolor=CLASH)):
        axes.add_patch(patch)
    inside = Circle(pin, PIN, facecolor=METAL)
    axes.add_patch(inside)
    inside.set_clip_path(opening)
    axes.add_patch(Circle(pin, PIN, fill=False, edgecolor="#333333"))
    axes.set(xlim=(-VIEW, VIEW), ylim=(-VIEW, VIEW), xticks=[], yticks=[], aspect="equal")
    axes.set_title(title, fontsize=10)


def main() -> None:
    mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "tolcontact", "font.family": "sans-serif"})
    with tc.run(MODEL, samples=1000, seed=1, solver="daqp") as results:
        number = int(results.gap_min.sel(state="raw").min("pair").argmin("realization"))  # parts lie deepest in each other
        centres = {}
        for part, point in (("cover", (*PLACE, 40.0)), ("round pin", (*PLACE, 44.0))):
            for state in ("raw", "corrected"):
                pose = results.sel(part=part, state=state).isel(realization=number)
                x, y, _ = SCALE * (pose.rotation.values @ point + pose.translation.values - (*PLACE, 0.0))
                centres[part, state] = (float(x), float(y))
        measured = results.measured.sel(measure=MEASURE)
        figure, axes = plt.subplots(1, 3, figsize=(9, 3), width_ratios=(1, 1, 1.5), layout="constrained")
        for place, state, title in (
            (axes[0], "raw", f"without contact, deviations x {SCALE}"),
            (axes[1], "corrected", "with contact"),
        ):
            section(place, title, centres["cover", state], centres["round pin", state])
        bins = np.linspace(-0.6, 0.6, 61)
        for state, colour, label in (("raw", "#c9ced6", "without contact"), ("corrected", "#1f5fa8", "with contact")):
            axes[2].hist(measured.sel(state=state), bins=bins, color=colour, label=label, alpha=0.85)
        for limit in (-0.15, 0.15):
            axes[2].axvline(limit, color=CLASH, linewidth=1)
        axes[2].set(xlabel="edge of the cover off the housing's [mm]", yticks=[], title="1000 realizations; limits in red")
        axes[2].title.set_fontsize(10)
        axes[2].legend(frameon=False, fontsize=9)
    figure.savefig(sys.argv[1], metadata={"Date": None})


if __name__ == "__main__":
    main()
