"""Stopping rules: a run continues until the interval of an estimate is narrow enough."""

import math
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from tolcontact.archive import open_unchecked
from tolcontact.compilation import Program
from tolcontact.simulation import block_rows
from tolcontact.statistics import STATISTICS, estimate_of
from tolcontact.statistics.measure_statistics import HALF_WIDTH, StatisticRequest
from tolcontact.vocabulary import OUTSIDE, PPM

MIN_GROWTH, MAX_GROWTH = 1.25, 16.0
MARGIN = 1.05  # times the estimated number of realizations that the interval needs
MAX_REALIZATIONS = 100_000_000
MAX_WITHOUT_INTERVAL = 10_000  # realizations: an estimate without an interval at this number will not get one
EXAMPLES = ("corner height: 6 sigma +-1 %", "gap: mean +-0.001")


@dataclass(frozen=True)
class Target:
    """The largest permitted half-width of the 95 % interval of a corrected measure's statistic.

    half  in the units of the measure, or as a fraction of the estimate if `is_relative`
    """

    request: StatisticRequest
    measure: str
    statistic: str
    half: float
    is_relative: bool

    @classmethod
    def of(cls, text: str) -> "Target":
        """Return the target "corner height: 6 sigma +-1 %" or "gap: ppm +-20 %". Raises OptionError for other texts."""
        request = StatisticRequest.parse(text, "until", statistics=(PPM, *STATISTICS), form=HALF_WIDTH, examples=EXAMPLES)
        is_ppm = request.statistic == PPM
        half = request.value / 100 if request.is_percent else request.value * (1e-6 if is_ppm else 1.0)
        return cls(request, request.measure, OUTSIDE if is_ppm else request.statistic, half, request.is_percent)

    def check(self, program: Program) -> None:
        """Raise OptionError if the model has no such measure."""
        self.request.number_of([measure.name for measure in program.nominal.measures])

    def next(self, path: Path, program: Program) -> int | None:
        """Return the number of realizations that the archive should have next.

        None means that the interval is narrow enough, or cannot become narrow enough.
        """
        with open_unchecked(path) as results:
            samples = int(results.attrs["samples"])
            estimate, half, target_half = self._widths(results)
        is_hopeless = math.isnan(half) and samples >= MAX_WITHOUT_INTERVAL
        if math.isnan(estimate) or half <= target_half or is_hopeless:
            return None
        growth = self._growth(half, target_half)
        if not samples * growth <= MAX_REALIZATIONS:
            return None
        rows = block_rows(program)
        return -(-int(samples * min(max(growth, MIN_GROWTH), MAX_GROWTH)) // rows) * rows

    def shortfall(self, results: xr.DataTree) -> str:
        """Return a sentence that states why the interval of finished results is not narrow enough; empty if it is."""
        estimate, half, target_half = self._widths(results)
        if math.isnan(estimate):
            return f"{self.statistic} of {self.measure} has no value (are there limits?); no more realizations were added"
        if half <= target_half:
            return ""
        stated = f"{estimate:.6g} without an interval" if math.isnan(half) else f"{estimate:.6g} +- {half:.2g}"
        return f"stopped at {results.attrs['samples']} realizations: {self.statistic} of {self.measure} is {stated}; " + (
            "more will not give one" if math.isnan(half) else f"+- {target_half:.2g} needs more than {MAX_REALIZATIONS}"
        )

    def _widths(self, results: xr.DataTree) -> tuple[float, float, float]:
        """Return the estimate, the half-width of its interval, and the largest permitted half-width."""
        estimate, lower, upper = estimate_of(results, self.measure, self.statistic)
        return estimate, (upper - lower) / 2, self.half * (abs(estimate) if self.is_relative else 1.0)

    @staticmethod
    def _growth(half: float, target_half: float) -> float:
        if not (target_half > 0 and math.isfinite(half)):
            return MAX_GROWTH
        ratio = half / target_half
        return MARGIN * ratio * ratio  # infinite for a tiny target, where a power would raise an error
