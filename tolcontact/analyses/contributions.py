"""Contributions to the variance of a measure, with and without contact.

Screening: few realizations show which groups of contributors matter for any measure; the others are estimated as one group.
The total index of a set of groups is at least the total index of each group in it: T_i <= T_u for i in u. So the joint total
index of all minor groups bounds the first-order and total index of each of them, and costs as much as one group.

Designs for Sobol' indices (Saltelli et al., 2010) have 2 + groups realizations for each base realization: A, B, and A with the
columns of each group from B. Those for Shapley effects (Song, Nelson, Staum, 2016; Goda, 2021) have 1 + units realizations.
The last one is A. Realization m has the first m units of A, in a random order for each base realization; the other units are
redrawn conditional on these m. The first one is B, independent of A.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import ndtr, ndtri

from tolcontact import vocabulary as terms
from tolcontact.analyses.analysis import Analysis, Answer, Design, Progress, Results, independent_groups, owners
from tolcontact.analyses.linear_model import total_derivatives
from tolcontact.compilation import Program
from tolcontact.method import Solver
from tolcontact.simulation import Block, defined_measures
from tolcontact.statistics.intervals import UNDEFINED, Estimate, effective_count
from tolcontact.statistics.variance_shares import missed, shapley_effects, sobol_indices
from tolcontact.variation.draws import MIN_UNIFORM, Draws
from tolcontact.variation.plans import Numbers, uniform
from tolcontact.workflow.models import Choice, Model

MIN_GROUPS = 17  # fewer are not screened
SCREENING_SAMPLES, START = 128, 1 << 38  # base realizations of a screening, and the number of the first one
MINOR_SHARE = 0.01  # of the variance of any measure in any state: the largest joint share of minor groups
MIN_EFFECTIVE = 16  # effective base realizations behind the variance of a measure: with fewer, no group is minor
REDRAWN_START = 1 << 40  # number of the first realization of B; no run is that long
BUDGET = 60_000  # realizations in total that determine the default number of base realizations
MIN_SAMPLES, MAX_SAMPLES = 512, 4096  # base realizations by default


def contributions(
    model: Model | Program, *, samples: int | None = None, seed: int = 1, solver: Solver | None = None,
    method: Choice | None = None, by: terms.GroupedBy = "contributor", into: str | Path | None = None, client: Any = None,
    progress: Progress | None = None, minutes: float | None = None,
) -> xr.Dataset:  # fmt: skip
    """Return Sobol' indices of each measure (see tolcontact.statistics.variance_shares), and the classical linear percentages.

        first   (measure, state, group, interval)   share of variance by a group alone, with its 95 % interval
        total   (measure, state, group, interval)   share of variance by a group and its interactions with others
        minor   (group)                             1: its interval is from 0 to the joint upper bound of all minor groups
        minor_total (measure, state, interval)      joint share of variance of all minor groups; 0 if there are none
        shapley (measure, state, unit, interval)    Shapley effects, if contributors are correlated; units are the groups
                                                    that there would be without the correlations
        linear  (measure, group)                    by sensitivities of the raw measure at the nominal assembly: (s sigma)^2,
                                                    exact for contributors that are drawn alone
        missed  (measure, state, interval)          share of variance that a prediction by these sensitivities misses
        by_status (status_meaning)                  number of realizations

    `by` is "contributor", "feature" or "part". Contributors that are not independent of each other (correlated, drawn jointly,
    or one determined by another) always form one group. A shared cause is a contributor like others, including its effects on
    the contributors that it drives; these have groups of their own if they also vary on their own. Contributors that do not
    vary are left out.
    With more than 16 groups and 256 samples, a screening of 128 base realizations selects minor groups, which jointly have at
    most 1 % of the variance of any measure; they are estimated as one group (see tolcontact.analyses.contributions).
    `samples` is the number of base realizations: samples (2 + groups) are simulated, and samples (1 + units) more for Shapley
    effects, in addition to the screening. The default follows from 60 000 realizations in total, and is between 512 and 4096.
    `progress` is called with the number of finished realizations and the total. `model`, `seed`, `solver`, `method`, `into`,
    `client` and `minutes` are as in all analyses: `tc.analyses.contributions("model.nc", by="feature")`.
    """
    analysis = Analysis(
        terms.CONTRIBUTIONS, model, samples=MIN_SAMPLES if samples is None else samples, seed=seed, solver=solver,
        method=method, into=into, client=client, progress=progress, minutes=minutes,
    )  # fmt: skip
    program = analysis.program
    deviations = program.draws.without_shared_causes(analysis.sampled_deviations())
    names, varies = owners(program, by), np.ptp(deviations, axis=0) > 0
    groups, units = (independent_groups(program.draws, names, varies, correlated=correlated) for correlated in (True, False))
    analysis.check_varies(groups)
    return analysis.finest(_answers(analysis, by, deviations, groups, units if len(units) > len(groups) else {}, samples))


def _answers(
    analysis: Analysis, by: str, deviations: np.ndarray, groups: Mapping[str, np.ndarray], units: Mapping[str, np.ndarray],
    samples: int | None,
) -> Iterator[Callable[[], Answer]]:  # fmt: skip
    """Yield the linear shares without contact, those of a screening, and those of more and more realizations.

    groups, units  columns of deviations (n, contributor); there are no units if nothing is correlated
    """
    program, columns = analysis.program, list(groups.values())
    released = ReleasedDraws(program.draws, units) if units else None
    slopes = total_derivatives(program)
    linear = [_linear_shares(program, deviations, row, columns) for row in slopes]
    unknown = np.full((len(slopes), len(terms.STATES), len(groups), len(terms.ESTIMATE)), np.nan)
    effects = np.full((*unknown.shape[:2], len(units), len(terms.ESTIMATE)), np.nan)
    is_minor, totals = unscreened = np.zeros(len(groups), dtype=bool), unknown[..., 0]

    def answer(
        coarse: str, count: int = 0, results: Results | None = None, screening: tuple[np.ndarray, np.ndarray] = unscreened,
        shapley: np.ndarray = effects,
    ) -> Answer:  # fmt: skip
        """Return the answer from the results of `count` base realizations; without any, it has linear shares only."""
        values: dict[str, Any] = {}
        values |= dict.fromkeys(("first", "total"), unknown)
        values |= dict.fromkeys(("minor_total", "missed"), unknown[:, :, 0])
        if results is not None:
            measured, firsts, _ = results()
            values = _indices(measured, program.accuracies, *screening)
            values["missed"] = _missed(program, measured[:, 0], firsts[:, 0], slopes)
        values |= {"minor": screening[0].astype(np.int8), "shapley": shapley, "linear": linear, "by_status": analysis.statuses}
        labels = {terms.GROUP: list(groups), terms.UNIT: list(units)}
        return Answer(values, labels, {"base_realizations": count, "realizations": analysis.simulated, "by": by}, coarse)

    def size(design: MixedDraws) -> int:
        return design.size + (released.size if released else 0)

    everything = MixedDraws(program.draws, columns)
    analysis.expect(analysis.samples * size(everything))
    yield partial(answer, "linear shares, without contact")
    if analysis.samples > 2 * SCREENING_SAMPLES and len(groups) >= MIN_GROUPS:
        observe = partial(_first_deviations, everything.size)
        for count, results in analysis.stages(everything, SCREENING_SAMPLES, start=START, observe=observe):
            yield partial(answer, f"a screening with {count} base realizations", count, results)
        is_minor, totals = _screened(results()[0], program.accuracies)
    is_screened, screening = analysis.simulated > 0, (is_minor, totals)
    minor = [columns[k] for k in np.flatnonzero(is_minor)]
    major = [columns[k] for k in np.flatnonzero(~is_minor)]
    mixed = MixedDraws(program.draws, major + ([np.concatenate(minor)] if minor else []))
    if samples is None:
        samples = int(np.clip((BUDGET - analysis.simulated) // size(mixed), MIN_SAMPLES, MAX_SAMPLES))
    analysis.total = analysis.simulated + samples * size(mixed)
    for count, results in analysis.stages(mixed, samples, observe=partial(_first_deviations, mixed.size)):
        if count > SCREENING_SAMPLES or not is_screened or count == samples:
            yield partial(answer, f"{count} of {samples} base realizations", count, results, screening)
    if released:
        measured, _ = analysis.simulate_design(released, samples)
        positions = released.positions(analysis.seed, 0, samples)
        shapley = _by_measure(measured, program.accuracies, lambda f, accuracy: shapley_effects(f, positions, accuracy))
        effects = np.array(shapley)
    yield partial(answer, "", samples, results, screening, effects)


def _by_measure(measured: np.ndarray, accuracies: np.ndarray, function: Callable[[np.ndarray, float], Any]) -> list[list[Any]]:
    """Return a function of values (base, realization) and their accuracy, by measure and state."""
    rows = zip(measured.transpose(3, 2, 0, 1), accuracies, strict=True)
    return [[function(f, accuracy) for f in states] for states, accuracy in rows]


def _screened(measured: np.ndarray, accuracies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return whether groups are minor (group,), and their rough total indices (measure, state, group), from a screening.

    Total indices are NaN where nothing varies.
    """
    totals = np.array(_by_measure(measured, accuracies, lambda f, accuracy: [x.value for x in sobol_indices(f, accuracy)[1]]))
    squares = _by_measure(measured, accuracies, lambda f, _: effective_count(((f[:, :2] - f[:, :2].mean()) ** 2).mean(axis=1)))
    shares = np.nan_to_num(totals).reshape(-1, totals.shape[2])
    order = np.argsort(shares.max(axis=0, initial=0.0), kind="stable")
    is_minor = np.zeros(len(order), dtype=bool)
    is_minor[order] = (shares[:, order].cumsum(axis=1) <= MINOR_SHARE).all(axis=0)
    is_known = not any(0 < count < MIN_EFFECTIVE for states in squares for count in states)
    return is_minor & (is_known and is_minor.sum() > 1), totals


