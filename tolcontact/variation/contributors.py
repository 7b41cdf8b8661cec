"""Contributors: everything that varies, and how. Each is a column of the deviations."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from tolcontact.declaration import GeometricTolerance, Tolerance
from tolcontact.declaration.feature_tolerance import EXTREMES, INSIDE
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError
from tolcontact.features import AxisFeature, FeatureOfSize, Layer, NominalFeature, PlaneFeature
from tolcontact.variation import zones
from tolcontact.variation.quantiles import quantile

ROOM = 1e-3  # what share of features tolerances within another one may leave outside of it, beyond 0.27 %
JOINT = ("truncated", "uniform", "polar")  # rules by which components are drawn together
LOCATOR, FEATURE, VARIABLE = "locator", "feature", "variable"  # sources


class Contributor(NamedTuple):
    """A column of the deviations.

    source     "locator", "feature" or "variable"
    tolerance  of a locator, a size or a variable
    layer      of a freedom of a feature: what it is controlled by, with
    spread     [mm] its standard deviation, where it is normal, and
    mean       [mm]
    """

    label: str
    source: str
    units: str
    tolerance: Tolerance | None = None
    layer: Layer | None = None
    spread: float = 0.0
    mean: float = 0.0

    @property
    def range(self) -> float:
        """Full width of its zone; NaN if its distribution alone says how it varies."""
        if self.layer is not None:
            return float(self.layer.tolerance.width)
        return np.nan if self.tolerance is None or self.tolerance.range is None else float(self.tolerance.range)

    @property
    def mean_shift(self) -> float:
        """Mean of its own distribution; NaN if that has none."""
        if self.tolerance is None:
            return self.mean
        own = self.tolerance.distribution
        return self.tolerance.mean_shift + (0.0 if isinstance(own, str) else float(own.mean()))

    @property
    def said(self) -> str:
        """Its distribution in words: a name, and the rule from the zone to the spread."""
        if self.layer is not None:
            return f"{self.layer.tolerance}; {self.layer.tolerance.rule}"
        if self.tolerance is None:
            return ""
        name = self.tolerance.distribution
        return name if isinstance(name, str) else str(name.dist.name)

    def drawn(self, u: np.ndarray) -> np.ndarray:
        """Its deviations for numbers between 0 and 1."""
        if self.tolerance is not None:
            return quantile(self.tolerance, u)
        return np.asarray(self.mean + self.spread * ndtri(u))


@dataclass(frozen=True, eq=False)
class Together:
    """Components of a feature that are drawn together.

    rule      by which
    columns   of the deviations
    draw      made of uniform numbers: attempt -> (n, component), anew for each attempt
    """

    rule: str
    columns: np.ndarray
    draw: Callable[[Callable[[int], np.ndarray]], np.ndarray]

    def rules(self, labels: Sequence[str]) -> Iterator[tuple[str, str]]:
        """The labels of its columns, with the rule."""
        return ((labels[column], self.rule) for column in self.columns)


@dataclass(frozen=True, eq=False)
class Zone:
    """What a drawing allows: no row of `rows` @ (components - middle) is longer than half of the width, and its bonus.

    columns     of the deviations: the components
    rows        (point, entry, component)
    middle      (component,) of a zone that is disposed unevenly
    size        column of the feature's size, if the zone grows with its departure from `limit`, to the side `growth` (1, -1)
    """

    columns: np.ndarray
    rows: np.ndarray
    middle: np.ndarray
    width: float
    size: int | None = None
    limit: float = 0.0
    growth: float = 0.0


@dataclass(frozen=True, eq=False)
class Bonus:
    """Components that fill the zone which the size of their feature leaves: those of the nominal zone times its growth.

    columns, size   of the deviations: the components, and the size of their feature
    factor          (n,) of size deviations (n,)
    """

    columns: np.ndarray
    size: int
    factor: Callable[[np.ndarray], np.ndarray]


class Contributors:
    """All contributors of a model, in the order of the columns of deviations."""

    def __init__(self, nominal: Nominal) -> None:
        self.together: list[Together] = []
        self.bonuses: list[Bonus] = []
        self.zones: list[Zone] = []
        locators = zip(nominal.locators.labels, nominal.locators.tolerances, strict=True)
        self.every = [Contributor(label, LOCATOR, "mm", tolerance) for label, tolerance in locators]
        self._nominal = nominal
        for feature in nominal.features:
            self.every += self._of_feature(feature)
        self.every += [Contributor(each.name, VARIABLE, each.units, each.tolerance) for each in nominal.assembly.variables]

    def _of_feature(self, own: NominalFeature) -> Iterator[Contributor]:
        """The freedoms of a feature's layers, from the innermost on, and its size."""
        labels, column = iter(own.labels), own.first_column
        basis, known = np.zeros((len(own.geometry.names), 0)), np.zeros(0)
        for layer in own.layers:
            count = layer.added.shape[1]
            if not count:
                continue
            tolerance, columns = layer.tolerance, np.arange(column, column + count)
            basis = np.hstack([basis, layer.added])
            seen = layer.controlled @ layer.controlled.T @ basis
            rows = layer.rows @ seen
            self._check(own, layer, first=not len(known))
            width = float(tolerance.width) or self._unit(own, tolerance, first=not len(known))
            spread = zones.extreme_spread if tolerance.rule in (EXTREMES, "truncated", "polar") else zones.equal_spread
            s = spread(rows, known, count, width)
            self._check_room(own, layer, rows[..., : len(known)], known, width)
            known = np.concatenate([known, np.full(count, s / tolerance.cp)])
            mean = _mean(own, layer, s)
            self.zones.append(_zone(own, layer, rows, own.first_column + np.arange(rows.shape[-1])))
            if tolerance.rule in JOINT:
                self.together.append(Together(tolerance.rule, columns, _joint(tolerance.rule, rows, s, width)))
            if tolerance.material and tolerance.bonus == "fills" and own.size_column is not None:
                self.bonuses.append(Bonus(columns, own.size_column, _growth(own, tolerance, width)))
            for k in range(count):
                yield Contributor(next(labels), FEATURE, "mm", layer=layer, spread=s / tolerance.cp, mean=float(mean[k]))
            column += count
        if own.feature.size is not None:
            yield Contributor(next(labels), FEATURE, "mm", own.feature.size.tolerance)

    def _check(self, own: NominalFeature, layer: Layer, *, first: bool) -> None:
        rule, layers = layer.tolerance.rule, sum(each.added.shape[1] > 0 for each in own.layers)
        if rule in JOINT and (not first or layers > 1):
            self._refuse(
                own, f'{layer.tolerance.kind}: the rule "{rule}" is for features with one tolerance of place or orientation; '
                f'choose "{INSIDE}" or "{EXTREMES}"'
            )  # fmt: skip
        if rule == "polar" and not (isinstance(own.geometry, AxisFeature) and layer.rows.shape[1] == layer.added.shape[1] == 2):
            self._refuse(own, f'{layer.tolerance.kind}: the rule "polar" is for axes in round zones; choose "{INSIDE}"')

    def _check_room(self, own: NominalFeature, layer: Layer, rows: np.ndarray, known: np.ndarray, width: float) -> None:
        share = zones.share_inside(rows, known, width)
        if share < zones.SHARE - ROOM:
            self._refuse(
                own, f"{layer.tolerance.kind} {layer.tolerance.width:g}: the narrower tolerances within it leave "
                f"{100 * (1 - share):.2g} % of the features outside already; make these narrower, or it wider"
            )  # fmt: skip

    def _unit(self, own: NominalFeature, tolerance: GeometricTolerance, *, first: bool) -> float:
        """The width for which a zone is scaled that has none but its bonus: 1 mm."""
        if tolerance.bonus != "fills" or not first:
            self._refuse(
                own,
                f'{tolerance.kind}: a zone of width 0 is its bonus alone; it needs bonus="fills", and no tolerance within',
            )
        return 1.0

    def _refuse(self, own: NominalFeature, fault: str) -> None:
        feature = own.feature
        where = f'part "{feature.part.name}": feature "{feature.name}" ({feature.declared_at})'
        raise ModelError(self._nominal.assembly.name, [f"{where}: {fault}"])


