"""Draw: tolerances become deviations of locators and features. A chapter of the guide.

## From a tolerance to a distribution

A tolerance range T is the full width of a zone around 0. `tc.Tolerance(range, distribution)` names the distribution within it:

| distribution | deviations |
|---|---|
| "normal" (default) | sigma = T / 6, unbounded |
| "uniform" | evenly between -T/2 and +T/2 |
| "triangular" | between -T/2 and +T/2, most often 0 |
| "truncated normal" | sigma = T / 6, cut at -T/2 and +T/2 |

A number stands for a normal distribution of that range, and 0 for a locator that does not vary. Any frozen continuous
distribution of `scipy.stats` may be given instead of a name. It defines its own spread, so leave out the range.

>>> import tolcontact as tc
>>> from scipy import stats
>>> print(tc.Tolerance(0.6))
normal, full width 0.6 mm
>>> skewed = tc.Tolerance(distribution=stats.gamma(4, scale=0.02))
>>> skewed.width  # six standard deviations [mm]
0.24

`tc.Tolerance(0.6, shift=0.1)` shifts the distribution; `cp=1.33, cpk=1.0` state the capability of a normal process, and how
close its mean is to a limit.

## From a zone to the spread of a feature

A feature has several freedoms: a plane has an offset in its middle and two tilts, an axis two shifts in its middle and two
tilts, a centre three shifts. All are displacements in mm, with tilts given at the edges or ends of the feature, so they do not
depend on the origin. `rule` states how they fill the zone of a tolerance:

| rule | components |
|---|---|
| "99.73 % inside" (default) | normal, independent, with equal spreads for which 99.73 % of the *features* lie inside |
| "6 sigma at the extremes" | the same, with six standard deviations at the worst point equal to the width; fewer lie inside |
| "translation" | as "99.73 % inside", without tilts |

Only the default has the same meaning for sizes, planes and axes. For a width t the spread of a component is t/6 for a size or
an offset alone, t/9.07 for a plane's two tilts, t/11.8 for a rectangle's place and tilts, t/6.88 for an axis that only shifts,
and t/7.28 at the ends of an axis that also tilts. Of nested tolerances, the narrower one draws the freedoms that it controls
and the wider one draws the remaining freedoms, so that 99.73 % of the sums lie inside. The share inside is integrated over
directions, not sampled.

>>> block = tc.Assembly("block")
>>> part = block.part("part", tc.Box(100, 50, 10), fixed=True)
>>> foot = part.feature("foot", part.face("-z"), datum="A")
>>> top = part.feature("top", part.face("+z"), tc.Profile(0.3, "A"))
>>> height = block.measure("corner", top.point(100, 50, 10), along="z")
>>> [(freedom.label, round(0.3 / freedom.spread, 2)) for freedom in tc.build(block).draws.contributors]
[('part.top.offset', 11.76), ('part.top.tilt x', 11.76), ('part.top.tilt y', 11.76)]

Of a pattern, 99.73 % of the *members* lie inside. A pattern with one position whose datums lock its members has the spreads of
features by themselves. Where its datums leave a motion of the whole pattern free, the place of the pattern counts as fitted by
least squares, and a wider tolerance with more datums draws that motion. A bonus goes by the size of each member, and for what
moves several of them by the smallest of theirs.

The form of a feature, if it is drawn, lies within the zones of the surface around it: of a plane within all, of a round face
within those of a profile and of run-out. Sizes do not limit form, nor form sizes. Not covered are the envelope of ASME's Rule
#1, and datum shift, which follows from contact.

## Draws depend only on the seed and the realization

The deviation of a contributor in realization k depends on the seed, on its label ("part.locator", "part.feature.freedom") and
on k; for correlated contributors also on each other's labels. It does not depend on the number of realizations, on blocks,
threads, other contributors, or the order of declarations. A longer run therefore begins with the realizations of a shorter
one, and two solvers or methods can be compared draw by draw.

>>> model = tc.Assembly("model")
>>> part = model.part("part", tc.Box(50, 30, 10))
>>> scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"))
>>> location = model.locate(part, scheme, tolerance=0.6)
>>> height = model.measure("height", part.point(50, 0, 10), along="z")
>>> from tolcontact.variation import draw
>>> nominal = tc.build(model).nominal
>>> nominal.locators.labels
('part.A1', 'part.A2', 'part.A3', 'part.B1', 'part.B2', 'part.C1')
>>> deviations = draw(nominal, seed=1, start=0, stop=1000)  # (realization, contributor) [mm]
>>> bool((deviations[500:510] == draw(nominal, seed=1, start=500, stop=510)).all())
True
>>> float(deviations.std().round(2))  # a sixth of the range
0.1

## Sampling plans

`tc.run(..., plan=...)` or `tolcontact run --plan` chooses how the random numbers are generated: "monte-carlo" (default),
"latin hypercube", or "sobol". The latter two draw replicates of 256 realizations that fill the ranges of all contributors
evenly. A measure that is nearly a sum of contributors then has a mean and a spread with less error for the same number of
realizations. Replicates are independent of each other, so from 16 replicates on (4096 realizations) intervals follow from the
differences between them. They are narrowest for multiples of 256: a last, incomplete replicate fills no range evenly, and may
vary more than all others together. The intervals of Ppk by percentiles, of displacement fields and of contact statistics remain
those of independent realizations, which are wider. No plan improves estimates of tails much.

>>> plain, even = (tc.summarize(tc.run(model, samples=4096, plan=plan)) for plan in ("monte-carlo", "sobol"))
>>> means = [run.statistic_value.sel(state="raw", statistic="mean", measure="height") for run in (plain, even)]
>>> width, narrow = (float(mean.sel(interval="upper") - mean.sel(interval="lower")) for mean in means)
>>> narrow < 0.1 * width
True

Each contributor has its own stream of random numbers (Philox, keyed by the seed, the label and blocks of 4096 realizations).
Deviations are quantiles of these numbers: the same number u gives the same rank in any distribution. A distribution that yields
non-finite deviations is rejected."""

from tolcontact.variation.contributors import Contributor
from tolcontact.variation.draws import Draws, GivenDraws, draw

__all__ = ["Contributor", "Draws", "GivenDraws", "draw"]