def _indices(measured: np.ndarray, accuracies: np.ndarray, is_minor: np.ndarray, totals: np.ndarray) -> dict[str, Any]:
    """Return the variables of Sobol' indices, from measures (base, realization, state, measure) of a design.

    The minor groups are the last one of the design. The interval of each extends from 0 to their joint upper bound.
    """
    first, total = np.array(_by_measure(measured, accuracies, sobol_indices)).transpose(2, 0, 1, 3, 4)
    together = np.zeros((*total.shape[:2], len(terms.ESTIMATE)))
    if is_minor.any():
        together = total[:, :, -1]
        indices = []
        for estimates in (first, total):
            of_groups = np.empty((*totals.shape, len(terms.ESTIMATE)))
            of_groups[:, :, ~is_minor] = estimates[:, :, :-1]
            for measure, state, group in np.argwhere(np.broadcast_to(is_minor, totals.shape)):
                of_groups[measure, state, group] = _bounded(totals[measure, state, group], Estimate(*together[measure, state]))
            indices.append(of_groups)
        first, total = indices
    return {"first": first, "total": total, "minor_total": together}


def _bounded(total: float, together: Estimate) -> Estimate:
    """Return the index of a minor group from its rough total and the joint total of all minor groups."""
    if np.isnan(together.value):
        return UNDEFINED
    upper = together.value if np.isnan(together.upper) else max(together.upper, 0.0)
    return Estimate(min(np.nan_to_num(total), upper), 0.0 * together.upper, together.upper)


