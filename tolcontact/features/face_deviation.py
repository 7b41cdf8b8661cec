"""How the faces of features deviate: a small rigid displacement and a height, both linear in what varies."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class FaceDeviation:
    """A face that deviates from its nominal place in its part; all in the nominal assembly frame.

    name      "part.feature"
    columns   (k,) of the deviations that displace it
    centre    (3,) [mm]: a point p of it goes to p + tau + rho x (p - centre), and
    twist     (6, k): tau [mm] and rho [rad] for deviations of 1
    height    (k,) [mm]: how much farther out of the material it then lies, everywhere
    """

    name: str
    columns: np.ndarray
    centre: np.ndarray
    twist: np.ndarray
    height: np.ndarray

    @property
    def grows(self) -> bool:
        """Whether its height varies."""
        return bool(self.height.any())

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """(row,) [mm] for deviations (row, column), summed up in a fixed order."""
        found = np.zeros(len(deviations))
        for column, factor in zip(self.columns, self.height, strict=True):
            found += factor * deviations[:, column]
        return found

    def outward(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """How far `points` (point, 3) of it go along `normals` (point, 3), to first order, for deviations of 1: (point, k)."""
        turned = np.cross(points - self.centre, normals)
        return np.asarray(np.hstack([normals, turned]) @ self.twist + self.height)
