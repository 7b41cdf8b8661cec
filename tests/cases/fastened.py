"""Plates with holes, bolted, screwed or pinned together."""

from collections.abc import Mapping

import numpy as np
import trimesh
from scipy.optimize import linprog

import tolcontact as tc
from tests.cases.frames import STILL, Frame
from tolcontact.declaration import GeometricTolerance

LENGTH, WIDTH, THICKNESS = 120.0, 60.0, 8.0
Place = tuple[float, float]
FOUR = [(x, y) for x in (-45.0, 45.0) for y in (-20.0, 20.0)]


def drilled(holes: Mapping[Place, float], sections: int = 48) -> trimesh.Trimesh:
    """A plate about the z axis, from z = 0 up, with holes of given diameters at places (x, y)."""
    slab = trimesh.creation.box(bounds=[(-LENGTH / 2, -WIDTH / 2, 0), (LENGTH / 2, WIDTH / 2, THICKNESS)])
    drills = [
        trimesh.creation.cylinder(diameter / 2, 3 * THICKNESS, sections=sections).apply_translation((x, y, THICKNESS / 2))
        for (x, y), diameter in holes.items()
    ]
    return trimesh.boolean.difference([slab, *drills], engine="manifold")


def plate(a: tc.Assembly, name: str, level: int, holes: Mapping[Place, float], frame: Frame = STILL, **options) -> tc.Part:
    """Declare a drilled plate with datums A (under), B (side) and C (end), as the plate number `level` of a stack."""
    part = a.part(name, tc.Mesh(drilled(holes)), **frame.place(0, 0, level * THICKNESS), **options)
    for letter, face in {"A": "-z", "B": "-y", "C": "-x"}.items():
        part.feature(letter, part.face(face), datum=letter)
    return part


def hole(part: tc.Part, name: str, place: Place, *tolerances) -> tc.declaration.Feature:
    """Declare the hole at a place, with its tolerances."""
    x, y = place
    box = tc.select.Inside((x - 8, y - 8, -1), (x + 8, y + 8, THICKNESS + 1))
    return part.feature(name, part.face(tc.select.Cylinder(inner=True), box), *tolerances)


def placed(width: float, rule: str = "translation") -> GeometricTolerance:
    return tc.Position(width, "A|B|C", rule=rule)


def lying(z: float = 0.0) -> list[tc.Locator]:
    """Three exact locators under a plate, which leave it free in their plane."""
    feet = [(40, -20), (-40, -20), (0, 20)]
    return [tc.Locator(f"Z{k}", (x, y, z), "z", 0.0) for k, (x, y) in enumerate(feet)]


def held(z: float = 0.0) -> list[tc.Locator]:
    """Six exact locators."""
    sides = [tc.Locator("Y1", (-40, 0, z), "y", 0.0), tc.Locator("Y2", (40, 0, z), "y", 0.0)]
    return [*lying(z), *sides, tc.Locator("X", (0, 0, z), "x", 0.0)]


def shifts(results, part: str, holes: int) -> np.ndarray:
    """Shifts (realization, hole, 2) [mm] of the holes "H0", "H1" ... of a part."""
    drawn = results["sample"].deviation
    labels = [[f"{part}.H{k}.shift {axis}" for axis in "xy"] for k in range(holes)]
    return np.array([[drawn.sel(contributor=label).values for label in row] for row in labels]).transpose(2, 0, 1)


def grown(results, part: str, holes: int) -> np.ndarray:
    """Deviations (realization, hole) [mm] of the diameters of the holes of a part."""
    drawn = results["sample"].deviation
    return np.array([drawn.sel(contributor=f"{part}.H{k}.size").values for k in range(holes)]).T


def most_room(off: np.ndarray, room: np.ndarray) -> float:
    """The largest room [mm] that all holes (hole, 2) can have at once, for a cover that shifts and turns a little."""
    ways = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    n = np.column_stack([np.cos(ways), np.sin(ways)])
    arms = np.column_stack([-np.array(FOUR)[:, 1], np.array(FOUR)[:, 0]])
    rows = np.vstack([np.column_stack([n, n @ arm, np.ones(len(n))]) for arm in arms])
    bounds = np.concatenate([r - n @ shift for shift, r in zip(off, room, strict=True)])
    return float(-linprog([0, 0, 0, -1], rows, bounds, bounds=[(None, None)] * 4).fun)


def bolted(
    places: list[Place],
    *,
    into: bool = False,
    position: tuple[float, float] = (1.0, 1.0),  # of the holes of the base, and of the cover; 0 for none
    size: float = 0.0,
    method: tc.Method | None = None,
    hole_diameter: float = 11.0,
    shank: float | tc.Size = 10.0,
    is_cover_fixed: bool = False,
    frame: Frame = STILL,
    pushed=None,
) -> tc.Assembly:
    """A cover on a base, held by bolts: they float in clearance holes of both, or go into threads of the base.

    The cover lies on the base, and is free in its plane unless it is fixed.
    """
    a = tc.Assembly("bolted", method=method)
    base = plate(a, "base", 0, dict.fromkeys(places, 8.5 if into else hole_diameter), frame, fixed=True)
    cover = plate(a, "cover", 1, dict.fromkeys(places, hole_diameter), frame, fixed=True if is_cover_fixed else None)
    sizes = [tc.Size(hole_diameter, size)] if size else []
    if not is_cover_fixed:
        a.locate(cover, lying(), floating=True)
    for k, place in enumerate(places):
        lower, upper = (
            hole(part, f"H{k}", place, *(tolerances if width == 0 else [*tolerances, placed(width)]))
            for part, tolerances, width in zip((base, cover), ([] if into else sizes, sizes), position, strict=True)
        )
        holes = {"through": [upper], "into": lower} if into else {"through": [upper, lower]}
        tc.fasten(a, f"bolt {k + 1}", shank, seat=cover.face("+z"), pushed=pushed, **holes)
    for axis in "xy":
        along = frame.along(*np.eye(3)["xy".index(axis)])
        a.measure(axis, cover.point(0, 0, 0), along=along)
    end = cover.point(LENGTH / 2, 0, 0)
    a.measure("end y", end, along=frame.along(0, 1, 0))
    return a
