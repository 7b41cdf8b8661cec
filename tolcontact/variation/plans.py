"""Sampling plans: where the numbers between 0 and 1 come from that deviations are quantiles of.

    monte-carlo       independent of each other
    latin hypercube   256 realizations together fill 256 classes of every contributor, once each (McKay, Beckman, Conover, 1979)
    sobol             256 realizations together are the first points of a Sobol' sequence (Joe, Kuo, 2008; linear matrix
                      scramble), with a random digital shift

With the last two, realizations k 256 to (k + 1) 256 are a replicate: independent of all others, each of its realizations
distributed as one drawn by itself. So intervals follow from the means of replicates (Owen, 1997). In any plan the numbers of
realization k depend on the seed, the labels and k alone.
"""

import functools
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import qmc

from tolcontact.variation.uniforms import BITS, generator, uniform
from tolcontact.vocabulary import LATIN_HYPERCUBE, MONTE_CARLO, REPLICATE, SOBOL

Numbers = Callable[[str], np.ndarray]  # numbers (realization,) strictly between 0 and 1 of a label


class Plan:
    """The numbers of some labels, by the name of a plan. Labels beside these have independent numbers in every plan."""

    def __init__(self, name: str, labels: Sequence[str]) -> None:
        self.name = name
        self._column = {label: k for k, label in enumerate(sorted(labels))}  # not the order of declarations

    def numbers(self, seed: int, start: int, stop: int) -> Numbers:
        """Those of realizations `start` to `stop`."""
        if self.name == MONTE_CARLO or not self._column:
            return lambda label: uniform(seed, label, start, stop)
        replicates = range(start // REPLICATE, -(-stop // REPLICATE))
        rows = np.concatenate([_POINTS[self.name](seed, replicate, len(self._column)) for replicate in replicates])
        own = rows[start - replicates.start * REPLICATE :][: stop - start]
        return lambda label: own[:, self._column[label]] if label in self._column else uniform(seed, label, start, stop)


def _latin(seed: int, replicate: int, count: int) -> np.ndarray:
    rng = generator(seed, LATIN_HYPERCUBE, replicate)
    return np.asarray(qmc.LatinHypercube(count, rng=rng).random(REPLICATE)).clip(2.0**-BITS, 1 - 2.0**-BITS)


def _sobol(seed: int, replicate: int, count: int) -> np.ndarray:
    shift = generator(seed, SOBOL, replicate).integers(0, 1 << BITS, count)
    return ((_net(seed, count) ^ shift) + 0.5) * 2.0**-BITS


@functools.lru_cache(maxsize=8)
def _net(seed: int, count: int) -> np.ndarray:
    """Points (REPLICATE, count) as whole numbers of BITS bits."""
    points = qmc.Sobol(count, scramble=True, bits=BITS, rng=generator(seed, SOBOL, -1)).random(REPLICATE)
    return np.asarray((points * 2.0**BITS).astype(np.int64))


_POINTS = {LATIN_HYPERCUBE: _latin, SOBOL: _sobol}
