"""A rail of two profiles: what does the welding fixture leave of the flush that the inspection fixture finds?

Two steel profiles lie in a welding fixture, each on three rests; the rear one laps over the front one by 60 mm and rests on it
where they would pass through each other. There they are welded. The welded rail is then set on the pins of an inspection
fixture, two under the front profile and one under the rear one, and its end is compared with a bracket beside it.

Expected without contact: heights of rests and pins enter by straight levers. The flush has 6 sigma of 0.48 mm: 0.34 from the
pins, 0.32 from the bracket, and 0.10 from the welding fixture, since the pins leave only what it bent the rail by. One station
alone would say 0.53. Contact in the welding fixture takes 40 % off the spread of the step at the lap, and next to nothing off
the flush. Ranges are guesses.

x along the rail, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import tolcontact as tc

LENGTH, WIDTH, HEIGHT, LAP = 500.0, 80.0, 40.0, 60.0
REST, PIN, SIDE = 0.4, 0.3, 0.2  # tolerances of rests, of inspection pins, and of stops at the sides


def sides(part: tc.Part) -> list[tc.Locator]:
    """Return stops along and across the rail."""
    return [
        tc.Locator("B1", part.point(50, 0, 20), "y", SIDE),
        tc.Locator("B2", part.point(450, 0, 20), "y", SIDE),
        tc.Locator("C1", part.point(0, 40, 20), "x", SIDE),
    ]


def rests(part: tc.Part, left: float, right: float) -> list[tc.Locator]:
    """Return two rests at the left, and one at the right."""
    places = {"A1": (left, 10, 0), "A2": (left, 70, 0), "A3": (right, 40, 0)}
    return [tc.Locator(name, part.point(*place), "z", REST) for name, place in places.items()]


def assembly() -> tc.Assembly:
    line = tc.Assembly("rail", method=tc.Method(objective="all points"))
    front = line.part("front", tc.Box(LENGTH, WIDTH, HEIGHT))
    rear = line.part("rear", tc.Box(LENGTH, WIDTH, HEIGHT), at=(LENGTH - LAP, 0, HEIGHT))
    bracket = line.part("bracket", tc.Box(100, WIDTH, HEIGHT), at=(2 * LENGTH - LAP + 5, 0, HEIGHT))

    weld = line.station("weld")
    weld.locate(front, [*rests(front, 20, 480), *sides(front)])
    weld.locate(rear, [*rests(rear, 80, 480), *sides(rear)])
    lap = front.face("+z", tc.select.Inside((LENGTH - LAP, 0, HEIGHT - 1), (LENGTH, WIDTH, HEIGHT + 1)))
    weld.contact("lap", moving=rear.face("-z"), reference=lap)
    weld.measure("step", rear.point(0, 40, 0), to=front.point(LENGTH - LAP, 40, HEIGHT), along="z", tolerance=1)
    rail = weld.join("rail", front, rear)

    check = line.station("check")
    pins = {"P1": front.point(20, 10, 0), "P2": front.point(20, 70, 0), "P3": rear.point(400, 40, 0)}
    check.locate(rail, [*(tc.Locator(name, point, "z", PIN) for name, point in pins.items()), *sides(front)])
    check.locate(bracket, tc.three_two_one(*map(bracket.face, ("-z", "-y", "-x")), inset=10), tolerance=PIN)
    check.measure("flush", rear.point(LENGTH, 40, HEIGHT), to=bracket.point(0, 40, HEIGHT), along="z", tolerance=1.5)
    return line


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/rail.py
