"""The deviation of a face of a feature, with everything that varies."""

from dataclasses import dataclass, field

import numpy as np

from tolcontact.features.form_field import FormField


@dataclass(frozen=True, eq=False)
class FaceDeviation:
    """The deviation of a face: a small rigid displacement and a height, both linear in what varies. Nominal assembly frame.

    name      "part.feature"
    columns   (k,) of the deviations that displace the face
    centre    (3,) [mm]: a point p of the face goes to p + tau + rho x (p - centre)
    twist     (6, k): tau [mm] and rho [rad] for deviations of 1
    height    (k,) [mm]: how much the face then grows out of the material, everywhere
    form      heights of the face's form in each place; None if it keeps its shape
    modes     (mode,) places of the coefficients of the form among the columns
    """

    name: str
    columns: np.ndarray
    centre: np.ndarray
    twist: np.ndarray
    height: np.ndarray
    form: FormField | None = None
    modes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    @property
    def form_columns(self) -> np.ndarray:
        """The columns (mode,) of the deviations that are coefficients of the form."""
        return self.columns[self.modes]

    def form_heights(self, points: np.ndarray) -> np.ndarray:
        """Return the heights (..., mode) of the form at points (..., 3) [mm] for deviations of 1."""
        return np.zeros((*points.shape[:-1], 0)) if self.form is None else self.form.heights(points)

    @property
    def grows(self) -> bool:
        """Whether the height varies."""
        return bool(self.height.any())

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """Return the heights (row,) [mm] for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(len(deviations))
        for column, factor in zip(self.columns, self.height, strict=True):
            heights += factor * deviations[:, column]
        return heights

    def outward(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return how far `points` (point, 3) of the face move along `normals` (point, 3) for deviations of 1: (point, k)."""
        turned = np.cross(points - self.centre, normals)
        outward = np.hstack([normals, turned]) @ self.twist + self.height
        if self.form is not None:
            outward[:, self.modes] += self.form.heights(points)
        return outward
