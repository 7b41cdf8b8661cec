"""Displacement fields (14): u = (R - I) v + t at surface points v, over all realizations.

u is linear in the 12 pose entries, so mean and spread of its components follow exactly from the mean and covariance of the
poses. In the corrected state, elastic parts are bent by their loads, in which u is linear, too. Its magnitude is not linear:
its moments are accumulated point by point, over the first realizations only. That is enough for a colour map, and the interval
states the uncertainty. The worker that simulates a block also computes its sums; the sums of all blocks are merged in order.
"""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.discretization import Nominal
from tolcontact.mechanics.flexibility import PartFlexibility
from tolcontact.realizations import is_assembled
from tolcontact.statistics import intervals, kernel
from tolcontact.vocabulary import CORRECTED, RAW, ArchiveVariable

SHIFT_REALIZATIONS = 64  # their mean magnitude is close enough to the mean of all
# "Some" realizations for magnitudes: more for parts with few points; the sums of all points take a tenth of a second.
MAX_REALIZATIONS, MIN_REALIZATIONS, MAX_POINTS = 16_384, 1024, 1 << 25


def _magnitudes(fields: str, points: int) -> int:
    """Return the number of realizations that the magnitudes at `points` points cover."""
    default = max(MIN_REALIZATIONS, min(MAX_REALIZATIONS, MAX_POINTS // points))
    return int(fields) if fields.isdigit() else {"some": default, "all": sys.maxsize, "none": 0}[fields]


class FieldSums:
    """Sums over realizations for the field of one part in one state, stored in one array `numbers`."""

    def __init__(self, points: int, numbers: np.ndarray | None = None, width: int = 4) -> None:
        """Create empty sums for `points` surface points, or views of the sums `numbers` (number,).

        u has a `width` of coefficients along each axis: four of the pose, and the loads that bend the part.
        """
        sizes = [1, 3 * width, 3 * width**2, 1, points, points, points, points]
        self.numbers = np.zeros(sum(sizes)) if numbers is None else numbers
        count, mean, scatter, magnitude_count, *moments = np.split(self.numbers, np.cumsum(sizes)[:-1])
        self.count, self.mean, self.scatter = count, mean.reshape(3, width), scatter.reshape(3, width, width)
        # Mean of the magnitude, and the sums of its second to fourth powers about it.
        self.magnitude_count, self.magnitude, self.moments = magnitude_count, moments[0], tuple(moments[1:])

    def __reduce__(self) -> tuple[type, tuple[int, np.ndarray, int]]:
        return FieldSums, (len(self.magnitude), self.numbers, self.mean.shape[1])  # the others are views of these

    def merge(self, addend: "FieldSums") -> None:
        """Add the sums of following realizations (Chan et al.; Pébay, 2008)."""
        n, m = self.count, addend.count
        if not m:
            return
        share = m / (n + m)
        step = addend.mean - self.mean
        self.scatter += addend.scatter + n * share * np.einsum("ia,ib->iab", step, step)
        self.mean += step * share
        self.count += m
        if addend.magnitude_count > 0:
            self._merge_magnitudes(addend)

    def _merge_magnitudes(self, addend: "FieldSums") -> None:
        n, m = self.magnitude_count, addend.magnitude_count
        total, step = n + m, addend.magnitude - self.magnitude
        (a2, a3, a4), (b2, b3, b4) = self.moments, addend.moments
        a4 += b4 + step**4 * (n * m * (n**2 - n * m + m**2) / total**3)
        a4 += 6 * step**2 * (n**2 * b2 + m**2 * a2) / total**2 + 4 * step * (n * b3 - m * a3) / total
        a3 += b3 + step**3 * (n * m * (n - m) / total**2) + 3 * step * (n * b2 - m * a2) / total
        a2 += b2 + step**2 * (n * m / total)
        self.magnitude += step * m / total
        self.magnitude_count += m


BlockSums = list[list[FieldSums]]  # of every part, in each state


class DisplacementFields:
    """The fields of all parts of a model, in both states."""

    def __init__(self, nominal: Nominal, fields: str, elastic: Mapping[int, PartFlexibility] | None = None) -> None:
        """Start with no realizations; `fields` limits the magnitudes to a number of realizations, "some", "all" or "none".

        elastic   the elastic parts, by their index in the model
        """
        self._indices, elastic = nominal.last_indices, elastic or {}
        self._parts = [_Surface(nominal.parts[index].vertices, elastic.get(index)) for index in self._indices.tolist()]
        self._magnitudes = [_magnitudes(fields, len(part)) for part in self._parts]
        # A part that contact cannot move has one field.
        self._states = [[RAW, CORRECTED] if nominal.may_differ(index) else [RAW] for index in nominal.last_indices]
        self.resume_from([])

    @property
    def sizes(self) -> list[int]:
        """The length of `FieldSums.numbers` for each part."""
        return [sums[0].numbers.size for sums in self._sums]

    @property
    def numbers(self) -> list[np.ndarray]:
        """The sums of each part, (state, number)."""
        return [np.array([sums[0].numbers, sums[-1].numbers]) for sums in self._sums]

    def resume_from(self, numbers: Sequence[np.ndarray]) -> None:
        """Continue from earlier `numbers`, or from nothing if there are none."""
        self._sums = [
            [FieldSums(len(part), sums[state].copy() if len(sums) else None, part.width) for state in states]
            for part, states, sums in zip(self._parts, self._states, numbers or [np.zeros(0)] * len(self._parts), strict=True)
        ]

    def sums(self, poses: np.ndarray, start: int, status: np.ndarray, loads: np.ndarray | None = None) -> BlockSums:
        """Return the sums of one block, from realization `start` on, at poses (n, state, part, 12). Threads may share it.

        Corrected poses of realizations that cannot be assembled, by their `status` (n,), are left out. `loads` (n, load) [N]
        bend elastic parts in the corrected state.
        """
        loads = np.zeros((len(status), 0)) if loads is None else loads
        exists = np.array([np.ones(len(status), dtype=bool), is_assembled(status)])
        return [
            [
                part.sums(
                    poses[exists[state], state, index],
                    int(exists[state, : max(0, count - start)].sum()),
                    loads[exists[state]] if state == CORRECTED else None,
                )
                for state in states
            ]
            for index, part, states, count in zip(self._indices, self._parts, self._states, self._magnitudes, strict=True)
        ]

    def merge(self, sums: BlockSums) -> None:
        """Add the sums of the block that follows."""
        for part_totals, part_sums in zip(self._sums, sums, strict=True):
            for total, state_sums in zip(part_totals, part_sums, strict=True):
                total.merge(state_sums)

    def fields(self) -> list[dict[ArchiveVariable, Any]]:
        """Return the values of `FIELDS` for each part, from all merged sums."""
        return [part.field([sums[0], sums[-1]]) for part, sums in zip(self._parts, self._sums, strict=True)]


class _Surface:
    """The surface points of a part, relative to their centroid, and how its loads bend them."""

    def __init__(self, vertices: np.ndarray, elastic: PartFlexibility | None = None) -> None:
        self._centre = vertices.mean(axis=0)
        v = np.hstack([vertices - self._centre, np.ones((len(vertices), 1))])
        self._points = np.ascontiguousarray(v[:, :3].T)
        self._loads = None if elastic is None else elastic.loads
        bends = [] if elastic is None else [elastic.surface.transpose(1, 0, 2)]
        self._basis = np.concatenate([np.broadcast_to(v, (3, *v.shape)), *bends], axis=2)  # (axis, point, coefficient)

    def __len__(self) -> int:
        return self._points.shape[1]

    @property
    def width(self) -> int:
        """The number of coefficients of u along an axis."""
        return int(self._basis.shape[2])

    def sums(self, poses: np.ndarray, count: int, loads: np.ndarray | None) -> FieldSums:
        """Return the sums over poses (n, 12); magnitudes only over the first `count`, and no point sums if that is 0.

        loads   (n, load) of the model, if they bend the part
        """
        sums, A = FieldSums(len(self) if count else 0, width=self.width), np.empty((len(poses), 3, 4))
        if not len(poses):
            return sums
        kernel.affine_parts(poses, self._centre, A)
        if self._loads is None:
            kernel.add_scatter(A, sums.mean, sums.scatter)
        else:
            A = self._coefficients(A, loads)
            kernel.add_wide_scatter(A, sums.mean, sums.scatter)
        sums.count[:] = len(A)
        if count:
            self._add_magnitudes(A[:count], sums)
        return sums

    def _coefficients(self, A: np.ndarray, loads: np.ndarray | None) -> np.ndarray:
        """Return the coefficients (n, 3, coefficient) of u: of the pose, the loads, and 1 for constant forces."""
        assert self._loads is not None
        wide = np.zeros((len(A), 3, self.width))
        wide[:, :, :4] = A
        if loads is not None:
            wide[:, :, 4:-1], wide[:, :, -1] = loads[:, None, self._loads], 1
        return wide

    def _add_powers(self, A: np.ndarray, shift: np.ndarray, powers: np.ndarray) -> None:
        if self._loads is None:
            kernel.add_magnitudes(A, self._points, shift, powers)
        else:
            kernel.add_bent_magnitudes(A, np.ascontiguousarray(self._basis.transpose(0, 2, 1)), shift, powers)

    def _add_magnitudes(self, A: np.ndarray, sums: FieldSums) -> None:
        # Powers are accumulated about a shift close to the mean, to avoid cancellation.
        shift, leading_powers, powers = np.zeros(len(self)), np.zeros((4, len(self))), np.zeros((4, len(self)))
        self._add_powers(A[:SHIFT_REALIZATIONS], shift, leading_powers)
        shift = leading_powers[0] / len(A[:SHIFT_REALIZATIONS])
        self._add_powers(A, shift, powers)
        n, (sum1, sum2, sum3, sum4) = len(A), powers
        mean = sum1 / n
        sums.magnitude_count[:], sums.magnitude[:] = n, shift + mean
        for moment, value in zip(
            sums.moments,
            (
                sum2 - n * mean**2,
                sum3 - 3 * mean * sum2 + 2 * n * mean**3,
                sum4 - 4 * mean * sum3 + 6 * mean**2 * sum2 - 3 * n * mean**4,
            ),
            strict=True,
        ):
            moment[:] = value

    def field(self, states: Sequence[FieldSums]) -> dict[ArchiveVariable, Any]:
        """Return the field from the sums of each state."""
        fields = [self._state_field(sums) for sums in states]
        variables = (terms.FIELD_MEAN, terms.FIELD_SIX_SIGMA, terms.FIELD_INTERVAL)
        return {
            **{variable: np.array([field[k] for field in fields]) for k, variable in enumerate(variables)},
            terms.FIELD_REALIZATIONS: int(states[-1].count[0]),
            terms.MAGNITUDE_REALIZATIONS: int(states[-1].magnitude_count[0]),
        }

    def _state_field(self, sums: FieldSums) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the mean, six standard deviations, and the interval of six standard deviations of the magnitude."""
        axes = zip(self._basis, sums.scatter, strict=True)
        scatter = np.column_stack([((basis @ axis_scatter) * basis).sum(axis=1) for basis, axis_scatter in axes])
        sigma = np.sqrt(np.maximum(scatter, 0) / max(sums.count[0] - 1, 1))
        n = int(sums.magnitude_count[0])
        magnitude, estimate = np.full(len(self), np.nan), np.full((3, len(self)), np.nan)
        if n > 1:
            moment2, moment4 = (np.maximum(moment, 0) / n for moment in (sums.moments[0], sums.moments[2]))
            magnitude, estimate = sums.magnitude, np.array(intervals.variance_from_moments(n, moment2, moment4))
        magnitude_six_sigma, lower, upper = 6 * np.sqrt(estimate)
        components = self._basis[0] @ sums.mean.T if self._loads is None else np.einsum("ivp,ip->vi", self._basis, sums.mean)
        mean = np.column_stack([components, magnitude])
        if not sums.count:
            mean, sigma = np.full_like(mean, np.nan), np.full_like(sigma, np.nan)
        return mean, np.column_stack([6 * sigma, magnitude_six_sigma]), np.column_stack([lower, upper])
