"""Draws: everything that varies becomes deviations.

The draw of a contributor in realization k depends on the seed, the contributor's label and k alone; of a correlated contributor
also on the labels of the others. It does not depend on blocks, or on the order of declarations.

Coefficients of correlation are of the Gaussian copula, of the deviations (Pearson), or of their ranks (Spearman). With normal
scores z of correlation r, deviations x(z) and y(z) have the Pearson coefficient sum a_k b_k r^k for k from 1, where a_k and b_k
are the coefficients of standardized x and y in normalized Hermite polynomials (Mehler's expansion). Ranks have the coefficient
6 / pi asin(r / 2).
"""

import copy
from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from scipy.special import ndtr, ndtri

from tolcontact.declaration import Correlation
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError
from tolcontact.features.datum_frames import Shifts
from tolcontact.features.freedoms import Freedom
from tolcontact.variation.plans import STREAM, Numbers, planned_numbers
from tolcontact.variation.spreads import ComponentZone, Envelope, Widening, envelopes, fill_zones
from tolcontact.vocabulary import KNOWN_FROM_FEW, MONTE_CARLO

MAX_SCORE, SCORES, TERMS = 8.0, 8001, 80
MIN_EIGENVALUE = 1e-12  # of a matrix of coefficients
MIN_UNIFORM = 1e-16  # smallest distance of a number from 0 and 1
MAX_NAMED = 4  # contributors with means on one side
ROUNDING = 1e-12  # of a column: independent deviations that are no larger are what sums leave over


def hermite_coefficients(freedom: Freedom) -> np.ndarray:
    """Return the coefficients (term,) of a freedom's standardized deviation, from the first one on; zeros if it is constant."""
    z = np.linspace(-MAX_SCORE, MAX_SCORE, SCORES)
    weights = np.exp(-(z**2) / 2)
    weights /= weights.sum()
    deviations = freedom.deviations(ndtr(z))
    deviations = deviations - weights @ deviations
    polynomials = [np.ones_like(z), z]
    for k in range(1, TERMS):
        polynomials.append((z * polynomials[k] - np.sqrt(k) * polynomials[k - 1]) / np.sqrt(k + 1))
    spread = np.sqrt(weights @ deviations**2)
    return np.array(polynomials[1:]) @ (weights * deviations) / spread if spread > 0 else np.zeros(TERMS)


def pearson(copula: float, first: np.ndarray, second: np.ndarray) -> float:
    """Return the Pearson coefficient for one of the copula, and coefficients (term,) of both deviations."""
    return float((first * second) @ copula ** np.arange(1, TERMS + 1))


def rank(copula: float) -> float:
    """Return the coefficient of ranks (Spearman) for one of the copula."""
    return float(6 / np.pi * np.arcsin(copula / 2))


def copula_matrix(correlation: Correlation, freedoms: Sequence[Freedom], model: str) -> np.ndarray:
    """Return the matrix of the Gaussian copula of a correlation. Raises ModelError for coefficients that cannot exist."""
    matrix = np.array(correlation.matrix)
    if correlation.kind == "copula":
        return matrix
    terms = [hermite_coefficients(freedom) for freedom in freedoms]
    faults = list[str]()
    for row, column in zip(*np.tril_indices(len(matrix), -1), strict=True):
        stated, pair = matrix[row, column], (terms[row], terms[column])
        if correlation.kind == "rank":
            coefficient = 2 * np.sin(np.pi / 6 * stated)
        else:
            low, high = pearson(-1.0, *pair), pearson(1.0, *pair)
            if not low < stated < high:
                first, second = correlation.labels[row], correlation.labels[column]
                faults.append(
                    f'"{first}" and "{second}" have Pearson coefficients from {low:.3f} to {high:.3f} alone, by their '
                    f"distributions, and not {stated:g}"
                )
                continue
            coefficient = scipy.optimize.brentq(lambda r, pair=pair, stated=stated: pearson(r, *pair) - stated, -1, 1)
        matrix[row, column] = matrix[column, row] = coefficient
    if not faults and np.linalg.eigvalsh(matrix).min() < MIN_EIGENVALUE:
        faults.append(f"no Gaussian copula has these {correlation.kind} coefficients together; make them smaller")
    if faults:
        raise ModelError(model, [f"{correlation.designation}: {fault}" for fault in faults])
    return matrix


