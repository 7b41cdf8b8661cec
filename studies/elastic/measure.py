"""Elastic parts: accuracy by element size, what the rule for thin sheets allows, and cost by number of contact rows.

    python -m studies.elastic.measure [--realizations 200] [--rows 38 81 153] [--to FOLDER]

It writes the tables of README.md. It needs the extra `elastic`.
"""

import argparse
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import tolcontact as tc
from studies.tables import Table, write
from tolcontact import elasticity
from tolcontact.errors import GeometryFault, NominalWarning

HERE = Path(__file__).resolve().parent
E, DENSITY, GRAVITY = 210e3, 7850.0, 9.81
CLAMPED = 0.00126532  # w D / q a^4 in the middle of a clamped square plate (Kirchhoff)
SHEARED = 19.0  # (t / a)^2 of that: shear deflection, 0.00150 in place of 0.00126 at a = 10 t (Mindlin, Poisson's ratio 0.3)
SIDE = 60.0  # of the clamped sheet, 1 mm thick
SOLVERS = ("qpoases", "daqp")


def box(size: Sequence[float], nu: float, h: float | None) -> elasticity.ElasticBody:
    """Return the elastic body of a box with a corner at the origin."""
    mesh = tc.Box(*size).mesh
    return elasticity.elastic_body(elasticity.MeshSource(mesh.vertices, mesh.faces, E, nu, DENSITY, element_size=h))


def opening(body: elasticity.ElasticBody, points: np.ndarray, weights: np.ndarray, radius: float | None = None) -> float:
    """Return sum(weights u_z) at `points` under the forces `weights` along z at them, which balance."""
    loads = body.spread(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), radius)
    return float(weights @ elasticity.flexibility(body, loads) @ weights)


def bent(h: float, size: tuple[float, float, float] = (220.0, 20.0, 10.0)) -> float:
    """Return the deflection of a beam under a unit force in the middle of 200 mm, by Timoshenko's."""
    length, width, height = size[0] - 20, size[1], size[2]
    places = [(x, y, height / 2) for x in (10, 10 + length / 2, 10 + length) for y in (0, width)]
    deflection = opening(box(size, 0.0, h), np.array(places), np.repeat([-0.25, 0.5, -0.25], 2))
    stiffness = E * width * height**3 / 12
    return deflection / (length**3 / 48 / stiffness + length / 4 / (5 / 6 * E / 2 * width * height))


def twisted(h: float, side: float = 100.0, thickness: float = 2.0, nu: float = 0.3) -> float:
    """Return the twist of a sheet under unit forces at its corners, by Kirchhoff's."""
    corners = np.array([(x, y, thickness / 2) for x, y in ((0, 0), (side, 0), (side, side), (0, side))])
    rigidity = E * thickness**3 / 12 / (1 - nu**2)
    return opening(box((side, side, thickness), nu, h), corners, np.array([1.0, -1, 1, -1])) / (
        side**2 / 2 / rigidity / (1 - nu)
    )


def clamped(h: float, nu: float = 0.3) -> float:
    """Return the deflection of a sheet under its weight, all nodes of its rim held, by that of thin plates with shear."""
    body = box((SIDE, SIDE, 1.0), nu, h)
    nodes = body.nodes
    rim = np.flatnonzero((np.abs(nodes[:, :2] - SIDE / 2) > SIDE / 2 - 1e-6).any(axis=1))
    held = (3 * rim[:, None] + np.arange(3)).ravel()
    units = np.zeros((nodes.size, len(held)))
    units[held, np.arange(len(held))] = 1.0
    weight = body.weight(np.array([0, 0, -GRAVITY]))
    by_reactions, by_weight = body.response(units), body.response(weight[:, None])[:, 0]
    R, _ = body.rigid
    count = len(held)
    system = np.block([[by_reactions[held], R[held]], [R[held].T, np.zeros((6, 6))]])
    answer = np.linalg.solve(system, -np.concatenate([by_weight[held], R.T @ weight]))
    u = by_weight + by_reactions @ answer[:count] + R @ answer[count:]
    middle = np.argsort(((nodes[:, :2] - SIDE / 2) ** 2).sum(axis=1))[:1]
    rigidity = E / 12 / (1 - nu**2)
    thin = CLAMPED * DENSITY * 1e-9 * GRAVITY * SIDE**4 / rigidity
    return float(-u[3 * middle + 2].mean() / thin / (1 + SHEARED / SIDE**2))


