"""Probabilities of events that are too rare to be counted.

A score g(u) of independent standard normal contributors u states whether a realization is in an event, g > 0, and for some
events also how near it is otherwise. Two searches look for the regions of the event:

by levels of the score (subset simulation; Au, Beck, 2001). The event is the last of nested events, g > c_1, g > c_2, ...,
g > 0. Each is a fifth of the previous one, and

    p = P(g > c_1) P(g > c_2 | g > c_1) ... P(g > 0 | g > c_last)

by inflation. All contributors are inflated until the event is common, u ~ N(0, s^2), and brought back to s = 1. With few
contributors realizations are weighted by the ratio of the densities, and resampled; with many the inflations are nested.

Each search consists of eight strands that share levels or inflations. Their differences determine the accuracy of the product.

The searches have different weaknesses: levels favour the region with the largest scores, and inflation favours distant regions.
Realizations within the event walk by u' = sqrt(1 - b^2) u + b v, v standard normal, accepted if u' is in the event (Papaioannou
and others, 2015). The results of both searches are the centres of a mixture of standard normals, which gives the probability by
importance sampling. This estimate is unbiased for any centres, but a region that neither search found is missing from it. It is
therefore used only if its weights are spread over many realizations, with no dominant one, and if neither search gives a
significantly larger value. Where a region was reached by one or two strands only, there may be others, and the interval is
widened (Good, 1953). Otherwise the result is the mean of the searches; where they disagree, the interval covers both, and
`disagreement` states it.

A search ends below 1e-9. The probability of the event is then reported as 0. Its upper bound is the probability of the last
level, which contains the event, or of the inflated event, on the assumption that less inflation makes an event no more
probable.

With more than ten contributors, the means of contributors without influence are noise in a centre, which spreads the weights:
entries of a centre below five standard errors are set to 0.
"""

from tolcontact.statistics.rare.probability import Tail, either, sufficient_tail, tail_probability
from tolcontact.statistics.rare.searches import NEGLIGIBLE, Score

__all__ = ["NEGLIGIBLE", "Score", "Tail", "either", "sufficient_tail", "tail_probability"]
