"""Tangent datum planes from an archive alone, by linear programmes, independently of the simulation."""

from collections.abc import Iterator

import numpy as np
import scipy
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.testing.archived_form import ArchivedForm

TOLERANCE = 1e-9  # mm
SOLVER_TOLERANCE = 1e-7  # of the largest height: tolerance of the solver


class ArchivedTangent:
    """A tangent datum plane from an archive, by its number."""

    def __init__(self, tree: xr.DataTree, number: int) -> None:
        contact = {str(name): values.values for name, values in tree.children["contact"].to_dataset().data_vars.items()}
        face = int(contact[terms.TANGENT_FACE.name][number])
        self.columns = contact[terms.TANGENT_CONTRIBUTOR.name][number]
        self._residuals, self._free = (contact[v.name][number] for v in (terms.TANGENT_RESIDUAL, terms.TANGENT_FREE))
        is_own = contact[terms.FACE_OF_TANGENT_PLACE.name] == face
        self._heights, form = contact[terms.TANGENT_HEIGHT.name][is_own], contact[terms.FORM_CONTRIBUTOR.name][face]
        modes = ArchivedForm(contact, face).heights(contact[terms.TANGENT_PLACE_AT.name][is_own])
        self._form_columns, self._modes = form[form >= 0], modes[:, form >= 0]

    def faults(self, deviations: np.ndarray) -> Iterator[tuple[int, str]]:
        """Yield realizations with a plane, from deviations (realization, contributor), that is not tangent, and the reason."""
        for row, deviation in enumerate(deviations):
            heights = self._heights @ (self._residuals @ deviation) + self._modes @ deviation[self._form_columns]
            least_distance, archived = self._distance(heights, None), self._distance(heights, deviation)
            if not archived <= least_distance + TOLERANCE + SOLVER_TOLERANCE * float(np.abs(heights).max()):
                yield row, f"is {archived:.9g} mm from its face, and one {least_distance:.9g} mm from it touches it, too"

    def _distance(self, heights: np.ndarray, deviation: np.ndarray | None) -> float:
        """Return the least distance [mm] of a plane from heights (point,) with no height outside it.

        With a deviation (contributor,), the plane has the archived coordinates in it.
        """
        scale = max(float(np.abs(heights).max()), 1e-300)
        planes, ones = self._heights @ self._free, np.ones((len(heights), 1))
        known_coordinates = np.zeros(0, dtype=int) if deviation is None else np.flatnonzero(self.columns >= 0)
        values = np.zeros(0) if deviation is None else deviation[self.columns[known_coordinates]]
        # A plane with known coordinates may be lower by rounding.
        slack = scale * 1e-12 if known_coordinates.size else 0.0
        solution = scipy.optimize.linprog(
            np.append(np.zeros(planes.shape[1]), 1.0),
            A_ub=np.block([[-planes, 0 * ones], [planes, -ones]]),
            b_ub=np.concatenate([slack - heights, heights]) / scale,
            A_eq=np.column_stack([self._free[known_coordinates], np.zeros(len(known_coordinates))]),
            b_eq=values / scale,
            bounds=[(None, None)] * planes.shape[1] + [(0, None)],
            method="highs-ds",
        )
        return float(scale * solution.fun) if solution.success else np.inf


def tangents(tree: xr.DataTree) -> list[ArchivedTangent]:
    """Return the tangent datum planes of an archive."""
    sizes = tree.children["contact"].to_dataset().sizes
    return [ArchivedTangent(tree, number) for number in range(sizes.get(terms.TANGENT, 0))]
