"""What is required of a measure: a share outside of its limits, or a capability."""

import re
from dataclasses import dataclass

import numpy as np

from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.statistics.capability import by_percentiles, share_outside
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import PPK, PPM

_FORM = re.compile(rf"(?P<measure>.+): *(?P<of>{PPM}|{PPK}) *(?P<value>[0-9.]+(?:[eE][+-]?[0-9]+)?)")
TAIL, HEAD = 0.00135, 0.99865
ROUNDING = 1e-9
ENOUGH = 10  # realizations outside of limits that a share is told by


@dataclass(frozen=True)
class Requirement:
    """Of a corrected measure, by number: at most a share outside of its limits (ppm), or at least a capability (Ppk)."""

    name: str
    measure: int
    lower: float
    upper: float
    of: str
    value: float

    @classmethod
    def of_text(cls, text: str, program: Program) -> "Requirement":
        """Of "corner height: ppm 1000" or "corner height: Ppk 1.33". Raises OptionError for what cannot be required."""
        found = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
        if found is None or not float(found["value"]) > 0:
            raise OptionError(f'require is {text!r}; expected a text such as "corner height: ppm 1000" or "gap: Ppk 1.33"')
        known = [measure.name for measure in program.nominal.measures]
        if found["measure"] not in known:
            raise OptionError(f'require has the measure "{found["measure"]}"; expected one of: {", ".join(known)}')
        number = known.index(found["measure"])
        lower, upper = program.nominal.measures[number].bounds(program.nominal_measures[number])
        if not (np.isfinite(lower) or np.isfinite(upper)):
            raise OptionError(f'require names "{found["measure"]}", which has no limits; give it tolerance=... or limits=...')
        return cls(text.strip(), number, lower, upper, found["of"], float(found["value"]) * (1e-6 if found["of"] == PPM else 1))

    def check(self, samples: int) -> None:
        """Raise OptionError if so few realizations do not tell it."""
        least = int(np.ceil(ENOUGH / (self.value if self.of == PPM else TAIL) * (1 - ROUNDING)))
        if samples < least:
            raise OptionError(f'"{self.name}" is not told by {samples} realizations; expected samples={least} or more')

    def margin(self, x: np.ndarray) -> float:
        """How well values (n,) keep it, above 0 if they do; in the measure's units.

        Of a share: how far the quantile of that share, of the distance beyond the limits, is within them. It changes as little
        as the values do, where a count jumps.
        """
        if self.of == PPM:
            return -float(np.quantile(np.maximum(self.lower - x, x - self.upper), 1 - self.value))
        tail, middle, head = np.quantile(x, [TAIL, 0.5, HEAD])
        sides = [self.upper - middle - self.value * (head - middle), middle - self.lower - self.value * (middle - tail)]
        return float(min(sides))

    def estimate(self, x: np.ndarray) -> Estimate:
        """The share, or the capability, of values (n,), with its 95 % interval."""
        sample = Sample.of(x)
        return (
            share_outside(sample, self.lower, self.upper)
            if self.of == PPM
            else by_percentiles(sample, self.lower, self.upper)[1]
        )
