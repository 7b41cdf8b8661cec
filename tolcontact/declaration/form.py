"""The statistics of form deviations of a face: a covariance, its length, and a number of modes."""

from collections.abc import Iterator
from dataclasses import dataclass

from tolcontact.declaration.values import is_length
from tolcontact.readable import Readable

COVARIANCES = ("squared exponential", "matern 5/2", "matern 3/2")
MAX_MODES = 200


@dataclass(frozen=True, repr=False)
class Form(Readable):
    """A random field of heights of a face, without what displaces the face as a whole.

    covariance   of the heights of two points, by their distance: "squared exponential", "matern 5/2" or "matern 3/2", from
                 smooth to rough
    length       [mm] correlation length; by default a third of the longest extent of the face
    modes        number of Karhunen-Loeve modes, those with the largest variances; each is a contributor
    """

    covariance: str = "squared exponential"
    length: float | None = None
    modes: int = 20

    def faults(self) -> Iterator[str]:
        if self.covariance not in COVARIANCES:
            yield f"covariance is {self.covariance!r}; expected one of: {', '.join(map(repr, COVARIANCES))}"
        if self.length is not None and not (is_length(self.length) and self.length > 0):
            yield f"length is {self.length!r}; expected a correlation length in mm above 0"
        if not (isinstance(self.modes, int) and not isinstance(self.modes, bool) and 1 <= self.modes <= MAX_MODES):
            yield f"modes is {self.modes!r}; expected a whole number from 1 to {MAX_MODES}"

    def __str__(self) -> str:
        length = "a third of the face" if self.length is None else f"{self.length:g} mm"
        return f"form of {self.modes} modes, {self.covariance}, length {length}"
