"""Gaps from what an archive holds alone, another way than the simulation computes them.

The distance of a ball from a wall is that of its centre, less its radius. A shaft inside a wall is as far from it as its end is
from the nearest of the wall's tangent planes: here all directions are tried, and the nearest one is narrowed down.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from tolcontact import vocabulary as terms

DIRECTIONS = 72  # that are tried
NARROWINGS = 60
GOLDEN = (np.sqrt(5) - 1) / 2
Rows = Mapping[str, xr.DataArray]  # variables (realization, ...) by name


class NotKeptError(LookupError):
    """The archive does not keep what gaps are computed from."""


def archived_points(contact: Mapping[str, np.ndarray], own: np.ndarray) -> "list[ArchivedPoint]":
    """Those of the contact points `own` (point,) that are of round faces; `contact`: variables of that group, by name."""
    if terms.POINT_OF_ROUND.name not in contact:
        return []
    chosen = np.flatnonzero(np.isin(contact[terms.POINT_OF_ROUND.name], own))
    wall, body = (
        {name: contact[variable.name][chosen] for name, variable in of.items()} for of in (terms.OF_WALL, terms.OF_ROUND)
    )
    return [
        ArchivedPoint(*({name: values[k] for name, values in of.items()} for of in (wall, body))) for k in range(len(chosen))
    ]


class ArchivedPoint(NamedTuple):
    """A ball, or the end of a shaft, and a wall, by the names that the vocabulary gives what they are."""

    wall: Mapping[str, Any]
    body: Mapping[str, Any]

    def gaps(self, R: np.ndarray, t: np.ndarray, of_moving: Any = 0.0, of_reference: Any = 0.0) -> np.ndarray:
        """Gaps (...) [mm] where the moving part is at R (..., 3, 3), t (..., 3) [mm], as the reference part sees it.

        Its face has grown by `of_moving` (...), the reference part's by `of_reference` (...) [mm].
        """
        of_body, of_wall = (of_moving, of_reference) if self.body["on_moving"] else (of_reference, of_moving)
        grown = ArchivedPoint(self.wall, {**self.body, "radius": self.body["radius"] + of_body})
        return np.asarray(grown._apart(R, t) - of_wall)

    def _apart(self, R: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Gaps (...) [mm] at such poses, of faces as large as they are."""
        if not self.body["on_moving"]:
            R = R.swapaxes(-1, -2)
            t = -np.einsum("...ij,...j->...i", R, t)
        centre, axis = R @ self.body["centre"] + t, R @ self.body["axis"]
        if terms.SURFACE_KINDS[self.wall["kind"]] == "plane":
            return self._beside(-self.wall["axis"], centre, axis)
        if self.body["axis"].any():
            return self._nearest(lambda e: self.wall["radius"] + self._beside(e, centre, axis), centre.shape[:-1])
        apart = centre - self.wall["origin"]
        gap = self._inside(apart) if self.body["is_hollow"] else self._distance(apart)
        return np.asarray(gap - self.body["radius"])

    def _beside(self, e: np.ndarray, centre: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Distance from the plane through the wall's point and across e (..., 3), which points out of the free side."""
        tilt = (e * axis).sum(axis=-1)
        stretch = np.sqrt(1 - tilt**2)
        if self.body["cut"].any():
            slope = axis @ self.body["cut"]
            centre = centre + ((self.body["centre"] - centre) @ self.body["cut"] / slope)[..., None] * axis
            stretch = np.sqrt(1 + (tilt / slope) ** 2)
        return np.asarray(-(e * (centre - self.wall["origin"])).sum(axis=-1) - self.body["radius"] * stretch)

    def _nearest(self, gap: Callable[[np.ndarray], np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
        """The least gap (...) of all directions that the wall has."""
        x, opening = self.body["towards"], self.body["opening"]
        y = np.cross(self.wall["axis"], x)

        def at(azimuth: np.ndarray) -> np.ndarray:
            azimuth = azimuth.clip(-opening, opening)[..., None] if opening < np.pi else azimuth[..., None]
            return gap(np.cos(azimuth) * x + np.sin(azimuth) * y)

        tried = np.linspace(-opening, opening, DIRECTIONS + 1)
        width = tried[1] - tried[0]
        best = tried[np.argmin([at(np.full(shape, azimuth)) for azimuth in tried], axis=0)]
        low, high = best - width, best + width
        for _ in range(NARROWINGS):
            inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
            left = at(inner) < at(outer)
            low, high = np.where(left, low, inner), np.where(left, outer, high)
        return at((low + high) / 2)

    def _inside(self, apart: np.ndarray) -> np.ndarray:
        """Distance (...) [mm] from the nearest tangent plane of a hollow wall."""
        if terms.SURFACE_KINDS[self.wall["kind"]] == "sphere":
            along = apart @ self.body["towards"]
            across = np.linalg.norm(apart - along[..., None] * self.body["towards"], axis=-1)
            beyond = np.maximum(np.arctan2(across, along) - self.body["opening"], 0)
            return np.asarray(self.wall["radius"] - np.hypot(across, along) * np.cos(beyond))
        along, angle = apart @ self.wall["axis"], self.wall["angle"]
        base = self.wall["radius"] + along * np.sin(angle)
        return self._nearest(lambda e: base - np.cos(angle) * (e * apart).sum(axis=-1), apart.shape[:-1])

    def _distance(self, apart: np.ndarray) -> np.ndarray:
        """Distance (...) [mm] from the wall's surface, positive outside, of what is `apart` (..., 3) from its point."""
        kind, wall = terms.SURFACE_KINDS[self.wall["kind"]], self.wall
        if kind == "sphere":
            return np.asarray(np.linalg.norm(apart, axis=-1) - wall["radius"])
        along = apart @ wall["axis"]
        across = np.linalg.norm(apart - along[..., None] * wall["axis"], axis=-1)
        if kind == "cylinder":
            return np.asarray(across - wall["radius"])
        if kind == "cone":
            return np.asarray(across * np.cos(wall["angle"]) - along * np.sin(wall["angle"]))
        return np.asarray(np.hypot(across - wall["radius"], along) - wall["minor"])


class ArchivedFaces:
    """The faces of features, from the groups `contact` and `sample` of an archive, variables by name."""

    def __init__(self, contact: Mapping[str, np.ndarray], sample: Mapping[str, np.ndarray]) -> None:
        self._contact, self._sample = contact, sample

    def displacement(self, face: int, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """tau (realization, 3) [mm] and rho (realization, 3) [rad] for deviations (realization, contributor)."""
        found = deviations @ self._contact[terms.FACE_TWIST.name][face].T
        return found[:, :3], found[:, 3:]

    def height(self, face: int, deviations: np.ndarray) -> np.ndarray:
        """How much farther out the face lies (realization,) [mm]; 0 of face -1."""
        if face < 0:
            return np.zeros(len(deviations))
        return np.asarray(deviations @ self._contact[terms.FACE_HEIGHT.name][face])

    def placed(self, face: int, deviations: np.ndarray, R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where a face is, R and t, of a part at R (realization, state, 3, 3), t (realization, state, 3) [mm]."""
        if face < 0:
            return R, t
        tau, rho = self.displacement(face, deviations)
        turned, centre = Rotation.from_rotvec(rho).as_matrix(), self._contact[terms.FACE_CENTRE.name][face]
        moved = tau + centre - turned @ centre
        return R @ turned[:, None], np.einsum("...ij,...j->...i", R, moved[:, None]) + t

    def held(self, locators: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """How far locators move their parts (realization, locator) [mm]."""
        found = deviations[:, locators].copy()
        for place, locator in enumerate(locators):
            face = int(self._sample[terms.FACE_OF_LOCATOR.name][locator]) if terms.FACE_OF_LOCATOR.name in self._sample else -1
            if face >= 0:
                tau, rho = self.displacement(face, deviations)
                arm = self._sample[terms.LOCATOR_POINT.name][locator] - self._contact[terms.FACE_CENTRE.name][face]
                inward = self._sample[terms.LOCATOR_DIRECTION.name][locator]
                found[:, place] += self.height(face, deviations) - (tau + np.cross(rho, arm)) @ inward
        return found


class ArchivedPair:
    """The nominal contact points of a pair, and where the archived poses put them.

    places   (point,): which of the archived contact points have gaps, numbers from the pair's first one on
    """

    def __init__(self, tree: xr.DataTree, pair: int) -> None:
        contact = {str(name): values.values for name, values in tree.children["contact"].to_dataset().data_vars.items()}
        own = contact[terms.PAIR_OF_POINT.name] == pair
        points = (terms.MOVING_POINT, terms.REFERENCE_POINT, terms.REFERENCE_NORMAL)
        self.moving_point, self.reference_point, self.normal = (contact[variable.name][own] for variable in points)
        self.moving_part, self.reference_part = (
            int(contact[variable.name][pair]) for variable in (terms.MOVING_PART, terms.REFERENCE_PART)
        )
        self.locators = contact[terms.LOCATOR_OF_POINT.name][own]
        self.round = archived_points(contact, np.flatnonzero(own))
        sample = {str(name): values.values for name, values in tree.children["sample"].to_dataset().data_vars.items()}
        self.faces = ArchivedFaces(contact, sample)
        self.moving_face, self.reference_face = (
            int(contact[variable.name][pair]) if variable.name in contact else -1
            for variable in (terms.FACE_OF_MOVING, terms.FACE_OF_REFERENCE)
        )
        self.places = np.arange(own.sum())
        if self.round:
            of_round = contact[terms.POINT_OF_ROUND.name]
            self.places = of_round[np.isin(of_round, np.flatnonzero(own))] - np.flatnonzero(own)[0]
        self.facing = contact[terms.FACING.name][own] if terms.FACING.name in contact else None

    @property
    def _is_drawn(self) -> bool:
        """Whether deviations matter beside poses."""
        return bool((self.locators >= 0).any()) or max(self.moving_face, self.reference_face) >= 0

    def gaps(self, rows: Rows, some: slice) -> np.ndarray:
        """Gaps (realization, state, point) [mm] of some realizations, at the `places`.

        Raises NotKeptError, with the name of a variable that they need and the archive does not have.
        """
        moving, reference = (_pose(rows, some, part) for part in (self.moving_part, self.reference_part))
        drawn = _needed(rows, terms.DEVIATION.name, some) if self._is_drawn else np.zeros((1, 0))
        R_m, t_m = self.faces.placed(self.moving_face, drawn, *moving)
        R_r, t_r = self.faces.placed(self.reference_face, drawn, *reference)
        of_moving, of_reference = (self.faces.height(face, drawn) for face in (self.moving_face, self.reference_face))
        if self.round:
            turn = np.broadcast_to(R_r.swapaxes(-1, -2), R_m.shape)
            apart = np.einsum("...ij,...j->...i", turn, t_m - t_r)
            grown = (of_moving[:, None], of_reference[:, None])
            return np.stack([point.gaps(turn @ R_m, apart, *grown) for point in self.round], axis=-1)
        # (R_m P_m + t_m - R_r P_r - t_r) . R_r n / |R_r n|, multiplied out: sums over points that matrix products form.
        back, n = R_r.swapaxes(-1, -2), self.normal
        apart = np.einsum("...ij,...j->...i", np.broadcast_to(back, R_m.shape), t_m - t_r)
        from_moving = _products(back @ R_m, n, self.moving_point) + apart @ n.T
        from_reference, length = (_products(back @ R_r, n, of) for of in (self.reference_point, n))
        gaps = (from_moving - from_reference) / np.sqrt(length)
        if self.facing is not None:
            gaps -= of_moving[:, None, None] * self.facing + of_reference[:, None, None]
        supports = self.locators >= 0
        if supports.any():
            gaps[..., supports] -= self.faces.held(self.locators[supports], drawn)[:, None]
        return np.asarray(gaps)


def _products(matrix: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left . matrix right (..., point) of matrices (..., 3, 3) and two vectors (point, 3)."""
    of_entries = left[:, :, None] * right[:, None, :]
    return np.asarray(matrix.reshape(*matrix.shape[:-2], 9) @ of_entries.reshape(-1, 9).T)


def _pose(rows: Rows, some: slice, part: int) -> tuple[np.ndarray, np.ndarray]:
    """R (realization, state, 3, 3) and t (realization, state, 3) [mm]; of the ground, part -1, one that moves nothing."""
    if part < 0:
        return np.eye(3)[None, None], np.zeros((1, 1, 3))
    return _needed(rows, terms.ROTATION.name, some)[:, :, part], _needed(rows, terms.TRANSLATION.name, some)[:, :, part]


def _needed(rows: Rows, name: str, some: slice) -> np.ndarray:
    if name not in rows:
        raise NotKeptError(f'"{name}"')
    return np.asarray(rows[name][some].values)
