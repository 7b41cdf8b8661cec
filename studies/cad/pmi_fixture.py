"""Parts with the tolerances that their files state, each on a fixture: python studies/cad/pmi_fixture.py FOLDER [--samples N].

The folder holds the AP242 files of NIST's test cases CTC 01, FTC 06 and FTC 10. Each part seats with its datum feature A on
boxes, pressed by its weight, and locators touch its datum features B and C. Printed are statuses, spreads of measures, those
that a sum by hand gives, and the contributors of each measure.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.pmi.declared import DeclaredPmi

FIXTURE = 0.05  # tolerance of the seats and of the locators of a fixture
AXIS = 1 / 7.27  # standard deviation of an end of an axis in a round zone of width 1, of which 99.73 % are inside
RECTANGLE = 1 / 11.77  # standard deviation of the middle of a rectangular plane in a zone of width 1
SIZE = 1 / 6
MAX_LABELS = 3  # of a group of contributors


@dataclass(frozen=True)
class Case:
    """A part on a fixture.

    body      of the file
    seats     corners of boxes, by the name of the face that is the seat
    locators  name, letter of the datum feature, point and direction into the part
    measure   adds measures to a model, and returns the standard deviations by hand of some of them
    """

    file: str
    body: int | None
    down: tuple[float, float, float]
    middle: tuple[float, float, float]
    face: str
    seats: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]
    locators: tuple[tuple[str, str, tuple[float, float, float], str], ...]
    measure: Callable[[tc.Assembly, tc.Part], dict[str, float]]


def ctc_01(model: tc.Assembly, part: tc.Part) -> dict[str, float]:
    """Measure a slot, a side and a round corner of CTC 01.

    The locators at B hold x and y, that at C holds y, so the part turns about z by (C - B) / 650 mm. As B grows, its locators
    let the part go by half of that, along -x and along -y, and both move the slot along -x. The middle of a slot has no tilt.
    """
    features = {feature.name: feature for feature in part.features}
    slot, side = features["slot 38"], features["plane 23"]
    middle = (-150.0, 117.5, -25.0)
    model.measure("slot 38, x", slot.point(*middle), along="x", tolerance=1)
    model.measure("slot 38 in the part", slot.point(*middle), to=part.point(*middle), along="x", tolerance=1)
    model.measure("side 23, y", side.point(325, -225, -50), along="y", tolerance=1.5)
    model.measure("side 23 in the part", side.point(325, -225, -50), to=part.point(325, -225, -50), along="y", tolerance=1.5)
    model.measure("end 25, x", features["plane 25"].point(400, 0, 0), along="x", tolerance=2)
    arm = 117.5 + 175
    by_hand = np.array([
        0.75 * RECTANGLE,
        FIXTURE * SIZE, FIXTURE * SIZE * arm / 650, FIXTURE * SIZE * arm / 650,  # locators B1, B2, C1
        0.2 * SIZE / 2 * (1 + arm / 650), 0.2 * SIZE / 2 * arm / 650,  # sizes of B and C
    ])  # fmt: skip
    return {
        "slot 38, x": float(np.linalg.norm(by_hand)),
        "slot 38 in the part": 0.75 * RECTANGLE,
        "side 23 in the part": 1.25 * RECTANGLE,
    }


def ftc_06(model: tc.Assembly, part: tc.Part) -> dict[str, float]:
    """Measure a hole of a pattern at maximum material, the height of D, and an inclined plane of FTC 06.

    The zone of a hole grows with its size, which departs from its lower limit by 0.2032 mm on average. The frame that leans
    with B and C adds to it.
    """
    features = {feature.name: feature for feature in part.features}
    hole, height, incline = features["cylinders 71 1"], features["D"], features["plane 56"]
    position = hole.axis(1)
    place = (-133.35, 19.05, -184.15)
    model.measure("hole 71 1, x", position, along="x", tolerance=1)
    model.measure("hole 71 1 in the part", position, to=part.point(*place), along="x", tolerance=1)
    middle = (0.0, 31.75, -120.65)
    model.measure("height of D", height.point(*middle), along="y", tolerance=1)
    model.measure("D in the part", height.point(*middle), to=part.point(*middle), along="y", tolerance=1)
    model.measure("incline 56", incline.point(0, 72.39, -82.55), along=(0, 0.89442719, -0.4472136), tolerance=1.5)
    growth = np.hypot(0.635 + 0.2032, 0.4064 * SIZE)
    return {"hole 71 1 in the part": float(growth) * AXIS, "D in the part": 0.508 * RECTANGLE}


def ftc_10(model: tc.Assembly, part: tc.Part) -> dict[str, float]:
    """Measure holes to A|B|C and to D|B|C, and a height in a composite frame of FTC 10."""
    features = {feature.name: feature for feature in part.features}
    hole, far, top = features["cylinders 131 1"], features["E"], features["plane 204"]
    place = (-52.0, 19.7308, -15.5)
    model.measure("hole 131 1, x", hole.axis(1), along="x", tolerance=1)
    model.measure("hole 131 1 in the part", hole.axis(1), to=part.point(*place), along="x", tolerance=1)
    model.measure("hole E, z", far.axis(1), along="z", tolerance=1)
    model.measure("plane 204, y", top.point(0, 8, 0), along="y", tolerance=1.2)
    return {"hole 131 1 in the part": 0.75 * AXIS}


CASES = {
    "CTC 01": Case(
        "nist_ctc_01_asme1_ap242-e1.stp", None, (0, 0, 1), (0, 0, -50), "-z",
        (((-390, -215, 0), (-250, 215, 30)), ((250, -215, 0), (390, 215, 30))),
        (("B1", "B", (-307.5, -175, -50), "x"), ("B2", "B", (-325, -157.5, -50), "y"), ("C1", "C", (325, -157.5, -50), "y")),
        ctc_01,
    ),
    "FTC 06": Case(
        "nist_ftc_06_asme1_ap242-e2.stp", None, (0, -1, 0), (0, 30, -110), "+y",
        (((-150, -20, -230), (150, 0, -5)),),
        (("C1", "C", (-140, 20, 0), "-z"), ("C2", "C", (140, 20, 0), "-z"), ("B1", "B", (-152.4, 10, -120), "x")),
        ftc_06,
    ),
    "FTC 10": Case(
        "nist_ftc_10_asme1_ap242-e2.stp", 1, (0, -1, 0), (0, 12, 0), "+y",
        (((-75, -10, -35), (-60, 0, 35)), ((62, -10, -35), (77, 0, 35))),
        (("B1", "B", (73, 3, 28.5), "x"), ("B2", "B", (70, 3, 31.5), "z"), ("C1", "C", (-70, 3, 31.5), "z")),
        ftc_10,
    ),
}  # fmt: skip


def assembly(case: Case, folder: Path, name: str) -> tuple[tc.Assembly, DeclaredPmi, dict[str, float]]:
    """Return the model of a case, what became of its PMI, and standard deviations by hand."""
    model = tc.Assembly(name, method=tc.Method(objective="seating"))
    part = model.part(name, tc.Mesh(folder / case.file, body=case.body, chord=0.05))
    declared = tc.io.features_from_pmi(part)
    letters = {feature.datum: feature for feature in part.features}
    opposite = case.face.translate(str.maketrans("+-", "-+"))
    locators = [tc.Locator(label, point, along, on=letters[letter]) for label, letter, point, along in case.locators]
    model.locate(part, locators, tolerance=FIXTURE, floating=True)
    for number, (low, high) in enumerate(case.seats, start=1):
        box = model.part(f"seat {number}", tc.Box(*np.subtract(high, low)), at=low, fixed=True)
        box.feature("foot", box.face(opposite), datum="A")
        top = box.feature("top", box.face(case.face), tc.Profile(FIXTURE, "A"))
        model.contact(f"A on seat {number}", moving=letters["A"], reference=top)
    model.force("weight", at=part.point(*case.middle), vector=np.multiply(case.down, 10.0))
    return model, declared, case.measure(model, part)


def main() -> None:
    """Print the results of each case whose file is in the folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, default=2000)
    parser.add_argument("--base", type=int, default=512, help="base realizations of the contributions")
    arguments = parser.parse_args()
    for name, case in CASES.items():
        if (arguments.folder / case.file).exists():
            _report(name, case, arguments)
        else:
            print(f"{name}: there is no {case.file} in {arguments.folder}")


