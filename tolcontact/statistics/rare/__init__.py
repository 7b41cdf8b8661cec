"""Probabilities of events too rare to be counted.

A score g(u) of independent standard normal contributors u says whether a realization is in an event, which is g > 0, and if it
is not, perhaps how near it is. Two searches look for the ways into the event:

by levels of the score (subset simulation; Au, Beck, 2001). The event is the last of nested ones, g > c_1, g > c_2, ..., g > 0,
of which each is a fifth of the one before, and

    p = P(g > c_1) P(g > c_2 | g > c_1) ... P(g > 0 | g > c_last)

by inflation. All contributors are inflated until the event is common, u ~ N(0, s^2), and brought back to s = 1. With few
contributors realizations are weighted by the ratio of the densities, and sampled again; with many the inflations are nested.

Each search is made by eight strands that share levels or inflations. How they differ says how well the product is known.

Each search moves along where the other may be led astray: levels follow the way that moves in the largest units, and inflation
prefers what is far away. Realizations within the event walk by u' = sqrt(1 - b^2) u + b v, v standard normal, taken if u' is in
the event (Papaioannou and others, 2015). What both have found are the centres of a mixture of standard normals, from which the
probability is estimated by importance sampling, which is unbiased for any centres. A way that neither search found is missing
from it. So the estimate counts only if many realizations carry it, none of them much of it, and if neither search says
significantly more; and where single strands alone came to a way, there may be others, for which the interval is widened (Good,
1953). Otherwise the searches answer; where they disagree, the interval covers both, and `disagreement` says so.

A search ends below 1e-9. The event is then said to have the probability 0, and as upper bound that of what was reached: a
level, which contains the event, or the inflated event, where it is assumed that less inflation makes an event no more probable.

With more than ten contributors, the means of those without influence are noise in a centre, which spreads the weights: what is
smaller than five standard errors in a centre is taken for 0.
"""

from tolcontact.statistics.rare.probability import Tail, either, sufficient_tail, tail_probability
from tolcontact.statistics.rare.searches import NEGLIGIBLE, Score

__all__ = ["NEGLIGIBLE", "Score", "Tail", "either", "sufficient_tail", "tail_probability"]
