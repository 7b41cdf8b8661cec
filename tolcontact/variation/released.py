"""The draws of Shapley effects: from one set to another, unit by unit in a random order, also where units are correlated.

Song, Nelson, Staum (2016); Goda (2021). For each base realization k there are 1 + units realizations. The last one is A; in
realization m the first m units, in an order that is random for each k, are those of A, and the others are drawn anew, given
these m. The first one is B, independent of A.
"""

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.variation.draws import SURELY, Draws
from tolcontact.variation.mixed import OTHER
from tolcontact.variation.plans import Numbers
from tolcontact.variation.uniforms import uniform


class ReleasedDraws:
    """Deviations as Draws give them: realization k (1 + units) + m has m units of A."""

    def __init__(self, draws: Draws, units: Mapping[str, np.ndarray]) -> None:
        """`units`: columns of deviations by name; those of different units are independent, or correlated by declaration."""
        self._draws, self._names = draws, list(units)
        self._unit = {draws.labels[column]: k for k, columns in enumerate(units.values()) for column in columns}
        self._unit |= {
            rows: self._unit[draws.labels[int(columns[0])]]
            for rows, (columns, _) in zip(draws.rows_drawn, draws.populations, strict=True)
            if draws.labels[int(columns[0])] in self._unit
        }

    @property
    def together(self) -> int:
        """How many realizations each base realization has."""
        return 1 + len(self._names)

    def places(self, seed: int, first: int, last: int) -> np.ndarray:
        """Where each unit stands in the order of base realizations, (base, unit)."""
        keys = np.stack([uniform(seed, f"order of {name}", first, last) for name in self._names], axis=1)
        return np.asarray(keys.argsort(axis=1).argsort(axis=1))

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        first, last = start // self.together, -(-stop // self.together)
        places, count = self.places(seed, first, last), last - first

        def kept(label: str) -> np.ndarray:
            return uniform(seed, label, first, last)

        def anew(label: str) -> np.ndarray:
            return uniform(seed, label, OTHER + first, OTHER + last)

        every = np.empty((count, self.together, len(self._draws.labels)))
        for members in range(self.together):
            every[:, members] = self._draws.made_of(self._mixed(kept, anew, places, members), count)
        return every.reshape(-1, every.shape[2])[start - first * self.together : stop - first * self.together]

    def _mixed(self, kept: Numbers, anew: Numbers, places: np.ndarray, members: int) -> Numbers:
        """Numbers with those of the first `members` units kept, and all others anew, given these."""
        correlated: dict[str, np.ndarray] = {}
        for labels, factor in self._draws.correlated:
            correlated |= self._conditional(kept, anew, places, members, labels, factor)

        def numbers(label: str) -> np.ndarray:
            if label in correlated:
                return correlated[label]
            unit = self._unit.get(label, self._unit.get(label.rpartition(" #")[0]))  # of a further attempt
            return anew(label) if unit is None else np.where(places[:, unit] < members, kept(label), anew(label))

        return numbers

    def _conditional(
        self, kept: Numbers, anew: Numbers, places: np.ndarray, members: int, labels: list[str], factor: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Numbers of correlated contributors by label.

        With the factor L of the correlations in the order of a realization, z = L e: what comes later in e is what z has
        beside that which the former determine. So e of the former from the one set, and of the others from the other set.
        """
        both = [np.stack([ndtri(of(label)) for label in labels], axis=1) @ factor.T for of in (kept, anew)]
        last = np.full(len(places), self.together)  # for what does not vary
        of_label = np.stack([places[:, self._unit[label]] if label in self._unit else last for label in labels], axis=1)
        order = of_label.argsort(axis=1, kind="stable")
        own = np.linalg.cholesky((factor @ factor.T)[order[:, :, None], order[:, None, :]])
        e = [np.linalg.solve(own, np.take_along_axis(z, order, axis=1)[..., None])[..., 0] for z in both]
        stays = np.take_along_axis(of_label, order, axis=1) < members
        z = np.empty_like(both[0])
        np.put_along_axis(z, order, (own @ np.where(stays, *e)[..., None])[..., 0], axis=1)
        numbers = ndtr(np.linalg.solve(factor, z.T)).clip(SURELY, 1 - SURELY)
        return dict(zip(labels, numbers, strict=True))
