"""The assembly "as1" of the STEP implementor forum, declared from its file: plate, two brackets, rod, bolts and nuts.

The brackets stand on the plate, the nuts of the rod bear on the brackets' backs. Bolts, their nuts and the rod are not
toleranced: they stay where the file has them. Measured are the gap between the brackets' feet, how flush their tops are, and
the room between the rod's nuts. A tolerance is the full width of its zone [mm].

    tolcontact run studies/cad/as1.py --samples 10000
    python -m studies.cad.as1 [--samples 2000] [--to FOLDER]     figure and table of the page
"""

import argparse
from pathlib import Path

import tolcontact as tc
from studies.tables import with_interval, write

FILE = Path(__file__).with_name("as1-oc-214.stp")
MOVING = ["l-bracket_1", "l-bracket_1 (2)", "nut_1", "nut_2"]
PLACED = 0.4


def assembly() -> tc.Assembly:
    model = tc.Assembly("as1", method=tc.Method(resolution="exact", objective="all points"))
    fixed = tc.io.parts_from(model, FILE, [body.name for body in tc.io.bodies_in(FILE) if body.name not in MOVING], fixed=True)
    near, far, far_nut, near_nut = tc.io.parts_from(model, FILE, MOVING).values()
    top = fixed["plate_1"].face(tc.select.Largest("plane", "+z"))
    bolts = [part for name, part in fixed.items() if name.startswith("bolt")]  # as thick as their holes, as the file has them
    for bracket in (near, far):
        model.may_overlap(bracket, fixed["rod_1"], *bolts)
        foot, back = bracket.face(tc.select.Largest("plane", "-y")), bracket.face(tc.select.Largest("plane", "-x"))
        model.locate(bracket, tc.three_two_one(foot, back, bracket.face("-z"), inset=5), tolerance=PLACED)
        model.contact(f"foot of {bracket.name}", moving=foot, reference=top)
    for nut, bracket, side in ((far_nut, far, "-z"), (near_nut, near, "+z")):
        bearing = nut.face(tc.select.Largest("plane", side))
        model.may_overlap(nut, fixed["rod_1"])  # its thread
        model.locate(nut, tc.three_two_one(bearing, nut.face("-y"), nut.face("-x"), inset=2), tolerance=PLACED)
        model.contact(f"{nut.name} on {bracket.name}", moving=bearing, reference=bracket.face(tc.select.Largest("plane", "-x")))
    model.measure("gap of the feet", near.point(50, 5, 50), to=far.point(50, 5, 50), along="x", tolerance=1)
    model.measure("flush of the tops", near.point(5, 60, 50), to=far.point(5, 60, 50), along="z", tolerance=1)
    model.measure("between the nuts", near_nut.point(10, 7.5, 3), to=far_nut.point(10, 7.5, 0), along="x", tolerance=1)
    return model


def main() -> None:
    """Draw the assembly, and write the table of its measures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--to", type=Path, default=FILE.parent, help="folder of the figure and the page")
    arguments = parser.parse_args()
    model = assembly()
    tc.plot.assembly(model, marks=False).screenshot(arguments.to / "as1.png", window_size=(760, 560))
    run = tc.run(model, samples=arguments.samples, seed=1, solver="daqp", fields="none")
    spreads = tc.summarize(run).statistic_value.sel(statistic="6 sigma")
    rows: list[tuple[object, ...]] = [("measure", *(f"6 sigma, {state} [mm]" for state in run.state.values))]
    for measure in run.measure.values:
        rows.append(
            (measure, *(with_interval(*spreads.sel(measure=measure, state=state).values) for state in run.state.values))
        )
    write(__file__, {"as1": rows}, arguments.to)


if __name__ == "__main__":
    main()
