"""Single realizations in the scene of an archive: form deviation of drawn faces, and remaining gaps at contact points."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import scipy
import xarray as xr
from scipy.spatial import Delaunay, QhullError

from tolcontact import vocabulary as terms
from tolcontact.features.associated_features import COVARIANCES, displacement_terms

MAX_GAPS = 1_000_000  # in a page: of all contact points in both states of the single realizations
FLATNESS = 1e-6  # of the size of a face: tolerance for vertices and normals of a plane
NEAR = 1.0  # correlation lengths: a vertex of the plane that is further from all stations belongs to another face
HOLE = 3.0  # times the usual edge length between neighbouring contact points: a triangle with a longer edge is a hole


class SingleStates:
    """Faces and contact points of an archive in selected realizations, by their row indices (realization,)."""

    def __init__(self, results: xr.DataTree, rows: np.ndarray) -> None:
        self._contact = {str(name): np.asarray(array.values) for name, array in results["contact"].to_dataset().items()}
        self._results, self._rows = results, rows

    def read(self, dataset: xr.Dataset, variable: terms.ArchiveVariable) -> np.ndarray:
        """Return the rows of a variable; they are read in ascending order."""
        rows, places = np.unique(self._rows, return_inverse=True)
        return np.asarray(dataset[variable.name].isel({terms.REALIZATION: rows}).values)[places]

    @cached_property
    def _deviations(self) -> np.ndarray:
        """The deviations (realization, contributor)."""
        return self.read(self._results["sample"].to_dataset(), terms.DEVIATION)

    @cached_property
    def _poses(self) -> tuple[np.ndarray, np.ndarray]:
        """The rotations (realization, state, part, 3, 3) and translations (realization, state, part, 3) [mm]."""
        dataset = self._results.to_dataset()
        return self.read(dataset, terms.ROTATION), self.read(dataset, terms.TRANSLATION)

    @property
    def are_known(self) -> bool:
        """Whether the archive keeps the poses and the deviations of realizations, and has contact points."""
        is_kept = terms.DEVIATION.name in self._results["sample"] and terms.ROTATION.name in self._results
        return is_kept and terms.FACE_OF_MOVING.name in self._contact and terms.MOVING_POINT.name in self._contact

    def forms(self, part: str, vertices: np.ndarray, faces: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """Yield the forms of a part with vertices (vertex, 3) [mm] and triangles (face, 3), at vertices of its drawn surface.

        vertices       (k,) their indices
        normal         (3,) outward
        modes          (k, mode) heights for unit coefficients
        coefficients   (realization, mode) [mm]
        """
        for face, covariance in enumerate(self._contact.get(terms.FORM_COVARIANCE.name, []) if self.are_known else []):
            is_plane = terms.SURFACE_KINDS[int(self._contact[terms.FORM_SURFACE["kind"].name][face])] == "plane"
            if covariance and is_plane and str(self._contact[terms.FEATURE_OF_FACE.name][face]).startswith(f"{part}."):
                yield from self._shown(face, vertices, faces)

    def _shown(self, face: int, vertices: np.ndarray, faces: np.ndarray) -> Iterator[dict[str, np.ndarray]]:
        """Yield a form at the vertices in the plane of its stations, if triangles show it."""
        stations = self._contact[terms.FORM_STATION_PLACE.name][self._contact[terms.FACE_OF_FORM_STATION.name] == face]
        centre, size = stations.mean(axis=0), np.ptp(vertices, axis=0).max()
        normal = np.linalg.svd(stations - centre)[2][2]
        distance, _ = scipy.spatial.KDTree(stations).query(vertices)
        is_near = distance < NEAR * self._contact[terms.FORM_LENGTH.name][face]
        is_shown = is_near & (np.abs((vertices - centre) @ normal) < FLATNESS * size)
        corners = vertices[faces[is_shown[faces].all(axis=1)]]
        if len(corners):
            outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
            yield {
                "vertices": np.flatnonzero(is_shown),
                "normal": outward / np.linalg.norm(outward),
                "modes": self._modes(face, vertices[is_shown]),
                "coefficients": self._deviations[:, self._columns(face)],
            }

    def _columns(self, face: int) -> np.ndarray:
        """Return the contributors (mode,) that are the coefficients of a form."""
        columns = self._contact[terms.FORM_CONTRIBUTOR.name][face]
        return np.asarray(columns[columns >= 0])

    def _modes(self, face: int, places: np.ndarray) -> np.ndarray:
        """Return the form heights (point, mode) of a plane at points (point, 3) [mm], for unit coefficients."""
        contact = self._contact
        is_of_face, removed = contact[terms.FACE_OF_FORM_STATION.name] == face, contact[terms.FORM_REMOVED.name][face]
        stations, weights = (contact[v.name][is_of_face] for v in (terms.FORM_STATION_PLACE, terms.FORM_STATION_WEIGHT))
        distance = scipy.spatial.distance.cdist(places, stations) / contact[terms.FORM_LENGTH.name][face]
        covariance = COVARIANCES[str(contact[terms.FORM_COVARIANCE.name][face])](distance)
        normals = np.broadcast_to(contact[terms.FORM_SURFACE["axis"].name][face], places.shape)
        heights = covariance @ weights - displacement_terms(normals, places) @ removed.T
        return np.asarray(heights[:, contact[terms.FORM_CONTRIBUTOR.name][face] >= 0])

    def gaps(self, pair: int) -> np.ndarray | None:
        """Return the gaps (realization, state, point) [mm] at the contact points of a pair of planes; None for other pairs.

        Displacements of faces within their parts count to first order.
        """
        if not self.are_known or self.points(pair) is None:
            return None
        is_own = self._contact[terms.PAIR_OF_POINT.name] == pair
        n = self._contact[terms.REFERENCE_NORMAL.name][is_own]
        sides = []
        for point, part, face in (
            (terms.MOVING_POINT, terms.MOVING_PART, terms.FACE_OF_MOVING),
            (terms.REFERENCE_POINT, terms.REFERENCE_PART, terms.FACE_OF_REFERENCE),
        ):
            places, number = self._contact[point.name][is_own], int(self._contact[face.name][pair])
            R, t = (values[:, :, int(self._contact[part.name][pair])] for values in self._poses)
            x = np.einsum("nsij,nkj->nski", R, self._displaced(number, places)) + t[:, :, None]
            sides.append((R, x, self._height(number, places)))
        (_, x_m, height_m), (R_r, x_r, height_r) = sides
        along = np.einsum("nsij,kj->nski", R_r, n)
        return np.asarray(((x_m - x_r) * along).sum(axis=-1) - (height_m + height_r)[:, None])

    def points(self, pair: int) -> np.ndarray | None:
        """Return the contact points (point, 3) [mm] of a pair of planes; None for other pairs, and for supports."""
        if terms.MOVING_POINT.name not in self._contact or self._contact[terms.REFERENCE_PART.name][pair] < 0:
            return None
        is_own = self._contact[terms.PAIR_OF_POINT.name] == pair
        points, n = (self._contact[v.name][is_own] for v in (terms.MOVING_POINT, terms.REFERENCE_NORMAL))
        is_support = (self._contact[terms.LOCATOR_OF_POINT.name][is_own] >= 0).any()
        size = np.ptp(points, axis=0).max(initial=0.0)
        if is_support or len(points) < 3 or np.ptp(n, axis=0).max() > FLATNESS or np.ptp(points @ n[0]) > FLATNESS * size:
            return None
        return points

    def triangles(self, pair: int) -> np.ndarray:
        """Return triangles (triangle, 3) between the contact points of a pair of planes, without its holes."""
        points = self.points(pair)
        if points is None:
            return np.zeros((0, 3), dtype=int)
        coordinates = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0))[2][:2].T
        try:
            triangles = Delaunay(coordinates).simplices
        except QhullError:  # the points lie on one line
            return np.zeros((0, 3), dtype=int)
        edges = np.linalg.norm(np.diff(coordinates[triangles[:, [0, 1, 2, 0]]], axis=1), axis=2)
        return np.asarray(triangles[edges.max(axis=1) <= HOLE * np.median(edges)])

    def _displaced(self, face: int, places: np.ndarray) -> np.ndarray:
        """Return points (point, 3) displaced with a face in its part, to first order: (realization, point, 3) [mm]."""
        if face < 0:
            return np.broadcast_to(places, (len(self._rows), *places.shape))
        tau, rho = np.split(self._deviations @ self._contact[terms.FACE_TWIST.name][face].T, 2, axis=1)
        arms = places - self._contact[terms.FACE_CENTRE.name][face]
        return np.asarray(places + tau[:, None] + np.cross(rho[:, None], arms))

    def _height(self, face: int, places: np.ndarray) -> np.ndarray:
        """Return the outward offset of a face (realization, point) [mm] at points (point, 3), including its form deviation."""
        if face < 0:
            return np.zeros((len(self._rows), len(places)))
        heights = np.repeat((self._deviations @ self._contact[terms.FACE_HEIGHT.name][face])[:, None], len(places), axis=1)
        if terms.FORM_COVARIANCE.name in self._contact and self._contact[terms.FORM_COVARIANCE.name][face]:
            heights += self._deviations[:, self._columns(face)] @ self._modes(face, places).T
        return heights
