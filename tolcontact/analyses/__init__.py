"""Analyse: what matters, what is rare, and which tolerances and positions suffice. A chapter of the guide.

An analysis answers a question that a plain `tc.run` does not, with contact resolved in every realization. It returns an
`xarray.Dataset` whose variables have units and 95 % intervals (dimension `interval`: estimate, lower, upper). Each analysis is
also a command, which prints tables, JSON or CSV.

| `tc.` | command | question |
|---|---|---|
| `contributions` | `contributions` | Which contributors cause the variance of a measure? |
| `sensitivities` | `sensitivities` | How much does a measure change with each contributor, with contact? |
| `worst_case` | `worst` | What are the smallest and largest values of a measure, and which deviations cause them? |
| `tails` | `tails` | How often is a measure outside its limits (a rare-event estimate in ppm)? |
| `allocate` | `allocate` | Which tolerance ranges suffice at the lowest cost, and which one should be tightened first? |
| `relocate` | `relocate` | At which position of a locator does a measure vary least? |
| `seating` | `seating` | Above which coefficient of friction can a part be held short of a locator or a seat? |

## Arguments of all analyses

| argument | meaning |
|---|---|
| `model` | an assembly, a function that declares it, the path of a script or archive, or a `tc.Program` (not for `relocate`) |
| `samples`, `seed` | number of realizations, at least 2 (see each analysis); the same seed gives the same draws |
| `solver`, `method` | as for `tc.build`; a `tc.Program` has its own, so leave them out with it |
| `client` | client of dask.distributed, whose workers simulate with the same results (see `tolcontact.simulation`) |
| `into` | path of an archive of the same model, which stores the result in the group statistics/NAME; reports show it |
| `progress` | function that is called with the number of finished steps and the total |

All of them raise `ModelError` for a model with faults; `ArchiveError` if the archive belongs to another model or already holds
the analysis; `OptionError` for other invalid arguments, or if nothing varies. These errors are raised before anything is
simulated.

>>> import tolcontact as tc
>>> def assembly():
...     stand = tc.Assembly("stand", method=tc.Method(resolution="linearized"))
...     table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
...     block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
...     scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"))
...     stand.locate(block, scheme, tolerance=1)
...     stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
...     stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
...     return stand

## What matters

`tc.contributions` gives Sobol' indices, which are valid with contact, and the classical linear percentages, which are not. By
default it simulates about 60 000 realizations: contributors with little influence are identified first, and estimated as one
group. In this example, contact removes the effect of the locators below the block.

>>> shares = tc.contributions(assembly, samples=1024, solver="daqp").sel(measure="height")
>>> bool(shares.total.sel(state="raw", interval="estimate").max() > 0.5)
True
>>> bool(shares.missed.sel(state="corrected", interval="estimate") > 0.5)  # of the variance, by linear sensitivities
True

`tc.sensitivities` gives the derivatives of each measure with respect to each contributor over the realizations: their means
and spreads, and separate means for realizations in which contact did or did not move parts.

>>> slopes = tc.sensitivities(assembly, samples=100, solver="daqp").sel(measure="height")
>>> bool(abs(slopes.by_contact.sel(contact="touched", interval="estimate")).max() < 0.01)  # the block lies flat on the table
True

## What is extreme or rare

`tc.worst_case` searches everything that the tolerances allow for the minimum and maximum of each measure, and returns the
deviations that cause them. It also returns linear estimates: to first order, no pose without penetration lies beyond them.
Where contact alone does not hold a part, as with a block that can be lifted off a table, there is none.

>>> worst = tc.worst_case(assembly, samples=64, solver="daqp").sel(measure="height")
>>> bool(worst.worst.sel(state="raw", end="largest") > 0.5), float(worst.bound.sel(state="corrected", end="least").round(2))
(True, -0.0)

`tc.tails` estimates probabilities that are too small to count. Two searches look for the regions of each event, and importance
sampling around their results estimates the probability. By default all events share 60 000 realizations, with 10 000 to 40 000
for each; a quarter suffices where the upper bound of the interval is then at most 1.5 times the lower one. Each limit has its
own search. Where the two searches disagree, `disagreement` states it, and the interval covers both. A region that neither
search finds is missing: a small region far from common ones, or further regions beyond about thirty. The same holds for events
that depend on more than forty contributors.

>>> far = tc.Assembly("far")
>>> bar = far.part("bar", tc.Box(50, 25, 10))
>>> location = far.locate(bar, tc.three_two_one(bar.face("-z"), bar.face("-y"), bar.face("-x")), tolerance=0.6)
>>> end = far.measure("end", bar.point(50, 12.5, 10), along="x", limits=(None, 0.5))
>>> _, lower, upper = tc.tails(far, samples=6000).probability.sel(event="end outside limits").values
>>> bool(0 < lower < upper < 1e-3)
True

## What to change

`tc.allocate` widens and narrows ranges until a required share outside limits, or a required Ppk, is met at the lowest cost. It
also estimates the effect of each range, which shows the one to tighten first.

>>> allocation = tc.allocate(far, "end: ppm 20000", by="part", samples=1024)
>>> bool(allocation.cost.sum("group").sel(stage="after") < allocation.cost.sum("group").sel(stage="before"))
True

`tc.relocate` finds the position of a locator, within a box, at which a measure varies least.

>>> moved = tc.relocate(assembly, "block.A3", between=((0, 25, 0), (50, 25, 0)), least="height: 6 sigma", samples=256)
>>> moved.point.sel(stage="before").values.tolist(), moved.sizes["trial"] > 9
([25.0, 25.0, 0.0], True)

## What seats

`tc.seating` examines the assembly where its forces seat it, and takes no other arguments than the model and `into`. For each
locator and each contact pair it finds the least coefficient of friction at which the other contacts can hold the part short of
it. Below this coefficient, the forces push the part home; above it, the part may stay where it was released. For a model that
states coefficients (`tc.Assembly(..., mu=0.15)`) it also returns their `reserve`, and warns (`[friction]`) where it is at most
1.

>>> clamped = tc.Assembly("clamped")
>>> table = clamped.part("table", tc.Box(100, 50, 10), at=(0, 0, -10), fixed=True)
>>> block = clamped.part("block", tc.Box(50, 25, 10))
>>> sides = [tc.Locator(f"side {x}", (x, 0, 5), "y") for x in (5, 45)]
>>> location = clamped.locate(
...     block, [*sides, tc.Locator("stop", (0, 12, 5), "x", one_sided=True)], tolerance=0.1, floating=True
... )
>>> pair = clamped.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
>>> measure = clamped.measure("place", block.point(0, 0, 0), along="x")
>>> clamp = clamped.force("clamp", at=block.point(30, 12, 10), vector=(-20, 0, -40))
>>> tc.seating(clamped).critical.sel(seat="block.stop").round(6).item()
0.5
"""
