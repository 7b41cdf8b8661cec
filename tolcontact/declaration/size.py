"""The size of a feature, with its limits, and the statistics of form deviations of a face."""

import contextlib
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, Literal, get_args

from tolcontact.declaration.checks import LENGTH, TRUTH, Checked, one_of, whole_number
from tolcontact.declaration.scale import MAX_SIZE_SHARE
from tolcontact.declaration.tolerance import Distribution, Side, Tolerance
from tolcontact.declaration.values import is_length
from tolcontact.declaration.written_tolerance import Deviations, TextFault, text_fault, tolerance_class, written

Moves = Literal["both", "first", "second"]
Covariance = Literal["squared exponential", "matern 5/2", "matern 3/2"]
MOVES, COVARIANCES = get_args(Moves), get_args(Covariance)
MAX_MODES = 200
MIN_LOBES, MAX_LOBES = 2, 12  # one lobe displaces a section


@dataclass(frozen=True, repr=False)
class Size(Checked):
    """The size of a feature [mm]: the diameter of a cylinder or sphere, the distance of two opposed planes.

    `tc.Size(8.1, +0.05, -0.02)` has the `nominal` size 8.1, and the limits 8.08 and 8.15; `tc.Size(8.1, 0.05)` has 8.05 and
    8.15. The limits may be written as on drawings: `tc.Size(8.1, "+0.05/-0.02")`, `tc.Size(8.1, "±0.05")`, and `tc.Size(8,
    "H7")` with a `tolerance_class` of ISO 286-1. Sizes vary about the midpoint of the limits by `distribution` (see
    tc.Tolerance). `moves` states which of two planes moves with the size: "both" by half each (default), or the "first" or
    "second" alone. `cp` and `cpk` are the capability of its process: by default six standard deviations equal `upper` less
    `lower`, with the mean in their middle; `side` is the side that the mean is on, "up", "down" or "either" (see
    tc.Tolerance). `parts` is the number of parts that a mean and a standard deviation as its distribution come from (see
    tc.Tolerance). With `envelope` the form of the feature stays inside the envelope of perfect form at maximum material (ISO
    8015, ASME Y14.5 Rule #1); by default as the `standard` of its part has it.
    """

    kind: ClassVar[str] = "size"
    letters: ClassVar[tuple[str, ...]] = ()  # of datums
    checks: ClassVar = {"moves": one_of(MOVES), "envelope": TRUTH}

    nominal: float
    upper: float  # a text or a pair only if it is no tolerance
    lower: float = None  # type: ignore[assignment]  # -upper by default
    _: KW_ONLY
    cp: float | None = None
    cpk: float | None = None
    side: Side | None = None
    moves: Moves = "both"
    distribution: Distribution = "normal"
    tolerance_class: str = ""
    envelope: bool | None = None
    parts: int | None = None

    def __post_init__(self) -> None:
        if self.lower is not None or not is_length(self.nominal):
            return
        with contextlib.suppress(TextFault):  # faults() reports it
            value = written(self.upper, nominal=self.nominal)
            if isinstance(self.upper, str) and (stated := tolerance_class(self.upper.strip())):
                object.__setattr__(self, "tolerance_class", str(stated))
            lower, upper = value if isinstance(value, Deviations) else (-value if is_length(value) else None, value)
            vars(self).update(lower=lower, upper=upper)

    @property
    def tolerance(self) -> Tolerance:
        """The tolerance of deviations from the nominal size [mm]; the limits have to be numbers."""
        if not isinstance(self.distribution, str):
            return Tolerance(distribution=self.distribution, parts=self.parts)
        width, middle = self.upper - self.lower, (self.upper + self.lower) / 2
        return Tolerance(width, self.distribution, middle, self.cp, self.cpk, self.side, self.parts)

    def faults(self) -> Iterator[str]:
        if not is_length(self.nominal):
            yield f"nominal is {self.nominal!r}; expected a number in mm"
        elif fault := text_fault(self.upper, nominal=self.nominal):
            yield f"tolerance is {fault}"
        elif isinstance(self.upper, str | list | tuple):
            yield f"upper is {self.upper!r}, which states both limits; leave lower={self.lower!r} out"
        elif not (is_length(self.upper) and is_length(self.lower)):
            name = "lower" if is_length(self.upper) else "upper"
            yield f"{name} is {getattr(self, name)!r}; expected a number in mm"
        else:
            yield from self._limit_faults()
        yield from super().faults()

    def _limit_faults(self) -> Iterator[str]:
        if not self.nominal > 0:
            yield f"nominal is {self.nominal!r}; expected a size in mm above 0"
        if self.lower == self.upper:
            yield f"both limits are {self.upper:g}, so the size does not vary; leave the size out"
        elif not self.lower < self.upper:
            yield f"the lower limit {self.lower:+g} is not below the upper one {self.upper:+g}; swap them"
        else:
            yield from self._scale_faults() if self.nominal > 0 else ()
            yield from self.tolerance.faults()
        if self.tolerance_class and (fault := text_fault(self.tolerance_class, nominal=self.nominal)):
            yield f"tolerance_class is {fault}"
        elif self.tolerance_class and written(self.tolerance_class, nominal=self.nominal) != (self.lower, self.upper):
            limits = f"{self.upper:+g} {self.lower:+g}"
            yield f"tolerance_class is {self.tolerance_class!r}, which has other limits than {limits}; leave it out"

    def _scale_faults(self) -> Iterator[str]:
        """Yield the fault of limits, or of a distribution, that can be no deviations from the nominal size."""
        largest = MAX_SIZE_SHARE * self.nominal
        if min(abs(self.lower), abs(self.upper)) >= largest and self.lower * self.upper > 0:
            upper, lower = (f"{limit - self.nominal:+.6g}" for limit in (self.upper, self.lower))
            meant = f", as in tc.Size({self.nominal:g}, {upper}, {lower})" if self.lower > 0 else ""
            yield (
                f"its limits are {self.upper:g} and {self.lower:g} for a size of {self.nominal:g} mm; limits are deviations "
                f"from the nominal size{meant}"
            )
        elif self.lower <= -self.nominal:
            yield (
                f"its lower limit {self.lower:+g} leaves nothing of a size of {self.nominal:g} mm; limits are deviations from "
                "the nominal size, in mm: divide micrometres by 1000"
            )
        elif hasattr(self.tolerance.frozen, "ppf") and abs(median := float(self.tolerance.frozen.ppf(0.5))) >= largest:
            yield (
                f"the median of its distribution is {median:g} mm for a size of {self.nominal:g} mm; it is one of deviations "
                "from the nominal size: subtract that from its mean"
            )

    def __str__(self) -> str:
        if not (is_length(self.nominal) and is_length(self.upper) and is_length(self.lower)):
            return f"size {self.nominal!r} {self.upper!r}"
        stated = f"{self.tolerance_class} " if self.tolerance_class else ""
        envelope = " Ⓔ" if self.envelope else ""
        return f"size {self.nominal:g} {stated}{self.upper:+g} {self.lower:+g} mm{envelope}"


