"""Stopping rules: a run continues until the interval of an estimate is narrow enough."""

import logging
import math
import re
from dataclasses import dataclass
from pathlib import Path

from tolcontact.archive import opened
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import block_rows
from tolcontact.statistics import STATISTICS, estimate_of
from tolcontact.vocabulary import OUTSIDE, PPM

log = logging.getLogger(__name__)

MIN_GROWTH, MAX_GROWTH = 1.25, 16.0
MARGIN = 1.05  # times the realizations that the interval seems to need
MAX_REALIZATIONS = 100_000_000
_PATTERN = re.compile(
    r"(?P<measure>.+): *(?P<statistic>.+?) *(?:\+-|±) *(?P<half>[0-9.]+(?:[eE][+-]?[0-9]+)?) *(?P<percent>%)?"
)
_STATISTIC_NAMES = {PPM: OUTSIDE}


@dataclass(frozen=True)
class Target:
    """The half-width that the 95 % interval of a corrected measure's statistic may have at most.

    half  in the units of the measure, or as a fraction of the estimate if `is_relative`
    """

    measure: str
    statistic: str
    half: float
    is_relative: bool

    @classmethod
    def of(cls, text: str) -> "Target":
        """Parse "corner height: 6 sigma +-1 %", "gap: mean +-0.001" or "gap: ppm +-20 %".

        Raises OptionError for other texts.
        """
        match = _PATTERN.fullmatch(text.strip()) if isinstance(text, str) else None
        if match is None or not float(match["half"]) > 0:
            raise OptionError(
                f'until is {text!r}; expected a text such as "corner height: 6 sigma +-1 %" or "gap: mean +-0.001"'
            )
        statistic = _STATISTIC_NAMES.get(match["statistic"], match["statistic"])
        if statistic not in STATISTICS:
            names = ", ".join([PPM, *STATISTICS])
            raise OptionError(f'until has "{match["statistic"]}"; expected one of: {names}')
        half = float(match["half"])
        if match["percent"]:
            return cls(match["measure"], statistic, half / 100, True)
        return cls(match["measure"], statistic, half * (1e-6 if match["statistic"] == PPM else 1.0), False)

    def check(self, program: Program) -> None:
        """Raise OptionError if the model has no such measure."""
        measures = [measure.name for measure in program.nominal.measures]
        if self.measure not in measures:
            raise OptionError(f'until has the measure "{self.measure}"; expected one of: {", ".join(measures)}')

    def next(self, path: Path, program: Program) -> int | None:
        """Return the number of realizations that the archive should have next.

        None means that the interval is narrow enough, or cannot become narrow enough.
        """
        with opened(path) as results:
            samples = int(results.attrs["samples"])
            estimate, lower, upper = estimate_of(results, self.measure, self.statistic)
        if math.isnan(estimate):
            log.warning(
                "%s of %s has no value (are there limits?); no more realizations are added", self.statistic, self.measure
            )
            return None
        half, target_half = (upper - lower) / 2, self.half * (abs(estimate) if self.is_relative else 1.0)
        if half <= target_half:
            return None
        growth = MARGIN * (half / target_half) ** 2 if target_half > 0 and math.isfinite(half) else MAX_GROWTH
        if not samples * growth <= MAX_REALIZATIONS:
            log.warning(
                "stopped at %d realizations: %s of %s is %.6g +- %.2g; an interval of +- %.2g needs more than %d",
                samples, self.statistic, self.measure, estimate, half, target_half, MAX_REALIZATIONS,
            )  # fmt: skip
            return None
        rows = block_rows(program)
        return -(-int(samples * min(max(growth, MIN_GROWTH), MAX_GROWTH)) // rows) * rows