def in_words(correlation: Correlation, matrix: np.ndarray, freedoms: Sequence[Freedom]) -> str:
    """Return the coefficients of a correlation of all kinds, for the first two contributors, from the matrix of its copula."""
    copula, terms = float(matrix[1, 0]), [hermite_coefficients(freedom) for freedom in freedoms[:2]]
    first, second = correlation.labels[:2]
    return (
        f'correlation of "{first}" and "{second}": copula {copula:.3f}, Pearson {pearson(copula, *terms):.3f}, '
        f"rank {rank(copula):.3f}"
    )


class Draws:
    """The draws of a model. Raises ModelError if rules cannot be applied to a feature.

    contributors  the freedoms of the model with their spreads, in the order of the columns of deviations
    zones         that components of features fill
    mean_widths   [mm] of the minimum zones of forms, by feature
    shifts        of datum planes, which follow from other deviations
    correlated    for each correlation its labels, and the lower factor of its matrix (Cholesky)
    populations   columns of measured parts, and the values (row, column) that are drawn
    """

    def __init__(self, nominal: Nominal) -> None:
        self.contributors, self.zones, self.mean_widths = fill_zones(nominal)
        self._scaling: list[ComponentZone | Envelope] = [zone for zone in self.zones if zone.sizes.size]
        self._scaling += envelopes(nominal)
        self.shifts = [shift for pattern in nominal.patterns for shift in pattern.shifts]
        self._assembly = assembly = nominal.assembly
        self._column = {contributor.label: k for k, contributor in enumerate(self.contributors)}
        self.plan = MONTE_CARLO
        self._scale, self._shifts = np.ones(len(self.contributors)), np.zeros(len(self.contributors))
        freedoms = self.contributors
        self._middle = np.array([freedom.tolerance.shift if freedom.tolerance else freedom.middle for freedom in freedoms])
        self.correlated = [
            (list(correlation.labels), np.linalg.cholesky(self._copula(correlation))) for correlation in assembly.correlations
        ]
        self.populations = [
            (np.array([self._column[label] for label in population.columns]), population.drawn)
            for population in assembly.populations
        ]

    def _copula(self, correlation: Correlation) -> np.ndarray:
        freedoms = [self.contributors[self._column[label]] for label in correlation.labels]
        return copula_matrix(correlation, freedoms, self._assembly.name)

    @property
    def in_words(self) -> list[str]:
        """A line for each correlation: its coefficient of the copula, of deviations and of ranks; and others on measured parts.

        These are on lots, gaps and gauges of populations, on few parts, and on means by cpk.
        """
        correlations, populations = self._assembly.correlations, self._assembly.populations
        lines = [
            in_words(correlation, self._copula(correlation), [self.contributors[self._column[k]] for k in correlation.labels])
            for correlation in correlations
        ]
        lines += [population.in_words for population in populations]
        sides, few = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
        for freedom in self.contributors:
            if freedom.side_in_words:
                sides[freedom.side_in_words].append(freedom.label)
            if freedom.parts:
                few[f"{freedom.parts} parts"].append(freedom.label)
        for population, label in zip(populations, self.population_labels, strict=True):
            few[f"{len(population.members)} lots" if population.lots else f"{len(population.values)} parts"].append(label)
        known = [f"{_shortened(labels)} from {count}" for count, labels in few.items()]
        means = [f"{_shortened(labels)} {side.rstrip(',')}" for side, labels in sides.items()]
        lines += [f"{KNOWN_FROM_FEW}: {'; '.join(known)}"] * bool(known)
        return lines + [f"means off centre by cpk: {'; '.join(means)}"] * bool(means)

    def planned(self, name: str) -> "Draws":
        """Return draws of the same contributors by a sampling plan (see plans)."""
        draws = copy.copy(self)
        draws.plan = name
        return draws

    def scaled(self, factors: np.ndarray, shifts: np.ndarray | None = None) -> "Draws":
        """Return draws of the same numbers with zones widened by factors (contributor,), each about its middle.

        Then the middles move by `shifts` (contributor,), in the units of the contributors. The limits of sizes move with their
        zones: a bonus and an envelope count from the limits of the widened size.
        """
        draws = copy.copy(self)
        draws._scale, draws._shifts = factors, np.zeros(len(factors)) if shifts is None else shifts
        return draws

    @property
    def labels(self) -> list[str]:
        """Labels of the columns of deviations."""
        return list(self._column)

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (realization, contributor) of realizations `start` to `stop`, in mm or the contributor's units.

        Raises ModelError for a distribution that yields non-finite deviations.
        """
        return self.from_numbers(self.numbers(seed=seed, start=start, stop=stop), stop - start)

    def numbers(self, *, seed: int, start: int, stop: int) -> Numbers:
        """Return the numbers between 0 and 1 of realizations `start` to `stop`, by label."""
        return planned_numbers(self.plan, [*self._column, *self.population_labels], seed, start, stop)

    @property
    def varying(self) -> list[str]:
        """Labels of the numbers that deviations depend on; contributors that do not vary or were measured have none."""
        measured = {label for population in self._assembly.populations for label in population.columns}
        u = np.array([0.1, 0.5, 0.9])
        varying = [contributor.label for contributor in self.contributors if np.ptp(contributor.deviations(u)) > 0]
        return [label for label in varying if label not in measured] + self.population_labels

    def from_numbers(self, numbers: Numbers, count: int) -> np.ndarray:
        """Return deviations (count, contributor) for numbers between 0 and 1 of each label."""
        deviations = np.empty((count, len(self.contributors)))
        correlated = self._correlated_numbers(numbers)
        for column, contributor in enumerate(self.contributors):
            u = correlated[column] if column in correlated else numbers(contributor.label)
            deviations[:, column] = contributor.deviations(u)
        if not (self._scale == 1.0).all() or self._shifts.any():
            deviations = self._middle + self._scale * (deviations - self._middle) + self._shifts
        measured = zip(self._assembly.populations, self.population_labels, self.populations, strict=True)
        for population, label, (columns, values) in measured:
            deviations[:, columns] = values[population.rows(numbers(label))]
        self._add_causes_and_scale(deviations)
        self.add_shifts(deviations)
        for contributor, drawn in zip(self.contributors, deviations.T, strict=True):
            if not np.isfinite(drawn).all():
                distribution = contributor.tolerance or contributor.description
                fault = f"its distribution, {distribution}, yields non-finite deviations"
                raise ModelError(self._assembly.name, [f'{contributor.source} "{contributor.label}": {fault}'])
        return deviations

    def add_shifts(self, deviations: np.ndarray) -> None:
        """Put into deviations (n, contributor) the shifts of datums, which follow from the other ones."""
        computed: Shifts = {}
        for shift in self.shifts:
            deviations[:, shift.columns] = shift.shifts(deviations, computed)

    def _add_causes_and_scale(self, deviations: np.ndarray) -> None:
        """Add shared causes to sizes, scale components by the bonus of their sizes, and add shared causes to the rest."""
        measured = [column for columns, _ in self.populations for column in columns]
        sizes = {int(size) for zone in self._scaling for size in zone.sizes}
        factors, shifts = self._scale.copy(), self._shifts.copy()
        factors[measured], shifts[measured] = 1.0, 0.0
        widening = Widening(factors, self._middle, shifts)
        self._add_causes(deviations, lambda column: column in sizes)
        for zone in self._scaling:
            is_drawn = ~np.isin(zone.scaled, measured)  # measured parts have used their bonus
            deviations[:, zone.scaled[is_drawn]] *= zone.scale(deviations, widening)[:, is_drawn]
        self._add_causes(deviations, lambda column: column not in sizes)

    @property
    def population_labels(self) -> list[str]:
        """Labels of the numbers that choose the rows of measured parts."""
        populations = enumerate(self._assembly.populations, start=1)
        return [f"population {k}: {', '.join(population.columns)}" for k, population in populations]

    def dependent(self, *, correlated: bool = True) -> list[list[int]]:
        """Return sets of columns that depend on each other: drawn together, or `correlated`.

        Columns that are coupled by sums alone are excluded.
        """
        sets = [[self._column[label] for label in labels] for labels, _ in self.correlated if correlated]
        sets += [list(map(int, columns)) for columns, _ in self.populations]
        together = [[*shift.columns, *map(int, shift.sources)] for shift in self.shifts]
        together += [sorted({*map(int, zone.sizes), *map(int, zone.scaled)}) for zone in self._scaling]
        # What follows from others by more than a sum also follows from the causes that drive them.
        followed = {column for columns in together for column in columns}
        of_causes = ([self._column[label] for label in (cause.name, *cause.drives)] for cause in self._assembly.variables)
        return sets + together + [columns for columns in of_causes if followed & set(columns[1:])]

    def without_shared_causes(self, deviations: np.ndarray) -> np.ndarray:
        """Return deviations (..., contributor) without what shared causes add to them: independent of these."""
        matrix = self.drive_matrix
        is_driven = matrix.any(axis=0)
        independent = deviations.copy()
        independent[..., is_driven] -= deviations @ matrix[:, is_driven]
        largest = np.abs(deviations).max(axis=tuple(range(deviations.ndim - 1)), initial=0.0)
        independent[is_driven & (np.abs(independent) <= ROUNDING * largest)] = 0.0
        return independent

    def with_shared_causes(self, independent: np.ndarray) -> np.ndarray:
        """Return deviations (..., contributor) with what shared causes among independent ones add to others."""
        matrix = self.drive_matrix
        is_driven = matrix.any(axis=0)
        deviations = independent.copy()
        deviations[..., is_driven] += independent @ matrix[:, is_driven]
        return deviations

    @property
    def drive_matrix(self) -> np.ndarray:
        """The amounts (column, column) that a unit deviation of each column adds to others through shared causes."""
        matrix = np.zeros((len(self._column), len(self._column)))
        for cause in self._assembly.variables:
            for label, factor in cause.drives.items():
                matrix[self._column[cause.name], self._column[label]] += factor
        return matrix

    def rows(self, numbers: np.ndarray, *, seed: int) -> np.ndarray:
        """Return deviations (row, contributor) of realizations by their numbers (row,)."""
        deviations = np.empty((len(numbers), len(self.contributors)))
        for stream in np.unique(numbers // STREAM):
            rows = np.flatnonzero(numbers // STREAM == stream)
            start = int(numbers[rows].min())
            deviations[rows] = self(seed=seed, start=start, stop=int(numbers[rows].max()) + 1)[numbers[rows] - start]
        return deviations

    def _add_causes(self, deviations: np.ndarray, is_driven: Callable[[int], bool]) -> None:
        """Add what shared causes contribute to some columns."""
        for cause in self._assembly.variables:
            for label, factor in cause.drives.items():
                if is_driven(self._column[label]):
                    deviations[:, self._column[label]] += factor * deviations[:, self._column[cause.name]]

    def _correlated_numbers(self, numbers: Numbers) -> dict[int, np.ndarray]:
        """Return uniform numbers (realization,) of correlated contributors by their column: a Gaussian copula."""
        uniforms = {}
        for labels, factor in self.correlated:
            normal = np.stack([ndtri(numbers(label)) for label in labels], axis=1)
            mixed = sum(normal[:, k, None] * factor[:, k] for k in range(len(factor)))  # in one order for blocks of any size
            for label, u in zip(labels, ndtr(mixed).T, strict=True):
                uniforms[self._column[label]] = u.clip(MIN_UNIFORM, 1 - MIN_UNIFORM)
        return uniforms


def _shortened(labels: list[str]) -> str:
    """Return the first labels in words, with the number of further ones."""
    more = len(labels) - MAX_NAMED
    return ", ".join(labels[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def draw(nominal: Nominal, *, seed: int, start: int, stop: int) -> np.ndarray:
    """Return deviations (realization, contributor) of realizations `start` to `stop`; see Draws."""
    return Draws(nominal)(seed=seed, start=start, stop=stop)


class GivenDraws:
    """Deviations in the place of Draws: the rows of an array (realization, contributor), for any seed."""

    def __init__(self, deviations: np.ndarray) -> None:
        self._deviations = deviations

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Return deviations (realization, contributor); see Draws."""
        return self._deviations[start:stop]
