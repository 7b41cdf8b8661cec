"""Costs of tolerance ranges: functions of the factor of a range, or tables of ranges or of ISO 286-1 grades to choose from."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from tolcontact.compilation import Program
from tolcontact.declaration.size import Size
from tolcontact.declaration.written_tolerance import GRADES, Deviations, TextFault, ToleranceClass, tolerance_class
from tolcontact.errors import OptionError

MIN_FACTOR, MAX_FACTOR = 0.1, 3.0  # times the present range, where a cost is no table
GRID = 40  # factors that represent a range of any width, next to tables
Cost = float | Callable[[float], float] | Mapping[float | str, float]


@dataclass(frozen=True, eq=False)
class Curve:
    """The cost of a range by the factor of its width; with a table it is linear in the logarithm between two choices.

    names    the choices of a table: the full width as declared, or the grade or the class with its limits; none without a table
    logs     (choice,): logarithms of their ranges over the present one, ascending; a wider choice costs less
    sizes    (size,): columns of the sizes whose middles move with their range
    middles  (2, point): factors of the range, ascending, and the middles there [mm] from the present one, linear in between
    """

    cost: Callable[[float], float]
    names: tuple[str, ...] = ()
    logs: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    middles: np.ndarray = field(default_factory=lambda: np.zeros((2, 1)))

    def __call__(self, factor: float) -> float:
        """Return the cost at a factor of the range."""
        return float(self.cost(factor))

    def shift(self, log: float) -> float:
        """Return the shift [mm] of the middle at a logarithm of the factor of the range."""
        return float(np.interp(math.exp(log), *self.middles))

    @property
    def ends(self) -> np.ndarray:
        """The least and the largest logarithm of the factor."""
        return self.logs[[0, -1]] if self.names else np.log([MIN_FACTOR, MAX_FACTOR])

    def nearest(self, log: float) -> int:
        """Return the index of the widest choice that is not wider, or of the narrowest."""
        return max(int(np.searchsorted(self.logs, log + 1e-9, side="right")) - 1, 0)

    def narrowed(self, log: float) -> float:
        """Return the logarithm of the next narrower choice; without a table, the same."""
        return float(self.logs[self.nearest(log)]) if self.names else log


def curves_of(
    costs: Mapping[str, Cost] | None, groups: Mapping[str, np.ndarray], ranges: Sequence[float], program: Program
) -> dict[str, Curve]:
    """Return the cost of each group that may change. Raises OptionError for costs that are none, and for unknown groups."""
    if costs is None:
        return dict.fromkeys(groups, constant(1.0))
    if not costs:
        raise OptionError("costs is empty; name the groups that may change, or leave it out")
    curves: dict[str, Curve] = {}
    widths = dict(zip(groups, ranges, strict=True))
    for name, cost in costs.items():
        if name not in groups:
            raise OptionError(f'costs has "{name}"; expected some of: {", ".join(groups)}')
        if isinstance(cost, Mapping):
            curves[name] = _table(name, cost, widths[name], _sizes(program, groups[name]))
        elif callable(cost):
            curves[name] = Curve(cost)
        elif _is_cost(cost):
            curves[name] = constant(cost)
        else:
            raise OptionError(
                f'cost of "{name}" is {cost!r}; expected a number above 0, a function of the factor of its range, or a table '
                'such as {0.1: 4, 0.2: 2.5} or {"IT6": 4, "IT7": 2.5}'
            )
    return curves


def constant(cost: float) -> Curve:
    """Return the cost c over the factor."""
    return Curve(lambda factor: cost / factor)


def cheapest(
    curves: Sequence[Curve], logs: np.ndarray, free: np.ndarray, margins: np.ndarray, slopes: np.ndarray
) -> np.ndarray | None:
    """Return the logarithms (group,) of the choices of least cost, or None if no choice has sufficient margins.

    Margins (requirement,) at `logs` change by their slopes (requirement, group) times half the relative change of the squared
    range: a linear program with a binary unknown for each choice. Free ranges without a table have a grid of factors.
    """
    grid = np.log(np.geomspace(MIN_FACTOR, MAX_FACTOR, GRID))
    options = [
        (curve.logs if curve.names else np.append(grid, log)) if is_free else np.array([log])
        for curve, log, is_free in zip(curves, logs, free, strict=True)
    ]
    group = np.repeat(np.arange(len(logs)), [len(choices) for choices in options])
    choices = np.concatenate(options)
    prices = [curves[int(k)](math.exp(choice)) for k, choice in zip(group, choices, strict=True)]
    gains = slopes[:, group] * (np.exp(2 * (choices - logs[group])) - 1) / 2
    one_each = scipy.sparse.csr_array((np.ones(len(group)), (group, np.arange(len(group)))))
    solution = scipy.optimize.milp(
        prices, integrality=np.ones(len(choices)), bounds=scipy.optimize.Bounds(0, 1),
        constraints=[scipy.optimize.LinearConstraint(one_each, 1, 1), scipy.optimize.LinearConstraint(gains, -margins, np.inf)],
    )  # fmt: skip
    return (
        None
        if solution.x is None
        else np.array([choices[group == k][solution.x[group == k].argmax()] for k in range(len(logs))])
    )


def _table(name: str, costs: Mapping[float | str, float], present: float, sizes: Mapping[int, Size]) -> Curve:
    """Return the curve of a table of costs by range or grade, for a group of a present range [mm] and sizes by column."""
    if not math.isfinite(present):
        raise OptionError(f'cost of "{name}" is a table, but its zones have several widths; use by="contributor"')
    if not costs or not all(map(_is_cost, costs.values())):
        raise OptionError(f'cost of "{name}" is {dict(costs)!r}; expected costs above 0 by range')
    choices = [(_zone(name, key, sizes), float(cost), key) for key, cost in costs.items()]
    rows = sorted((zone.width, cost, zone.middle, _named(key, zone, sizes)) for zone, cost, key in choices)
    # A choice that is no cheaper than a narrower one is of no use.
    rows = [row for k, row in enumerate(rows) if all(row[1] < narrower[1] for narrower in rows[:k])]
    widths, prices, middles, names = zip(*rows, strict=True)
    logs = np.log(np.array(widths) / present)
    curve = Curve(lambda factor: np.interp(math.log(factor), logs, prices), names, logs)
    if not any(isinstance(key, str) for key in costs) or not _size_of(name, sizes).tolerance_class:
        return curve
    shifts = dict(zip(np.exp(logs), np.array(middles) - _present(_size_of(name, sizes)).middle, strict=True)) | {1.0: 0.0}
    return replace(curve, sizes=np.array(list(sizes)), middles=np.array(sorted(shifts.items())).T)


def _zone(name: str, key: float | str, sizes: Mapping[int, Size]) -> Deviations:
    """Return the zone [mm] that a key of a table states: of a class for a grade, else about the present middle."""
    if not isinstance(key, str):
        if _is_cost(key):
            middle = _present(next(iter(sizes.values()))).middle if sizes else 0.0
            return Deviations(middle - key / 2, middle + key / 2)
        raise OptionError(
            f'cost of "{name}" has the range {key!r}; expected a full width above 0 in mm, or a grade such as "IT7"'
        )
    grade = match.group(1) if (match := re.fullmatch(r"IT ?(\d+)", key)) else ""
    if grade not in GRADES:
        raise OptionError(f'cost of "{name}" has "{key}"; expected a grade of ISO 286-1, IT01 to IT{GRADES[-1]}')
    if not sizes:
        raise OptionError(f'cost of "{name}" has "{key}"; grades are for sizes (tc.Size): state full widths in mm')
    size = _size_of(name, sizes)
    declared = tolerance_class(size.tolerance_class)
    try:
        zone = Deviations(*ToleranceClass(declared.letters if declared else "js", grade).deviations(float(size.nominal)))
    except TextFault as fault:
        raise OptionError(f'cost of "{name}": {fault}') from None
    middle = 0.0 if declared else _present(size).middle
    return Deviations(zone.lower + middle, zone.upper + middle)


def _named(key: float | str, zone: Deviations, sizes: Mapping[int, Size]) -> str:
    """Return the name of a choice: a width as declared, or a grade or class with its limits."""
    if not isinstance(key, str):
        return str(key)
    declared = tolerance_class(next(iter(sizes.values())).tolerance_class)
    return f"{declared.letters + key.removeprefix('IT').strip() if declared else key} ({zone} mm)"


def _present(size: Size) -> Deviations:
    return Deviations(size.lower, size.upper)


def _size_of(name: str, sizes: Mapping[int, Size]) -> Size:
    """Return the size that all columns of a group have. Raises OptionError if they have several."""
    size, *others = sizes.values()
    stated = (size.nominal, size.tolerance_class, _present(size))
    if any((other.nominal, other.tolerance_class, _present(other)) != stated for other in others):
        raise OptionError(f'cost of "{name}" has grades, but its sizes differ; use by="contributor"')
    return size


def _sizes(program: Program, columns: np.ndarray) -> dict[int, Size]:
    """Return the sizes among columns of deviations, by column."""
    sizes = {
        freedom.label: pattern.declared.size
        for pattern in program.nominal.patterns if pattern.declared.size is not None
        for freedom in pattern.freedoms if freedom.label.endswith(".size")
    }  # fmt: skip
    labels = {int(column): program.draws.labels[column] for column in columns}
    return {column: sizes[label] for column, label in labels.items() if label in sizes}


def _is_cost(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0