def _report(name: str, case: Case, arguments: argparse.Namespace) -> None:
    start = time.process_time()
    model, declared, by_hand = assembly(case, arguments.folder, name)
    program = tc.build(model)
    print(f"\n{name}: {len(declared.features)} features and patterns, {len(program.draws.labels)} contributors, ", end="")
    print(f"{time.process_time() - start:.1f} s CPU")
    start = time.process_time()
    rows = tc.simulate(program, arguments.samples).compute()
    statuses = {status.name: int((rows.status == status).sum()) for status in tc.Status if (rows.status == status).any()}
    print(f"{arguments.samples} realizations, {time.process_time() - start:.1f} s CPU, {statuses}")
    start = time.process_time()
    shares = tc.analyses.contributions(program, samples=arguments.base)
    print(f"contributions of {shares.attrs['realizations']} realizations, {time.process_time() - start:.1f} s CPU")
    print("| measure | 6 sigma raw | 6 sigma corrected | by hand | contributors |\n|---|---:|---:|---:|---|")
    for measure in rows.measure.values.tolist():
        raw, corrected = 6 * rows.measured.sel(measure=measure).std("realization").values
        ordered = shares.linear.sel(measure=measure).drop_vars("measure").to_series().sort_values(ascending=False)
        largest = ", ".join(
            f"{_shortened(label)} {100 * share:.0f} %" for label, share in ordered.head(5).items() if share > 0.01
        )
        expected = f"{6 * by_hand[measure]:.4f}" if measure in by_hand else ""
        print(f"| {measure} | {raw:.4f} | {corrected:.4f} | {expected} | {largest} |", flush=True)


def _shortened(group: str) -> str:
    """Return the label of a group of contributors that are not independent: the first three of them."""
    labels = group.split(" + ")
    return group if len(labels) <= MAX_LABELS else f"{' + '.join(labels[:MAX_LABELS])} and {len(labels) - MAX_LABELS} more"


if __name__ == "__main__":
    main()