def percent(ratio: float) -> str:
    """Return the error of a ratio."""
    return f"{100 * (ratio - 1):+.2f} %"


def accuracy() -> Table:
    """Return the errors of deflections by element size in thicknesses."""
    rows: list[list[object]] = [["element size / thickness", "beam, bent", "sheet, twisted"]]
    return [*rows, *([f"{k:g}", percent(bent(10 * k)), percent(twisted(2 * k))] for k in (1.5, 2.5, 5))]


def thin() -> Table:
    """Return the errors of a clamped sheet under its weight, and the message beyond the limit."""
    rows: list[list[object]] = [["element size / thickness", "deflection"]]
    rows += [[f"{h:g}", percent(clamped(h))] for h in (3.0, 4.0, 5.0)]
    try:
        clamped(6.0)
    except GeometryFault as fault:
        return [*rows, ["6", str(fault)]]
    raise AssertionError("a sheet is meshed that is too thin for its elements")


def cover(rows: int) -> tc.Assembly:
    """Return an elastic plate of 80 x 60 x 4, pressed at its corners onto a seat that is flat within 0.1."""
    model = tc.Assembly("cover", method=tc.Method(objective="seating"))
    base, plate = model.part("base", tc.Box(80, 60, 20), fixed=True), model.part("cover", tc.Box(80, 60, 4), at=(0, 0, 20))
    plate.elastic(E=70e3, nu=0.33)
    seat = base.feature("seat", base.face("+z"), tc.Flatness(0.1))
    sides = [tc.Locator("B1", (10, 0, 2), "y"), tc.Locator("B2", (70, 0, 2), "y"), tc.Locator("C", (0, 30, 2), "x")]
    model.locate(plate, sides, tolerance=0.1, floating=True)
    model.contact("seat", moving=plate.face("-z"), reference=seat, points=rows)
    for k, (x, y) in enumerate(((6, 6), (74, 6), (74, 54), (6, 54))):
        model.force(f"bolt {k}", at=plate.point(x, y, 4), vector=(0, 0, -400))
    model.measure("middle", plate.point(40, 30, 4), along="z", tolerance=0.1)
    return model


def microseconds(model: tc.Assembly, solver: str, realizations: int) -> tuple[int, float, float, float]:
    """Return contact points, set-up [s], time of a realization [us] on one thread, and the share that is certified."""
    start = time.perf_counter()
    program = tc.build(model, solver=solver)
    setup = time.perf_counter() - start
    list(tc.simulate_blocks(program, samples=10, seed=2, threads=1))  # compiles what is compiled at first use
    start = time.perf_counter()
    (block,) = tc.simulate_blocks(program, samples=realizations, seed=1, threads=1)
    elapsed = time.perf_counter() - start
    points = int((program.nominal.loads[:, 0] == 0).sum())
    return points, setup, 1e6 * elapsed / realizations, float((block.status == tc.Status.RESOLVED).mean())


def cost(rows: Sequence[int], realizations: int) -> Table:
    """Return the cost of a realization by contact rows and solver."""
    table: list[list[object]] = [["contact points asked for", "contact points", "solver", "set-up s", "us", "certified"]]
    for count in rows:
        for solver in SOLVERS:
            points, setup, each, resolved = microseconds(cover(count), solver, realizations)
            table.append([count, points, solver, f"{setup:.1f}", f"{each:.0f}", f"{100 * resolved:.0f} %"])
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--realizations", type=int, default=200)
    parser.add_argument("--rows", type=int, nargs="+", default=[38, 81, 153])
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the page")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", NominalWarning)
    tables = {"accuracy": accuracy(), "thin": thin(), "cost": cost(arguments.rows, arguments.realizations)}
    write(__file__, tables, arguments.to)


if __name__ == "__main__":
    main()
