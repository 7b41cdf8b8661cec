"""Displacement fields (14): u = (R - I) v + t at surface points v, over all realizations.

u is linear in the 12 pose entries, so mean and spread of its components follow exactly from the mean and covariance of
those. Its magnitude is not: its moments are summed up point by point, over the first realizations only, which is enough for a
colour map; the interval says how sure it is. Blocks are summed up one by one, by whoever simulates them, and merged in order.
"""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.declaration import movers
from tolcontact.discretization import Nominal
from tolcontact.statistics import intervals, kernel
from tolcontact.vocabulary import CORRECTED, RAW, ArchiveVariable

NEAR = 64  # realizations whose mean magnitude is near enough to that of all
# "Some" realizations for magnitudes: more for parts with few points, and as many points in all as take a tenth of a second.
MOST, LEAST, POINTS = 16_384, 1024, 1 << 25


def _magnitudes(fields: str, points: int) -> int:
    """Over how many realizations, the first ones, the magnitudes at so many points are summed up."""
    some = max(LEAST, min(MOST, POINTS // points))
    return int(fields) if fields.isdigit() else {"some": some, "all": sys.maxsize, "none": 0}[fields]


class FieldSums:
    """Sums over some realizations for the field of one part in one state, all in one array of numbers."""

    def __init__(self, points: int, numbers: np.ndarray | None = None) -> None:
        """Of `points` surface points; nothing is summed up yet, but for what `numbers` (number,) hold."""
        sizes = [1, 12, 48, 1, points, points, points, points]
        self.numbers = np.zeros(sum(sizes)) if numbers is None else numbers
        count, mean, scatter, of_magnitude, *moments = np.split(self.numbers, np.cumsum(sizes)[:-1])
        self.count, self.mean, self.scatter = count, mean.reshape(3, 4), scatter.reshape(3, 4, 4)
        # Mean of the magnitude, and the sums of its second to fourth powers about it.
        self.of_magnitude, self.magnitude, self.moments = of_magnitude, moments[0], tuple(moments[1:])

    def __reduce__(self) -> tuple[type, tuple[int, np.ndarray]]:
        return FieldSums, (len(self.magnitude), self.numbers)  # the others are views of these

    def merge(self, other: "FieldSums") -> None:
        """Take in the sums of other realizations, at least one, those that come next. Chan et al., Pébay (2008)."""
        n, m = self.count, other.count
        share = m / (n + m)
        step = other.mean - self.mean
        self.scatter += other.scatter + n * share * np.einsum("ia,ib->iab", step, step)
        self.mean += step * share
        self.count += m
        if other.of_magnitude > 0:
            self._merge_magnitudes(other)

    def _merge_magnitudes(self, other: "FieldSums") -> None:
        n, m = self.of_magnitude, other.of_magnitude
        total, step = n + m, other.magnitude - self.magnitude
        (a2, a3, a4), (b2, b3, b4) = self.moments, other.moments
        a4 += b4 + step**4 * (n * m * (n**2 - n * m + m**2) / total**3)
        a4 += 6 * step**2 * (n**2 * b2 + m**2 * a2) / total**2 + 4 * step * (n * b3 - m * a3) / total
        a3 += b3 + step**3 * (n * m * (n - m) / total**2) + 3 * step * (n * b2 - m * a2) / total
        a2 += b2 + step**2 * (n * m / total)
        self.magnitude += step * m / total
        self.of_magnitude += m


BlockSums = list[list[FieldSums]]  # of every part, in each state


class DisplacementFields:
    """The fields of all parts of a model, in both states."""

    def __init__(self, nominal: Nominal, fields: str) -> None:
        """Magnitudes are summed up over as many realizations as `fields` says: a number, "some", "all" or "none"."""
        self._parts = [_Surface(part.vertices) for part in nominal.parts]
        self._magnitudes = [_magnitudes(fields, len(part)) for part in self._parts]
        # A part that contact cannot move has one field.
        self._states = [[RAW, CORRECTED] if movers(nominal.assembly, part.part) else [RAW] for part in nominal.parts]
        self.start_over()

    def start_over(self) -> None:
        """Forget all realizations."""
        self._sums = [[FieldSums(len(part)) for _ in states] for part, states in zip(self._parts, self._states, strict=True)]

    @property
    def sizes(self) -> list[int]:
        """How many numbers the sums of each part are, in one state."""
        return [sums[0].numbers.size for sums in self._sums]

    @property
    def numbers(self) -> list[np.ndarray]:
        """All that was summed up, for each part (state, number)."""
        return [np.array([sums[0].numbers, sums[-1].numbers]) for sums in self._sums]

    def go_on_from(self, numbers: Sequence[np.ndarray]) -> None:
        """Take up `numbers` of before; nothing, if there are none."""
        if not numbers:
            self.start_over()
            return
        self._sums = [
            [FieldSums(len(part), of_part[state].copy()) for state in states]
            for part, states, of_part in zip(self._parts, self._states, numbers, strict=True)
        ]

    def sums(self, poses: np.ndarray, start: int) -> BlockSums:
        """The sums of a block alone, of realizations `start` on, at poses (n, state, part, 12). Threads may share it."""
        return [
            [part.sums(poses[:, state, index], max(0, count - start)) for state in states]
            for index, (part, states, count) in enumerate(zip(self._parts, self._states, self._magnitudes, strict=True))
        ]

    def merge(self, sums: BlockSums) -> None:
        """Take in the sums of the block that comes next."""
        for own, others in zip(self._sums, sums, strict=True):
            for one, other in zip(own, others, strict=True):
                one.merge(other)

    def fields(self) -> list[dict[ArchiveVariable, Any]]:
        """The field of each part, of what was merged: the values of `FIELDS`."""
        return [part.field([sums[0], sums[-1]]) for part, sums in zip(self._parts, self._sums, strict=True)]


class _Surface:
    """The surface points of a part, about their centre."""

    def __init__(self, vertices: np.ndarray) -> None:
        self._centre = vertices.mean(axis=0)
        self._v = np.hstack([vertices - self._centre, np.ones((len(vertices), 1))])
        self._points = np.ascontiguousarray(self._v[:, :3].T)

    def __len__(self) -> int:
        return len(self._v)

    def sums(self, poses: np.ndarray, count: int) -> FieldSums:
        """Sums over poses (n, 12), in the magnitude over the first `count` of them; without it there are no sums of points."""
        sums, A = FieldSums(len(self) if count else 0), np.empty((len(poses), 3, 4))
        kernel.affine_parts(poses, self._centre, A)
        kernel.add_scatter(A, sums.mean, sums.scatter)
        sums.count[:] = len(A)
        if count and len(A):
            self._add_magnitudes(A[:count], sums)
        return sums

    def _add_magnitudes(self, A: np.ndarray, sums: FieldSums) -> None:
        # Powers are summed up from a shift near the mean, so that nothing cancels.
        shift, some, powers = np.zeros(len(self)), np.zeros((4, len(self))), np.zeros((4, len(self)))
        kernel.add_magnitudes(A[:NEAR], self._points, shift, some)
        shift = some[0] / len(A[:NEAR])
        kernel.add_magnitudes(A, self._points, shift, powers)
        n, (first, second, third, fourth) = len(A), powers
        mean = first / n
        sums.of_magnitude[:], sums.magnitude[:] = n, shift + mean
        for moment, value in zip(
            sums.moments,
            (
                second - n * mean**2,
                third - 3 * mean * second + 2 * n * mean**3,
                fourth - 4 * mean * third + 6 * mean**2 * second - 3 * n * mean**4,
            ),
            strict=True,
        ):
            moment[:] = value

    def field(self, states: Sequence[FieldSums]) -> dict[ArchiveVariable, Any]:
        """The field, from the sums of each state."""
        found = [self._of_state(sums) for sums in states]
        kinds = (terms.FIELD_MEAN, terms.FIELD_SIX_SIGMA, terms.FIELD_INTERVAL)
        return {
            **{variable: np.array([each[k] for each in found]) for k, variable in enumerate(kinds)},
            terms.FIELD_REALIZATIONS: int(states[0].count[0]),
            terms.MAGNITUDE_REALIZATIONS: int(states[0].of_magnitude[0]),
        }

    def _of_state(self, sums: FieldSums) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean, six standard deviations, and the interval of those of the magnitude."""
        scatter = np.column_stack([((self._v @ of_axis) * self._v).sum(axis=1) for of_axis in sums.scatter])
        sigma = np.sqrt(np.maximum(scatter, 0) / max(sums.count[0] - 1, 1))
        n = int(sums.of_magnitude[0])
        magnitude, estimate = np.full(len(self), np.nan), np.full((3, len(self)), np.nan)
        if n > 1:
            second, fourth = (np.maximum(moment, 0) / n for moment in (sums.moments[0], sums.moments[2]))
            magnitude, estimate = sums.magnitude, np.array(intervals.variance_from_moments(n, second, fourth))
        of_magnitude, lower, upper = 6 * np.sqrt(estimate)
        mean = np.column_stack([self._v @ sums.mean.T, magnitude])
        return mean, np.column_stack([6 * sigma, of_magnitude]), np.column_stack([lower, upper])
