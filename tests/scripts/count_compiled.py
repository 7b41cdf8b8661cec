"""Call a compiled function, which needs memory of its own, and say how often it was found compiled and how often not."""

import numpy as np

from tolcontact.compiled import compiled


@compiled
def squares(values):
    return values * values


found = squares(np.arange(4.0))
assert found.tolist() == [0, 1, 4, 9], found
print(sum(squares.stats.cache_hits.values()), sum(squares.stats.cache_misses.values()))
