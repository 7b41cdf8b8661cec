"""Designs: draws with several realizations for each base realization, for derivatives, Sobol' indices and Shapley effects.

Sobol' indices: Saltelli et al. (2010). Each base realization has 2 + groups realizations: A, B, and A with the columns of each
group from B.

Shapley effects: Song, Nelson, Staum (2016); Goda (2021). Each base realization has 1 + units realizations. The last one is A.
Realization m has the first m units of A, in a random order for each base realization; the other units are redrawn conditional
on these m. The first one is B, independent of A.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.variation.draws import MIN_UNIFORM, Draws
from tolcontact.variation.plans import Numbers, uniform

REDRAWN_START = 1 << 40  # number of the first realization of B; no run is that long


class Design(ABC):
    """Deviations in the form of Draws: realization k size + m is member m of base realization k.

    size   number of realizations of each base realization
    """

    size: int

    @abstractmethod
    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (realization, contributor); see Draws."""
        base = start // self.size
        members = self.members(seed, base, -(-stop // self.size))
        return members.reshape(-1, members.shape[2])[start - base * self.size : stop - base * self.size]


class SteppedDraws(Design):
    """Each realization, followed by steps up, then down, of each of `columns` by `steps` (column,) in its units.

    A step of a shared cause also steps the contributors that it drives.
    """

    def __init__(self, draws: Draws, columns: np.ndarray, steps: np.ndarray) -> None:
        self._draws, self._columns, self._steps = draws, columns, steps
        self._drive = draws.drive_matrix
        self.size = 1 + 2 * len(columns)

    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""
        members = np.repeat(self._draws(seed=seed, start=start, stop=stop)[:, None], self.size, axis=1)
        count, width = len(self._columns), members.shape[2]
        changes = self._steps[:, None] * (np.eye(width) + self._drive)[self._columns]
        members[:, 1 : count + 1] += changes
        members[:, count + 1 :] -= changes
        for k in np.flatnonzero(self._drive[self._columns].any(axis=1)):  # a datum depends on the tilts that a cause drives
            self._draws.add_shifts(members[:, 1 + k])
            self._draws.add_shifts(members[:, 1 + count + k])
        return members


class MixedDraws(Design):
    """A, B, and A with the columns of each of `groups` from B; own deviations of different groups are independent."""

    def __init__(self, draws: Draws, groups: Sequence[np.ndarray]) -> None:
        self._draws, self._groups = draws, groups
        self.size = 2 + len(groups)

    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""
        A = self._draws.without_shared_causes(self._draws(seed=seed, start=start, stop=stop))
        B = self._draws.without_shared_causes(self._draws(seed=seed, start=REDRAWN_START + start, stop=REDRAWN_START + stop))
        members = np.repeat(A[:, None], self.size, axis=1)
        members[:, 1] = B
        for member, columns in enumerate(self._groups, start=2):
            members[:, member, columns] = B[:, columns]
        members = self._draws.with_shared_causes(members)
        self._draws.add_shifts(members.reshape(-1, members.shape[2]))
        return members


class ReleasedDraws(Design):
    """Member m has m units of A; the others are redrawn.

    units  columns of deviations by name; different units are independent, or correlated by declaration
    """

    def __init__(self, draws: Draws, units: Mapping[str, np.ndarray]) -> None:
        self._draws, self._names = draws, list(units)
        self.size = 1 + len(units)
        self._unit = {draws.labels[column]: k for k, columns in enumerate(units.values()) for column in columns}
        self._unit |= {
            rows: self._unit[draws.labels[int(columns[0])]]
            for rows, (columns, _) in zip(draws.population_labels, draws.populations, strict=True)
            if draws.labels[int(columns[0])] in self._unit
        }

    def positions(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return the positions (base, unit) of the units in the random orders of base realizations."""
        keys = np.stack([uniform(seed, f"order of {name}", start, stop) for name in self._names], axis=1)
        return np.asarray(keys.argsort(axis=1).argsort(axis=1))

    def members(self, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (base, member, contributor) of base realizations `start` to `stop`."""
        positions = self.positions(seed, start, stop)

        def retained(label: str) -> np.ndarray:
            return uniform(seed, label, start, stop)

        def redrawn(label: str) -> np.ndarray:
            return uniform(seed, label, REDRAWN_START + start, REDRAWN_START + stop)

        members = np.empty((stop - start, self.size, len(self._draws.labels)))
        for count in range(self.size):
            numbers = self._mixed(retained, redrawn, positions, count)
            members[:, count] = self._draws.from_numbers(numbers, stop - start)
        return members

    def _mixed(self, retained: Numbers, redrawn: Numbers, positions: np.ndarray, count: int) -> Numbers:
        """Return numbers with the first `count` units retained, and the others redrawn conditional on these."""
        correlated: dict[str, np.ndarray] = {}
        for labels, factor in self._draws.correlated:
            correlated |= self._conditional(retained, redrawn, positions, count, labels, factor)

        def numbers(label: str) -> np.ndarray:
            if label in correlated:
                return correlated[label]
            unit = self._unit.get(label, self._unit.get(label.rpartition(" #")[0]))  # " #2": a further attempt
            if unit is None:
                return redrawn(label)
            return np.where(positions[:, unit] < count, retained(label), redrawn(label))

        return numbers

    def _conditional(
        self, retained: Numbers, redrawn: Numbers, positions: np.ndarray, count: int, labels: list[str], factor: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Return numbers of correlated contributors by label: the first `count` units retained, the others conditional on them.

        Normal scores z of the contributors have the covariance `factor` factor^T. In the order of the units' positions z = L e,
        with L the Cholesky factor of the covariance in this order, and e independent standard normal numbers. An entry of e is
        the part of its score that earlier contributors do not determine. So z composed of the retained e up to `count`, and of
        the redrawn e after it, has the earlier scores unchanged and the later ones conditional on them.
        """
        scores = [np.stack([ndtri(numbers(label)) for label in labels], axis=1) @ factor.T for numbers in (retained, redrawn)]
        after_all = np.full(len(positions), self.size)  # the position of a contributor that does not vary
        place = np.stack([positions[:, self._unit[label]] if label in self._unit else after_all for label in labels], axis=1)
        order = place.argsort(axis=1, kind="stable")
        L = np.linalg.cholesky((factor @ factor.T)[order[:, :, None], order[:, None, :]])
        e_retained, e_redrawn = (np.linalg.solve(L, np.take_along_axis(z, order, axis=1)[..., None])[..., 0] for z in scores)
        is_retained = np.take_along_axis(place, order, axis=1) < count
        z = np.empty_like(scores[0])
        np.put_along_axis(z, order, (L @ np.where(is_retained, e_retained, e_redrawn)[..., None])[..., 0], axis=1)
        numbers = ndtr(np.linalg.solve(factor, z.T)).clip(MIN_UNIFORM, 1 - MIN_UNIFORM)
        return dict(zip(labels, numbers, strict=True))
