"""Dependence between deviations: shared causes, correlations, and measured populations.

Contributors are named by labels: "part.locator", "part.feature.freedom" ("cover.H1.size"), or the name of a variable.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal, get_args

import numpy as np

from tolcontact.declaration.checks import Declaration, one_of
from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import is_length, is_line
from tolcontact.declaration.written_tolerance import DIGITS, Deviations

CorrelationKind = Literal["copula", "pearson", "rank"]
MAX_LISTED = 6  # coefficients in a row of the model
MAX_EXPANSION = 1e-3  # 1/K
MIN_EIGENVALUE = 1e-12  # of a correlation matrix; of a smaller absolute value it is zero


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Variable(Declaration):
    """A cause that drives several contributors: `drives[label]` times its deviation is added to the draw of each.

    The variable is in `units`; a factor converts them to the units of its contributor. A variable with a `nominal` value is a
    dimension, the link of a chain, and may drive nothing. A temperature `expands` parts, by their names: all dimensions of a
    part grow by the factor [1/K] times the deviation, about the origin of its frame. A variable `loads` forces, by their names:
    the factor [N per unit] times the deviation is added to their magnitude.
    """

    tolerance: Tolerance
    drives: Mapping[str, float] = field(default_factory=dict)
    name: str
    units: str = "mm"
    declared_at: str = ""
    nominal: float | None = None
    expands: Mapping[str, float] = field(default_factory=dict)
    loads: Mapping[str, float] = field(default_factory=dict)
    noun: ClassVar[str] = "variable"

    def faults(self) -> Iterator[str]:
        yield from self.tolerance.faults()
        if self.nominal is not None and not is_length(self.nominal):
            yield f"nominal is {self.nominal!r}; expected a number in {self.units}"
        if not (self.drives or self.expands or self.loads) and self.nominal is None:
            yield 'it drives nothing; give drives={"part.locator": factor, ...}, expands={"part": ...} or loads={"force": ...}'
        for part, factor in self.expands.items():
            if not (is_length(factor) and abs(factor) <= MAX_EXPANSION):
                yield (
                    f'expands has "{part}": {factor!r}; expected a coefficient of expansion in 1/K, up to {MAX_EXPANSION:g}, '
                    "such as 23.5e-6 for aluminium"
                )
        for force, factor in self.loads.items():
            if not is_length(factor):
                yield f'loads has "{force}": {factor!r}; expected a number in N per {self.units}'
        for label, factor in self.drives.items():
            if not (isinstance(label, str) and is_length(factor)):
                yield f"drives has {label!r}: {factor!r}; expected the label of a contributor, and a number"
        if not (self.units and is_line(self.units)):
            yield f'units is {self.units!r}; expected a text such as "mm" or "K"'
        elif self.expands and self.units in UNITS:
            yield f'units is "{self.units}", and a temperature expands parts; give units="K"'
        elif self.drives and self.units in UNITS and self.units != "mm":
            yield (
                f'units is "{self.units}", and nothing is converted; state the cause in mm: its tolerance times '
                f"{UNITS[self.units]:g}, and factors in mm per mm"
            )

    def __str__(self) -> str:
        drives = ", ".join(f"{label} by {factor:g}" for label, factor in self.drives.items())
        expands = ", ".join(f"{part} by {factor:g} per {self.units}" for part, factor in self.expands.items())
        loads = ", ".join(f"{force} by {factor:g} N per {self.units}" for force, factor in self.loads.items())
        effects = {"drives": drives, "expands": expands, "loads": loads}
        driven = "".join(f"; {verb} {things}" for verb, things in effects.items() if things)
        if self.limits is None:
            return f"variable {self.name} [{self.units}]: {self.tolerance.in_units(self.units)}{driven}"
        centred = f", centred {self.centred}" if self.limits.middle else ""
        return f"dimension {self.name} [{self.units}]: {self.drawn}{centred}{driven}"

    @property
    def limits(self) -> Deviations | None:
        """The limit deviations from the nominal value, as drawn; None without a nominal value or a range."""
        if self.nominal is None or not is_length(self.tolerance.range):
            return None
        half, middle = float(self.tolerance.range or 0) / 2, self.tolerance.shift
        return Deviations(round(middle - half, DIGITS), round(middle + half, DIGITS))

    @property
    def drawn(self) -> str:
        """The dimension with its limits as drawn: "0.375 0 -0.031", "40 ±0.05"."""
        is_equal = self.limits is not None and not self.limits.middle
        return self.centred if is_equal else f"{self.nominal or 0:.12g} {self.limits or self.tolerance}"

    @property
    def centred(self) -> str:
        """The dimension with equal limits: "0.3595 ±0.0155"; empty without limits."""
        if self.limits is None or self.nominal is None:
            return ""
        return f"{self.nominal + self.limits.middle:.12g} ±{self.limits.width / 2:.12g}"


@dataclass(frozen=True, eq=False, repr=False)
class Correlation(Declaration):
    """A correlation of contributors: a Gaussian copula, which leaves their distributions unchanged.

    kind   what the coefficients of the matrix are of: "copula", the normal scores; "pearson", the deviations; or "rank", the
           ranks of the deviations (Spearman). They are equal, or nearly so, for normal distributions
    """

    labels: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]
    declared_at: str = ""
    kind: CorrelationKind = "copula"
    checks: ClassVar = {"kind": one_of(get_args(CorrelationKind))}
    noun: ClassVar[str] = "correlation"

    @property
    def name(self) -> str:  # type: ignore[override]
        return ", ".join(map(str, self.labels))

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if len(set(self.labels)) < len(self.labels) or len(self.labels) < 2:
            yield f"its labels are {', '.join(map(str, self.labels)) or 'none'}; expected two or more different contributors"
        try:
            matrix = np.array(self.matrix, dtype=float)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        count = len(self.labels)
        if matrix.shape != (count, count) or not np.isfinite(matrix).all():
            yield f"its matrix is not {count} x {count} finite numbers, one row for each contributor"
        elif not (np.allclose(matrix, matrix.T, atol=1e-12) and np.allclose(np.diag(matrix), 1, atol=1e-12)):
            yield "its matrix is not symmetric with ones on the diagonal; expected correlation coefficients, not covariances"
        elif (smallest := float(np.linalg.eigvalsh(matrix).min())) < -MIN_EIGENVALUE:
            yield (
                f"its matrix is not positive definite (smallest eigenvalue {smallest:.3g}): no variables have "
                "these correlations; check the signs, or make the coefficients smaller"
            )
        elif smallest < MIN_EIGENVALUE:
            yield (
                "its matrix is singular: a contributor in it follows from the others, as with a coefficient of 1 or -1; "
                "expected contributors with a part of their own. Give those that follow a tolerance of 0, and declare their "
                "common cause by variable(name, tolerance, drives={label: factor, ...}), with factors of opposite signs for -1"
            )

    def __str__(self) -> str:
        numbers = [f"{self.matrix[row][column]:g}" for row in range(len(self.matrix)) for column in range(row)]
        listed = ", ".join(numbers) if len(numbers) <= MAX_LISTED else f"{len(numbers)} coefficients"
        return f"correlation of {self.name}: {listed} ({self.kind})"
