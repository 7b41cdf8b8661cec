"""A car's hood: hemmed, hung on its hinges, and inspected. Which station decides about the flush to the fender?

In the hemming station the outer panel is set into the inner one, and rests on it where they would pass through each other. The
hood is then hung on the body: two hinges hold its rear, and it comes down on two bump stops, which only push. Fenders are
located on the same body. The measuring machine aligns the car by eight points of the body, as a best fit.

Expected: the stops lift the hood where the latch would pull it through them, which takes two fifths off the spread of the
flush at its front corner. The machine reports the same flush, since hood and fender are on one body by then, and takes three
tenths off the spread of the corner itself, which is that of the body in its fixture. Tolerances are usual in body shops; shapes
are boxes.

Corrected poses minimize the energy of the locators: the stops touch the hood along its front alone, and a sum of displacements
of these points would let the hood swing about them, off its hinges.

x to the rear, y to the right, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import tolcontact as tc

LENGTH, WIDTH, SKIN = 900.0, 1200.0, 6.0
PANEL, HINGE, STOP, HEM = 0.5, 0.3, 0.4, 0.3


def locate(station: tc.declaration.Station, part: tc.Part, tolerance: float, on: tc.Part | None = None) -> None:
    """Locate a part by its underside, its left side and its front."""
    scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5)
    station.locate(part, scheme, tolerance=tolerance, on=on)


def datum_points(body: tc.Part) -> list[tc.Locator]:
    """Return the points by which the measuring machine aligns the body."""
    under = [body.point(x, y, 0) for x in (50, 950) for y in (50, 1450)]
    left, front = [body.point(x, 0, 10) for x in (50, 950)], [body.point(0, y, 10) for y in (50, 1450)]
    points = [("z", under), ("y", left), ("x", front)]
    return [tc.Locator(f"{axis}{k}", point, axis) for axis, places in points for k, point in enumerate(places, 1)]


def assembly() -> tc.Assembly:
    car = tc.Assembly("hood", method=tc.Method(objective="locator stiffness"))
    body = car.part("body", tc.Box(1000, 1500, 20), at=(0, -150, -60))
    inner = car.part("inner", tc.Box(LENGTH, WIDTH, SKIN))
    outer = car.part("outer", tc.Box(LENGTH, WIDTH, SKIN), at=(0, 0, SKIN))
    fender = car.part("fender", tc.Box(LENGTH, 120, SKIN), at=(0, WIDTH + 4, SKIN))
    stops = [car.part(f"stop {k}", tc.Box(30, 30, 40), at=(40, y, -40)) for k, y in enumerate((60, WIDTH - 90), 1)]
    car.may_overlap(body, *stops)  # stops are screwed into the body, to their height

    hem = car.station("hem")
    for panel in (inner, outer):
        locate(hem, panel, HEM)
    hem.contact("hem", moving=outer.face("-z"), reference=inner.face("+z"), spacing=150)
    hood = hem.join("hood", inner, outer)

    hang = car.station("hang on")
    locate(hang, body, PANEL)
    locate(hang, fender, PANEL, on=body)
    hinges = [inner.point(LENGTH - 20, y, 0) for y in (100, WIDTH - 100)]
    held = [tc.Locator(f"hinge {k} {axis}", hinge, axis, HINGE) for k, hinge in enumerate(hinges, 1) for axis in "xz"]
    held += [tc.Locator("hinge y", hinges[0], "y", HINGE), tc.Locator("latch", inner.point(20, WIDTH / 2, 0), "z", 2 * PANEL)]
    hang.locate(hood, held, on=body)
    for stop in stops:
        locate(hang, stop, STOP, on=body)
        hang.contact(stop.name, moving=inner.face("-z"), reference=stop.face("+z"))
    whole = hang.join("car", body, hood, fender, *stops)

    inspection = car.station("inspection")
    inspection.locate(whole, datum_points(body), tolerance=0, placing="best fit")
    corner, beside = outer.point(20, WIDTH, SKIN), fender.point(20, 0, SKIN)
    for station, word in ((hang, "as hung"), (inspection, "as inspected")):
        station.measure(f"flush {word}", corner, to=beside, along="z", tolerance=2)
        station.measure(f"corner {word}", corner, along="z", tolerance=2)
    return car


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/hood.py
