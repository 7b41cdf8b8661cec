"""Fasten: bolts, screws, pins and dowels in the holes of several parts. A chapter of the guide.

`tc.fasten` declares a fastener from its diameter, or from a part that stands in its holes, and from the holes that it
passes `through`, from its head on.

>>> import tolcontact as tc
>>> import trimesh
>>> model = tc.Assembly("flanges")
>>> def flange(name, bore, z, **options):
...     part = model.part(name, tc.Mesh(trimesh.creation.annulus(bore / 2, 25, 8)), at=(0, 0, z), **options)
...     part.feature("under", part.face("-z"), datum="A")
...     part.feature("rim", part.face(tc.Cylinder(radius=25)), datum="B")
...     return part, part.feature("bore", part.face(tc.Cylinder(inner=True)), tc.Position(0.5, "A|B", rule="translation"))
>>> base, thread = flange("base", 8.5, 4, fixed=True)
>>> cover, bore = flange("cover", 11, 12)
>>> scheme = [tc.Locator(f"Z{k}", (x, y, -4), "z", 0) for k, (x, y) in enumerate([(20, 0), (-20, 0), (0, 20)])]
>>> scheme += [tc.Locator("X", (0, 0, 0), "x", 0), tc.Locator("Y", (0, 0, 0), "y", 0), tc.Locator("turn", (20, 0, 0), "y", 0)]
>>> location = model.locate(cover, scheme)
>>> screw = tc.fasten(model, "screw", 10, through=[bore], into=thread, seat=cover.face("+z"))

It expands into plain declarations, which can be inspected, are archived as such, and may be followed by others, such as
measures of `screw.point(0, 0, 0)`:

>>> for declared in (screw, model.locations[-1], *model.pairs):
...     print(declared)
part screw: pin 10 x 16 mm with a head at (0, 0, 16)
location of screw on bore of base: 6 locators
contact screw in cover: cover inner cylinders (moving) against screw outer cylinders of radius 5 mm (reference), ...

## What holds it

| fastener | declared by | its place |
|---|---|---|
| fixed: a screw, a stud, a dowel | `into=` a threaded or press-fit hole | that of the hole: it shifts and leans with it |
| floating, with a nut | `seat=` the plane under its head | its head slides on the seat, and neither lifts off nor leans |
| floating, without a seat | neither | what contact leaves; along its axis it stays |

In each hole of `through` there is a contact pair, which is exact for tilted axes and follows the sizes of holes and shanks that
vary. Declare the holes and their tolerances first; a hole or a seat that belongs to no feature becomes one, without
tolerances. Contact may move the parts before the last one, unless they are `fixed`. The last one, the base, is the reference.

A made fastener has its origin under its head, and its z axis points to the head. With `tc.Size(10, 0, -0.1)` in place of a
diameter it has a feature "shank". A part in place of a diameter stands where the model puts it, and its shank is the thickest
outer cylinder in the first hole; the face of a shank may be given instead.

## Where it stands in its clearance

In the raw state a floating fastener is in its nominal place. Contact then moves it, and the parts, as the objective of the
model requires: "all points" no farther than needed, and "seating" to where forces press. A force of its own is
`pushed=(0, 0, -3)`, in N.

Two formulas of drawings follow. Floating fasteners of diameter F pass holes of diameter H with positions T if H - F = T;
fixed ones if H - F = T1 + T2, or T1 + T2 (1 + 2P / D) where a thread of depth D leans, and the cover has the thickness P. An
assembly in which the fasteners do not go in is `not_assemblable`, or `not_converged`, with the penetration in `gap_min`. If
locators hold the parts, look at the raw state: its `gap_min` says how far a hole is from its fastener, and the corrected state
how far the part had to move.

>>> shift = model.measure("screw", screw.point(0, 0, 0), along="x")
>>> results = tc.run(model, samples=1000, solver="daqp", surfaces=0)
>>> bool(results.gap_min.sel(state="raw").min() > -0.01)  # 0.5 + 0.5 = 11 - 10: hardly any screw touches
True

## Limits

A part that one fastener alone holds may turn about it: hold its turning with a locator. Threads, friction and preload are not
modelled. Holes with several floating fasteners that do not go in take seconds a realization, the others milliseconds.
"""

from tolcontact.fasteners.fastening import fasten

__all__ = ["fasten"]
