"""Designs: draws in which realizations belong together, as sensitivities, Sobol' indices and Shapley effects need them.

Sobol' indices: Saltelli et al. (2010). For each base realization k there are 2 + groups realizations: A, B, and A with the
columns of each group from B.

Shapley effects: Song, Nelson, Staum (2016); Goda (2021). For each base realization k there are 1 + units realizations. The
last one is A; in realization m the first m units, in an order that is random for each k, are those of A, and the others are
drawn anew, given these m. The first one is B, independent of A.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.variation.draws import MIN_UNIFORM, Draws
from tolcontact.variation.plans import Numbers, uniform

OTHER = 1 << 40  # realizations that B begins at: no run comes so far


class SteppedDraws:
    """Deviations as Draws give them: realization k (1 + 2 columns) + m is realization k, with one column stepped for m > 0.

    First come the steps up of all `columns`, by `steps` (column,) in their units, then the steps down.
    """

    def __init__(self, draws: Draws, columns: np.ndarray, steps: np.ndarray) -> None:
        self._draws, self._columns, self._steps = draws, columns, steps

    @property
    def together(self) -> int:
        """How many realizations there are of each."""
        return 1 + 2 * len(self._columns)

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        first, last = start // self.together, -(-stop // self.together)
        own = self._draws(seed=seed, start=first, stop=last)
        every = np.repeat(own[:, None], self.together, axis=1)
        count = len(self._columns)
        for k, (column, step) in enumerate(zip(self._columns, self._steps, strict=True), start=1):
            every[:, k, column] += step
            every[:, count + k, column] -= step
        return every.reshape(-1, own.shape[1])[start - first * self.together : stop - first * self.together]


class MixedDraws:
    """Deviations as Draws give them: realization k (2 + groups) + m is mixture m of base realization k."""

    def __init__(self, draws: Draws, groups: Sequence[np.ndarray]) -> None:
        """`groups`: columns of deviations that change together; those of different groups are independent."""
        self._draws, self._groups = draws, groups

    @property
    def together(self) -> int:
        """How many realizations each base realization has."""
        return 2 + len(self._groups)

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        count = self.together
        first, last = start // count, -(-stop // count)
        A = self._draws(seed=seed, start=first, stop=last)
        B = self._draws(seed=seed, start=OTHER + first, stop=OTHER + last)
        every = np.repeat(A[:, None], count, axis=1)
        every[:, 1] = B
        for member, columns in enumerate(self._groups, start=2):
            every[:, member, columns] = B[:, columns]
        return every.reshape(-1, A.shape[1])[start - first * count : stop - first * count]


def independent_groups(draws: Draws, owners: Sequence[str], *, correlated: bool = True) -> dict[str, np.ndarray]:
    """Columns by who owns them, so that groups are independent of each other: what is drawn together is one group.

    Without `correlated`, groups may be correlated by declaration, but not depend on each other in another way.
    """
    leader = list(range(len(owners)))

    def find(k: int) -> int:
        while leader[k] != k:
            k = leader[k]
        return k

    first: dict[str, int] = {}
    together = [[first.setdefault(owner, k), k] for k, owner in enumerate(owners)]
    for columns in [*together, *draws.dependent(correlated=correlated)]:
        for k in columns[1:]:
            one, other = sorted((find(int(columns[0])), find(int(k))))
            leader[other] = one
    found: dict[int, list[int]] = {}
    for k in range(len(owners)):
        found.setdefault(find(k), []).append(k)
    return {" + ".join(dict.fromkeys(owners[k] for k in columns)): np.array(columns) for columns in found.values()}


class ReleasedDraws:
    """Deviations as Draws give them: realization k (1 + units) + m has m units of A."""

    def __init__(self, draws: Draws, units: Mapping[str, np.ndarray]) -> None:
        """`units`: columns of deviations by name; those of different units are independent, or correlated by declaration."""
        self._draws, self._names = draws, list(units)
        self._unit = {draws.labels[column]: k for k, columns in enumerate(units.values()) for column in columns}
        self._unit |= {
            rows: self._unit[draws.labels[int(columns[0])]]
            for rows, (columns, _) in zip(draws.population_labels, draws.populations, strict=True)
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
            every[:, members] = self._draws.from_numbers(self._mixed(kept, anew, places, members), count)
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
        numbers = ndtr(np.linalg.solve(factor, z.T)).clip(MIN_UNIFORM, 1 - MIN_UNIFORM)
        return dict(zip(labels, numbers, strict=True))
