"""The statistics of form deviations of a face: a covariance, its length, and a number of modes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from tolcontact.declaration.checks import LENGTH, Checked, one_of, whole_number

COVARIANCES = ("squared exponential", "matern 5/2", "matern 3/2")
MAX_MODES = 200
MIN_LOBES, MAX_LOBES = 2, 12  # one lobe displaces a section


@dataclass(frozen=True, repr=False)
class Form(Checked):
    """A random field of heights of a face, orthogonal to displacements of the face as a whole.

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

    covariance: str = "squared exponential"
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
