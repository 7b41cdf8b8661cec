"""Sample: everything that varies becomes deviations.

The draw of a contributor in realization k depends on the seed, the contributor's label and k alone (if it is correlated, on the
labels of the others, too): not on blocks, or on the order of declarations.
"""

import copy
from collections.abc import Callable

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration.feature_tolerance import INSIDE
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError
from tolcontact.variation.contributors import Contributors
from tolcontact.variation.plans import Numbers, Plan
from tolcontact.variation.uniforms import STREAM
from tolcontact.vocabulary import MONTE_CARLO

SURELY = 1e-16  # the least distance of a number from 0 and 1


class Draws:
    """The draws of a model."""

    def __init__(self, nominal: Nominal) -> None:
        """Raises ModelError if rules cannot be applied to a feature."""
        self.contributors = Contributors(nominal)
        self._assembly = nominal.assembly
        self._column = {each.label: k for k, each in enumerate(self.contributors.every)}
        populations = self._assembly.populations
        self._measured = [self._column[label] for population in populations for label in population.columns]
        together = {label: rule for own in self.contributors.together for label, rule in own.rules(list(self._column))}
        faults = []
        for each in self._assembly.correlations:
            if joint := [label for label in each.labels if label in together]:
                faults.append(
                    f'correlation "{each.name}" ({each.declared_at}): "{joint[0]}" is drawn with others by the rule '
                    f'"{together[joint[0]]}"; choose a rule of normal components, such as "{INSIDE}"'
                )
        if faults:
            raise ModelError(self._assembly.name, faults)
        self._plan = Plan(MONTE_CARLO, [])
        self._scale = np.ones(len(self.contributors.every))
        self._middle = np.array([each.tolerance.shift if each.tolerance else 0.0 for each in self.contributors.every])
        self._factors = [np.linalg.cholesky(np.array(each.matrix)) for each in self._assembly.correlations]

    def planned(self, name: str) -> "Draws":
        """The same contributors, drawn by a sampling plan (see plans)."""
        other = copy.copy(self)
        other._plan = Plan(name, [*self._column, *self.rows_drawn])
        return other

    def scaled(self, factors: np.ndarray) -> "Draws":
        """The same numbers with zones that are so many times as wide (contributor,), each about its middle."""
        other = copy.copy(self)
        other._scale = factors
        return other

    @property
    def labels(self) -> list[str]:
        """Labels of the columns of deviations."""
        return list(self._column)

    @property
    def correlated(self) -> list[tuple[list[str], np.ndarray]]:
        """Labels that are correlated, set by set, and the lower factor of their correlations (Cholesky)."""
        return [(list(each.labels), own) for each, own in zip(self._assembly.correlations, self._factors, strict=True)]

    @property
    def plan(self) -> str:
        """The name of its sampling plan."""
        return self._plan.name

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor) of realizations `start` to `stop`, in mm or the units of the contributor.

        Raises ModelError for a distribution that yields non-finite deviations.
        """
        return self.made_of(self._plan.numbers(seed, start, stop), stop - start)

    @property
    def varying(self) -> list[str]:
        """Labels of the numbers that deviations are made of, but for contributors that do not vary, or were measured."""
        measured = {label for population in self._assembly.populations for label in population.columns}
        some = np.array([0.1, 0.5, 0.9])
        drawn = [each.label for each in self.contributors.every if np.ptp(each.drawn(some)) > 0 and each.label not in measured]
        return drawn + self.rows_drawn

    def made_of(self, numbers: Numbers, count: int) -> np.ndarray:
        """Deviations (count, contributor) of numbers between 0 and 1 for each label."""
        every, labels = self.contributors.every, list(self._column)
        deviations = np.empty((count, len(every)))
        correlated = self._correlated(numbers)
        for column, each in enumerate(every):
            u = correlated[column] if column in correlated else numbers(each.label)
            deviations[:, column] = each.drawn(u)
        for together in self.contributors.together:
            own = [labels[column] for column in together.columns]

            def anew(attempt: int, own: list[str] = own) -> np.ndarray:
                said = [f"{label} #{attempt}" if attempt else label for label in own]
                return np.stack([numbers(label) for label in said], axis=1)

            deviations[:, together.columns] = together.draw(anew)
        if not (self._scale == 1.0).all():
            deviations = self._middle + self._scale * (deviations - self._middle)
        for label, population in zip(self.rows_drawn, self._assembly.populations, strict=True):
            rows = numbers(label)
            drawn = population.values[(rows * len(population.values)).astype(int)]
            deviations[:, [self._column[label] for label in population.columns]] = drawn
        sizes = {bonus.size for bonus in self.contributors.bonuses}
        self._drive(deviations, lambda column: column in sizes)
        for bonus in self.contributors.bonuses:
            drawn_here = np.setdiff1d(bonus.columns, self._measured)  # measured parts have used their bonus
            deviations[:, drawn_here] *= bonus.factor(deviations[:, bonus.size])[:, None]
        self._drive(deviations, lambda column: column not in sizes)
        self._check(deviations)
        return deviations

    @property
    def rows_drawn(self) -> list[str]:
        """What the numbers that choose the rows of measured parts are called."""
        return [f"population {k}: {', '.join(each.columns)}" for k, each in enumerate(self._assembly.populations, start=1)]

    def dependent(self, *, correlated: bool = True) -> list[list[int]]:
        """Columns that are not independent of each other, set by set: drawn together, driven by one cause, `correlated`."""
        assembly = self._assembly
        found = [[self._column[label] for label in each.labels] for each in assembly.correlations if correlated]
        found += [[self._column[label] for label in each.columns] for each in assembly.populations]
        found += [[int(column) for column in each.columns] for each in self.contributors.together]
        found += [[each.size, *(int(column) for column in each.columns)] for each in self.contributors.bonuses]
        return found + [
            [self._column[each.name], *(self._column[label] for label in each.drives)] for each in assembly.variables
        ]

    @property
    def driven(self) -> np.ndarray:
        """How much a deviation of 1 of each column adds to others (column, column): what shared causes drive."""
        found = np.zeros((len(self._column), len(self._column)))
        for variable in self._assembly.variables:
            for label, factor in variable.drives.items():
                found[self._column[variable.name], self._column[label]] += factor
        return found

    @property
    def populations(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Columns of measured parts, and their rows (row, column)."""
        every = self._assembly.populations
        return [(np.array([self._column[label] for label in each.columns]), each.values) for each in every]

    def of(self, rows: np.ndarray, *, seed: int) -> np.ndarray:
        """Deviations (row, contributor) of some realizations, by their numbers (row,)."""
        found = np.empty((len(rows), len(self.contributors.every)))
        for stream in np.unique(rows // STREAM):
            here = np.flatnonzero(rows // STREAM == stream)
            first = int(rows[here].min())
            found[here] = self(seed=seed, start=first, stop=int(rows[here].max()) + 1)[rows[here] - first]
        return found

    def _drive(self, deviations: np.ndarray, drives: Callable[[int], bool]) -> None:
        """Add what shared causes make of some columns."""
        for variable in self._assembly.variables:
            for label, factor in variable.drives.items():
                if drives(self._column[label]):
                    deviations[:, self._column[label]] += factor * deviations[:, self._column[variable.name]]

    def _correlated(self, numbers: Numbers) -> dict[int, np.ndarray]:
        """Uniform numbers (realization,) of correlated contributors by their column: a Gaussian copula."""
        found = {}
        for correlation, factor in zip(self._assembly.correlations, self._factors, strict=True):
            normal = np.stack([ndtri(numbers(label)) for label in correlation.labels], axis=1)
            mixed = sum(normal[:, k, None] * factor[:, k] for k in range(len(factor)))  # in a fixed order, whatever the block
            for label, u in zip(correlation.labels, ndtr(mixed).T, strict=True):
                found[self._column[label]] = u.clip(SURELY, 1 - SURELY)
        return found

    def _check(self, deviations: np.ndarray) -> None:
        for each, column in zip(self.contributors.every, deviations.T, strict=True):
            if not np.isfinite(column).all():
                said = each.tolerance or each.said
                raise ModelError(
                    self._assembly.name,
                    [f'{each.source} "{each.label}": its distribution, {said}, yields non-finite deviations'],
                )


def draw(nominal: Nominal, *, seed: int, start: int, stop: int) -> np.ndarray:
    """Deviations (realization, contributor) of realizations `start` to `stop`; see Draws."""
    return Draws(nominal)(seed=seed, start=start, stop=stop)


class GivenDraws:
    """Deviations as Draws give them: the rows of an array (realization, contributor), whatever the seed."""

    def __init__(self, deviations: np.ndarray) -> None:
        self._deviations = deviations

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        return self._deviations[start:stop]
