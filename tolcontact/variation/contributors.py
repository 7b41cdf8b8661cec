"""Contributors: everything that varies, and its distribution. Each is a column of the deviations."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, SupportsIndex

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration import GeometricTolerance, Tolerance
from tolcontact.declaration.feature_tolerance import EXTREMES, INSIDE
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError, designation
from tolcontact.features import Layer, NominalPattern
from tolcontact.variation import zones
from tolcontact.variation.component_zones import (
    ComponentZone,
    MemberGroup,
    bonus,
    component_zone,
    includes_form,
    member_groups,
    member_zones,
    uneven_shifts,
)
from tolcontact.variation.form_spreads import FormSpread
from tolcontact.variation.zones import MemberZone

INNER_SHARE_TOLERANCE = 1e-3  # share of features that narrower tolerances may leave outside of a wider one, beyond 0.27 %
LOCATOR, FEATURE, FORM, DATUM, VARIABLE = "locator", "feature", "form", "datum", "variable"  # sources
MAX_SCORE, SCORES = 8.0, 4001  # normal scores that a variance is summed over
TAIL = float(ndtr(-3))
# Quantiles of the named distributions for a zone of width 1.
QUANTILES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "normal": lambda u: ndtri(u) / 6,
    "uniform": lambda u: u - 0.5,
    "triangular": lambda u: np.where(u < 0.5, np.sqrt(u / 2) - 0.5, 0.5 - np.sqrt((1 - u) / 2)),
    "truncated normal": lambda u: ndtri(TAIL + u * (1 - 2 * TAIL)) / 6,
}


class Contributor(NamedTuple):
    """A column of the deviations.

    source     "locator", "feature", "form", "variable", or "datum": a shift that follows from other deviations
    tolerance  of a locator, a size or a variable
    layer      of a freedom or a form of a feature: the tolerance that controls it
    spread     [mm] standard deviation of a freedom of a feature, or of a coefficient of its form
    mean       [mm] of a freedom of a feature
    middle     [mm] of a freedom of a feature: where its zone has its middle, if that is disposed unevenly
    rule       of a datum: what its shift follows from
    """

    label: str
    source: str
    units: str
    tolerance: Tolerance | None = None
    layer: Layer | None = None
    spread: float = 0.0
    mean: float = 0.0
    middle: float = 0.0
    rule: str = ""

    @property
    def range(self) -> float:
        """The full width of its zone; NaN if a distribution alone states how it varies."""
        if self.layer is not None:
            return float(self.layer.tolerance.width)
        return np.nan if self.tolerance is None or self.tolerance.range is None else float(self.tolerance.range)

    @property
    def mean_shift(self) -> float:
        """The mean of its distribution; NaN if the distribution has none."""
        if self.tolerance is None:
            return self.mean
        distribution = self.tolerance.distribution
        return self.tolerance.mean_shift + (0.0 if isinstance(distribution, str) else float(distribution.mean()))

    @property
    def description(self) -> str:
        """The name of its distribution; of a freedom of a feature the tolerance, and the rule from its zone to the spread."""
        if self.layer is not None:
            return f"{self.layer.tolerance.archived_text}; {self.layer.tolerance.rule}"
        if self.source == DATUM:
            return self.rule
        if self.tolerance is None:
            return ""
        name = self.tolerance.distribution
        return name if isinstance(name, str) else str(name.dist.name)

    @property
    def variance(self) -> float:
        """The variance of its distribution by itself, by the trapezoidal rule in normal scores."""
        z = np.linspace(-MAX_SCORE, MAX_SCORE, SCORES)
        weights = np.exp(-(z**2) / 2)
        weights /= weights.sum()
        x = self.deviations(ndtr(z))
        return float(weights @ (x - weights @ x) ** 2)

    def deviations(self, u: np.ndarray) -> np.ndarray:
        """Return its deviations for numbers between 0 and 1."""
        return quantile(self.tolerance, u) if self.tolerance is not None else self.mean + self.spread * ndtri(u)


def quantile(tolerance: Tolerance, u: np.ndarray) -> np.ndarray:
    """Return the deviation [mm] below which a share `u` (0 < u < 1) of parts lies."""
    if not isinstance(tolerance.distribution, str):
        deviations = np.asarray(tolerance.distribution.ppf(u), dtype=float)
    elif (width := float(tolerance.range or 0.0)) == 0:
        deviations = np.zeros_like(u)
    else:
        deviations = width / (tolerance.cp or 1.0) * QUANTILES[tolerance.distribution](u)
    return deviations + tolerance.mean_shift if tolerance.mean_shift else deviations


@dataclass(frozen=True, eq=False)
class Bonus:
    """Components that fill the zone enlarged by the size of their feature: those of the nominal zone times its growth.

    columns, sizes  of the deviations: the components, and the sizes of the features that they move
    factor          (n,) for size deviations (n, size)
    """

    columns: np.ndarray
    sizes: np.ndarray
    factor: Callable[[np.ndarray], np.ndarray]


class Contributors:
    """All contributors of a model, in the order of the columns of deviations.

    Raises ModelError if the rule of a tolerance cannot be applied to its feature.
    """

    def __init__(self, nominal: Nominal) -> None:
        self.bonuses: list[Bonus] = []
        self.zones: list[ComponentZone] = []
        self.mean_zones: dict[str, float] = {}  # mm, of the forms of features
        locators = zip(nominal.locators.labels, nominal.locators.tolerances, strict=True)
        self._contributors = [Contributor(label, LOCATOR, "mm", tolerance) for label, tolerance in locators]
        self._assembly = nominal.assembly
        for pattern in nominal.patterns:
            self._contributors += self._pattern_contributors(pattern)
        variables = nominal.assembly.variables
        self._contributors += [Contributor(cause.name, VARIABLE, cause.units, cause.tolerance) for cause in variables]

    def __len__(self) -> int:
        return len(self._contributors)

    def __getitem__(self, column: SupportsIndex) -> Contributor:
        return self._contributors[column]

    def __iter__(self) -> Iterator[Contributor]:
        return iter(self._contributors)

    def _pattern_contributors(self, pattern: NominalPattern) -> Iterator[Contributor]:
        """Yield the freedoms of a pattern's layers, from the innermost on, then its leans and the sizes of its members."""
        labels, column = iter(pattern.labels), pattern.first_column
        basis, spreads, form_spreads = np.zeros((pattern.geometry.count, 0)), np.zeros(0), self._form_spreads(pattern)
        for layer in pattern.layers:
            count = layer.added.shape[1]
            if not count:
                continue
            tolerance = layer.tolerance
            basis = np.hstack([basis, layer.added])
            members = member_zones(pattern, layer, basis, form_spreads)
            width = float(tolerance.width) or self._unit_width(pattern, tolerance, is_innermost=not len(spreads))
            spread_rule = zones.extreme_spread if tolerance.rule == EXTREMES else zones.equal_spread
            spread = spread_rule(members, spreads, count, width)
            self._check_inner_share(pattern, layer, [member.take(len(spreads)) for member in members], spreads, width)
            spreads = np.concatenate([spreads, np.full(count, spread / tolerance.cp)])
            middles = uneven_shifts(pattern, layer, basis)
            middle = middles[-count:]
            mean = middle.copy()
            for group in member_groups(pattern, layer, members):
                self._check_rule(pattern, layer, group)
                self.zones.append(component_zone(pattern, layer, group, middles))
                self._add_bonus(layer, group, column, width)
                if tolerance.cpk is not None:
                    mean[group.added[:1]] += 3 * spread * (1 - tolerance.cpk / tolerance.cp)
            for k in range(count):
                yield Contributor(
                    next(labels), FEATURE, "mm", None, layer, spread / tolerance.cp, float(mean[k]), float(middle[k])
                )
            column += count
        for lean in pattern.leans.values():
            for _ in lean.coordinates:
                yield Contributor(next(labels), DATUM, "mm", rule=lean.rule)
        if pattern.declared.size is not None:
            for _ in pattern.members:
                yield Contributor(next(labels), FEATURE, "mm", pattern.declared.size.tolerance)
        form = next((layer for layer in pattern.layers if layer.tolerance is pattern.form), None)
        for member, spreads_of_form in zip(pattern.members, form_spreads, strict=False):  # none without form
            means = np.zeros(len(spreads_of_form)) if member.form is None or member.form.means is None else member.form.means
            for spread, mean in zip(spreads_of_form, means, strict=True):
                yield Contributor(next(labels), FORM, "mm", None, form, float(spread), float(mean))

    def _form_spreads(self, pattern: NominalPattern) -> list[np.ndarray]:
        """Return the standard deviations (mode,) [mm] of the coefficients of each member's form; nothing without form."""
        spreads = list[np.ndarray]()
        for member in pattern.members:
            if member.form is not None and pattern.form is not None:
                form = FormSpread(member.form)
                spreads.append(form.spreads(pattern.form.width, pattern.form.cp))
                self.mean_zones[member.label] = form.mean_width(spreads[-1])
        return spreads

    def _add_bonus(self, layer: Layer, group: MemberGroup, first_column: int, width: float) -> None:
        """Add the bonus of the components of a group that a layer adds; `first_column` is that of the layer's first one."""
        tolerance, member, columns = layer.tolerance, group.members[0], first_column + group.added
        if tolerance.material and len(group.sizes):

            def factor(sizes: np.ndarray) -> np.ndarray:
                return np.asarray((tolerance.width + bonus(member, tolerance, sizes).min(axis=1)) / width)

            self.bonuses.append(Bonus(columns, group.sizes, factor))

    def _check_rule(self, pattern: NominalPattern, layer: Layer, group: MemberGroup) -> None:
        rule = layer.tolerance.rule
        if pattern.form is not None and rule != INSIDE and includes_form(layer.tolerance, group.members[0].geometry):
            raise self._error(
                pattern,
                f'{layer.tolerance.kind}: the rule "{rule}" is for features that keep their shape, and the form of this one is '
                f'drawn; choose "{INSIDE}", or give its {pattern.form.kind} form=None',
            )

    def _check_inner_share(
        self, pattern: NominalPattern, layer: Layer, members: Sequence[MemberZone], spreads: np.ndarray, width: float
    ) -> None:
        """Raise ModelError if narrower tolerances, with spreads (component,), leave too many features outside of the zone."""
        share = zones.share_inside(members, spreads, width)
        if share < zones.SHARE - INNER_SHARE_TOLERANCE:
            raise self._error(
                pattern,
                f"{layer.tolerance.kind} {layer.tolerance.width:g}: the narrower tolerances within it leave "
                f"{100 * (1 - share):.2g} % of the features outside already; make these narrower, or it wider",
            )

    def _unit_width(self, pattern: NominalPattern, tolerance: GeometricTolerance, *, is_innermost: bool) -> float:
        """Return the width [mm] for which spreads are computed if a zone has width 0: its bonus scales them."""
        if not is_innermost:
            raise self._error(
                pattern,
                f"{tolerance.kind}: a zone of width 0 is its bonus alone; leave out the tolerances within it",
            )
        return 1.0

    def _error(self, pattern: NominalPattern, fault: str) -> ModelError:
        declared = pattern.declared
        place = f'part "{declared.part.name}": {designation(declared.noun, declared)}'
        return ModelError(self._assembly.name, [f"{place}: {fault}"])
