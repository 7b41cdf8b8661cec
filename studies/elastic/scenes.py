"""Models of the study: a bolted cover, and welded sheets with any number of contact points."""

import importlib.util
from pathlib import Path

import numpy as np

import tolcontact as tc

MODELS = Path(__file__).resolve().parents[2] / "models"
BOLTS = ((8, 40), (112, 40), (60, 8), (60, 72))
GRIDS = {83: (5, 13), 160: (7, 21)}  # columns and lines of nodes on the flange, by rows of the released sheets
WELD_ROWS = 21  # of the released sheets: six locators, and three rows for each of five welds


def bolted_cover(points: int) -> tc.Assembly:
    """Return models/cover.step as aluminium, pressed by four bolts onto the rim of its rigid housing; both have form."""
    model = tc.Assembly("cover", method=tc.Method(objective="seating", resolution="exact"))
    housing = model.part("housing", tc.Mesh(MODELS / "housing.step"), fixed=True)
    cover = model.part("cover", tc.Mesh(MODELS / "cover.step"), at=(0, 0, 40))
    cover.elastic(E=70e3, nu=0.33)
    seat = cover.feature("seat", cover.face("-z"), tc.Flatness(0.1, form=tc.Form(length=40)))
    inside = tc.select.Inside((0, 0, 39), (120, 80, 40))
    rim = housing.feature("rim", housing.face("+z", inside), tc.Flatness(0.05, form=tc.Form(length=40)))
    sides = [tc.Locator("B1", (0, 40, 4), "y"), tc.Locator("B2", (120, 40, 4), "y"), tc.Locator("C", (60, 40, 4), "x")]
    model.locate(cover, sides, tolerance=0.1, floating=True)
    model.contact("seat", moving=seat, reference=rim, points=points)
    for k, (x, y) in enumerate(BOLTS):
        model.force(f"bolt {k}", at=cover.point(x, y, 8), vector=(0, 0, -400))
    for name, x, y in (("corner", 3, 3), ("centre", 60, 40)):
        model.measure(name, cover.point(x, y, 8), along="z", tolerance=1)
    return model


def welded_sheets(rows: int, folder: Path) -> tc.Assembly:
    """Return models/welded_sheets.py with more contact points, so that the released sheets have a number of rows."""
    spec = importlib.util.spec_from_file_location("welded_sheets", MODELS / "welded_sheets.py")
    assert spec is not None and spec.loader is not None
    sheets = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sheets)
    columns, lines = GRIDS[rows]
    grid = [(250 + 50 * i / (columns - 1), 200 * j / (lines - 1)) for i in range(columns) for j in range(lines)]
    free = [place for place in grid if place not in sheets.WELDS and 250 < place[0] < 300 and 0 < place[1] < 200]
    surplus = len(grid) + WELD_ROWS - rows
    left_out = [free[k] for k in np.linspace(0, len(free) - 1, surplus).astype(int)]
    flange = [place for place in grid if place not in left_out]
    vars(sheets).update(FOLDER=folder / str(rows), CELLS=(6 * (columns - 1), lines - 1, 1), FLANGE=flange)
    model = sheets.assembly()
    assert isinstance(model, tc.Assembly)
    return model
