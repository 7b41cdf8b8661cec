"""What springs cost beside rigid supports and pairs: python studies/speed/springs.py [REALIZATIONS] (half a minute).

Processor time of one thread from draws to measures, the least of three turns, in microseconds per realization.
"""

import sys
import time

import tolcontact as tc

SOLVERS = ("daqp", "qpoases", "graph")
REALIZATIONS = 4000


def table(stiffness: float | None) -> tc.Assembly:
    """Return a table on four legs, with a load in its middle."""
    model = tc.Assembly("table", method=tc.Method(objective="seating"))
    top = model.part("top", tc.Box(400, 400, 20))
    corners = [(0, 0, 0), (400, 0, 0), (400, 400, 0), (0, 400, 0)]
    legs = [tc.Locator(f"L{k}", corner, "z", 0.6, one_sided=True, stiffness=stiffness) for k, corner in enumerate(corners)]
    sides = {"B1": ((100, 0, 0), "y"), "B2": ((300, 0, 0), "y"), "C1": ((0, 200, 0), "x")}
    model.locate(top, [*legs, *(tc.Locator(name, place, along, 0.1) for name, (place, along) in sides.items())])
    model.force("load", at=top.point(200, 200, 0), vector=(0, 0, -100))
    model.measure("height", top.point(200, 200, 0), along="z")
    return model


def pad(stiffness: float | None) -> tc.Assembly:
    """Return a block on a base, pressed beside its middle."""
    model = tc.Assembly("pad", method=tc.Method(objective="seating"))
    base = model.part("base", tc.Box(400, 300, 50))
    model.locate(base, tc.three_two_one(*map(base.face, ("-z", "-y", "-x")), inset=5), tolerance=0.3)
    block = model.part("block", tc.Box(120, 60, 30), at=(100, 100, 50))
    sides = {"B1": ((20, 0, 0), "y"), "B2": ((100, 0, 0), "y"), "C1": ((0, 30, 0), "x")}
    held = [tc.Locator(name, place, along, 0.2) for name, (place, along) in sides.items()]
    model.locate(block, held, floating=True)
    model.contact("pad", moving=block.face("-z"), reference=base.face("+z"), stiffness=stiffness)
    model.force("load", at=block.point(68, 27, 0), vector=(0, 0, -100))
    model.measure("end", block.point(120, 30, 0), along="z")
    return model


def microseconds(model: tc.Assembly, solver: str, count: int) -> float:
    """Return the processor time of a realization [us]."""
    program, turns = tc.build(model, solver=solver), []
    for _ in range(4):  # the first turn compiles
        start = time.process_time()
        for _block in tc.simulate_blocks(program, samples=count, seed=1, threads=1):
            pass
        turns.append(time.process_time() - start)
    return min(turns[1:]) / count * 1e6


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else REALIZATIONS
    print("| model | solver | springs [us] | rigid [us] | ratio |\n|---|---|---:|---:|---:|")
    for declare in (table, pad):
        for solver in SOLVERS:
            springs, rigid = (microseconds(declare(stiffness), solver, count) for stiffness in (1000.0, None))
            print(f"| {declare.__name__} | {solver} | {springs:.1f} | {rigid:.1f} | {springs / rigid:.2f} |")
