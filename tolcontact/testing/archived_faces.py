"""Faces that deviate and tangent datum planes, computed from an archive alone, independently of the simulation.

Sections and lines with form are not displaced: their displacements are fitted to many points of each by least squares. Tangent
planes are found by linear programmes.
"""

from collections.abc import Iterator, Mapping

import numpy as np
import scipy
import xarray as xr
from scipy.spatial.transform import Rotation

from tolcontact import vocabulary as terms

AZIMUTHS = 32  # points around the axis
TOLERANCE = 1e-9  # mm
SOLVER_TOLERANCE = 1e-7  # of the largest height: tolerance of the solver
LINE_POINTS = 16  # points along a line, at the roots of a Legendre polynomial


class ArchivedForm:
    """The form deviation of a face by its number, from the group `contact` of an archive, variables by name."""

    def __init__(self, contact: Mapping[str, np.ndarray], face: int) -> None:
        def value(variable: terms.ArchiveVariable) -> np.ndarray:
            return contact[variable.name][face]

        is_own = contact[terms.FACE_OF_FORM_STATION.name] == face
        self._stations, self._weights = (
            contact[variable.name][is_own] for variable in (terms.FORM_STATION_PLACE, terms.FORM_STATION_WEIGHT)
        )
        self._covariance, self._associated = str(value(terms.FORM_COVARIANCE)), str(value(terms.FORM_ASSOCIATED))
        self._across, self._along = value(terms.FORM_LENGTH), value(terms.FORM_LENGTH_ALONG)
        self._lobes, self._removed = int(value(terms.FORM_LOBES)), value(terms.FORM_REMOVED)
        self._ends = value(terms.FORM_START), value(terms.FORM_END)
        self._kind = terms.SURFACE_KINDS[value(terms.FORM_SURFACE["kind"])]
        self._origin, self._axis = value(terms.FORM_SURFACE["origin"]), value(terms.FORM_SURFACE["axis"])
        self._angle = value(terms.FORM_SURFACE["angle"])

    def heights(self, places: np.ndarray) -> np.ndarray:
        """Return the heights (..., mode) of modes at points (..., 3) [mm]."""
        points = places.reshape(-1, 3)
        heights = {"surface": self._functions, "circles": self._without_circles, "lines": self._without_lines}[
            self._associated
        ](points)
        n = self._normals(points)
        displacement = self._removed[:, 0] + n @ self._removed[:, 1:4].T + np.cross(points, n) @ self._removed[:, 4:].T
        return (heights - displacement).reshape(*places.shape[:-1], -1)

    def _functions(self, points: np.ndarray) -> np.ndarray:
        """Return the sums (point, mode) of covariances with the stations."""
        offsets = points[:, None] - self._stations
        along = offsets @ self._axis
        across = np.sqrt(np.maximum((offsets**2).sum(axis=-1) - along**2, 0))
        factor = 1.0
        if self._lobes:
            azimuths = [self._azimuth(places) for places in (points, self._stations)]
            factor, across = np.cos(self._lobes * (azimuths[0][:, None] - azimuths[1])), 0 * across
        r = np.hypot(across / self._across, along / self._along)
        covariance = {
            "squared exponential": np.exp(-r * r / 2),
            "matern 5/2": (1 + 5**0.5 * r + 5 / 3 * r * r) * np.exp(-(5**0.5) * r),
            "matern 3/2": (1 + 3**0.5 * r) * np.exp(-(3**0.5) * r),
        }[self._covariance]
        return (factor * covariance) @ self._weights

    def _without_circles(self, points: np.ndarray) -> np.ndarray:
        """Return the sums without the position and the diameter of each section, by least squares."""
        arms = points - self._origin
        along = (arms @ self._axis)[:, None] * self._axis
        turns = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
        copies = [self._origin + along + np.cos(t) * (arms - along) + np.sin(t) * np.cross(self._axis, arms) for t in turns]
        terms_ = np.column_stack([np.ones(AZIMUTHS), np.cos(turns), np.sin(turns)])
        return self._minus_fit(points, copies, np.linalg.pinv(terms_)[None], np.array([[1.0, 1.0, 0.0]]))

    def _without_lines(self, points: np.ndarray) -> np.ndarray:
        """Return the sums without the position and the slope of each line, by least squares over even points."""
        (start, end), along = self._ends, (points - self._origin) @ self._axis
        nodes, weights = np.polynomial.legendre.leggauss(LINE_POINTS)
        targets = (start + end) / 2 + (end - start) / 2 * nodes
        if self._kind == "cone":
            copies = [self._origin + (target / along)[:, None] * (points - self._origin) for target in targets]
        else:
            copies = [points + (target - along)[:, None] * self._axis for target in targets]
        root = np.sqrt(weights)
        terms_ = np.column_stack([root, root * nodes])
        point_terms = np.column_stack([np.ones(len(points)), (2 * along - start - end) / (end - start)])
        return self._minus_fit(points, copies, (np.linalg.pinv(terms_) * root)[None], point_terms)

    def _minus_fit(self, points: np.ndarray, copies: list[np.ndarray], fit: np.ndarray, point_terms: np.ndarray) -> np.ndarray:
        """Return the sums at points minus their fit (1, term, copy) to the sums at copies, by `point_terms` (point, term)."""
        values = np.stack([self._functions(places) for places in copies], axis=1)  # (point, copy, mode)
        return self._functions(points) - ((point_terms @ fit[0])[:, None] @ values)[:, 0]

    def _azimuth(self, points: np.ndarray) -> np.ndarray:
        u = np.cross(self._axis, np.roll(self._axis, 1) + np.array([0.3, 0.2, 0.1]))
        arms = points - self._origin
        return np.arctan2(arms @ np.cross(self._axis, u), arms @ u)

    def _normals(self, points: np.ndarray) -> np.ndarray:
        """Return unit normals (point, 3), away from an axis or a centre."""
        if self._kind == "plane":
            return np.broadcast_to(self._axis, points.shape)
        arms = points - self._origin
        if self._kind != "sphere":
            arms = arms - (arms @ self._axis)[:, None] * self._axis
        outward = arms / np.linalg.norm(arms, axis=1, keepdims=True)
        return np.cos(self._angle) * outward - np.sin(self._angle) * self._axis