def _mean(own: NominalFeature, layer: Layer, s: float) -> np.ndarray:
    """Means (component,) of the added components: of an uneven profile, and what `cpk` says, along the first."""
    tolerance, mean = layer.tolerance, np.zeros(layer.added.shape[1])
    if isinstance(own.geometry, PlaneFeature):
        mean += _uneven(layer) * layer.added[0]
    if tolerance.cpk is not None and mean.size:
        mean[0] += 3 * s * (1 - tolerance.cpk / tolerance.cp)
    return mean


def _uneven(layer: Layer) -> float:
    """How far a zone lies outside of the nominal feature [mm], of an uneven profile."""
    tolerance = layer.tolerance
    return 0.0 if tolerance.outside is None else tolerance.outside - tolerance.width / 2


def _zone(own: NominalFeature, layer: Layer, rows: np.ndarray, columns: np.ndarray) -> Zone:
    """What a layer allows of the components that it and the narrower ones have."""
    tolerance, middle = layer.tolerance, np.zeros(len(columns))
    if isinstance(own.geometry, PlaneFeature):
        middle[-layer.added.shape[1] :] = _uneven(layer) * layer.added[0]
    if own.feature.size is None or not tolerance.material or tolerance.bonus == "none":
        return Zone(columns, rows, middle, tolerance.width)
    is_lower = _counts_from_lower(own, tolerance)
    limit = own.feature.size.lower if is_lower else own.feature.size.upper
    return Zone(columns, rows, middle, tolerance.width, own.size_column, limit, 1.0 if is_lower else -1.0)


