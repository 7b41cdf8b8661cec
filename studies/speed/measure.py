"""What a realization costs: ours beside what a person would write, on the same draws, in one run of about a quarter hour.

Usage: python studies/speed/measure.py [--quick] [--only loops] [--figure cost.png]

Contenders take turns; every figure is the median of the turns, in microseconds per realization from draws to measures.
"""

import argparse
import contextlib
import hashlib
import resource
import runpy
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import matplotlib as mpl
import numpy as np
import peers
import shapes

import tolcontact as tc
from tolcontact.archive import ArchiveWriter, Run, row_values
from tolcontact.archive.journal import Journal
from tolcontact.compilation.functions import InterpretedFunction, named
from tolcontact.contact.scan import FixedScan
from tolcontact.simulation import processors, simulate_blocks
from tolcontact.statistics import DisplacementFields
from tolcontact.variation import Draws
from tolcontact.variation.draws import draw
from tolcontact.vocabulary import BLOCK_ROWS

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
TURNS, PAIRS = 5, 11
named.MIN_COMPILED_CALLS = 0  # compile Functions at once: what counts here is the cost of many realizations
EXACT = tc.Method(search="fixed", objective="active points")
CLOSED = "loop over qpsolvers, daqp, until closed"
Contender = Callable[[], float]  # microseconds per realization, of one turn
Name = TypeVar("Name")


def model(name: str, *choices) -> tc.Assembly:
    return runpy.run_path(str(HERE.parents[1] / "models" / f"{name}.py"))["assembly"](*choices)


def ours(
    assembly,
    samples: int,
    *,
    solver: str = "daqp",
    threads: int = 1,
    method: tc.Method | None = None,
    block: int = BLOCK_ROWS,
) -> Contender:
    program = tc.build(assembly, solver=solver, method=method or tc.Method(resolution="linearized"))
    list(simulate_blocks(program, samples=256, seed=1))

    def turn() -> float:
        start = time.perf_counter()
        blocks = [len(done) for done in simulate_blocks(program, samples=samples, seed=1, threads=threads, block=block)]
        return 1e6 * (time.perf_counter() - start) / sum(blocks)

    return turn


def loop(assembly, samples: int, solve: peers.Solve, form: str = "first") -> Contender:
    program = tc.build(assembly, solver="daqp")
    geometry = peers.Loop(program)
    corrected = next(simulate_blocks(program, samples=samples, seed=1)).measured[:, 1, 0]
    deviations = draw(program.nominal, seed=1, start=0, stop=samples)
    geometry.measure(deviations[:20], solve, form)

    def turn() -> float:
        start = time.perf_counter()
        measured, closed = geometry.measure(deviations, solve, form)
        seconds = time.perf_counter() - start
        apart = np.abs(measured - corrected)[closed]
        # Where few points are active the regularization decides, which the loop has in a simpler form.
        assert np.quantile(apart, 0.9) < 1e-4, f"{assembly.name}: the loop's answers are others, {np.quantile(apart, 0.9)}"
        return 1e6 * seconds / samples

    return turn


def medians(contenders: dict[Name, Contender]) -> dict[Name, float]:
    taken: dict[Name, list[float]] = {name: [] for name in contenders}
    for _ in range(TURNS):
        for name, turn in contenders.items():
            taken[name].append(turn())
    return {name: float(np.median(times)) for name, times in taken.items()}


