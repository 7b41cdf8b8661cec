"""The variation of a contributor: the range of its tolerance, and the distribution that fills this range."""

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, get_args

import scipy

from tolcontact.declaration.values import is_length
from tolcontact.declaration.written_tolerance import Deviations, TextFault, text_fault, written
from tolcontact.readable import Readable
from tolcontact.tables import MAX_NUMBER

MAX_DRAW_SECONDS = 0.01
MIN_PARTS = 5
DRAWN = (0.1, 0.4, 0.9)
Shape = Literal["normal", "uniform", "triangular", "truncated normal"]
Distribution = Shape | Any  # or a frozen distribution of scipy.stats
SHAPES = get_args(Shape)
Side = Literal["up", "down", "either"]  # to which a process is off its centre
EITHER = "either"
SIDES: dict[Any, float] = {None: 1.0, "up": 1.0, "down": -1.0, EITHER: 0.0}


@dataclass(frozen=True, repr=False)
class Tolerance(Readable):
    """A deviation [mm] around 0 that fills a zone of full width `range`.

        normal             6 sigma = range, unbounded (the default)
        uniform            between -range/2 and +range/2
        triangular         between -range/2 and +range/2, mode 0
        truncated normal   6 sigma = range, cut at -range/2 and +range/2

    The range may be written as on drawings: "±0.1" has the range 0.2, and "+0.1/-0.05" or (-0.05, 0.1) the range 0.15 with a
    shift of 0.025. `shift` [mm] moves the whole distribution. `cp` and `cpk` are the capability of a process with a normal
    distribution: 6 sigma = range / cp, and the mean moves by a further range / 2 * (1 - cpk / cp), to the `side` "up" or
    "down"; by default up, which a check tells where shifts would cancel. With "either" each lot has its mean on one of the two
    sides, with equal odds, and each realization takes its part from another lot: the density is the mean of the two.
    `tc.Tolerance(0.6, "uniform")` and `tc.Tolerance(0.6, cp=1.33, cpk=1.0)` are examples.
    `distribution` may also be a frozen continuous distribution of `scipy.stats`. It defines the spread alone; leave
    `range` out. A supplier's mean 0.012 and standard deviation 0.008 of 30 parts are
    `tc.Tolerance(distribution=scipy.stats.norm(0.012, 0.008), parts=30)`: with the number of `parts`, 5 or more, the intervals
    of results include what so few parts leave open (see tolcontact.statistics).
    """

    range: float | None = None  # a text or a pair only if it is no tolerance
    distribution: Distribution = "normal"
    shift: float = 0.0
    cp: float | None = None
    cpk: float | None = None
    side: Side | None = None
    parts: int | None = None

    def __post_init__(self) -> None:
        with contextlib.suppress(TextFault):  # faults() reports it
            value = written(self.range)
            object.__setattr__(self, "range", value.width if isinstance(value, Deviations) else value)
            if isinstance(value, Deviations) and value.middle and is_length(self.shift):
                object.__setattr__(self, "shift", self.shift + value.middle)

    def faults(self) -> Iterator[str]:
        if isinstance(self.distribution, str):
            if self.distribution not in SHAPES:
                yield (
                    f'unknown distribution "{self.distribution}"; expected one of {", ".join(SHAPES)}, '
                    "or a frozen distribution of scipy.stats"
                )
            if fault := text_fault(self.range):
                yield f"tolerance is {fault}"
            elif not (is_length(self.range) and self.width >= 0):
                expected = f"the full width of the zone in mm, 0 or above, up to {MAX_NUMBER:g}"
                yield f"tolerance is {self.range!r}; expected {expected}"
        else:
            yield from self._scipy_faults()
        if not is_length(self.shift):
            yield f"shift is {self.shift!r}; expected a number in mm"
        for option, value in (("cp", self.cp), ("cpk", self.cpk)):
            if value is not None and not (is_length(value) and (value > 0 or option == "cpk")):
                yield f"{option} is {value!r}; expected a number{' above 0' if option == 'cp' else ''}"
            elif value is not None and self.distribution != "normal":
                yield f"{option} is given, which goes with a normal distribution; leave it out"
        if self.cpk is not None and (self.cp is None or (is_length(self.cpk) and is_length(self.cp) and self.cpk > self.cp)):
            yield f"cpk is {self.cpk!r} with cp {self.cp!r}; expected cp, and cpk not above it"
        yield from side_faults(self.side, self.cpk)
        if self.parts is not None and not (type(self.parts) is int and self.parts >= MIN_PARTS):
            expected = f"a whole number, {MIN_PARTS} or more: fewer do not show a standard deviation"
            yield f"parts is {self.parts!r}; expected {expected}"
        if self.parts is not None and getattr(getattr(self.distribution, "dist", None), "name", "") != "norm":
            yield "parts is given, which goes with a mean and a standard deviation: distribution=scipy.stats.norm(mean, sd)"

    def _scipy_faults(self) -> Iterator[str]:
        frozen = self.frozen
        if not (hasattr(getattr(frozen, "dist", None), "pdf") and hasattr(getattr(frozen, "dist", None), "name")):
            yield (
                f"distribution is a {type(frozen).__name__}; expected one of {', '.join(SHAPES)}, "
                "or a frozen continuous distribution such as scipy.stats.norm(0, 0.1)"
            )
        elif fault := _not_archivable(frozen):
            yield fault
        elif self.range is not None:
            yield "a width is given with a scipy.stats distribution, which has its own; leave range out"
        elif not math.isfinite(median := float(frozen.ppf(0.5))):
            yield f"the median of scipy.stats.{frozen.dist.name} is {median}; expected finite parameters [mm]"
        elif (seconds := _seconds_per_draw(frozen)) > MAX_DRAW_SECONDS:
            yield (
                f"a draw of scipy.stats.{frozen.dist.name} takes {1000 * seconds:.0f} ms of processor time, too long for a "
                f"run; expected at most {1000 * MAX_DRAW_SECONDS:g} ms; choose a distribution with a quicker ppf"
            )

    @property
    def frozen(self) -> Any:
        """The distribution, if it is one of scipy.stats, which have no types."""
        return self.distribution

    @property
    def mean_shift(self) -> float:
        """The shift [mm] of the distribution by `shift` and `cpk`."""
        return float(self.shift) + self.capability_shift

    @property
    def capability_shift(self) -> float:
        """The shift [mm] of the mean that `cpk` states, with the sign of its side; 0 if it may be on either."""
        return SIDES.get(self.side, 1.0) * self.off_centre

    @property
    def off_centre(self) -> float:
        """The distance [mm] of a lot's mean from the centre, which `cpk` states."""
        if self.cp is None or self.cpk is None:
            return 0.0
        return float(self.range or 0) / 2 * (1 - self.cpk / self.cp)

    @property
    def width(self) -> float:
        """Full width of the zone [mm]: the range, or six standard deviations of a scipy.stats distribution.

        It is 0 if the tolerance has a fault that leaves it without a width.
        """
        if is_length(self.range):
            return float(self.range or 0)
        return float(6 * self.frozen.std()) if hasattr(self.frozen, "std") else 0.0

    def __str__(self) -> str:
        return self.in_units("mm")

    def in_units(self, units: str) -> str:
        """Return the tolerance in words, of a variable with these units."""
        if hasattr(self.frozen, "dist"):
            spread = f"scipy.stats.{self.frozen.dist.name}"
            if self.frozen.dist.name == "norm":
                spread = f"mean {self.frozen.mean():g}, standard deviation {self.frozen.std():g} {units}"
            if self.parts:
                spread += f" of {self.parts} parts"
        else:
            width = f"{self.range:g} {units}" if is_length(self.range) else repr(self.range)
            spread = f"{self.distribution}, full width {width}"
        numbers = [(name, value) for name, value in (("cp", self.cp), ("cpk", self.cpk)) if is_length(value)]
        capability = "".join(f", {name} {value:g}" for name, value in numbers)
        if len(numbers) > 1 and is_length(self.range):
            capability += f" (mean {side_in_words(self.side)} by {self.off_centre:.4g} {units})"
        return spread + capability + (f", shifted by {self.shift:g} {units}" if is_length(self.shift) and self.shift else "")


