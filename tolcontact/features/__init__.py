"""Features: tolerances of a drawing become freedoms of faces. A chapter of the guide.

A face is recognized as a plane, cylinder, cone, sphere or general surface; two opposed planes are a slot, a tab or a thickness.
It deviates as a whole by small displacements in mm, each of them a contributor:

| feature | displacements |
|---|---|
| plane; middle of two planes | offset in its middle, two tilts at the edges of its smallest rectangle |
| cylinder, cone | two shifts in the middle of its axis, two tilts at its ends; for a cone also a shift along the axis |
| sphere | three shifts of its centre |
| general surface | the rigid displacements, of six, that move its vertices along their normals |
| cylinder, sphere, two planes | also its size: a diameter or a distance |

>>> import tolcontact as tc
>>> model = tc.Assembly("block")
>>> block = model.part("block", tc.Box(100, 50, 10), fixed=True)
>>> foot = block.feature("foot", block.face("-z"), datum="A")
>>> top = block.feature("top", block.face("+z"), tc.Parallelism(0.1, "A"), tc.Profile(0.3, "A"))
>>> far = block.feature("far", block.face("+x"), tc.Perpendicularity(0.1, "A"))
>>> height = model.measure("height", top.point(0, 0, 10), along="z")
>>> tc.build(model).nominal.contributors
('block.top.tilt x', 'block.top.tilt y', 'block.top.offset', 'block.far.tilt z')

## Tolerances

| tolerance | applies to | controls |
|---|---|---|
| `tc.Size(8, 0.05, -0.02)`, `tc.Size(8, "H7")` | cylinder, sphere, two planes | diameter or distance, as shaped; limits |
| `tc.Position(0.2, datums)` | axis, centre, plane, two planes | place and tilt |
| `tc.Coaxiality`, `tc.Symmetry` | axis; middle of two planes | as position |
| `tc.Profile(0.2, "A", outside=0.15)`, `tc.LineProfile` | any surface | place and tilt; without datums form alone |
| `tc.Parallelism`, `tc.Perpendicularity`, `tc.Angularity` | plane, axis | tilt |
| `tc.CircularRunout`, `tc.TotalRunout` | cylinder, plane | radial: place and tilt; axial: tilt |
| `tc.Straightness` | plane, axis, cylinder, cone | form, which does not displace a feature |
| `tc.Flatness` | plane | form |
| `tc.Roundness` | cylinder, cone, sphere | form |
| `tc.Cylindricity` | cylinder | form |

`tc.Flatness(0.1, per=(25, 25))`, or `per=25` for lines, limits the form of any part of this size. `tangent=True` states the
orientation or place of the plane that touches a plane from outside, and does not limit its form. `zone="flat", along="x"` puts
an axis between planes; with `projected=20` the zone stands 20 mm out of the primary datum. `material="M"` (or "L") enlarges
the zone as the size departs from its maximum (least) material limit, and the process fills the larger zone. `rule=`, `cp=` and
`cpk=` are explained in `tolcontact.variation`. All this follows ISO 1101, 5459 and 2692. Sizes do not limit form (independency,
ISO 8015), unlike under ASME's Rule #1.

## Form

A plane with a flatness is not flat, and a cylinder with a cylindricity is not round: each drawn face has bumps and hollows of
its own, and contact, locators, measured points and datum targets all see the same ones. Heights are a random field, the sum of
modes with normal coefficients. Each coefficient is a contributor, "part.feature.form 01". Their common spread is such that
99.73 % of the faces need no wider zone than the tolerance:

>>> rough = tc.Assembly("rough")
>>> part = rough.part("part", tc.Box(100, 50, 10), fixed=True)
>>> seat = part.feature("seat", part.face("+z"), tc.Flatness(0.05))
>>> height = rough.measure("height", seat.point(30, 20, 10), along="z")
>>> program = tc.build(rough)
>>> len(program.nominal.contributors), program.nominal.contributors[-1]
(20, 'part.seat.form 20')

| tolerance | of | what is drawn |
|---|---|---|
| `tc.Flatness`; a profile without datums | plane | heights beside offset and tilts |
| `tc.Cylindricity` | cylinder | heights beside size, shifts and tilts: lobes, and also bent, conical or barrel-shaped |
| profile without datums | cylinder, cone, sphere | the same of any of these |
| `tc.Roundness` | cylinder, cone | heights beside place and size of each section; sections are in line |
| `tc.Straightness` | cylinder, cone | heights beside place and slope of each line, not of the axis |

`tc.Flatness(0.05, form=tc.Form("matern 5/2", length=20, modes=40))` names the covariance of two heights by their distance
("squared exponential", "matern 5/2" or "matern 3/2", from smooth to rough), its correlation length, by default a third of the
longest extent of the face, and the number of modes. For cylinders and cones it is a third of the length along the axis, and of
the diameter across it. `tc.Form(lobes=3)` has this number of lobes in all sections. `tc.Form(measured="scans/*.csv")` varies as
measured faces do, whose points are in files, one for each part: about their mean by their principal components. It is not
scaled to the tolerance, and of its mean the zones around it count nothing. Of several tolerances of form the narrowest is
drawn. Archives state which share of the variance the modes leave out, of measured faces the share of their mean square that
modes and stations leave out, and the mean width of the zones.

A measured face is a smooth field at 160 stations, or at up to 1280 if these predict points that are left out better, and as
smooth as predicts them best: scatter that neighbouring points do not share is no form. Of very many points some thousands are
taken at random. A form that changes over too short lengths for the stations, or of which the field is far higher between the
points than at them, is refused. Check points for outliers before: they change the form around them. Contact points are as close
as its slopes require: waves that are 12 mm long need points 1 mm apart, and many.

The field is orthogonal to displacements of the face as a whole, so that it moves no datum that is
fitted by least squares. The tolerances around a form limit form and displacement together: displacements have what the form
leaves of their zones, and a form that leaves nothing is refused.

The form of general surfaces, of lines of a plane, of sections of a sphere or of part of a circle, of part of a surface, and of
pairs of planes cannot be drawn. Such a tolerance needs `form=None`: it is stated, and the feature keeps its shape.

## Datums

Datums are features of the same part; "A-B" is a common datum, "B(M)" one at maximum material, as in `tc.Position(0.2,
"A|B(M)")`. A tolerance limits only the freedoms that its datums lock: the position of a hole relative to a plane across its
axis limits only its tilt. If a datum deviates, the features that refer to it follow. A plane that leans against the datums
before it is taken where it touches its datum outside of the material (ISO 5459), or in its middle with `part.feature(...,
association="least squares")`. That shift is a contributor, "far.datum B of A|B", which is not drawn: it follows from the tilts
of the plane. Planes of a common datum count by least squares. The frame of a part is the frame of its
shape, in which datums are nominal. A datum shift is not drawn: it follows from the contact of the datum feature with its mate.

The datum of a plane with form is the plane that touches its high spots from outside of the material, again unless its
association is "least squares". Of all such planes it is the one whose largest distance from the face is least (the minimax
rule of ISO 5459), tilted as far as the datums before it leave free; several contacts need not carry, and a saddle does not
rock. If places in line leave a choice, it is the plane with the least sum of squared distances. The datum is found again in
each realization, at the places of the face where its zone is evaluated. Its offset and tilts against the datum by least squares
are contributors, "top.datum A of A|B: tilt x", which are not drawn: they follow from the form, and not linearly. Contributions
count them together with the form; sensitivities are those to the datum itself, and to the form at the same datum:

>>> rest = rough.parts[0].feature("rest", part.face("-z"), tc.Flatness(0.02), datum="A")
>>> lid = part.feature("lid", part.face("+x"), tc.Perpendicularity(0.05, "A"))
>>> [label for label in tc.build(rough).nominal.contributors if "datum" in label]
['part.lid.datum A of A: tilt x']

The form of other datums, and of the planes of a common datum, counts by least squares. Of cylinders this is also because the
smallest one around a shaft is often held in one section only, and is then free to tilt.

`part.datum_targets("A", foot.point(5, 5, 0), ...)` is a datum that touches features at points, along their normals there, like
the locators of a fixture. The features may be of any kind, also free-form, and several may have targets of one datum. Three
targets on one plane give that plane. A fixture that holds the part at its targets has locators there, one for each:
`tc.Locator("A1", (5, 5, 0), "z", 0.1, on=foot)`. The tolerances of the part and its place then have the same frame.

Several tolerances of a feature are nested, form within orientation within location; a finer lower segment of a frame is a
second position tolerance. The datums of the lower segments of a composite frame lock directions alone, which "><" says, as in
`tc.Position(0.1, "A><|B><")`; without it they lock places, too. Each tolerance draws the freedoms that narrower tolerances
leave, as the top of the block shows.

## Patterns

A pattern is several features of one kind and size with common tolerances: `holes = part.pattern("H", face, face, ...)` has
the members "H 1", "H 2", ..., each of which is a feature like any other (`holes.members[0]`). A member may also be a pair of
planes, as in `(face, face)`. The zones of a tolerance keep the places to each other that the drawing gives them, and move
together in the motions that its datums leave free. So a second, narrower position with fewer datums, or with none, limits the
members to each other, and the wider one moves the pattern as a whole:

>>> other = tc.Assembly("other")
>>> part = other.part("part", tc.Box(40, 40, 10), fixed=True)
>>> for letter, way in {"A": "-z", "B": "-y", "C": "-x"}.items():
...     datum = part.feature(letter, part.face(way), datum=letter)
>>> sides = part.pattern("S", part.face("+x"), part.face("+y"), tc.Profile(0.3, "A|B|C"), tc.Profile(0.1))
>>> corner = other.measure("corner", sides.members[0].point(40, 40, 0), along="x")
>>> tc.build(other).nominal.contributors  # the inner tolerance limits how square the sides are to each other
('part.S.relative 1', 'part.S 1.offset', 'part.S 2.offset', 'part.S 2.tilt z', 'part.S 1.tilt z', 'part.S.mixed 1')

Contributors of one member are "part.H 1.shift x", those of several "part.H.common shift x", "part.H.common turn z" or
"part.H.relative 1". The latter are directions of length 1 in the coordinates of all members: as the contributor "common shift
x" of four holes deviates by 1 mm, each of them moves by 1/2 mm. Sizes of members are independent of each other.

With `datum="D"` all members together are the datum, by least squares. A pattern without tolerances, which is a datum alone,
names one datum of several surfaces: coplanar pads, or the two seats of a shaft. Its members may be unlike, and features that
were declared before with tolerances of their own: `part.pattern("seats", seat, other_seat, datum="A")`. Tolerances that each
member has by itself, without a common zone, are those of features: declare one for each.
"""

from tolcontact.features.datum_planes import TangentPlane
from tolcontact.features.face_deviation import FaceDeviation
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, PlaneFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.form_field import FormField
from tolcontact.features.nominal_features import Features, NominalFeature, NominalPattern, Placement
from tolcontact.features.tolerance_layers import Datum, Layer, datum_order

__all__ = [
    "AxisFeature", "Datum", "FaceDeviation", "FeatureGeometry", "FeatureOfSize", "Features", "FormField", "Layer",
    "NominalFeature", "NominalPattern", "Placement", "PlaneFeature", "TangentPlane", "datum_order", "feature_geometry",
]  # fmt: skip
