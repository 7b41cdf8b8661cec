"""Discretize: shapes become surfaces, contact points and locator points in the nominal assembly frame. A chapter of the guide.

`tc.build(model)` reads the shapes, finds the faces, and spreads contact points. They are the same in all realizations.

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

Points are spread over the moving face, as far apart as possible, starting from the corners of its rim. They follow `points=`
or `spacing=`, not the tessellation. Each point is projected onto the reference face. It takes part if it does not overhang the
rim of that face and lies within `within` of it. A contact point has a place on the moving part, a place on the reference part,
and the outward normal of the reference face there.

If you leave out both `points` and `spacing`, contact points are added. For two flat faces these are the points where their
rims cross or where a corner of one lies over the other: tilted parts touch there first. For curved faces the points follow
curvature. They are at most 5000, and so close that the faces cannot sink into each other between them by more than a
two-thousandth of the smallest tolerance range. This is the smallest range of any locator or measure in mm; a range narrower
than a thousandth of the widest one is taken for a constant and does not count.

## Warnings

A `tc.ContactWarning` states the error in mm if your points, or the triangles of a round face, leave more than that open.

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
contact pair "foot" (...): parts may be off by up to 0.0092 mm between flat triangles and the round faces ...

A `tc.UnitsWarning` names a mesh without stated units whose size is implausible in mm, by itself (below 1 mm, above 10 m) or
beside a part that it touches. It also names a mesh if a locator, measure or force is farther from it than its own size.

## Meshes

`tc.Mesh(source, units=...)` states the units of the source: "um", "mm", "cm", "m", "in" or "ft". Without it, a STEP file
states its own, a GLB file is in m, `mesh.units` of a Trimesh applies if it is set, and all others are in mm.

Meshes may be open, or hold several bodies. A surface whose outside is undefined is rejected: neighbouring triangles oriented
inconsistently, a body turned inside out, coincident triangles that point opposite ways. A part may have a million triangles
and extend to 10 km from its origin. On curved faces normals are interpolated between the corners of the triangles. Triangles
that meet at more than 30 degrees form an edge.

## Round faces

A face is known exactly where a STEP file states a plane, cylinder, cone, sphere or torus. It is also known where a cylinder,
cone or sphere fits all vertices of a smooth piece of a mesh to within 1 um; the piece has at least five facets, with turns of
at most 30 degrees between them. Contact points, their feet and normals then lie on that surface, not on its triangles. So a
prism of many sides counts as a cylinder: `tolcontact check` says how far the triangles lie inside. Other curved faces are as
round as their triangles.

If a ball or a shaft of one part lies beside walls of the other, no points are sampled at all. A ball (a sphere) is its centre
beside a plane, cylinder, cone or sphere, or a convex torus. A shaft (an outer cylinder) is the two ends of its axis in a
parallel hole (an inner cylinder), or along a plane. The points of contact are computed at every pose, also a tilted one: a pin
jams in its hole at the right angle for any tessellation. Where an edge of the wall, a gap in it or another curve may touch
first, the pair has sampled points. `tolcontact check` names the pairs of round faces; `points=` or `spacing=` overrule it.

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

The ends of the faces are those of the nominal assembly. A shaft that is pushed out of its hole, or a ball beyond the end of its
wall, is not detected at that pose, but afterwards (see the checks of surfaces in `tolcontact.contact`).

## STEP files

STEP needs the package cascadio: `pip install '.[step]'`. Faces are triangulated to within 2 um (or 5e-6 of the extent of the
file, beyond 0.4 m) and 0.1 rad; with `tc.Mesh(file, chord=0.1)` to within 0.1 mm. Contact on surfaces that the file states does
not depend on this. Faces keep their boundary representation, to which `tc.Brep`, `tc.Cylinder` and `tc.Largest` refer. Where
the file states a plane, cylinder, cone, sphere or torus, vertices are put onto it in double precision (as near as the surfaces
that meet in a vertex come to each other). Elsewhere they have single precision, 1e-5 mm at 100 mm and 2e-4 mm at 1 m. If there
would be more than a million triangles, or if it takes too long, faces are triangulated 30 times as coarsely, and to 0.5 rad; a
warning says so.

A file of an assembly holds several bodies: `tolcontact bodies FILE.stp` and `tc.bodies_in` list them. `tc.Mesh(file,
body=...)` is one of the bodies in the frame of its product, and `tc.parts_from(model, file)` declares all bodies, or the named
ones, as parts in their places. `tolcontact faces FILE.stp --body NAME` and `tc.faces_in` list the faces of a body with their
numbers, kinds, directions, radii and areas, and with the names that the file gives them: `tc.Brep("...")` chooses by these.
(If the faces of a body have several colours, they are out of the file's order and their names are unknown.) Where a file
states no simple surface, a plane, cylinder, cone or sphere is fitted if it is within 1 um of all vertices, and its distance is
stated. References to other files are rejected.

## Files from others

Shape files are read by a separate process with a limit on time (30 s, and 20 s for each MB) and memory (6 GiB). A damaged
file therefore ends in one message that names the file and says what to do.
"""

from tolcontact.discretization.discretizing import discretize
from tolcontact.discretization.locators import Locators
from tolcontact.discretization.nominal import ContactPoints, Nominal, NominalPart, Offsets
from tolcontact.discretization.round_points import RoundPoint, RoundPoints

__all__ = ["ContactPoints", "Locators", "Nominal", "NominalPart", "Offsets", "RoundPoint", "RoundPoints", "discretize"]
