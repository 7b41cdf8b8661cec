"""The declarations of an assembly about what varies together: shared causes, correlations, measured parts."""

from collections.abc import Mapping, Sequence
from typing import Any

from tolcontact.declaration.declarations import Declarations, expect
from tolcontact.declaration.dependence import (
    Correlation,
    CorrelationKind,
    Variable,
    correlation as _correlation,
)
from tolcontact.declaration.geometry import Unit
from tolcontact.declaration.measured_table import Gaps, population as _population
from tolcontact.declaration.part import Part
from tolcontact.declaration.population import Population
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.values import script_line
from tolcontact.declaration.written_tolerance import TextFault, written


class Causes(Declarations):
    """The methods that declare what several contributors depend on."""

    def variable(
        self, name: str, tolerance: Any, *, drives: Mapping[str, float] | None = None, units: str = "mm",
        nominal: float | None = None, expands: Mapping[Part | str, float] | None = None,
        loads: Mapping[str, float] | None = None,
    ) -> Variable:  # fmt: skip
        """Declare a cause that drives several contributors or expands parts, or a dimension that chains measure (see Variable).

        name        of the cause
        tolerance   full width of its range in its `units`, a text such as "±5 K", or a tc.Tolerance
        drives      factor [mm per unit] of each contributor, by its label
        units       of the cause, by default mm
        nominal     value of a dimension in its `units`, which may drive nothing
        expands     coefficient of thermal expansion [1/K] of each part, or of its name; deviations are from the temperature
                    at which dimensions hold
        loads       factor [N per unit] on the magnitude of each force, by its name

        `model.variable("warmth", 20, drives={"cover.width.size": 0.0007}, units="K")`
        """
        for option, factors in (("drives", drives), ("expands", expands), ("loads", loads)):
            expect(f'variable "{name}": {option}', factors, Mapping | None, f'a factor for each name: {option}={{"name": 0.1}}')
        if isinstance(tolerance, str) and isinstance(units, str) and units != "mm":
            try:
                tolerance = written(tolerance, units=units)
            except TextFault as fault:
                raise ValueError(f'variable "{name}": tolerance is {tolerance!r}; {fault}') from fault
        by_name = {part.name if isinstance(part, Part) else part: alpha for part, alpha in (expands or {}).items()}
        variable = Variable(
            name=name, tolerance=_tolerance(tolerance), drives=dict(drives or {}), units=units, nominal=nominal,
            declared_at=script_line(), expands=by_name,
            loads=dict(loads or {}),
        )  # fmt: skip
        return self._add("variables", variable)

    def correlate(self, labels: Sequence[str], matrix: Any, *, kind: CorrelationKind = "copula") -> Correlation:
        """Declare that contributors with these `labels` are correlated: a `matrix`, or one coefficient for two of them.

        `kind` is what the coefficients are of: "copula" (default), "pearson" or "rank" (see Correlation).
        `model.correlate(["top.A1", "top.A2"], 0.5)`
        """
        return self._add("correlations", _correlation(labels, matrix, script_line(), kind))

    def population(
        self, source: Any, columns: Mapping[str, str] | None = None, *, absolute: bool = False, units: Unit = "mm",
        gauge: float | Mapping[str, float] = 0.0, lots: str | None = None, gaps: Gaps = "refused",
    ) -> Population:  # fmt: skip
        """Declare that contributors are drawn from measured rows (see Population).

        source    a CSV file, a DataFrame, a Dataset or a mapping of columns, with deviations from nominal values
        columns   label of the contributor of each column; by default the names of the columns are labels
        absolute  True: columns of sizes, of features declared before, hold sizes in place of deviations
        units     of the numbers, by default mm: "um", "in", ...
        gauge     standard uncertainty of measurement in `units`, or one for each label: its variance is taken off the spread of
                  the parts; by default it stays in it
        lots      column with the lot of each row: realizations draw a lot, then a part of it; by default they draw any row
        gaps      "left out": rows with an empty cell are left out, as a whole; by default they are refused

        `model.population("batch.csv", columns={"block.top.offset": "height"}, units="um")`
        """
        expect("population: absolute", absolute, bool, "True or False")
        sizes = {f"{feature.label}.size": feature.size.nominal for feature in self.assembly.features if feature.size}
        expect("population: lots", lots, str | None, "the name of a column")
        table = _population(
            source, columns, script_line(), units=units, sizes=sizes if absolute else None, gauge=gauge, lots=lots, gaps=gaps
        )
        return self._add("populations", table)
