"""Elastic parts: accuracy by element size, thin sheets, whole meshes, cost by number of contact rows, and set-up.

    python -m studies.elastic.measure [--realizations 1000] [--rows 38 81 153 500] [--draws 20] [--to FOLDER]

It writes the tables of README.md. It needs the extra `elastic`.
"""

import argparse
import statistics
import tempfile
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

import tolcontact as tc
from studies.elastic.scenes import GRIDS, bolted_cover, welded_sheets
from studies.elastic.set_up import set_up as set_up_cover
from studies.elastic.whole import whole_parts
from studies.tables import Table, write
from tolcontact import elasticity
from tolcontact.errors import GeometryFault, NominalWarning
from tolcontact.simulation import Block

HERE = Path(__file__).resolve().parent
E, DENSITY, GRAVITY = 210e3, 7850.0, 9.81
PAD = 1.5  # mm: small, so that little of the error is that forces are spread
SIZES = (5.0, 4.0, 2.5)  # of elements, in thicknesses
LENGTHS = (60.0, 200.0)  # of clamped sheets, 1 mm thick
SOLVERS, LARGEST, TURNS = ("graph", "qpoases", "daqp"), {"graph": 1000, "qpoases": 200, "daqp": 200}, 5  # rows at most
WELDED = HERE.parents[1] / "models" / "welded_sheets.py"


def box(size: Sequence[float], nu: float, h: float | None) -> elasticity.ElasticBody:
    """Return the elastic body of a box with a corner at the origin."""
    mesh = trimesh.creation.box(bounds=[(0, 0, 0), size])
    return elasticity.meshed_body(mesh.vertices, mesh.faces, E, nu, DENSITY, element_size=h)


def opening(body: elasticity.ElasticBody, points: np.ndarray, weights: np.ndarray, radius: float) -> float:
    """Return sum(weights u_z) at `points` under the forces `weights` along z at them, which balance."""
    loads = body.spread(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), radius)
    return float(weights @ elasticity.flexibility(body, loads) @ weights)


def bent(h: float, size: tuple[float, float, float] = (220.0, 20.0, 10.0)) -> float:
    """Return the deflection of a beam under a unit force in the middle of 200 mm, by Timoshenko's."""
    length, width, height = size[0] - 20, size[1], size[2]
    places = [(x, y, height / 2) for x in (10, 10 + length / 2, 10 + length) for y in (0, width)]
    deflection = opening(box(size, 0.0, h), np.array(places), np.repeat([-0.25, 0.5, -0.25], 2), PAD)
    stiffness = E * width * height**3 / 12
    return deflection / (length**3 / 48 / stiffness + length / 4 / (5 / 6 * E / 2 * width * height))


def sagged(body: elasticity.ElasticBody, ends: np.ndarray) -> np.ndarray:
    """Return the displacements (node, 3) of a body under its weight, the nodes `ends` held."""
    held = (3 * ends[:, None] + np.arange(3)).ravel()
    units = np.zeros((body.nodes.size, len(held)))
    units[held, np.arange(len(held))] = 1
    weight = body.weight(np.array([0, 0, -GRAVITY]))
    by_reactions, by_weight = body.response(units), body.response(weight[:, None])[:, 0]
    R, _ = body.rigid
    system = np.block([[by_reactions[held], R[held]], [R[held].T, np.zeros((6, 6))]])
    answer = np.linalg.solve(system, -np.concatenate([by_weight[held], R.T @ weight]))
    return np.asarray(by_weight + by_reactions @ answer[: len(held)] + R @ answer[len(held) :]).reshape(-1, 3)


def clamped(h: float, length: float, width: float = 20.0) -> float:
    """Return the deflection of a sheet of 1 mm under its weight, all nodes of both ends held, by Timoshenko's."""
    body = box((length, width, 1.0), 0.0, h)
    from_middle = np.abs(body.nodes[:, 0] - length / 2)
    u = sagged(body, np.flatnonzero(from_middle > length / 2 - 1e-6))
    q = DENSITY * 1e-9 * GRAVITY * width
    expected = q * length**4 / 384 / (E * width / 12) + q * length**2 / 8 / (5 / 6 * E / 2 * width)
    return float(-u[from_middle.argmin(), 2] / expected)


def clamped_disc(h: float, radius: float = 15.0, nu: float = 0.3) -> float:
    """Return the deflection of a round sheet of 1 mm under its weight, its rim held, by Mindlin's theory."""
    mesh = trimesh.creation.cylinder(radius, 1.0, sections=96)
    body = elasticity.meshed_body(mesh.vertices, mesh.faces, E, nu, DENSITY, element_size=h)
    from_centre = np.hypot(*body.nodes[:, :2].T)
    u = sagged(body, np.flatnonzero(from_centre > np.cos(np.pi / 96) * radius - 1e-6))
    q, rigidity, shear = DENSITY * 1e-9 * GRAVITY, E / 12 / (1 - nu**2), 5 / 6 * E / 2 / (1 + nu)
    return float(-u[from_centre.argmin(), 2] / (q * radius**4 / 64 / rigidity + q * radius**2 / 4 / shear))


def percent(ratio: float) -> str:
    """Return the error of a ratio."""
    return f"{100 * (ratio - 1):+.2f} %"


