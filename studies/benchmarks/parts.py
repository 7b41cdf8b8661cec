"""Parts that several models declare."""

from __future__ import annotations  # references.py reads this module without tolcontact

from typing import Any

import trimesh
from scipy import stats

import tolcontact as tc

AXES = "xyz"


def sliding(size: tuple[float, float, float], along: str, tolerance: Any) -> list[tc.Locator]:
    """Return six locators of a box, of which "S" alone varies: it moves the box `along` an axis without turning it."""
    k = AXES.index(along)
    i, j = (k + 1) % 3, (k + 2) % 3

    def corner(*axes: int) -> tuple[float, ...]:
        return tuple(size[axis] if axis in axes else 0.0 for axis in range(3))

    first = [tc.Locator(f"I{n}", point, AXES[i], 0.0) for n, point in enumerate((corner(), corner(k), corner(j)))]
    second = [tc.Locator(f"J{n}", point, AXES[j], 0.0) for n, point in enumerate((corner(), corner(k)))]
    return [tc.Locator("S", corner(), along, tolerance), *first, *second]


def slider(
    model: tc.Assembly, name: str, tolerance: Any, *, along: str = "z", at: Any = (0, 0, 0), on: tc.Part | None = None,
    size: tuple[float, float, float] = (10, 10, 10),
) -> tc.Part:  # fmt: skip
    """Declare a box that moves along one axis by a deviation; `on` another part it follows that part."""
    part = model.part(name, tc.Box(*size), at=at)
    model.locate(part, sliding(size, along, tolerance), on=on)
    return part


def dimensions(model: tc.Assembly, **tolerances: Any) -> dict[str, tc.Part]:
    """Declare a slider along x for each dimension of a drawing: how far it has moved is the deviation of the dimension."""
    places = enumerate(tolerances.items())
    return {name: slider(model, name, tolerance, along="x", at=(0, 20.0 * k, 0)) for k, (name, tolerance) in places}


def leaning_wall(
    model: tc.Assembly, name: str, x: float, *, off: Any, tilt: Any, arm: float, on: tc.Part | None = None
) -> tc.Part:
    """Declare a wall of 1 x 2 arm x 2 arm whose lower corner is (x, -arm, 0); it moves along x, and leans in the plane x, y.

    `off` [mm] is the distribution of its displacement, and `tilt` [rad] that of its angle; None for what does not vary.
    """
    part = model.part(name, tc.Box(1, 2 * arm, 2 * arm), at=(x, -arm, 0), fixed=True)
    guides = {"Z1": ((0, 0, 0), "z"), "Z2": ((1, 0, 0), "z"), "Z3": ((0, 2 * arm, 0), "z"), "Y": ((0, 0, 0), "y")}
    ends = [tc.Locator(f"X{k}", (0, y, 0), "x", 0.0) for k, y in enumerate((0, 2 * arm))]
    model.locate(part, [*(tc.Locator(key, point, axis, 0.0) for key, (point, axis) in guides.items()), *ends], on=on)
    for cause, tolerance, arms, units in (("off", off, (1.0, 1.0), "mm"), ("tilt", tilt, (-arm, arm), "rad")):
        if tolerance is not None:
            drives = {f"{name}.X{k}": arms[k] for k in (0, 1)}
            model.variable(f"{name} {cause}", tolerance, drives=drives, units=units)
    return part


def pins_and_slots(*, off: Any, tilt: Any, pin: float, slot: float, places: Any) -> tc.Assembly:
    """Return a plate with square pins in slots, free to slide along x only, and pushed along x to where the pins fit.

    `off` and `tilt` are as for leaning walls, the faces of pins and slots.
    """
    model = tc.Assembly("pins and slots", method=tc.Method(search="fixed", resolution="exact", objective="seating"))
    plate = model.part("plate", tc.Box(130, 40, 5), at=(0, -20, pin), fixed=False)
    guides = {"A1": ((10, 5, 0), "z"), "A2": ((120, 5, 0), "z"), "A3": ((65, 35, 0), "z")}
    guides |= {"B1": ((10, 0, 2), "y"), "B2": ((120, 0, 2), "y")}
    stop = tc.Locator("stop", (0, 20, 2), "x", stats.uniform(-1, 1e-9), one_sided=True)
    model.locate(plate, [*(tc.Locator(name, point, axis, 0.0) for name, (point, axis) in guides.items()), stop])
    model.force("push", at=plate.point(0, 20, 2), vector=(1, 0, 0))
    spread = {"off": off, "tilt": tilt, "arm": pin / 2}
    for k, x in enumerate(places):
        pin_left = leaning_wall(model, f"pin {k} left", x - pin / 2, on=plate, **spread)
        pin_right = leaning_wall(model, f"pin {k} right", x + pin / 2 - 1, on=plate, **spread)
        slot_left = leaning_wall(model, f"slot {k} left", x - slot / 2 - 1, **spread)
        slot_right = leaning_wall(model, f"slot {k} right", x + slot / 2, **spread)
        model.contact(f"left {k}", moving=pin_left.face("-x"), reference=slot_left.face("+x"), points="vertices")
        model.contact(f"right {k}", moving=pin_right.face("+x"), reference=slot_right.face("-x"), points="vertices")
    model.measure("slide", plate.point(0, 0, 0), along="x")
    return model


def ring(model: tc.Assembly, radius: float, height: float, feature: str, *tolerances: Any) -> tc.declaration.Feature:
    """Return a toleranced bore or rim of a fixed ring about z, its lower plane datum A and the other cylinder datum B."""
    shape = trimesh.creation.annulus(radius, 4 * radius, height, sections=48)
    part = model.part("ring", tc.Mesh(shape), fixed=True)
    part.feature("bottom", part.face("-z"), datum="A")
    bore, rim = part.face(tc.select.Cylinder(inner=True)), part.face(tc.select.Cylinder(inner=False))
    face, other_face = (bore, rim) if feature == "bore" else (rim, bore)
    part.feature("other", other_face, datum="B")
    return part.feature(feature, face, *tolerances)


def block(model: tc.Assembly, size: tuple[float, float, float], *tolerances: Any) -> tc.declaration.Feature:
    """Return the toleranced top of a fixed block, its lower plane datum A, a side datum B and an end datum C."""
    part = model.part("block", tc.Box(*size), fixed=True)
    for letter, direction in (("A", "-z"), ("B", "-y"), ("C", "-x")):
        part.feature(letter, part.face(direction), datum=letter)
    return part.feature("top", part.face("+z"), *tolerances)
