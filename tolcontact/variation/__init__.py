"""Draw: tolerances become deviations of the locators. A chapter of the guide.

## From a tolerance to a distribution

A tolerance range T is the full width of a zone around 0. `tc.Tolerance(range, distribution)` names what fills it:

| distribution | deviations |
|---|---|
| "normal" (default) | sigma = T / 6, unbounded |
| "uniform" | evenly between -T/2 and +T/2 |
| "triangular" | between -T/2 and +T/2, most often 0 |
| "truncated normal" | sigma = T / 6, cut at -T/2 and +T/2 |

A number stands for a normal distribution of that range, and 0 for a locator that does not vary. Any frozen continuous
distribution of `scipy.stats` may take the place of a name; it defines the spread by itself, so leave the range out.

>>> import tolcontact as tc
>>> from scipy import stats
>>> print(tc.Tolerance(0.6))
normal, range 0.6 mm
>>> skewed = tc.Tolerance(distribution=stats.gamma(4, scale=0.02))
>>> skewed.width  # six standard deviations [mm]
0.24

## Draws depend on the seed and on the realization alone

The deviation of a locator in realization k depends on the seed, on the locator's label ("part.locator") and on k. It does not
depend on the number of realizations, on blocks, threads, other locators, or the order of declarations. So a longer run begins
with the realizations of a shorter one, and two solvers or two methods can be compared draw by draw.

>>> model = tc.Assembly("model")
>>> part = model.part("part", tc.Box(50, 30, 10))
>>> scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"))
>>> location = model.locate(part, scheme, tolerance=0.6)
>>> height = model.measure("height", part.point(50, 0, 10), along="z")
>>> from tolcontact.variation import draw
>>> nominal = tc.build(model).nominal
>>> nominal.locators.labels
('part.A1', 'part.A2', 'part.A3', 'part.B1', 'part.B2', 'part.C1')
>>> deviations = draw(nominal, seed=1, start=0, stop=1000)  # (realization, locator) [mm]
>>> bool((deviations[500:510] == draw(nominal, seed=1, start=500, stop=510)).all())
True
>>> float(deviations.std().round(2))  # a sixth of the range
0.1

Each locator has a stream of random numbers of its own (Philox, keyed by the seed, the label and blocks of 4096 realizations).
Deviations are its quantiles: the same share u gives the same rank in any distribution. A distribution that yields non-finite
deviations is rejected.
"""

from tolcontact.variation.contributors import Contributor
from tolcontact.variation.draws import Draws, draw

__all__ = ["Contributor", "Draws", "draw"]
