"""Declare: parts, how they are located, which faces may touch, and what is measured. A chapter of the guide.

A model is a `tc.Assembly`. Its methods collect what a script declares and return a handle to it; nothing is computed yet.
Lengths are in mm, angles in rad, forces in N. Points, faces and locators are given in the frame of their own part.

>>> import tolcontact as tc
>>> clamp = tc.Assembly("clamp")

## Parts and shapes

`part(name, shape, at=..., rotation=...)` places a shape in the nominal assembly: the point p of its own frame lies at
`rotation * p + at`, where `rotation` is a rotation vector. A shape is a `tc.Box(x, y, z)`, which reaches from the origin of
its frame to (x, y, z), a `tc.Pin(diameter, length)` about the z axis, from -length to 0, or a `tc.Mesh(source)`, a triangle
surface. The source is a file (STL, OBJ, PLY, GLB, STEP) or a
`trimesh.Trimesh`; `units="in"` states the units of a file that is not in mm (see `tolcontact.geometry`).

>>> base = clamp.part("base", tc.Box(100, 50, 10), fixed=True)
>>> plate = clamp.part("plate", tc.Box(60, 40, 8), at=(20, 5, 10))
>>> plate
part plate: box 60 x 40 x 8 mm at (20, 5, 10)

`rotation=tc.degrees(0, 0, 90)` turns a part by 90 degrees about z.

>>> tc.degrees(90), tc.degrees(0, 0, 180)
(1.5707963267948966, (0.0, 0.0, 3.141592653589793))

Names of parts, pairs, forces and measures also name groups and labels of the archive. They start with a letter, digit or
underscore, hold no "/" and no control character, and differ from each other.

## Faces

A face consists of the triangles that meet every criterion you give; without any it is the whole surface.

| criterion | chooses |
|---|---|
| `"+x"` to `"-z"` | triangles whose outward normal has this direction, to within 1 degree |
| `tc.Facing((0, 1, 2), angle)` | triangles whose outward normal is within `angle` of any direction |
| `tc.Inside(lower, upper)` | the surface inside a box; triangles that cross its sides are cut there |
| `tc.Near(other, within)` | faces that face another part and come within a distance of it |
| `tc.Cylinder(radius, inner)` | cylinders: all, those of one radius, or holes only (`inner=True`) |
| `tc.Largest("plane", "+z")` | the largest face of a kind, along a direction |
| `tc.Brep((x, y, z))`, `tc.Brep(12)` | the face of a STEP file that passes through a point, or has a number |
| `tc.Brep("seat")` | the faces of a STEP file that have a name, where it gives names |
| `tc.Brep(3, 7)` | all of these faces; so are those of <code>tc.Brep(3) &#124; tc.Brep("seat")</code> |
| `tc.Brep(3, whole=True)` | all faces of one surface: both halves of a hole that the file splits, also between keyways |
| `tc.Brep(3, whole="slot")` | the two planes and the two round ends of a slot, by any of its faces |
| `tc.Brep(3, whole="pattern")` | all equal holes of the body with parallel axes, by any of them |
| `[0, 1, 2]` | triangles by their indices in the mesh |
| a function | `function(centres, normals)` takes arrays (triangle, 3) and returns a mask (triangle,) |

>>> base.face("+z", tc.Inside((0, 0, 9), (50, 50, 11)))
base +z inside (0, 0, 9) to (50, 50, 11)

## Locators and tolerances

`locate(part, scheme)` states what positions a part: six locators, each a point of the part, a direction into the part, and a
deviation along it. `tc.three_two_one(primary, secondary, tertiary, inset=...)` derives them from three faces: A1, A2, A3 on
the primary face, B1, B2 on the secondary one, C1 on the tertiary one, `inset` mm inside the edges. A list of `tc.Locator(name,
point, direction)` declares them one by one.

A tolerance is the full width of its zone: 0.6 means -0.3 to +0.3. The tolerance of `locate(..., tolerance=...)` applies to
every locator that does not have its own. By default the deviation is normal with 6 sigma equal to the width;
`tolcontact.variation` lists the other distributions. Limits may be written as on a drawing, "±0.3" or "+0.4/-0.2", or as a
pair (-0.2, 0.4). Unequal ones move the mean to their middle.

>>> scheme = tc.three_two_one(plate.face("-z"), plate.face("-y"), plate.face("-x"), inset=5)
>>> location = clamp.locate(plate, scheme, tolerance=0.6)
>>> print(location)
location of plate on the ground: 3-2-1 on plate -z, plate -y, plate -x, 5 mm inside the edges; normal, full width 0.6 mm
>>> print(tc.Locator("A1", (5, 5, 0), "z", tc.Tolerance(0.1, "uniform")))
locator A1: (5, 5, 0) along (0, 0, 1), uniform, full width 0.1 mm

`locate(..., on=other)` positions a part on another part, which then carries it along. With `on=feature` the part also follows
a feature of the other part as it shifts and tilts: a pin, for example, the axis of the hole that it is pressed into. A part
that is not located must be `fixed=True`, and stays at its nominal place. Six locators whose directions are not independent are
rejected.

A locator with `one_sided=True` is a support: its part may lift off it, and may not pass through it. A part with supports may
have more than six locators, of which at most six are two-sided. The objective "locator stiffness" uses
the `stiffness` (N/mm) of two-sided locators. With "seating", a locator with a `stiffness` is a spring, and without one it is
rigid. The spring of a support pushes only: its gap is negative by its compression, which is its force divided by its stiffness.
That of a two-sided locator pulls, too. It is a pair of its own in results, "part.locator", whose reaction is negative if it
pulls; its gap is minus its elongation or compression.

A contact pair with a `stiffness` (N/mm) gives way, too: `contact(..., stiffness=5000)` states the force that presses its faces
into each other evenly by 1 mm, as the data sheet of a pad or a press test does, for any number of contact points. These
share it by the areas that they stand for, and push only. The faces must be flat, or those of balls and shafts against walls.
The points are those of the nominal assembly, and push against the plane of the reference face without end, in every search.
Where a part slides over an edge, a spring beyond it still pushes, so slides should be small beside the face.

A part that contact alone holds in some directions (a shaft in a V, a lid over studs) is `floating=True` and has fewer
locators, or none. In the directions that its locators leave open, it keeps its nominal position in the raw state. Contact then
moves it as the objective requires: with "active points" or "all points" only as far as needed to avoid penetration, with
"seating" as its forces pull. Locators that hold the same direction twice are rejected by name.

## Features, and the tolerances of a drawing

`part.feature(name, face, tolerances..., datum=...)` names a face: a plane, cylinder, cone, sphere or a general surface, or two
opposed planes (a slot, a tab, a thickness). It deviates as a whole, outward from its material, and can be used in place of a
face. The same deviation moves everything that touches the feature, is located by it, or is measured at `feature.point(x, y,
z)` or at an end of its axis, `feature.axis(0)`. This includes pairs and 3-2-1 schemes that choose the triangles of the feature
without naming it. The limits of a size may be a tolerance class of ISO 286-1, with capital letters for holes and slots.

>>> tc.Size(8, "H7"), tc.Size(8, "g6")
(size 8 H7 +0.015 +0 mm, size 8 g6 -0.005 -0.014 mm)

>>> cover = clamp.part("cover", tc.Box(60, 40, 5), at=(20, 5, 18))
>>> foot = cover.feature("foot", cover.face("-z"), datum="A")
>>> side = cover.feature("side", cover.face("-y"), tc.Perpendicularity(0.05, "A"), datum="B")
>>> top = cover.feature("top", cover.face("+z"), tc.Parallelism(0.05, "A"), tc.Profile(0.2, "A"))
>>> width = cover.feature("width", cover.face("+x"), cover.face("-x"), tc.Size(60, 0.1, -0.05))
>>> print(top)
feature top of cover: cover +z; parallelism 0.05 A; profile 0.2 A
>>> thickness = clamp.measure("thickness", foot.point(0, 0, 0), to=top.point(0, 0, 5), along="z", tolerance=0.3)

`part.pattern("H", face, face, ..., tolerances...)` declares several like features with common tolerances, such as holes.
`tolcontact.features` lists the tolerances, what each of them controls, and how datums, their targets and patterns work.

## Shared causes, correlation, measured parts

Every quantity that varies is a *contributor* with a label: "part.locator", "part.feature.freedom" ("cover.width.size",
"cover.top.offset"), or the name of a variable. `print(tc.build(model).nominal.contributors)` lists them.

>>> warmth = clamp.variable("warmth", 20, drives={"cover.width.size": 0.0007, "cover.top.offset": 0.00006}, units="K")
>>> alike = clamp.correlate(["cover.top.tilt x", "cover.top.tilt y"], 0.5)
>>> batch = clamp.population({"cover.side.tilt z": [0.004, -0.002, 0.001]})

A variable adds its factor times its own deviation to each contributor that it drives. A correlation is a matrix, or a number
between -1 and 1 for two contributors; it leaves their distributions unchanged. A population is a table of measured parts (a
CSV file, a DataFrame, a Dataset, a mapping) whose rows are drawn as a whole, with replacement. Each column replaces the draws
of the contributor that it is named after.

## Contact pairs

`contact(name, moving=..., reference=...)` keeps points of the `moving` face outside the `reference` face. By default it
spreads 200 points evenly, and adds more where the rims of flat faces cross or faces are curved; `points=` sets their number,
`spacing=` their distance, and `points="vertices"` takes the vertices of the mesh. A point takes part if the reference face
lies within `within` mm of it in the nominal assembly (by default a tenth of the diagonal of the moving part). A ball or a
shaft beside walls needs no sampled points, unless you request them (see Balls and shafts in `tolcontact.discretization`).

>>> pair = clamp.contact("seat", moving=plate.face("-z"), reference=base.face("+z"), spacing=5)
>>> print(pair)
contact seat: plate -z (moving) against base +z (reference), spacing 5 mm

## What contact may move

Contact can move any part that is the moving side of a pair, or that has one-sided locators; prevent it with `fixed=True`. A
part that is only ever a reference stays where its locators put it; let it move with `fixed=False`. All parts that contact can
move are corrected together, each with six degrees of freedom, also parts located on others. Other parts that lie in each
other are named; `may_overlap(part, part)` states that it is meant (see `tolcontact.plausibility`).

## Forces

`force(name, at=point, vector=...)` declares a force in N, constant in the assembly frame. Only the objective "seating" uses
forces (see `tolcontact.mechanics`): they press parts onto their supports and neighbours, and decide which supports carry load.
`tc.seating` asks whether forces push a part home against friction at its other contacts. A coefficient of friction is stated
for all contacts, `tc.Assembly("clamp", mu=0.15)`, or for a pair, `contact(..., mu=0.1)`. Contact is resolved without friction.

>>> weight = clamp.force("weight", at=plate.point(30, 20, 4), vector=(0, 0, -100))
>>> print(weight)
force weight: (0, 0, -100) N at plate (30, 20, 4)

## Fasteners

`tc.fasten(assembly, name, 10, through=[hole, ...], into=hole)` declares a bolt, screw, pin or dowel in the holes of several
parts: its part, its location and its contact pairs (see `tolcontact.fasteners`).

## Measures

A measure is the displacement of a point along a direction, the distance of two points along a direction (`to=`), or a function
of the symbolic poses that returns a CasADi expression. With `absolute=True` a displacement becomes the coordinate of the
point; with `absolute=False` a distance becomes its difference from the nominal distance. `limits=(lower, upper)` are the
allowed values of the measure, with None for an open side. `tolerance` is short for limits at half the tolerance below and
above the nominal value; `tolerance="+0.2/-0.1"` states them on both sides of it.

>>> height = clamp.measure("height", plate.point(0, 0, 8), along="z", tolerance=0.5)
>>> step = clamp.measure("step", base.point(20, 5, 10), to=plate.point(0, 0, 0), along="z", limits=(None, 0.2))
>>> def tilt(poses):
...     return poses.rotation(plate)[2, 0]
>>> slope = clamp.measure("slope", tilt, units="rad")

The function receives poses with `position(point)`, `rotation(part)` and `translation(part)`.
Measurements of faces are declared as objects. Their units follow from their kind: mm, and rad for angles.

| measurement | value |
|---|---|
| `tc.Gap(point, face)` | distance of a point of one part from a face of another, perpendicular to this face |
| `tc.Flush(point, face)` | the same distance, of a point from a neighbouring outer face |
| `tc.Clearance(face, face)` | least distance of two planes, of a ball or a shaft from walls beside it, of any faces or parts |
| `tc.LargestGap(face, face)` | largest gap left between two faces, with their form: the widest leak |
| `tc.MeanGap(face, face)` | mean of this gap by area |
| `tc.AxisDistance(face, face)` | shortest distance of the axes of two holes or shafts, each as long as its face |
| `tc.AxisDistance(..., across="z")` | their distance in the plane across a direction, through the middle of the first axis |
| `tc.AxisDistance(..., along="x")` | component of the perpendicular from the middle of the first axis to the second one |
| `tc.Angle(face, face)` | angle between planes or axes, from 0 on; at most a right angle nominally |
| `tc.Angle(..., about="y")` | angle about a direction, with its sign: positive if the second face is turned counterclockwise |
| `tc.Minimum(...)`, `tc.Maximum` | least and largest of several measurements, or measures by name |
| `tc.Mean`, `tc.Sum`, `tc.Difference` | their mean, their sum, the first less the second |

A face counts beyond its ends, as its whole plane, cylinder, cone, sphere or torus, or as its tangent plane at the point's
nominal foot. The stations of a seam are points along it. Gap and flush are perpendicular to the second part's faces.

>>> gaps = [tc.Gap(point, base.face("+z")) for point in tc.stations(plate.point(0, 0, 0), plate.point(60, 0, 0), 5)]
>>> least = clamp.measure("least gap", tc.Minimum(*gaps), limits=(-0.1, None))
>>> play = clamp.measure("play", tc.Clearance(cover.face("-z"), plate.face("+z")))
>>> lean = clamp.measure("lean", tc.Angle(plate.face("-z"), base.face("+z"), about="y"), tolerance=0.01)

A measurement may lie within one part if it has features with tolerances there: the distance of two holes, the angle of two
sides. Minima, clearances, and angles and distances that are nominally 0 have a kink in the nominal assembly. There they have no
derivatives, so `sensitivities` and `contributions` state none for them by a linear model, and `worst` states no bound.

## Stations and joints

Products are located, joined, and located again before anybody measures them. `station(name)` declares the next step of such a
sequence, and has the methods `locate`, `contact`, `force` and `measure` of an assembly, and `join`; `tc.fasten` takes a station
as well. Locators belong to a station and vary there ("weld.left.A1"); features belong to parts, and deviate equally in all
stations. A joint keeps the poses of its parts relative to each other that they had in the station that joined them: raw states
follow from raw states, and corrected states from corrected states. Later stations locate the joint by points, or by three
faces, of any of its parts.

>>> line = tc.Assembly("line")
>>> left, right = line.part("left", tc.Box(100, 50, 10)), line.part("right", tc.Box(100, 50, 10), at=(80, 0, 10))
>>> weld, check = line.station("weld"), line.station("check")
>>> for part in (left, right):
...     location = weld.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.2)
>>> lap = weld.contact("lap", moving=right.face("-z"), reference=left.face("+z"))
>>> rail = weld.join("rail", left, right)
>>> points = [left.point(5, 5, 0), left.point(5, 45, 0), right.point(95, 25, 0)]
>>> pins = [tc.Locator(f"P{k}", point, "z") for k, point in enumerate(points)]
>>> stops = [tc.Locator("H1", left.point(5, 0, 5), "y"), tc.Locator("H2", right.point(95, 0, 5), "y")]
>>> check.locate(rail, [*pins, *stops, tc.Locator("S", left.point(0, 25, 5), "x")], tolerance=0.1, placing="exact")
location of rail on the ground: 6 locators, exact; normal, full width 0.1 mm
>>> end = check.measure("end", right.point(100, 25, 10), along="z", tolerance=0.5)
>>> tc.build(line).nominal.contributors[-6:]
('check.rail.P0', 'check.rail.P1', 'check.rail.P2', 'check.rail.H1', 'check.rail.H2', 'check.rail.S')

A fixture or a measuring table is a part, with locators and features of its own. `placing` states how a pose follows from
locators: to "first order" (default, as in the paper); "exact", with faces that slide over them; or as the "best fit" of any
number of locators, as a measuring machine aligns a part by its datum points, with `tolerance=0`. A station is a set of
declarations, not a process: it has no springback, clamping order or weld distortion.

## The model's method, and faults

A model can state the method that it needs (see `tolcontact.contact`): `tc.Assembly("cells",
method=tc.Method(objective="all points"))`. Options of the command line, or `tc.run(...,
method={"objective": "seating"})`, replace single choices. The archive states which method was used, and whether it was the
model's own, the defaults, or set by options.

`tc.check(model)`, or `tolcontact check MODEL.py`, lists all faults of a model at once, each with its line in the script.

>>> tc.check(clamp)
('part "cover" (...): it is not located; call locate(...), or declare it fixed=True to hold it at its nominal place',)
>>> place = clamp.locate(cover, tc.three_two_one(foot, side, cover.face("-x")), tolerance=0.1, on=plate)
>>> meant = clamp.may_overlap(cover, plate)
>>> tc.check(clamp)
()
>>> nothing = tc.Assembly("nothing")
>>> try:
...     tc.build(nothing)
... except tc.ModelError as error:
...     print(error)
model "nothing" has 2 faults:
  - it has no parts; declare at least one with assembly.part(name, geometry)
  - it measures nothing; declare at least one measurement with assembly.measure(...)

## Scripts, and models as data

A model script is a Python file with a function `assembly()` that returns the declared assembly. With `tc.main(assembly)`
under a main guard it runs by itself, with the options of `tolcontact run`; the files in `models/` are such scripts.

The same declarations as JSON are accepted wherever a script is: `tolcontact run model.json`. `tc.write_model(model,
"model.json")` writes them. What a script would leave out may be left out, tolerances may be written as texts, files of shapes
are named from the folder of the JSON file, and errors state the place: `parts[2].features[0].tolerances[1].width`. The JSON
schema follows from the classes of this chapter: `python -m tolcontact.declaration.script > model.schema.json` writes it.

A model of a stranger is data, and cannot ask for everything: files have at most 64 MiB, assemblies 1000 parts and 2000
measures, pairs 100 000 contact points, names 500 characters (of parts and stations 255 bytes in UTF-8), expressions 100 000
steps, and a draw of a distribution takes at most 10 ms. What is more is refused with the place in the file before anything is
computed. (Scripts run code: run only those that you trust.)

Every archive holds its model as JSON, too, with the triangles of meshes beside it: `tc.model_of(results)` rebuilds the
assembly without running any code of the script. Functions of poses are kept as lists of elementary operations.

>>> results = tc.run(clamp, samples=10, surfaces=0)
>>> print(tc.model_of(results).pairs[0])
contact seat: plate -z (moving) against base +z (reference), spacing 5 mm
"""

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import ContactPair, Force
from tolcontact.declaration.dependence import Correlation, Population, Variable
from tolcontact.declaration.feature_tolerance import (
    Angularity,
    CircularRunout,
    Coaxiality,
    Cylindricity,
    Flatness,
    GeometricTolerance,
    LineProfile,
    Parallelism,
    Perpendicularity,
    Position,
    Profile,
    Roundness,
    Straightness,
    Symmetry,
    TotalRunout,
)
from tolcontact.declaration.form import Form
from tolcontact.declaration.geometry import Box, Geometry, Mesh, Pin
from tolcontact.declaration.joint import Joint, Overlap
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne, three_two_one
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measurement import (
    Angle,
    AxisDistance,
    Clearance,
    Combination,
    Difference,
    Flush,
    Gap,
    LargestGap,
    Maximum,
    Mean,
    MeanGap,
    Measurement,
    Minimum,
    Sum,
    stations,
)
from tolcontact.declaration.part import OUTSIDE, DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.selection import Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Triangles
from tolcontact.declaration.size import Size
from tolcontact.declaration.station import Station
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import degrees

__all__ = [
    "OUTSIDE", "Angle", "Angularity", "Assembly", "AxisDistance", "Box", "Brep", "CircularRunout", "Clearance", "Coaxiality",
    "Combination", "ContactPair", "Correlation", "Cylinder", "Cylindricity", "DatumTargets", "Difference", "Face", "Facing",
    "Feature", "Flatness", "Flush", "Force", "Form", "Gap", "GeometricTolerance", "Geometry", "Inside", "Joint", "Largest",
    "LargestGap", "LineProfile", "Location", "Locator", "Maximum", "Mean", "MeanGap", "Measure", "Measurement", "Mesh",
    "Minimum", "Near", "Overlap", "Parallelism", "Part", "Pattern", "Perpendicularity", "Picked", "Pin", "Point", "Population",
    "Position", "Profile", "Roundness", "Size", "Station", "Straightness", "Sum", "Symmetry", "ThreeTwoOne", "TitleBlock",
    "Tolerance", "TotalRunout", "Triangles", "Variable", "degrees", "stations",
    "three_two_one",
]  # fmt: skip
