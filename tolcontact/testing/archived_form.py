"""The form deviation of a face, computed from an archive alone, independently of the simulation.

Sections and lines are not displaced: their displacements are fitted to many points of each by least squares.
"""

from collections.abc import Mapping

import numpy as np

from tolcontact import vocabulary as terms

AZIMUTHS = 32  # points around the axis
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
