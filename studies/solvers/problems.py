"""Accuracy of QP solvers on contact problems with a row for every contact point: problems.csv and the table of the page.

    python -m studies.solvers.problems [--realizations 12] [--to FOLDER]

The QPs are those of tolcontact, but with all rows, so that hundreds of them coincide or nearly do. Every solver gets the same
ones, first in order, then reversed: an answer must not depend on the problem before it.
"""
# ruff: noqa: E402

import argparse
import csv
import functools
import multiprocessing
import queue
import runpy
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.modules["highspy"] = None  # type: ignore[assignment]  # its HiGHS and CasADi's crash each other in one process

import casadi as ca
import numpy as np
import qpsolvers
from scipy.optimize import nnls

import tolcontact as tc
from studies.cost.scenes import slab
from studies.tables import Table, write
from tolcontact.compilation import program as compilation, solvers as conic
from tolcontact.compilation.graph import GraphSolver
from tolcontact.compilation.solvers import SOLVERS, usable_solvers
from tolcontact.mechanics.quiet import quiet
from tolcontact.simulation import simulate_block
from tolcontact.variation.draws import draw

HERE = Path(__file__).resolve().parent
PATIENCE = 10  # seconds
WRONG = 1e-4  # mm: an answer with a larger error is wrong, unless the solver reports a failure
REFUSED = {"ipqp": {}, "superscs": {"superscs": {"eps": 1e-9, "verbose": 0}}}
OUTSIDE = {
    "daqp": {"primal_tol": 1e-11}, "quadprog": {}, "clarabel": {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11},
    "piqp": {"eps_abs": 1e-11}, "proxqp": {"eps_abs": 1e-10}, "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9},
}  # fmt: skip
COLUMNS = ("ms", "median", "largest", "wrong", "given up", "order", "of", "note")
Problem = dict[str, np.ndarray]
Solve = Callable[[Problem], tuple[np.ndarray, bool]]


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name}.py"))["assembly"](*choices)


def models() -> dict[str, tc.Assembly]:
    flat = tc.Assembly("coincident")  # the block only moves up and down: 400 rows are the same
    base, block = flat.part("base", tc.Box(50, 50, 10), fixed=True), flat.part("block", tc.Box(50, 50, 10), at=(0, 0, 10))
    places = {
        "Z1": ((25, 25, 0), "z", 2), "X1": ((0, 25, 0), "x", 0), "X2": ((0, 25, 10), "x", 0),
        "X3": ((0, 40, 0), "x", 0), "Y1": ((25, 0, 0), "y", 0), "Y2": ((25, 0, 10), "y", 0),
    }  # fmt: skip
    flat.locate(block, [tc.Locator(name, *place) for name, place in places.items()])
    flat.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=400)
    flat.measure("height", block.point(25, 25, 10), along="z")
    return {
        "RA1": model("ra1"),
        "coincident rows": flat,
        "opposed faces": model("channel"),
        "curved": slab(450, 60.0),
        "RA2": model("ra2"),
        "8 free bodies": model("cells"),
    }


def problems(assembly: tc.Assembly, realizations: int) -> list[Problem]:
    """Return the QPs of the first linear step, with a row for every contact point of the first group."""
    kept = compilation.standing_points  # type: ignore[attr-defined, method-assign]
    compilation.standing_points = lambda pair, *_: np.arange(len(pair.P_m))  # type: ignore[attr-defined, method-assign]
    found: list[Problem] = []
    solve = conic.ConicSolver.__call__

    def record(self, problem, reactions, slacks):
        if not found:
            arrays = dict(zip("hgabc", (problem[name] for name in conic.QP), strict=True))
            found.extend({name: values[k].copy() for name, values in arrays.items()} for k in range(len(reactions)))
        return solve(self, problem, reactions, slacks)

    conic.ConicSolver.__call__ = record  # type: ignore[method-assign]
    try:
        program = tc.build(assembly, solver="daqp", method=tc.Method(resolution="linearized"))
        simulate_block(program, draw(program.nominal, seed=1, start=0, stop=realizations))
    finally:
        compilation.standing_points = kept  # type: ignore[attr-defined, method-assign]
        conic.ConicSolver.__call__ = solve  # type: ignore[method-assign]
    functions = program.groups[0].qp
    h, a = functions.sparsity("h"), functions.sparsity("a")
    for one in found:
        one["H"], one["A"] = ca.DM(h, one["h"]).full(), ca.DM(a, one["a"]).full()
        one["low"] = np.r_[np.full(h.size1() - functions.slacks, -np.inf), np.zeros(functions.slacks)]
    return found


