"""The text "measure: statistic value" of options that name a statistic of a corrected measure."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from tolcontact.errors import OptionError

NUMBER = r"(?P<value>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
NO_VALUE, VALUE, HALF_WIDTH = "", rf" *{NUMBER}", rf" *(?:\+-|±) *{NUMBER} *(?P<percent>%)?"  # may follow the statistic


@dataclass(frozen=True)
class StatisticRequest:
    """A statistic of a measure, with its required value above 0 if there is one.

    option      the name of the option, for messages
    is_percent  whether the value is followed by a percent sign
    """

    option: str
    measure: str
    statistic: str
    value: float
    is_percent: bool

    @classmethod
    def parse(
        cls, text: str, option: str, *, statistics: Sequence[str], form: str = NO_VALUE, examples: tuple[str, str]
    ) -> "StatisticRequest":
        """Return the request that a text states. Raises OptionError for other texts, and for statistics not in `statistics`."""
        match = re.fullmatch(rf"(?P<measure>.+): *(?P<statistic>.+?){form}", text.strip()) if isinstance(text, str) else None
        fields = match.groupdict() if match else {}
        value = float(fields.get("value", "nan"))
        if match is None or value == 0:
            expected = " or ".join(f'"{example}"' for example in examples)
            raise OptionError(f"{option} is {text!r}; expected a text such as {expected}")
        if fields["statistic"] not in statistics:
            raise OptionError(f'{option} has "{fields["statistic"]}"; expected one of: {", ".join(statistics)}')
        return cls(option, fields["measure"], fields["statistic"], value, fields.get("percent") is not None)

    def number_of(self, measures: Sequence[str]) -> int:
        """Return the index of the measure among the names of a model's measures. Raises OptionError if it is not there."""
        if self.measure not in measures:
            raise OptionError(f'{self.option} has the measurement "{self.measure}"; expected one of: {", ".join(measures)}')
        return list(measures).index(self.measure)