def against_loops(samples: int) -> None:
    """Ours, each plugin, one thread and all, beside each loop."""
    few, fewest = 512, 16
    cases = {  # and how many realizations take about a second
        "RA1, 202 points": (model("ra1"), 4 * samples),
        "RA2, 3000 points": (model("ra2"), 2 * samples),
        "curved, 3003 points": (shapes.slab(3000, 200.0), samples // 2),
    }
    columns = {}
    for name, (a, many) in cases.items():
        contenders = {f"ours, {solver}": ours(a, many, solver=solver) for solver in ("daqp", "qpoases")}
        # Not highs: CasADi's copy of it and highspy's, which qpsolvers loads, crash each other in one process.
        contenders |= {f"ours, {solver}": ours(a, fewest, solver=solver) for solver in ("piqp", "proxqp", "osqp")}
        for solver in ("daqp", "qpoases"):
            contenders[f"ours, {solver}, all processors"] = ours(a, many, solver=solver, threads=processors())
        contenders["ours, daqp, exact"] = ours(a, many // 2, method=EXACT)
        contenders["loop over DAQP's own interface"] = loop(a, few, peers.with_daqp)
        contenders["the same, until closed"] = loop(a, few, peers.with_daqp, "closed")
        for solver, count in {
            "daqp": few,
            "quadprog": few,
            "highs": fewest,
            "piqp": few,
            "proxqp": fewest,
            "osqp": fewest,
        }.items():
            contenders[f"loop over qpsolvers, {solver}"] = loop(a, count, peers.with_qpsolvers(solver))
        contenders[CLOSED] = loop(a, few, peers.with_qpsolvers("daqp"), "closed")
        contenders["loop over scipy, SLSQP"] = loop(a, fewest, peers.with_scipy)
        rows = len(peers.Loop(tc.build(a)).P)
        for plugin in ("daqp", "qpoases"):
            contenders[f"loop over CasADi, all rows, {plugin}"] = loop(a, fewest, peers.with_casadi(plugin, rows), "every")
        columns[name] = medians(contenders)
    print("|  |", " | ".join(f"{name} [us] | times ours, daqp" for name in columns), "|")
    print("|---|" + "---:|---:|" * len(columns))
    for row in next(iter(columns.values())):
        cells = [f"{of[row]:.1f} | {of[row] / of['ours, daqp']:.2f}" for of in columns.values()]
        print(f"| {row} |", " | ".join(cells), "|")
    for name, of in columns.items():
        first, closed = of["loop over qpsolvers, daqp"], of[CLOSED]
        print(
            f"\n{name}: {first / of['ours, daqp']:.1f} times as fast as the loop over qpsolvers with daqp and the first rows,"
            f" with qpoases {first / of['ours, qpoases']:.1f}; until closed {closed / of['ours, daqp']:.1f} and"
            f" {closed / of['ours, qpoases']:.1f}; two threads {of['ours, daqp'] / of['ours, daqp, all processors']:.2f} times"
            f" (qpoases {of['ours, qpoases'] / of['ours, qpoases, all processors']:.2f}); exact costs"
            f" {of['ours, daqp, exact'] / of['ours, daqp']:.1f} times linearized"
        )


def against_threads(samples: int) -> None:
    """One thread and all, one after the other: quartiles of many ratios, since others use the machine, too."""
    threads = processors()
    print(
        f"\n| {threads} threads against one, {PAIRS} pairs | lower quartile | median | upper quartile |\n|---|---:|---:|---:|"
    )
    contenders = {"what the machine gives: hashing in C": [hashing(each) for each in (1, threads)]}
    cases = {
        "RA1": (model("ra1"), 4 * samples),
        "RA2": (model("ra2"), samples),
        "curved": (shapes.slab(3000, 200.0), samples // 2),
    }
    for name, (a, many) in cases.items():
        for solver in ("daqp", "qpoases"):
            contenders[f"{name}, {solver}"] = [ours(a, many, solver=solver, threads=each) for each in (1, threads)]
    ratios: dict[str, list[float]] = {contender: [] for contender in contenders}
    for _ in range(PAIRS):
        for contender, (one, every) in contenders.items():
            ratios[contender].append(one() / every())
    for contender, found in ratios.items():
        print(f"| {contender} |", " | ".join(f"{ratio:.2f}" for ratio in np.quantile(found, [0.25, 0.5, 0.75])), "|")


def hashing(threads: int) -> Contender:
    """Work that shares nothing: neither memory nor the interpreter."""

    def turn() -> float:
        start = time.perf_counter()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(lambda salt: hashlib.pbkdf2_hmac("sha256", b"", bytes([salt]), 100_000), range(16)))
        return 1e6 * (time.perf_counter() - start)

    return turn


def against_size(samples: int, figure: Path) -> None:
    sizes = (50, 200, 1000, 3000, 10_000, 30_000, 100_000)
    shapes_of = {"flat": np.inf, "curved": 200.0}
    found: dict[str, list[float]] = {}
    for size in sizes:
        contenders = {}
        for shape, radius in shapes_of.items():
            a = shapes.slab(size, radius)
            contenders[f"ours, {shape}"] = ours(a, samples // 4)
            contenders[f"loop, {shape}"] = loop(a, 100 if size > 3000 else 400, peers.with_qpsolvers("daqp"))
        for name, cost in medians(contenders).items():
            found.setdefault(name, []).append(cost)
    print("\n| contact points |", " | ".join(f"{size}" for size in sizes), "|\n|---|" + "---:|" * len(sizes))
    for name, costs in found.items():
        print(f"| {name} [us] |", " | ".join(f"{cost:.1f}" for cost in costs), "|")
    fig, axes = plt.subplots(figsize=(6.4, 4), layout="constrained")
    for name, costs in found.items():
        axes.loglog(
            sizes, costs, "o-" if name.startswith("ours") else "s--", label=name, color="C0" if "flat" in name else "C1"
        )
    axes.set(xlabel="contact points", ylabel="microseconds per realization", title="One thread, DAQP, from draws to measures")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    fig.savefig(figure, dpi=130)


def against_bodies(samples: int) -> None:
    print("\n| free bodies | realizations | linearized [us] | exact [us] | exact / linearized |\n|---:|---:|---:|---:|---:|")
    for blocks in (1, 2, 5, 10, 20, 30):
        count = min(samples // 4, 20 * samples // blocks**2)
        both = {"linearized": ours(model("tower", blocks), count), "exact": ours(model("tower", blocks), count, method=EXACT)}
        cost = medians(both)
        ratio = cost["exact"] / cost["linearized"]
        print(f"| {blocks} | {count} | {cost['linearized']:.1f} | {cost['exact']:.1f} | {ratio:.1f} |", flush=True)


def against_packing(samples: int) -> None:
    """Blocks four times as large pack what four blocks leave unsolved into the same batches."""
    packed = 4 * BLOCK_ROWS
    print(f"\n| exact | blocks of {BLOCK_ROWS} [us] | of {packed}, packed [us] | packed / not |\n|---|---:|---:|---:|")
    cases = {
        "RA1": model("ra1"),
        "curved, 3003": shapes.slab(3000, 200.0),
        "tower of 5": model("tower", 5),
        "cells": model("cells"),
    }
    for name, a in cases.items():
        sizes = (BLOCK_ROWS, packed)
        cost = medians({size: ours(a, max(samples, packed), method=EXACT, block=size) for size in sizes})
        print(
            f"| {name} | {' | '.join(f'{each:.1f}' for each in cost.values())} | {cost[packed] / cost[BLOCK_ROWS]:.2f} |",
            flush=True,
        )


def whole_runs(largest: int) -> None:
    """Print the time and memory of runs of RA1 with their archive, on all processors."""
    print("\n| realizations | seconds, build to archive | archive [MB] | largest memory so far [MB] |\n|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as folder:
        samples = 1000
        while samples <= largest:
            path = Path(folder) / "run.nc"
            start = time.perf_counter()
            tc.run(model("ra1"), samples=samples, solver="daqp", out=path, overwrite=True, keep="measures").close()
            seconds = time.perf_counter() - start
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(f"| {samples} | {seconds:.2f} | {path.stat().st_size / 1e6:.1f} | {memory:.0f} |", flush=True)
            samples *= 10


@contextlib.contextmanager
def clocked(where: dict[str, list[tuple[object, str]]]) -> Iterator[dict[str, float]]:
    """Seconds spent in some functions, while the context lasts."""
    spent = dict.fromkeys(where, 0.0)
    kept = [(owner, name, getattr(owner, name)) for places in where.values() for owner, name in places]

    def timed(word: str, function: Callable) -> Callable:
        def call(*args, **kwargs):
            start = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                spent[word] += time.perf_counter() - start

        return call

    for word, places in where.items():
        for owner, name in places:
            setattr(owner, name, timed(word, getattr(owner, name)))
    try:
        yield spent
    finally:
        for owner, name, function in kept:
            setattr(owner, name, function)


def breakdown(samples: int) -> None:
    where: dict[str, list[tuple[object, str]]] = {
        "sampling": [(Draws, "__call__")],
        "scan": [(FixedScan, name) for name in ("survey", "min_gap", "deepest")],
        "QP": [(InterpretedFunction, "__call__")],
        "rows, update, measures": [(named.NamedFunction, "__call__")],
        "fields": [(DisplacementFields, "sums"), (DisplacementFields, "merge")],
        "archive": [(ArchiveWriter, "append"), (Journal, "put_into")],
    }
    print("\n| us per realization, one thread |", " | ".join(where), "| between them |\n|---|" + "---:|" * (len(where) + 1))
    cases = {
        "RA1": model("ra1"),
        "RA2": model("ra2"),
        "curved, 3003": shapes.slab(3000, 200.0),
        "flat, 100 000": shapes.slab(100_000),
    }
    for name, a in cases.items():
        program = tc.build(a, solver="daqp")
        list(simulate_blocks(program, samples=256, seed=1))
        turns = []
        for _ in range(TURNS):
            with clocked(where) as spent:
                start = time.perf_counter()
                blocks = list(simulate_blocks(program, samples=samples // 4, seed=1, threads=1))
                whole = time.perf_counter() - start
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "run.nc"
                    fields = DisplacementFields(program.nominal, "all")
                    run = Run(seed=1, samples=samples // 4, keep="measures", surfaces=0, fields="all")
                    writer = ArchiveWriter(path, program, run, fields.sizes)
                    for block in blocks:
                        fields.merge(fields.sums(block.poses, block.start, block.status))
                        writer.append(row_values(block, [row.label for row in writer.kept], program.nominal))
                    with writer.completed({}):
                        pass
            inside = {word: seconds for word, seconds in spent.items() if word not in ("fields", "archive")}
            turns.append([*spent.values(), whole - sum(inside.values())])
        cells = 1e6 * np.median(turns, axis=0) / (samples // 4)
        print(f"| {name} |", " | ".join(f"{cell:.2f}" for cell in cells), "|", flush=True)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--quick", action="store_true", help="few realizations: does it run?")
    parts = ["loops", "threads", "size", "bodies", "packing", "breakdown", "runs"]
    options.add_argument("--only", choices=parts, help="one of the measurements")
    options.add_argument("--figure", type=Path, default=HERE / "cost.png")
    chosen = options.parse_args()
    samples = 2048 if chosen.quick else 16_384
    measurements = {
        "loops": lambda: against_loops(samples),
        "threads": lambda: against_threads(samples),
        "size": lambda: against_size(samples, chosen.figure),
        "bodies": lambda: against_bodies(samples),
        "packing": lambda: against_packing(samples),
        "breakdown": lambda: breakdown(samples),
        "runs": lambda: whole_runs(10_000 if chosen.quick else 10_000_000),
    }
    for name, measure in measurements.items():
        if chosen.only in (None, name):
            measure()


if __name__ == "__main__":
    main()