class ArchivedFaces:
    """The faces of features, from the groups `contact` and `sample` of an archive, variables by name."""

    def __init__(self, contact: Mapping[str, np.ndarray], sample: Mapping[str, np.ndarray]) -> None:
        self._contact, self._sample = contact, sample

    def displacement(self, face: int, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return tau (realization, 3) [mm] and rho (realization, 3) [rad] for deviations (realization, contributor)."""
        twist = deviations @ self._contact[terms.FACE_TWIST.name][face].T
        return twist[:, :3], twist[:, 3:]

    def height(self, face: int, deviations: np.ndarray) -> np.ndarray:
        """Return the outward offset of a face (realization,) [mm]; 0 for face -1."""
        if face < 0:
            return np.zeros(len(deviations))
        return deviations @ self._contact[terms.FACE_HEIGHT.name][face]

    def modes(self, face: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the contributors (mode,) of the form of a face, and their heights (..., mode) at points (..., 3) [mm]."""
        if face < 0 or terms.FORM_COVARIANCE.name not in self._contact or not self._contact[terms.FORM_COVARIANCE.name][face]:
            return np.zeros(0, dtype=int), np.zeros((*places.shape[:-1], 0))
        columns = self._contact[terms.FORM_CONTRIBUTOR.name][face]
        return columns[columns >= 0], ArchivedForm(self._contact, face).heights(places)[..., columns >= 0]

    def form(self, face: int, deviations: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the form deviation (realization, point) [mm] of a face at points (point, 3), or at one point each."""
        columns, heights = self.modes(face, places)
        if places.ndim == 2:
            return deviations[:, columns] @ heights.T if columns.size else np.zeros((len(deviations), len(places)))
        return np.einsum("npm,nm->np", heights, deviations[:, columns])

    def placed(self, face: int, deviations: np.ndarray, R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return R and t of a face of a part at R (realization, state, 3, 3), t (realization, state, 3) [mm]."""
        if face < 0:
            return R, t
        tau, rho = self.displacement(face, deviations)
        turned, centre = Rotation.from_rotvec(rho).as_matrix(), self._contact[terms.FACE_CENTRE.name][face]
        moved = tau + centre - turned @ centre
        return R @ turned[:, None], np.einsum("...ij,...j->...i", R, moved[:, None]) + t

    def directions(self, locators: np.ndarray) -> np.ndarray:
        """Return the directions (locator, 3) of locators."""
        return np.asarray(self._sample[terms.LOCATOR_DIRECTION.name][locators])

    def pushes(self, locators: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """Return the displacements (realization, locator) [mm] of parts by their locators."""
        pushes = deviations[:, locators].copy()
        none = np.full(max(locators, default=0) + 1, -1)
        for variable, sign in ((terms.FACE_OF_LOCATOR, -1.0), (terms.GROUND_OF_LOCATOR, 1.0)):
            for place, locator in enumerate(locators):
                face = int(self._sample.get(variable.name, none)[locator])
                if face >= 0:
                    tau, rho = self.displacement(face, deviations)
                    arm = self._sample[terms.LOCATOR_POINT.name][locator] - self._contact[terms.FACE_CENTRE.name][face]
                    inward = self._sample[terms.LOCATOR_DIRECTION.name][locator]
                    point = self._sample[terms.LOCATOR_POINT.name][[locator]]
                    pushes[:, place] += self.height(face, deviations) + sign * (tau + np.cross(rho, arm)) @ inward
                    pushes[:, place] += self.form(face, deviations, point)[:, 0]
        return pushes


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
