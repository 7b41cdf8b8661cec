"""Discretize: surfaces, contact points and locators of the nominal assembly, in its frame. A chapter of the guide.

`tc.build(model)` reads the shapes, finds the faces (see `tolcontact.geometry`) and spreads contact points, which are the same
in all realizations.

>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(80, 12.5, 10))
>>> scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"))
>>> location = stand.locate(block, scheme, tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z")
>>> points = tc.build(stand).nominal.pairs[0]
>>> points.P_m.max(axis=0).round(6).tolist()  # the block overhangs the table; its points end at the table's edge
[100.0, 37.5, 10.0]

## Contact points

Points are spread over the moving face, as far apart as possible, starting from the corners of its rim. Their number depends on
`points=` or `spacing=`, not on the tessellation. Each point is projected onto the reference face. It takes part if it does not
overhang the rim of that face and lies within `within` of it. A contact point consists of a position on the moving part, a
position on the reference part, and the outward normal of the reference face there.

If you leave out both `points` and `spacing`, contact points are added. For two flat faces these are the points where their
rims cross or where a corner of one lies over the other: tilted parts touch there first. For curved faces the density of points
follows the curvature. There are at most 5000 points, close enough that between them the faces cannot penetrate each other by
more than a two-thousandth of the smallest tolerance range. This is the smallest range of any locator or measure in mm; a range
narrower than a thousandth of the widest one is treated as a constant and ignored.

If a face has form, its points are a fifth of the correlation length apart, unless you choose otherwise; more than half is
refused. Planes with form touch planes that face them. A cylinder in a parallel one has a grid of points: at least 48 azimuths,
and heights a third of the correlation length apart. Other round faces have the points of curved faces. Heights are those at the
nominal points; where planes end, those at the places found at each pose, and contact points between these count as long as they
stand over the reference face. Planes with form also touch between contact points (see `tolcontact.contact`), so that closer
points find no deeper contact. Round faces with form are not followed beyond their ends.

## Warnings

A `tc.NominalWarning` states the error in mm if your points, or the triangles of a round face, allow more penetration than
that. `tc.build` checks the nominal assembly for other mistakes as well (see `tolcontact.plausibility`).

>>> import trimesh, warnings
>>> ball = tc.Assembly("ball")
>>> floor = ball.part("floor", tc.Box(40, 40, 5), at=(-20, -20, -5), fixed=True)
>>> egg = trimesh.creation.icosphere(subdivisions=4, radius=10).apply_scale([1.2, 1, 1])
>>> sphere = ball.part("egg", tc.Mesh(egg), at=(0, 0, 10))
>>> feet = [tc.Locator("A1", (-5, -5, 0), "z"), tc.Locator("A2", (5, -5, 0), "z"), tc.Locator("A3", (0, 5, 0), "z")]
>>> sides = [tc.Locator("B1", (-5, 0, 0), "y"), tc.Locator("B2", (5, 0, 0), "y"), tc.Locator("C1", (0, 0, 0), "x")]
>>> location = ball.locate(sphere, feet + sides, tolerance=1)
>>> pair = ball.contact("foot", moving=sphere.face(tc.Near(floor, 1)), reference=floor.face("+z"))
>>> height = ball.measure("height", sphere.point(0, 0, 0), along="z")
>>> with warnings.catch_warnings(record=True) as caught:
...     program = tc.build(ball)
>>> print(caught[0].message)
[coarse] contact pair "foot" (...): parts may be off by up to 0.0092 mm between flat triangles and the round faces ...

## Balls and shafts

If a ball or a shaft of one part lies beside walls of the other, no points are sampled at all. A ball (a sphere) is its centre
beside a plane, cylinder, cone or sphere, or a convex torus. A shaft (an outer cylinder) is the two ends of its axis in a
parallel hole (an inner cylinder), or along a plane. The points of contact are computed at every pose, including tilted ones: a
pin jams in its hole at the correct angle for any tessellation. Where an edge of the wall, a gap in it or another curve
may touch first, the pair has sampled points. `tolcontact check` names the pairs that are handled in this way; `points=` or
`spacing=` overrides it.

>>> stand = tc.Assembly("pin in a hole")
>>> plate = stand.part("plate", tc.Mesh(trimesh.creation.annulus(5.05, 20, 10, sections=24)), fixed=True)
>>> pin = stand.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=24)))
>>> ends = [tc.Locator(f"A{k}", (x, y, 0), "z", 0) for k, (x, y) in enumerate([(5, 0), (-5, 0), (0, 5)])]
>>> ends += [tc.Locator("B1", (0, 0, 0), "y"), tc.Locator("B2", (5, 0, 0), "y"), tc.Locator("C", (0, 0, 0), "x")]
>>> location = stand.locate(pin, ends, tolerance=0.3)
>>> fit = stand.contact("fit", moving=pin.face(tc.Cylinder()), reference=plate.face(tc.Cylinder(inner=True, radius=5.05)))
>>> aside = stand.measure("aside", pin.point(0, 0, 0), along="x")
>>> print(tc.build(stand))
program of pin in a hole: ...
  contact fit: 12 contact points, exact on round faces; triangles up to 0.043 mm inside
...

Diameters of features vary exactly in these contacts: the radius of the ball, the shaft or the wall is the drawn one.

The ends of the faces are those of the nominal assembly. A shaft that is pushed out of its hole, or a ball beyond the end of
its wall, is detected only afterwards (see the checks of surfaces in `tolcontact.contact`).
"""

from tolcontact.discretization.coordinates_in_words import coordinates_in_words
from tolcontact.discretization.counted_points import counted_points
from tolcontact.discretization.discretizing import discretize
from tolcontact.discretization.form_places import FIRST_POINT, raised_places, rim_points
from tolcontact.discretization.locators import Locators, NominalPart
from tolcontact.discretization.nominal import ContactPoints, Nominal
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.round_points import RoundPoint, RoundPoints

__all__ = [
    "FIRST_POINT", "ContactPoints", "Locators", "Nominal", "NominalPart", "Offsets", "RoundPoint",
    "RoundPoints", "coordinates_in_words", "counted_points", "discretize", "raised_places", "rim_points",
]  # fmt: skip
