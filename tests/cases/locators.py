"""Ways to hold a part."""

from scipy.stats import norm

import tolcontact as tc


def translating(tolerance) -> list[tc.Locator]:
    """Six locators of which one varies, and moves the part along z without turning it."""
    return [
        tc.Locator("Z", (5, 5, 0), "z", tolerance),
        tc.Locator("X1", (0, 5, 0), "x", 0),
        tc.Locator("X2", (0, 5, 10), "x", 0),
        tc.Locator("X3", (0, 15, 0), "x", 0),
        tc.Locator("Y1", (5, 0, 0), "y", 0),
        tc.Locator("Y2", (5, 0, 10), "y", 0),
    ]


def parked(*names: str, away: float = 0.5) -> list[tc.Locator]:
    """One-sided stops that hold nothing once a part has come to rest: `name:x,y,z:direction`, that far behind the part."""
    found = []
    for said in names:
        name, at, along = said.split(":")
        point = tuple(float(c) for c in at.split(","))
        found.append(tc.Locator(name, point, along, norm(-away, 1e-9), one_sided=True))
    return found
