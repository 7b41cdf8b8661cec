"""Ask: what matters, what is rare, and which tolerances and places suffice. A chapter of the guide.

An analysis asks a model a question of its own, beside `tc.run`, with contact resolved in every realization. It returns an
`xarray.Dataset` whose variables have units and 95 % intervals (dimension `interval`: estimate, lower, upper). Each analysis
is also a command, which prints tables, JSON or CSV.

| `tc.` | command | question |
|---|---|---|
| `contributions` | `contributions` | Which contributors does the variance of a measure come from? |
| `sensitivities` | `sensitivities` | How much does a measure follow each contributor, through contact? |
| `worst_case` | `worst` | What are the least and the largest value of a measure, and which deviations give them? |
| `tails` | `tails` | How often is a measure outside its limits, where this is rare? |
| `allocate` | `allocate` | Which tolerance ranges suffice at least cost, and which one should be tightened first? |
| `relocate` | `relocate` | At which place of a locator does a measure vary least? |

## Arguments of all analyses

| argument | meaning |
|---|---|
| `model` | an assembly, the function that declares it, the path of its script, or a `tc.Program` (not for `relocate`) |
| `samples`, `seed` | number of realizations (each analysis states of what), at least 2; the same seed gives the same draws |
| `solver`, `method` | as for `tc.build`; a `tc.Program` has its own, so leave them out with it |
| `client` | of dask.distributed: its workers simulate (see `tolcontact.simulation`), with the same results to the last bit |
| `into` | path of an archive of the same model, which gets the result as the group statistics/NAME; reports show it |
| `progress` | a function that is called with the number of finished steps, and of all |

All of them raise `ModelError` for a model with faults; `ArchiveError` if the archive is of another model, or has the analysis
already; `OptionError` for other arguments that cannot be used, or if nothing varies. Nothing is simulated before.

>>> import tolcontact as tc
>>> def assembly():
...     stand = tc.Assembly("stand")
...     table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
...     block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
...     scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"))
...     stand.locate(block, scheme, tolerance=1)
...     stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
...     stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
...     return stand

## What matters

`tc.contributions` gives Sobol' indices, which hold with contact, beside the classical linear percentages, which do not. Here
contact leaves nothing of the effect that the locators below have.

>>> shares = tc.contributions(assembly, samples=1024, solver="daqp").sel(measure="height")
>>> bool(shares.total.sel(state="raw", interval="estimate").max() > 0.5)
True
>>> bool(shares.missed.sel(state="corrected", interval="estimate") > 0.5)  # of the variance, by linear sensitivities
True

`tc.sensitivities` gives the derivatives of each measure by each contributor, realization by realization: their means, their
spreads, and their means where contact moved parts and where it did not.

>>> slopes = tc.sensitivities(assembly, samples=100, solver="daqp").sel(measure="height")
>>> bool(abs(slopes.by_contact.sel(contact="touched", interval="estimate")).max() < 0.01)  # the block lies flat on the table
True

## What is extreme or rare

`tc.worst_case` searches all that the drawings allow for the least and the largest value of each measure, with the combination
of deviations that gives them. It also bounds them: no pose free of penetration lies beyond, to first order. Where contact alone
does not hold a part, as on a table from above, there is no bound.

>>> worst = tc.worst_case(assembly, samples=256, solver="daqp").sel(measure="height")
>>> bool(worst.worst.sel(state="raw", end="largest") > 0.5), float(worst.bound.sel(state="corrected", end="least").round(2))
(True, -0.0)

`tc.tails` estimates probabilities that are too small to be counted, by subset simulation: some ten thousand realizations give
probabilities of 1e-6 or less to within a few tenths of their value.

>>> far = tc.Assembly("far")
>>> bar = far.part("bar", tc.Box(50, 25, 10))
>>> location = far.locate(bar, tc.three_two_one(bar.face("-z"), bar.face("-y"), bar.face("-x")), tolerance=0.6)
>>> end = far.measure("end", bar.point(50, 12.5, 10), along="x", limits=(None, 0.5))
>>> _, lower, upper = tc.tails(far, samples=20_000).probability.sel(event="end outside limits").values
>>> bool(0 < lower < upper < 1e-3)
True

## What to change

`tc.allocate` widens and narrows ranges until a share outside of limits, or a Ppk, is kept at least cost. It also estimates the
effect of each range, so that one sees which to tighten first.

>>> allocation = tc.allocate(far, "end: ppm 20000", by="part", samples=1024)
>>> bool(allocation.cost.sum("group").sel(stage="after") < allocation.cost.sum("group").sel(stage="before"))
True

`tc.relocate` looks for the place of a locator, within a box, at which a measure varies least.

>>> moved = tc.relocate(assembly, "block.A3", between=((0, 25, 0), (50, 25, 0)), least="height: 6 sigma", samples=256)
>>> moved.point.sel(stage="before").values.tolist(), moved.sizes["trial"] > 9
([25.0, 25.0, 0.0], True)
"""
