"""Assemblies that are built in stations, whose answers are known in closed form."""

from collections.abc import Callable
from typing import Any

import casadi as ca

import tolcontact as tc

SIGMA = 0.1  # mm


def held(part: tc.Part, x: float = 20.0) -> list[tc.Locator]:
    """Locators that hold a part in x and y."""
    places = {"B1": ((x, 0, 5), "y"), "B2": ((x + 20, 0, 5), "y"), "C1": ((0, 10, 5), "x")}
    return [tc.Locator(name, part.point(*p), along) for name, (p, along) in places.items()]


def supported(part: tc.Part, left: float, right: float) -> list[tc.Locator]:
    """Locators that hold a part, in z at three points."""
    rests = [(left, 5, 0), (left, 15, 0), (right, 10, 0)]
    return [*(tc.Locator(f"A{k}", part.point(*p), "z") for k, p in enumerate(rests, 1)), *held(part)]


def rail() -> tc.Assembly:
    """Two parts that move in z, rest on each other, and are joined; the joint is placed on two pins, beside a third part."""
    line = tc.Assembly("rail", method=tc.Method(objective="all points"))
    a = line.part("a", tc.Box(100, 20, 10))
    b = line.part("b", tc.Box(100, 20, 10), at=(60, 0, 10))
    c = line.part("c", tc.Box(50, 20, 10), at=(165, 0, 10))
    weld = line.station("weld")
    weld.locate(a, supported(a, 10, 90), tolerance=0)
    weld.locate(b, supported(b, 50, 90), tolerance=0)
    weld.contact("lap", moving=b.face("-z"), reference=a.face("+z", tc.select.Inside((60, 0, 9), (100, 20, 11))), points=40)
    weld.measure("step", b.point(0, 10, 0), to=a.point(60, 10, 10), along="z")
    joint = weld.join("ab", a, b)
    check = line.station("check")
    pins = [tc.Locator("P1", a.point(10, 5, 0), "z"), tc.Locator("P2", a.point(10, 15, 0), "z")]
    check.locate(joint, [*pins, tc.Locator("P3", b.point(90, 10, 0), "z"), *held(a)], tolerance=0)
    check.locate(c, supported(c, 5, 45), tolerance=0)
    check.measure("flush", b.point(100, 10, 10), to=c.point(0, 10, 10), along="z")
    for name, body, locators in (
        ("za", "weld.a", "A1 A2 A3"), ("zb", "weld.b", "A1 A2 A3"), ("p1", "check.ab", "P1 P2"), ("p2", "check.ab", "P3"),
        ("zc", "check.c", "A1 A2 A3"),
    ):  # fmt: skip
        drives = {f"{body}.{locator}": 1.0 for locator in locators.split()}
        line.variable(name, 6 * SIGMA, drives=drives)
    return line


def three_stations(tolerance: float, *, contact: bool = True, placing: str = "first order", x: float = 0.0) -> tc.Assembly:
    """Boxes that are placed with six locators each, joined, located by points of both, and joined with a third one."""
    line = tc.Assembly("three stations")
    a = line.part("a", tc.Box(100, 50, 10), at=(x, 0, 0))
    b = line.part("b", tc.Box(100, 50, 10), at=(x + 60, 0, 10), rotation=(0, 0, 0.01))
    c = line.part("c", tc.Box(40, 50, 10), at=(x + 160, 0, 10))
    tack, weld, check = (line.station(name) for name in ("tack", "weld", "check"))
    for part in (a, b):
        tack.locate(part, box_scheme(part), tolerance=tolerance, placing=placing)
    ab = tack.join("ab", a, b)
    weld.locate(ab, pins(a, b), tolerance=tolerance, placing=placing)
    weld.locate(c, box_scheme(c), tolerance=tolerance, placing=placing)
    abc = weld.join("abc", ab, c)
    check.locate(abc, pins(a, c), tolerance=tolerance, placing=placing)
    if contact:
        tack.contact("lap", moving=b.face("-z"), reference=a.face("+z"))
        weld.contact("butt", moving=c.face("-x"), reference=b.face("+x"))
    for station in (tack, weld, check):
        station.measure(f"{station.name} a to b", distance(a.point(0, 50, 10), b.point(100, 0, 0)))
        station.measure(f"{station.name} height", b.point(100, 50, 10), along="z")
    for station in (weld, check):
        station.measure(f"{station.name} b to c", distance(b.point(0, 50, 10), c.point(40, 0, 0)))
    return line


def box_scheme(part: tc.Part) -> object:
    return tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5)


def pins(first: tc.Part, last: tc.Part) -> list[tc.Locator]:
    """Six locators at points of two parts."""
    return [
        tc.Locator("P1", first.point(5, 5, 0), "z"),
        tc.Locator("P2", first.point(5, 45, 0), "z"),
        tc.Locator("P3", last.point(35, 25, 0), "z"),
        tc.Locator("H1", first.point(5, 0, 5), "y"),
        tc.Locator("H2", last.point(35, 0, 5), "y"),
        tc.Locator("S1", first.point(0, 25, 5), "x"),
    ]


def distance(start: tc.declaration.Point, end: tc.declaration.Point) -> Callable[[Any], ca.SX]:
    """The distance of two points, wherever their parts stand."""
    return lambda poses: ca.norm_2(poses.position(end) - poses.position(start))