def _missed(program: Program, measured: np.ndarray, deviations: np.ndarray, slopes: np.ndarray) -> list[Any]:
    """Return the shares (measure, state, interval) of variance that linear predictions miss."""
    deviations = program.draws.without_shared_causes(deviations)
    return [
        [missed(f, deviations @ row, accuracy) for f in states]
        for states, row, accuracy in zip(measured.transpose(2, 1, 0), slopes, program.accuracies, strict=True)
    ]


def _linear_shares(program: Program, deviations: np.ndarray, slopes: np.ndarray, groups: Iterable[np.ndarray]) -> np.ndarray:
    """Return the share (group,) of each group in the variance of a linear measure with slopes (contributor,).

    The variance of a group is exact for a single contributor that is drawn alone; otherwise it is estimated from own deviations
    (n, contributor).
    """
    draws = program.draws
    together = {column for columns in draws.dependent() for column in columns}
    alone = {k for k, label in enumerate(draws.labels) if label in draws.varying and k not in together}

    def variance(columns: np.ndarray) -> float:
        if len(columns) == 1 and int(columns[0]) in alone:
            return float(slopes[columns[0]] ** 2 * draws.contributors[int(columns[0])].variance)
        return float((deviations[:, columns] @ slopes[columns]).var())

    variances = np.array([variance(columns) for columns in groups])
    return variances / variances.sum() if variances.sum() > 0 else np.full(len(variances), np.nan)


def _first_deviations(size: int, block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the measures, the deviations of the first of every `size` realizations, and the statuses of a block."""
    deviations = block.deviations[-block.start % size :: size]
    return defined_measures(block), deviations.copy(), block.status.copy()


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
