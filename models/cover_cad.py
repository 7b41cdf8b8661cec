"""Script that makes housing.step and cover.step, the shapes of cover.py. It needs build123d; the two files are beside it."""

import math
from pathlib import Path

import build123d as bd

HERE = Path(__file__).parent
LENGTH, WIDTH, DEPTH, COVER = 120.0, 80.0, 40.0, 8.0
ROUND, SLOTTED = (15.0, 15.0), (105.0, 65.0)  # where the dowel pins stand
PIN, HOLE = 8.0, 8.1  # diameters; the slot is as wide as the hole
CORNER = (bd.Align.MIN, bd.Align.MIN, bd.Align.MIN)


def housing() -> bd.BuildPart:
    """Return a block with a cavity and two blind holes, into which the pins are pressed."""
    with bd.BuildPart() as made:
        bd.Box(LENGTH, WIDTH, DEPTH, align=CORNER)
        bd.fillet(made.edges().filter_by(bd.Axis.Z), 6)
        with bd.Locations((LENGTH / 2, WIDTH / 2, DEPTH)):
            bd.Box(60, 40, 30, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX), mode=bd.Mode.SUBTRACT)
        for pin in (ROUND, SLOTTED):
            with bd.Locations((*pin, DEPTH)):
                bd.Cylinder(PIN / 2, 12, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX), mode=bd.Mode.SUBTRACT)
    return made


def cover() -> bd.BuildPart:
    """Return a plate with a round hole, and a slot along the line between the two pins."""
    with bd.BuildPart() as made:
        bd.Box(LENGTH, WIDTH, COVER, align=CORNER)
        bd.fillet(made.edges().filter_by(bd.Axis.Z), 6)
        with bd.Locations((*ROUND, 0)):
            bd.Cylinder(HOLE / 2, COVER, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN), mode=bd.Mode.SUBTRACT)
        turn = math.degrees(math.atan2(SLOTTED[1] - ROUND[1], SLOTTED[0] - ROUND[0]))
        with bd.BuildSketch(), bd.Locations(bd.Location((*SLOTTED, 0), (0, 0, turn))):
            bd.SlotOverall(HOLE + 4, HOLE)
        bd.extrude(amount=COVER, mode=bd.Mode.SUBTRACT)
    return made


if __name__ == "__main__":
    bd.export_step(housing().part, HERE / "housing.step", timestamp="2026-11-21T00:00:00")
    bd.export_step(cover().part, HERE / "cover.step", timestamp="2026-11-21T00:00:00")
