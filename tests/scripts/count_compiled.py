"""Call a compiled function, and say how often it was found compiled and how often not."""

import numpy as np

from tolcontact.statistics import kernel

powers = np.zeros((4, 3))
kernel.add_magnitudes(np.ones((2, 3, 4)), np.ones((3, 3)), np.zeros(3), powers)
assert np.allclose(powers[1], 96), powers
found = kernel.add_magnitudes.stats
print(sum(found.cache_hits.values()), sum(found.cache_misses.values()))