def with_casadi(name: str, one: Problem) -> Solve:
    options = SOLVERS[name].options if name in SOLVERS else REFUSED[name]
    dense = {"h": ca.Sparsity.dense(*one["H"].shape), "a": ca.Sparsity.dense(*one["A"].shape)}
    with quiet():
        S = ca.conic("S", name, dense, {**options, "error_on_fail": False})

    def solve(of: Problem) -> tuple[np.ndarray, bool]:
        # DM first: converting arrays would count as the solver's time.
        inputs = {"h": ca.DM(of["H"]), "a": ca.DM(of["A"]), "g": ca.DM(of["g"]), "lba": ca.DM(of["b"]), "lbx": ca.DM(of["low"])}
        with quiet():
            x = S(**inputs, uba=ca.inf, ubx=ca.inf)["x"].full().ravel()
        return x, bool(S.stats()["success"])

    return solve


def on_graph(_: str, one: Problem) -> Solve:
    sparsities = {name: ca.sparsify(ca.DM(one[matrix])).sparsity() for name, matrix in (("h", "H"), ("a", "A"))}
    sparsities |= {name: ca.Sparsity.dense(len(one[vector]), 1) for name, vector in (("g", "g"), ("lba", "b"))}
    rows, slacks = len(one["b"]), int(np.isfinite(one["low"]).sum())
    graph = GraphSolver(sparsities, slacks=slacks, equations=0)
    places = {name: tuple(map(list, sparsities[name].get_triplet())) for name in ("h", "a")}

    def solve(of: Problem) -> tuple[np.ndarray, bool]:
        stored = {"h": of["H"][places["h"]][None], "a": of["A"][places["a"]][None], "g": of["g"][None], "lba": of["b"][None]}
        answer, failed = graph(stored, np.zeros((1, rows)), np.zeros((1, slacks)))
        return answer["x"][0], not failed[0]

    return solve


def outside(name: str, _: Problem) -> Solve:
    def solve(of: Problem) -> tuple[np.ndarray, bool]:
        problem = qpsolvers.Problem(of["H"], of["g"], -of["A"], -of["b"], lb=of["low"])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = qpsolvers.solve_problem(problem, solver=name, **OUTSIDE[name])
        return (found.x if found.x is not None else np.full(len(of["g"]), np.nan)), bool(found.found)

    return solve


def reference(of: Problem) -> np.ndarray:
    """By quadprog's dual method; its optimality is checked by hand, with nonnegative least squares for the multipliers."""
    x, _ = outside("quadprog", of)(of)
    rows = np.vstack([of["A"], np.eye(len(x))[np.isfinite(of["low"])]])
    slack = rows @ x - np.r_[of["b"], of["low"][np.isfinite(of["low"])]]
    assert slack.min() > -1e-7, f"the reference penetrates by {slack.min()}"
    _, rest = nnls(rows[slack < 1e-7].T, of["H"] @ x + of["g"], maxiter=10_000)
    assert rest < 1e-6 * max(1.0, np.abs(of["g"]).max()), f"the reference is not optimal: {rest}"
    return x


