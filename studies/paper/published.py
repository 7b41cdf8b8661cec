"""What the paper prints of its two reference assemblies."""

from dataclasses import dataclass
from typing import Literal

STATES: tuple[Literal["raw", "corrected"], ...] = ("raw", "corrected")  # contactless, contact


@dataclass(frozen=True)
class Published:
    """Table 1 as (mean, 6 sigma, variance) by state; colour scale [mm] of the field's figure; the varying part shown."""

    figures: dict[str, tuple[float, float, float]]
    scale: tuple[float, float]
    part: str


PAPER = {
    "RA1": Published({"raw": (0.0632, 16.1173, 7.2158), "corrected": (0.2734, 9.8223, 2.6799)}, (5.2, 9.5), "top"),
    "RA2": Published({"raw": (-0.0014, 12.5187, 4.3534), "corrected": (-0.0664, 5.8544, 0.9521)}, (0.0, 7.7), "inner"),
}
SENSITIVE = 0.1972  # by how much the maximum of RA1's sensitive area is reduced