def side_in_words(side: Side | None) -> str:
    """Return the side of a process's mean in words."""
    return "up, as assumed," if side is None else "up or down" if side == EITHER else side


def side_faults(side: Any, cpk: Any) -> Iterator[str]:
    """Yield the fault of the side of a process's mean."""
    if side not in SIDES:
        yield f"side is {side!r}; expected up, down or either"
    elif side is not None and cpk is None:
        yield "side is given without cpk, which states how far the mean is off; leave it out"


def tolerance(value: Any) -> Tolerance:
    """Return the Tolerance for a range [mm], limit deviations, a frozen scipy.stats distribution, or a Tolerance."""
    if isinstance(value, Tolerance):
        return value
    if hasattr(value, "ppf"):
        return Tolerance(distribution=value)
    return Tolerance(range=value)


def scipy_distribution(name: str) -> Any | None:
    """Return the continuous distribution of scipy.stats with this name; None for an unknown name."""
    family = getattr(scipy.stats, name, None)
    return family if isinstance(family, scipy.stats.rv_continuous) and family.name == name else None


def _seconds_per_draw(frozen: Any) -> float:
    """Return the processor time [s] of a draw. The first one may load libraries, and does not count."""
    began = time.process_time()
    for u in DRAWN:
        frozen.ppf(u)
    return (time.process_time() - began) / len(DRAWN)


def _not_archivable(frozen: Any) -> str:
    """Return the reason why a frozen distribution cannot be rebuilt from its name and its parameters; empty if it can."""
    name, family = frozen.dist.name, scipy_distribution(str(frozen.dist.name))
    if family is None or type(frozen.dist) is not type(family):
        return (
            f'distribution "{name}" is a {type(frozen.dist).__name__}, which an archive cannot store; expected a '
            "continuous distribution that scipy.stats has under that name"
        )
    for parameter in (*frozen.args, *frozen.kwds.values()):
        if not is_length(parameter):
            return f"a parameter of scipy.stats.{name} is {parameter}; expected finite numbers [mm]"
    return ""