def judge(solve: Solve, of: list[Problem], truth: list[np.ndarray], limit: float) -> dict[str, float]:
    """`limit` [s]: a solver that takes longer is stopped, and judged by what it has done."""
    solve(of[0])
    answers, seconds, begun = [], [], time.perf_counter()
    for one in of:
        start = time.perf_counter()
        answers.append(solve(one))
        seconds.append(time.perf_counter() - start)
        if time.perf_counter() - begun > limit:
            break
    back = [solve(one)[0] for one in of[: len(answers)][::-1]][::-1] if len(answers) == len(of) else [x for x, _ in answers]
    errors = np.array([np.abs(x - t).max() for (x, _), t in zip(answers, truth, strict=False)])
    owned = np.array([not success for _, success in answers])
    bad = ~(errors < WRONG)
    moved = [np.abs(x - y).max() for (x, _), y in zip(answers, back, strict=True)]
    return {
        "ms": 1e3 * float(np.median(seconds)), "median": float(np.nanmedian(errors)), "largest": float(np.nanmax(errors)),
        "wrong": int((bad & ~owned).sum()), "given up": int(owned.sum()), "order": float(np.nanmax(moved)), "of": len(answers),
    }  # fmt: skip


def trial(make: Callable[[str, Problem], Solve], which: str, of: list[Problem], truth: list[np.ndarray]) -> dict[str, float]:
    return judge(make(which, of[0]), of, truth, limit=1.0)


def separately(work: Callable[[], dict[str, float]]) -> dict[str, float] | str:
    """Return the result of `work`, computed in a separate process: solvers may crash or never return."""
    context = multiprocessing.get_context("fork")
    answers = context.Queue()

    def run() -> None:
        try:
            answers.put(work())
        except (RuntimeError, ValueError, qpsolvers.exceptions.SolverError) as error:
            answers.put(f"fails: {str(error).splitlines()[0][:60]}")

    process = context.Process(target=run)
    process.start()
    try:
        return answers.get(timeout=PATIENCE)
    except queue.Empty:
        return f"no answer within {PATIENCE} s" if process.is_alive() else "crashes"
    finally:
        process.kill()


def table(rows: list[dict[str, Any]]) -> Table:
    """Return a row for each solver: its largest error in each problem, and its wrong answers in all of them."""
    names = list(dict.fromkeys(str(row["problem"]) for row in rows))
    lines: list[tuple[object, ...]] = [("solver", *(f"{name} [mm]" for name in names), "wrong, reported as success")]
    for solver in dict.fromkeys(row["solver"] for row in rows):
        results = {row["problem"]: row for row in rows if row["solver"] == solver}
        errors = [f"{float(results[name]['largest']):.0e}" if results[name]["of"] else results[name]["note"] for name in names]
        wrong, of = (sum(int(row[column] or 0) for row in results.values()) for column in ("wrong", "of"))
        lines.append((solver, *errors, f"{wrong} of {of}"))
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--realizations", type=int, default=12)
    parser.add_argument("--to", type=Path, default=HERE, help="folder of problems.csv and of the page")
    arguments = parser.parse_args()
    solvers: dict[str, tuple[Callable[[str, Problem], Solve], str]]
    solvers = {f"CasADi {name}": (with_casadi, name) for name in (*usable_solvers(), *REFUSED)}
    solvers["graph"] = (on_graph, solvers.pop("CasADi graph")[1])
    solvers |= {name: (outside, name) for name in OUTSIDE}
    rows: list[dict[str, Any]] = []
    for name, assembly in models().items():
        qps = problems(assembly, arguments.realizations)
        truth = [reference(qp) for qp in qps]
        for solver, (make, which) in solvers.items():
            result = separately(functools.partial(trial, make, which, qps, truth))
            cells = {"note": result} if isinstance(result, str) else result
            rows.append({"problem": name, "solver": solver, **dict.fromkeys(COLUMNS), **cells})
    with (arguments.to / "problems.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ["problem", "solver", *COLUMNS], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    write(__file__, {"problems": table(rows)}, arguments.to)


if __name__ == "__main__":
    main()
