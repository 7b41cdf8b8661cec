"""Two flanged sheets, clamped, welded at five points and released. How much do clamps move what leaves the fixture?

Each sheet of 300 x 200 mm is held by seven locators, n-2-1: four of them across. They bend it, which only elastic parts allow.
Guns close the gaps of the flanges at five points, which are welded then; the flanges do not pass through each other anywhere.
The joined sheets are released, and measured on six of the locators.

Expected: a clamp that is off by d moves the sheet there by d while it is clamped. Flat sheets that are welded while bent spring
back, since the welds keep no gap across: what is left comes from their slip along the flange, one thickness off the middle of
the sheets. So the released corner varies by less than the clamped one.

The stiffness of each sheet is that of bricks which bend without locking, condensed to the nodes where something acts: a script
for a finite-element program would export the same. x along the sheets, z up. Lengths in mm, forces in N.
"""

import itertools
import tempfile
from pathlib import Path

import numpy as np

import tolcontact as tc

LENGTH, WIDTH, CELLS = 300.0, 200.0, (12, 8, 1)
FOLDER = Path(tempfile.gettempdir()) / "tolcontact-welded-sheets"
SHEETS = {"front": (0.0, 0.0, 1.0), "rear": (250.0, 1.0, 1.5)}  # x and z of their place, and their thickness
FLANGE = [(x, y) for x in (250.0, 275.0, 300.0) for y in (0.0, 50.0, 100.0, 150.0, 200.0)]
WELDS = [(250.0, 0.0), (300.0, 50.0), (250.0, 100.0), (300.0, 150.0), (250.0, 200.0)]
CLAMPS = {"front": [(0, 0), (0, 200), (225, 200), (225, 0)], "rear": [(550, 0), (550, 200), (325, 200), (325, 0)]}


def brick(edges: np.ndarray, young: float = 210e3, poisson: float = 0.3) -> np.ndarray:
    """Return the stiffness (24, 24) of a brick with incompatible modes."""
    corners, shear = np.array(list(itertools.product((-1.0, 1.0), repeat=3))), young / 2 / (1 + poisson)
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += young * poisson / (1 + poisson) / (1 - 2 * poisson)
    K = np.zeros((33, 33))
    for point in itertools.product((-(3**-0.5), 3**-0.5), repeat=3):
        f = 1 + corners * point
        slopes = np.stack([corners[:, k] * f[:, (k + 1) % 3] * f[:, (k + 2) % 3] / 8 for k in range(3)], axis=1)
        rows = np.vstack([slopes, np.diag(-2.0 * np.array(point))]) * 2 / edges
        B = np.hstack([[[x, 0, 0], [0, y, 0], [0, 0, z], [0, z, y], [z, 0, x], [y, x, 0]] for x, y, z in rows])
        K += B.T @ law @ B * edges.prod() / 8
    return np.asarray(K[:24, :24] - K[:24, 24:] @ np.linalg.solve(K[24:, 24:], K[24:, :24]))


def export(file: Path, thickness: float, points: list[tuple[float, float, float]]) -> None:
    """Write the stiffness of a sheet, condensed to the nodes at points."""
    size = np.array([LENGTH, WIDTH, thickness])
    axes = [np.linspace(0, length, count + 1) for length, count in zip(size, CELLS, strict=True)]
    nodes, element = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3), brick(size / CELLS)
    numbers, K = np.arange(len(nodes)).reshape([count + 1 for count in CELLS]), np.zeros((3 * len(nodes),) * 2)
    for place in itertools.product(*map(range, CELLS)):
        own = [numbers[tuple(np.add(place, corner))] for corner in itertools.product((0, 1), repeat=3)]
        freedoms = (3 * np.array(own)[:, None] + np.arange(3)).ravel()
        K[np.ix_(freedoms, freedoms)] += element
    kept = np.unique([((nodes - point) ** 2).sum(axis=1).argmin() for point in points])
    a = (3 * kept[:, None] + np.arange(3)).ravel()
    b = np.setdiff1d(np.arange(len(K)), a)
    file.parent.mkdir(exist_ok=True)
    np.savez(file, nodes=nodes[kept], K=K[np.ix_(a, a)] - K[np.ix_(a, b)] @ np.linalg.solve(K[np.ix_(b, b)], K[np.ix_(b, a)]))


def sheet(model: tc.Assembly, name: str) -> tc.Part:
    """Declare a sheet, elastic by its exported matrix."""
    (x0, z0, thickness), file = SHEETS[name], FOLDER / f"{name}.npz"
    touching = thickness if name == "front" else 0.0
    places = [(x, y, 0.0) for x, y in (*CLAMPS[name], (x0, 100), (x0 + LENGTH, 100))] + [(x, y, touching) for x, y in FLANGE]
    export(file, thickness, [(x - x0, y, z) for x, y, z in places])
    part = model.part(name, tc.Box(LENGTH, WIDTH, thickness), at=(x0, 0, z0))
    part.elastic(stiffness=file, nodes=file)
    return part


def assembly() -> tc.Assembly:
    model = tc.Assembly("welded sheets")
    front, rear = (sheet(model, name) for name in SHEETS)

    def locator(part: tc.Part, name: str, x: float, y: float, along: str) -> tc.Locator:
        return tc.Locator(name, part.point(x - SHEETS[part.name][0], y, 0), along)

    sides = {part: [locator(part, f"B{k}", *CLAMPS[part.name][k], "y") for k in (0, 3)] for part in (front, rear)}
    sides[front].append(locator(front, "C", 0, 100, "x"))
    sides[rear].append(locator(rear, "C", 550, 100, "-x"))

    weld = model.station("weld")
    for part in (front, rear):
        clamps = [locator(part, f"A{k}", *place, "z") for k, place in enumerate(CLAMPS[part.name])]
        weld.locate(part, [*clamps, *sides[part]], tolerance=0.2)
    weld.contact("flange", moving=rear.face("-z"), reference=front.face("+z"), within=0.5)
    rail = weld.join("rail", front, rear, at=[front.point(x, y, 1) for x, y in WELDS])

    check = model.station("check")
    feet = [locator(front, f"A{k}", *CLAMPS["front"][k], "z") for k in (0, 1)] + [locator(rear, "A2", 550, 100, "z")]
    check.locate(rail, [*feet, *sides[front]], tolerance=0.02)
    check.contact("released flange", moving=rear.face("-z"), reference=front.face("+z"), within=0.5)
    for station in (weld, check):
        corner = rear.point(LENGTH, WIDTH, 0)
        station.measure("clamped corner" if station is weld else "released corner", corner, along="z", tolerance=0.5)
    return model


if __name__ == "__main__":
    print(tc.summarize(tc.run(assembly(), samples=200, seed=1)))
