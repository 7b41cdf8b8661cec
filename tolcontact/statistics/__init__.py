"""Summarize: estimates of measures, contact and displacement fields, with their intervals. A chapter of the guide.

`tc.summarize(results)` reads the result of `tc.run` or `tc.open_archive`, or the archive at a path, and returns an
`xarray.Dataset`. `tolcontact summary FILE.nc` prints it.

>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
>>> results = tc.run(stand, samples=1000, seed=1)
>>> summary = tc.summarize(results)
>>> spread = summary.statistic_value.sel(measure="height", state="corrected", statistic="6 sigma")
>>> dict(zip(spread.interval.values.tolist(), spread.values.round(2).tolist()))
{'estimate': 0.45, 'lower': 0.42, 'upper': 0.48}

## Estimates

Every estimate has a 95 % confidence interval (dimension `interval`: estimate, lower, upper). No interval assumes a normal
distribution, because contact truncates distributions.

| estimate | interval |
|---|---|
| mean | Student's t |
| standard deviation, 6 sigma, variance | Hall's (1992), from the sixth moment; below 1000 realizations Bonett's if wider |
| magnitude of displacement fields | Bonett's (2006), from the fourth moment |
| percentiles 0.135, 5, 50, 95, 99.865 | order statistics; a bound is infinite if the sample is too small |
| share below, above and outside the limits, touched by contact, not assemblable | Clopper-Pearson |
| Pp, Ppk by percentiles (ISO 22514-2) | order statistics at three percentiles, conservative |
| skewness, kurtosis, Pp and Ppk for a normal distribution | influence functions (delta method) |
| Sobol' indices, share that linear sensitivities miss | influence functions of ratios of means |
| probabilities of rare events (`tc.tails`) | from importance sampling, or from two searches |
| change: shift of the mean | Student's t on the differences of the same draws |
| change: ratio of 6 sigma, ratio of variance | from the same draws, on the log scale |

For a run with a sampling plan and 16 replicates or more, the intervals of the mean, the standard deviation, percentiles,
shares outside, shape and changes follow from the differences between replicates (their design effect).

Shares outside and capability are given only for measures with limits. Contact often keeps a measure exactly at a stop, and
solvers find this value to within about 1e-13 mm, on either side. So a value counts as beyond a limit only if it is beyond by
more than the accuracy of the measure: 1e-8 mm, the accuracy of gaps in a certified realization, or the effect of such a gap on
the measure if that is larger (`measure_accuracy` in the archive). `tc.summarize`, `--until`, `compare`, `tails`, `allocate` and
`relocate` all use this rule. If the outer percentile of the values is the limit itself, and no value lies beyond, the limit is
a stop: capability leaves this side out, and the table says so. A measure that varies by less than its accuracy is constant.

Some estimates have no interval, "[-]" in tables: spreads of fewer than 10 realizations; skewness and kurtosis, unless there
are 1000 realizations with a kurtosis below 3.5, since heavy tails appear in few realizations; and Sobol' indices if fewer than
100 realizations contribute to the variance, for example of a measure that contact holds at a stop. If a bound is infinite, more
realizations are needed. Fewer than about 2730 realizations with one limit, or 3240 with two limits, do not bound a tail, which
may then have any length: the lower bound of Ppk is 0, or below.

`studies/verification` shows how often each interval covers the truth, for eight distributions and 100 to 10 000 realizations.
Coverage is below 92.5 % only in these cases. A measure at its stop in 93 % of realizations: the mean (86 % at 100 realizations,
91 % at 300), the ratio of variance (86 %, 92 %), 6 sigma (91 % at 100). Heavy tails (Student's t with 5 degrees of freedom): 6
sigma (91 % at 300). A skewed measure (lognormal): Ppk as normal (91 % at 100) and the ratio of variance (92 %). In runs of 30
realizations, the intervals of 6 sigma of skewed measures cover the truth in 90 % (exponential) and 89 % (lognormal).

A measure that evaluates to NaN does not stop the run; its statistics are NaN, and the table shows "-". Statistics always cover
all finished realizations, of any status.

>>> change = summary.change.sel(measure="height", change_of="ratio of 6 sigma")
>>> bool(change.sel(interval="upper") < 1)  # contact reduces the spread, at 95 % confidence
True

For contact, the summary contains the share of realizations with each pair under load, the mean and percentiles of its
reaction (in the units of the objective: N only for "locator stiffness" and "seating"), and the pairs that are under load at the
same time. Where faces lie flat on each other, the distribution of the reaction over points is not unique, but the set of
touching points is. A run counts touching points in its first 2048 realizations; the group `contact` of the archive contains the
shares for each point, and `results.tolcontact.touching()` returns them.

>>> round(float(summary.carried.sel(pair="interface", interval="estimate")), 2)
0.9
>>> results.tolcontact.touching().touching.dims
('point', 'interval')

The summary also contains the number of realizations of each status, the pairs in conflict, the largest penetration at contact
points and between surfaces, and the number of steps: see `tc.summarize`, or `print(summary)`.

## Displacement fields

The displacement u = (R - I) v + t (14) is evaluated at surface points v of every part, in both states. It is the displacement
of the part as a rigid body, without the deviations of its features (use measures at points of features for these). The field
contains its mean and 6 sigma in x, y, z and magnitude. Components follow exactly from the mean and covariance of the poses of
all realizations, even if poses are not kept. The magnitude is summed over the first 16 384 realizations, or fewer (at least
1024) for a part with more than 2048 vertices (`fields=`, `--fields`: "some", a number, "all" or "none"); its 6 sigma has an
interval at each point.

>>> field = results["field/block"]
>>> int(field.realizations), int(field.magnitude_realizations)
(1000, 1000)
>>> field.six_sigma.sel(state="corrected", component="z").dims
('vertex',)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