def accuracy() -> Table:
    """Return the errors of deflections by element size in thicknesses, and the message beyond the limit."""
    rows: list[list[object]] = [["element size / thickness", "beam on supports, 200 x 20 x 10"]]
    rows[0] += [*(f"clamped sheet, {length:g} x 20 x 1" for length in LENGTHS), "clamped disc, diameter 30 x 1"]
    for k in SIZES:
        sheets = (percent(clamped(k, length)) for length in LENGTHS)
        rows.append([f"{k:g}", percent(bent(10 * k)), *sheets, percent(clamped_disc(k))])
    return rows


def refusal() -> str:
    """Return the message for elements that are too coarse."""
    try:
        clamped(6.0, 60.0)
    except GeometryFault as fault:
        return str(fault)
    raise AssertionError("a sheet is meshed by elements that are too coarse")


def cover(rows: int) -> tc.Assembly:
    """Return an elastic plate of 80 x 60 x 4, pressed at its corners onto a seat that is flat within 0.1."""
    model = tc.Assembly("cover", method=tc.Method(objective="seating"))
    base, plate = model.part("base", tc.Box(80, 60, 20), fixed=True), model.part("cover", tc.Box(80, 60, 4), at=(0, 0, 20))
    plate.elastic(E=70e3, nu=0.33)
    seat = base.feature("seat", base.face("+z"), tc.Flatness(0.1, form=tc.Form(length=40)))
    sides = [tc.Locator("B1", (10, 0, 2), "y"), tc.Locator("B2", (70, 0, 2), "y"), tc.Locator("C", (0, 30, 2), "x")]
    model.locate(plate, sides, tolerance=0.1, floating=True)
    model.contact("seat", moving=plate.face("-z"), reference=seat, points=rows)
    for k, (x, y) in enumerate(((6, 6), (74, 6), (74, 54), (6, 54))):
        model.force(f"bolt {k}", at=plate.point(x, y, 4), vector=(0, 0, -400))
    model.measure("middle", plate.point(40, 30, 4), along="z", tolerance=0.1)
    return model


def set_up(model: tc.Assembly | Path, solver: str) -> tuple[tc.Program, float]:
    """Return a program, ready for realizations, and the set-up [s] of processor time."""
    start = time.process_time()
    program = tc.build(model, solver=solver)
    seconds = time.process_time() - start
    list(tc.simulate_blocks(program, samples=5, seed=2, threads=1))  # loads what is compiled
    return program, seconds


def turn(program: tc.Program, realizations: int) -> tuple[float, Block]:
    """Return the time of a realization [us] of processor time, and the realizations."""
    start = time.process_time()
    (block,) = tc.simulate_blocks(program, samples=realizations, seed=1, threads=1)
    return 1e6 * (time.process_time() - start) / realizations, block


def difference(block: Block, expected: Block) -> str:
    """Return by how much measures [mm], and forces relative to the largest, differ from those of another solver."""
    lengths = np.abs(block.measured - expected.measured).max()
    forces = np.abs(block.load - expected.load).max() / np.abs(expected.load).max()
    return f"{lengths:.0e}, {forces:.0e}"


def cost(rows: Sequence[int], sheets: Sequence[int], realizations: int, folder: Path) -> Table:
    """Return the cost of a realization by model and solver: medians of turns, in which all of them alternate."""
    set_up(cover(rows[0]), SOLVERS[0])  # the mesh, and kernels that the first build compiles
    models: dict[str, tc.Assembly | Path] = {f"plate, {count} points": cover(count) for count in rows}
    counts = dict(zip(models, rows, strict=True))
    models["welded sheets"] = WELDED
    for count in sheets:
        models[f"welded sheets, {count} rows"] = welded_sheets(count, folder)
    cases = [(name, solver) for name in models for solver in SOLVERS if counts.get(name, 0) <= LARGEST[solver]]
    programs = {case: set_up(models[case[0]], case[1]) for case in cases}
    turns = [{case: turn(program, realizations) for case, (program, _) in programs.items()} for _ in range(TURNS)]
    table: list[list[object]] = [["model", "solver", "set-up s", "us / realization", "certified", "differs from graph by"]]
    for name, solver in cases:
        times, blocks = zip(*(of_turn[name, solver] for of_turn in turns), strict=True)
        setup, certified = f"{programs[name, solver][1]:.1f}", float((blocks[0].status == tc.Status.RESOLVED).mean())
        differs = difference(blocks[0], turns[0][name, "graph"][1]) if solver != "graph" else ""
        table.append([name, solver, setup, f"{statistics.median(times):.0f}", f"{100 * certified:.4g} %", differs])
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--realizations", type=int, default=1000)
    parser.add_argument("--rows", type=int, nargs="+", default=[38, 81, 153, 500])
    parser.add_argument("--to", type=Path, default=HERE, help="folder of the page")
    parser.add_argument("--sheets", type=int, nargs="*", default=list(GRIDS), help="rows of the welded sheets")
    parser.add_argument("--draws", type=int, default=20, help="draws that are compared with the whole mesh")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", NominalWarning)
    with tempfile.TemporaryDirectory() as folder:  # first, in a process that has done nothing else
        costs = cost(arguments.rows, arguments.sheets, arguments.realizations, Path(folder))
    tables: dict[str, Table] = {"accuracy": accuracy(), "refusal": [["message"], [refusal()]], "cost": costs}
    wholes = {"plate, 38 points": tc.build(cover(38)), "cover, 81 points": tc.build(bolted_cover(81))}
    tables |= {"whole": whole_parts(wholes, arguments.draws), "set_up": set_up_cover(81)}
    write(__file__, tables, arguments.to)


if __name__ == "__main__":
    main()
