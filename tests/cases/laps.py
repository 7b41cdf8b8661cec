"""Bodies of boxes whose whole surfaces may touch, and that overlap little sideways, or stand in corners; with their boxes."""

import numpy as np
import trimesh

import tolcontact as tc
from studies.certificates.ends import METHOD

TABLE = ((0, 0, 0), (40, 50, 13))
FLOOR, WALL, SIDE = ((-10, -10, -10), (50, 50, 0)), ((-10, -10, -10), (0, 50, 20)), ((-10, -10, -10), (50, 0, 20))


def box(low, high):
    """Return the corners (8, 3) of a box."""
    return np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])], dtype=float)


def on_table(lap, low=10, high=40, sunk=0.0):
    """Return a box that lies on a table with its end alone, `lap` [mm] of it, and the table."""
    return ((40 - lap, low, 13 - sunk), (100 - lap, high, 21 - sunk)), [TABLE]


def on_step(height):
    """Return a box on the upper one of two steps, over the lower one, and the steps."""
    return ((30, 10, 10 + height), (90, 40, 18 + height)), [((0, 0, 0), (40, 50, 10 + height)), ((0, 0, 0), (80, 50, 10))]


# by name: the moving box, the boxes of the reference body, and the range [mm] of all locators
CASES = {
    "lap": (*on_table(1.5), 0.6),
    "long lap": (*on_table(10), 4.0),
    "lap below the range": (*on_table(0.3), 0.6),
    "lap of a wider box": (*on_table(1.5, -10, 60), 0.6),
    "lap of two corners": (*on_table(1.5, 48, 90), 0.6),
    "sunk lap": (*on_table(1.5, sunk=0.1), 0.6),
    "low step": (*on_step(0.5), 4.0),
    "step": (*on_step(3), 4.0),
    "two walls": (((0, 10, 0), (30, 40, 8)), [FLOOR, WALL], 1.0),
    "wall shorter than the box": (((0, -5, 0), (30, 35, 8)), [((-10, 0, -10), (50, 30, 0)), ((-10, 0, -10), (0, 30, 20))], 1.0),
    "three walls": (((0, 0, 0), (30, 25, 8)), [FLOOR, WALL, SIDE], 1.0),
}


def case(name, faces=(None, None), turn=(0.0, 0.0, 0.0), reverses=False):
    """Return the assembly of a case, and the pieces of its fixed and its located body, for `turn` 0.

    faces      what is chosen of the box and of the body below; the whole body for None
    reverses   whether the body below is located, and the box above is fixed
    """
    (low, high), below, tolerance = CASES[name]
    pieces = [box(low, high)], [box(*ends) for ends in below]
    hulls = [[trimesh.convex.convex_hull(points) for points in of_body] for of_body in pieces]
    meshes = [of_body[0] if len(of_body) == 1 else trimesh.boolean.union(of_body, engine="manifold") for of_body in hulls]
    a = tc.Assembly(name, method=METHOD)
    located, fixed = (1, 0) if reverses else (0, 1)
    parts = {
        k: a.part(("box", "below")[k], tc.Mesh(meshes[k]), rotation=turn, fixed=k == fixed or None) for k in (fixed, located)
    }
    (x0, y0, z0), (x1, y1, _) = low, high
    feet = [(x0 + 3, y0 + 3, z0), (x1 - 3, y0 + 3, z0), ((x0 + x1) / 2, y1 - 3, z0)]
    stops = [(x0 + 3, y0, z0 + 4), (x1 - 3, y0, z0 + 4), (x0, (y0 + y1) / 2, z0 + 4)]
    rows = zip([*feet, *stops], "zzzyyx", strict=True)
    a.locate(parts[located], [tc.Locator(f"L{k}", p, along, tolerance) for k, (p, along) in enumerate(rows)])
    moving, reference = (parts[k].face() if faces[k] is None else parts[k].face(faces[k]) for k in (located, fixed))
    a.contact("contact", moving=moving, reference=reference)
    a.measure("height", parts[located].point(*pieces[located][0][-1]), along="z")
    return a, [pieces[fixed], pieces[located]]