@dataclass(frozen=True, repr=False)
class Form(Checked):
    """A random field of heights of a face, orthogonal to displacements of the face as a whole.

    `tc.Flatness(0.05, form=tc.Form("matern 5/2", length=20))`

    covariance   of the heights of two points, by their distance: "squared exponential", "matern 5/2" or "matern 3/2", from
                 smooth to rough
    length       [mm] correlation length; by default a third of the longest extent of the face, of a cylinder or cone a
                 third of its length along the axis, and of its diameter across it
    modes        number of Karhunen-Loeve modes, those with the largest variances; each is a contributor
    lobes        of a cylinder or cone: all sections have this number of lobes, as waviness has; covariances then count the
                 distance along the axis alone
    measured     path of the points of measured faces, one CSV or PLY file for each part, as in "scans/*.csv": lines x, y, z
                 [mm] in the frame of the part. Faces then vary as these do, regardless of the tolerance, without the
                 scatter of points about a smooth form; waves too short for the points or for 1280 stations are refused
    """

    covariance: Covariance = "squared exponential"
    length: float | None = None
    modes: int = 20
    lobes: int | None = None
    measured: str | None = None

    checks: ClassVar = {
        "covariance": one_of(COVARIANCES), "length": LENGTH, "modes": whole_number(1, MAX_MODES),
        "lobes": whole_number(MIN_LOBES, MAX_LOBES),
    }  # fmt: skip

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self.measured is not None and not (isinstance(self.measured, str) and self.measured):
            yield f'measured is {self.measured!r}; expected the path of CSV or PLY files, as in "scans/*.csv"'
        elif self.measured is not None and (self.covariance, self.length, self.lobes) != (COVARIANCES[0], None, None):
            yield "it is measured, and has a covariance, a length or lobes beside that; leave these out"

    def __str__(self) -> str:
        if self.measured is not None:
            return f"form of up to {self.modes} components, measured in {self.measured}"
        length = "a third of the face" if self.length is None else f"{self.length:g} mm"
        lobes = "" if self.lobes is None else f", {self.lobes} lobes"
        return f"form of {self.modes} modes, {self.covariance}, length {length}{lobes}"