def _growth(own: NominalFeature, tolerance: GeometricTolerance, width: float) -> Callable[[np.ndarray], np.ndarray]:
    """The zone that a size leaves, beside the `width` that its spread was computed for."""

    def factor(size: np.ndarray) -> np.ndarray:
        return np.asarray((tolerance.width + bonus(own, tolerance, size)) / width)

    return factor


def bonus(own: NominalFeature, tolerance: GeometricTolerance, size: np.ndarray) -> np.ndarray:
    """How much a zone grows (n,) [mm] for deviations of the feature's size (n,): its departure from the limit that counts."""
    limits = own.feature.size
    if limits is None or not tolerance.material:
        return np.zeros_like(size)
    return np.maximum(size - limits.lower if _counts_from_lower(own, tolerance) else limits.upper - size, 0.0)


def _counts_from_lower(own: NominalFeature, tolerance: GeometricTolerance) -> bool:
    """Whether a zone grows with what the size is above its lower limit, or below its upper one."""
    is_inner = isinstance(own.geometry, FeatureOfSize) and own.geometry.is_inner
    return is_inner == (tolerance.material == "M")


def _joint(rule: str, rows: np.ndarray, s: float, width: float) -> Callable[[Callable[[int], np.ndarray]], np.ndarray]:
    """How components (n, component) are drawn together."""
    if rule == "polar":
        return lambda uniforms: _polar(uniforms(0), s)
    far = zones.reach(rows, width)

    def attempt(u: np.ndarray) -> np.ndarray:
        return np.asarray(s * ndtri(u) if rule == "truncated" else far * (2 * u - 1))

    def draw(uniforms: Callable[[int], np.ndarray]) -> np.ndarray:
        found = attempt(uniforms(0))
        left = np.flatnonzero(~zones.is_inside(rows, found, width))
        number = 0
        while left.size:
            number += 1
            found[left] = attempt(uniforms(number)[left])
            left = left[~zones.is_inside(rows, found[left], width)]
        return found

    return draw


def _polar(u: np.ndarray, s: float) -> np.ndarray:
    """Two components with a uniform angle and a normal radius."""
    angle, radius = np.pi * u[:, 1], s * ndtri(u[:, 0])
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
