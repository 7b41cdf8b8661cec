"""How long to go on: until the interval of an estimate is narrow enough."""

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

LEAST_GROWTH, MOST_GROWTH = 1.25, 16.0
SPARE = 1.05  # more realizations than the interval seems to need
MOST = 100_000_000
_FORM = re.compile(r"(?P<measure>.+): *(?P<statistic>.+?) *(?:\+-|±) *(?P<half>[0-9.]+(?:[eE][+-]?[0-9]+)?) *(?P<of>%)?")
_WORDS = {PPM: OUTSIDE}


@dataclass(frozen=True)
class Target:
    """Half the width that the 95 % interval of a corrected measure's statistic may have: of the estimate, if relative."""

    measure: str
    statistic: str
    half: float
    is_relative: bool

    @classmethod
    def of(cls, text: str) -> "Target":
        """Of "corner height: 6 sigma +-1 %", "gap: mean +-0.001" or "gap: ppm +-20 %". Raises OptionError for other texts."""
        found = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
        if found is None or not float(found["half"]) > 0:
            raise OptionError(
                f'until is {text!r}; expected a text such as "corner height: 6 sigma +-1 %" or "gap: mean +-0.001"'
            )
        statistic = _WORDS.get(found["statistic"], found["statistic"])
        if statistic not in STATISTICS:
            known = ", ".join([PPM, *STATISTICS])
            raise OptionError(f'until has "{found["statistic"]}"; expected one of: {known}')
        half = float(found["half"])
        if found["of"]:
            return cls(found["measure"], statistic, half / 100, True)
        return cls(found["measure"], statistic, half * (1e-6 if found["statistic"] == PPM else 1.0), False)

    def check(self, program: Program) -> None:
        """Raise OptionError if the model has no such measure."""
        known = [measure.name for measure in program.nominal.measures]
        if self.measure not in known:
            raise OptionError(f'until has the measure "{self.measure}"; expected one of: {", ".join(known)}')

    def next(self, path: Path, program: Program) -> int | None:
        """How many realizations an archive should have next; None if the interval is narrow enough, or cannot become so."""
        with opened(path) as results:
            samples = int(results.attrs["samples"])
            estimate, lower, upper = estimate_of(results, self.measure, self.statistic)
        if math.isnan(estimate):
            log.warning(
                "%s of %s has no value (are there limits?); no more realizations are added", self.statistic, self.measure
            )
            return None
        half, wanted = (upper - lower) / 2, self.half * (abs(estimate) if self.is_relative else 1.0)
        if half <= wanted:
            return None
        grows = SPARE * (half / wanted) ** 2 if wanted > 0 and math.isfinite(half) else MOST_GROWTH
        if not samples * grows <= MOST:
            log.warning(
                "stopped at %d realizations: %s of %s is %.6g +- %.2g; until +- %.2g it takes more than %d",
                samples, self.statistic, self.measure, estimate, half, wanted, MOST,
            )  # fmt: skip
            return None
        rows = block_rows(program)
        return -(-int(samples * min(max(grows, LEAST_GROWTH), MOST_GROWTH)) // rows) * rows
