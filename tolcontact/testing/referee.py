"""The referee: gaps computed from an archive alone, independently of the simulation.

No run uses it: the equations of gaps are in `mechanics/`, and the assertion compares them with the results of this module. The
distance of a ball from a wall is the distance of its centre minus its radius. The distance of a shaft inside a wall is the
distance of its end from the nearest tangent plane of the wall: the referee samples all directions, and refines the nearest one.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.discretization import ContactPoints, rim_points
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.surface import Surface
from tolcontact.testing.archived_faces import ArchivedFaces

DIRECTIONS = 72  # initial samples
NARROWINGS = 60
POSES_AT_ONCE = 256
GOLDEN = (np.sqrt(5) - 1) / 2
Rows = Mapping[str, xr.DataArray]  # variables (realization, ...) by name


def archived_points(contact: Mapping[str, np.ndarray], points: np.ndarray) -> "list[ArchivedPoint]":
    """Return the contact points that belong to round faces, out of the indices `points` (point,).

    contact   variables of the archive's group of that name, by name
    """
    if terms.POINT_OF_ROUND.name not in contact:
        return []
    places = np.flatnonzero(np.isin(contact[terms.POINT_OF_ROUND.name], points))
    wall, body = (
        {name: contact[variable.name][places] for name, variable in variables.items()}
        for variables in (terms.OF_WALL, terms.OF_ROUND)
    )
    return [
        ArchivedPoint(*({name: values[k] for name, values in side.items()} for side in (wall, body)))
        for k in range(len(places))
    ]


class ArchivedPoint(NamedTuple):
    """A ball, or the end of a shaft, and a wall, with values named as in the vocabulary."""

    wall: Mapping[str, Any]
    body: Mapping[str, Any]

    def gaps(self, R: np.ndarray, t: np.ndarray, of_moving: Any = 0.0, of_reference: Any = 0.0) -> np.ndarray:
        """Return gaps (...) [mm] with the moving part at R (..., 3, 3), t (..., 3) [mm] in the reference part's frame.

        The moving face is offset outwards by `of_moving` (...), the reference face by `of_reference` (...) [mm].
        """
        of_body, of_wall = (of_moving, of_reference) if self.body["on_moving"] else (of_reference, of_moving)
        grown = ArchivedPoint(self.wall, {**self.body, "radius": self.body["radius"] + of_body})
        return grown._nominal_gaps(R, t) - of_wall

    def _nominal_gaps(self, R: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return gaps (...) [mm] at these poses, for faces without offset."""
        if not self.body["on_moving"]:
            R = R.swapaxes(-1, -2)
            t = -np.einsum("...ij,...j->...i", R, t)
        centre, axis = R @ self.body["centre"] + t, R @ self.body["axis"]
        if terms.SURFACE_KINDS[self.wall["kind"]] == "plane":
            return self._distance_from_plane(-self.wall["axis"], centre, axis)
        if self.body["axis"].any():
            return self._nearest(lambda e: self.wall["radius"] + self._distance_from_plane(e, centre, axis), centre.shape[:-1])
        offset = centre - self.wall["origin"]
        gap = self._inside(offset) if self.body["is_hollow"] else self._distance(offset)
        return gap - self.body["radius"]

    def _distance_from_plane(self, e: np.ndarray, centre: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Return the distance from the plane through the wall's point with normal e (..., 3) into the wall."""
        tilt = (e * axis).sum(axis=-1)
        stretch = np.sqrt(1 - tilt**2)
        if self.body["cut"].any():
            slope = axis @ self.body["cut"]
            centre = centre + ((self.body["centre"] - centre) @ self.body["cut"] / slope)[..., None] * axis
            stretch = np.sqrt(1 + (tilt / slope) ** 2)
        return -(e * (centre - self.wall["origin"])).sum(axis=-1) - self.body["radius"] * stretch

    def _nearest(self, gap: Callable[[np.ndarray], np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
        """Return the least gap (...) over all directions of the wall."""
        x, opening = self.body["towards"], self.body["opening"]
        y = np.cross(self.wall["axis"], x)

        def at(azimuth: np.ndarray) -> np.ndarray:
            azimuth = azimuth.clip(-opening, opening)[..., None] if opening < np.pi else azimuth[..., None]
            return gap(np.cos(azimuth) * x + np.sin(azimuth) * y)

        azimuths = np.linspace(-opening, opening, DIRECTIONS + 1)
        width = azimuths[1] - azimuths[0]
        best = azimuths[np.argmin([at(np.full(shape, azimuth)) for azimuth in azimuths], axis=0)]
        low, high = best - width, best + width
        for _ in range(NARROWINGS):
            inner, outer = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
            is_inner = at(inner) < at(outer)
            low, high = np.where(is_inner, low, inner), np.where(is_inner, outer, high)
        return at((low + high) / 2)

    def _inside(self, offset: np.ndarray) -> np.ndarray:
        """Return the distance (...) [mm], `offset` (..., 3) from the wall's point, to the nearest tangent of a hollow wall."""
        if terms.SURFACE_KINDS[self.wall["kind"]] == "sphere":
            along = offset @ self.body["towards"]
            across = np.linalg.norm(offset - along[..., None] * self.body["towards"], axis=-1)
            beyond = np.maximum(np.arctan2(across, along) - self.body["opening"], 0)
            return self.wall["radius"] - np.hypot(across, along) * np.cos(beyond)
        along, angle = offset @ self.wall["axis"], self.wall["angle"]
        base = self.wall["radius"] + along * np.sin(angle)
        return self._nearest(lambda e: base - np.cos(angle) * (e * offset).sum(axis=-1), offset.shape[:-1])

    def _distance(self, offset: np.ndarray) -> np.ndarray:
        """Return the distance (...) [mm], `offset` (..., 3) from the wall's point, to its surface; positive outside."""
        kind, wall = terms.SURFACE_KINDS[self.wall["kind"]], self.wall
        if kind == "sphere":
            return np.linalg.norm(offset, axis=-1) - wall["radius"]
        along = offset @ wall["axis"]
        across = np.linalg.norm(offset - along[..., None] * wall["axis"], axis=-1)
        if kind == "cylinder":
            return across - wall["radius"]
        if kind == "cone":
            return across * np.cos(wall["angle"]) - along * np.sin(wall["angle"])
        return np.hypot(across - wall["radius"], along) - wall["minor"]


class ArchivedBending:
    """How elastic parts open the gaps at some contact points, by their indices; `loads` are the loads at these points.

    holds   (load,): whether it is a two-sided locator, whose gap counts either way
    """

    def __init__(self, tree: xr.DataTree, points: np.ndarray) -> None:
        group = tree.children[terms.ELASTIC_GROUP].to_dataset()
        self.loads = np.flatnonzero(np.isin(group[terms.POINT_OF_LOAD.name].values, points))
        self.holds = group[terms.HOLDS.name].values[self.loads] != 0
        self._by_load = group[terms.FLEXIBILITY.name].values[self.loads]
        self._by_forces = group[terms.OPENING.name].values[self.loads]
        self._weld_rows = group[terms.WELD_OF_LOAD.name].values[self.loads]

    def kept(self, gaps: np.ndarray) -> np.ndarray:
        """Return the gaps (realization, point) [mm] that welds keep, from those of all welds; 0 of other points."""
        return np.where(self._weld_rows >= 0, gaps[:, self._weld_rows], 0.0) if gaps.size else np.zeros((1, len(self.loads)))

    def openings(self, loads: np.ndarray) -> np.ndarray:
        """Return the openings (realization, point) [mm] under reactions `loads` (realization, load) [N]."""
        return np.asarray(loads @ self._by_load.T + self._by_forces)


class ArchivedPair:
    """The nominal contact points of a pair, and their positions at the archived poses.

    With a `meeting`, the faces are bounded, and contact points are searched again at the archived poses; with form deviation
    the pair also touches in between, at points of the `nominal` pair.
    """

    def __init__(
        self, tree: xr.DataTree, pair: int, meeting: Meeting | None = None, nominal: ContactPoints | None = None
    ) -> None:
        self.meeting, self.nominal = meeting, nominal
        contact = {str(name): values.values for name, values in tree.children["contact"].to_dataset().data_vars.items()}
        is_own = contact[terms.PAIR_OF_POINT.name] == pair
        points = (terms.MOVING_POINT, terms.REFERENCE_POINT, terms.REFERENCE_NORMAL)
        self.moving_point, self.reference_point, self.normal = (contact[variable.name][is_own] for variable in points)
        self.moving_part, self.reference_part = (
            int(contact[variable.name][pair]) for variable in (terms.MOVING_PART, terms.REFERENCE_PART)
        )
        self.locators = contact[terms.LOCATOR_OF_POINT.name][is_own]
        self.round = archived_points(contact, np.flatnonzero(is_own))
        sample = {str(name): values.values for name, values in tree.children["sample"].to_dataset().data_vars.items()}
        self.faces = ArchivedFaces(contact, sample)
        self.moving_face, self.reference_face = (
            int(contact[variable.name][pair]) if variable.name in contact else -1
            for variable in (terms.FACE_OF_MOVING, terms.FACE_OF_REFERENCE)
        )
        self.coordinate_error = (
            float(contact[terms.COORDINATE_ERROR.name][pair]) if terms.COORDINATE_ERROR.name in contact else 0.0
        )
        self.facing = contact[terms.FACING.name][is_own] if terms.FACING.name in contact else None
        self.bending = ArchivedBending(tree, np.flatnonzero(is_own)) if terms.ELASTIC_GROUP in tree.children else None

    @property
    def _needs_deviations(self) -> bool:
        """Whether gaps depend on deviations as well as on poses: for supports, and for deviating faces."""
        return bool((self.locators >= 0).any()) or max(self.moving_face, self.reference_face) >= 0

    def gaps(self, rows: Rows, piece: slice) -> np.ndarray:
        """Return the gaps (realization, state, point) [mm] of a piece of the realizations; parts bend in corrected states only.

        Raises AssertionError, with the name of a required variable that the archive does not have.
        """
        gaps = self._rigid_gaps(rows, piece)
        if self.bending is not None and self.bending.loads.size:
            gaps[:, terms.CORRECTED] += self.bending.openings(_needed(rows, terms.LOAD.name, piece))
            gaps[:, terms.CORRECTED] -= self.bending.kept(_needed(rows, terms.WELD_GAP.name, piece))
            gaps[:, terms.CORRECTED, self.bending.holds] *= -np.sign(gaps[:, terms.CORRECTED, self.bending.holds])
        return gaps

    def _rigid_gaps(self, rows: Rows, piece: slice) -> np.ndarray:
        """Return the gaps (realization, state, point) [mm] between stress-free parts."""
        moving, reference = (_pose(rows, piece, part) for part in (self.moving_part, self.reference_part))
        deviations = _needed(rows, terms.DEVIATION.name, piece) if self._needs_deviations else np.zeros((1, 0))
        R_m, t_m = self.faces.placed(self.moving_face, deviations, *moving)
        R_r, t_r = self.faces.placed(self.reference_face, deviations, *reference)
        of_moving, of_reference = (self.faces.height(face, deviations) for face in (self.moving_face, self.reference_face))
        if self.round or self.meeting:
            turn = np.broadcast_to(R_r.swapaxes(-1, -2), R_m.shape)
            offset = np.einsum("...ij,...j->...i", turn, t_m - t_r)
            grown = (of_moving[:, None], of_reference[:, None])
            if self.meeting:
                return (self._gaps_at_ends(turn @ R_m, offset, deviations) - sum(grown))[..., None]
            grown = (of_moving[:, None], of_reference[:, None] - self.coordinate_error)
            return np.stack([point.gaps(turn @ R_m, offset, *grown) for point in self.round], axis=-1)
        # (R_m P_m + t_m - R_r P_r - t_r) . R_r n / |R_r n|, expanded into sums over points that are matrix products.
        back, n = R_r.swapaxes(-1, -2), self.normal
        offset = np.einsum("...ij,...j->...i", np.broadcast_to(back, R_m.shape), t_m - t_r)
        from_moving = _products(back @ R_m, n, self.moving_point) + offset @ n.T
        from_reference, length = (_products(back @ R_r, n, vectors) for vectors in (self.reference_point, n))
        gaps = (from_moving - from_reference) / np.sqrt(length)
        if self.facing is not None:
            gaps -= of_moving[:, None, None] * self.facing + of_reference[:, None, None]
            gaps -= (self.faces.form(self.moving_face, deviations, self.moving_point) * self.facing)[:, None]
            gaps -= self.faces.form(self.reference_face, deviations, self.reference_point)[:, None]
        supports = self.locators >= 0
        if supports.any():
            locators = self.locators[supports]
            along = np.sign((self.normal[supports] * self.faces.directions(locators)).sum(axis=1))  # -1 of springs that pull
            gaps[..., supports] -= (along * self.faces.pushes(locators, deviations))[:, None]
        return gaps

    def _form(self, deviations: np.ndarray, P_m: np.ndarray, P_r: np.ndarray) -> np.ndarray:
        """Return the sum of the form deviations (realization, point) [mm] of both faces at their points P_m, P_r."""
        return self.faces.form(self.moving_face, deviations, P_m) + self.faces.form(self.reference_face, deviations, P_r)

    @property
    def _has_form(self) -> bool:
        return any(self.faces.modes(face, np.zeros((1, 3)))[0].size for face in (self.moving_face, self.reference_face))

    def _gaps_at_ends(self, R: np.ndarray, t: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """Return the least gaps (realization, state) [mm] over all contact points, for faces without offset.

        The moving part is at R (realization, state, 3, 3), t (realization, state, 3) [mm] in the reference part's frame.
        """
        assert self.meeting is not None
        X_RM = np.concatenate([R.reshape(-1, 9), t.reshape(-1, 3)], axis=1)
        by_pose = np.broadcast_to(deviations[:, None], (*R.shape[:2], deviations.shape[1])).reshape(len(X_RM), -1)
        pieces = []
        for start in range(0, len(X_RM), POSES_AT_ONCE):
            piece = slice(start, start + POSES_AT_ONCE)
            places = self.meeting.at(X_RM[piece])
            gaps = places.gaps
            if self._has_form:
                gaps = gaps - self._form(by_pose[piece], places.P_m, places.P_r)
                gaps = np.concatenate([gaps, self._gaps_over_face(X_RM[piece], by_pose[piece])], axis=1)
            pieces.append(gaps.min(axis=1, initial=np.inf))
        return np.concatenate(pieces).reshape(R.shape[:-2])

    def _gaps_over_face(self, X_RM: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """Return gaps (n, point) [mm] of points inside the faces; infinite for points outside their rims."""
        assert self.nominal is not None
        R, t = X_RM[:, :9].reshape(-1, 3, 3), X_RM[:, None, 9:]
        across, rim_gaps = rim_points(self.nominal, X_RM)
        moved = self.moving_point @ R.swapaxes(1, 2) + t
        gaps = ((moved - self.reference_point) * self.normal).sum(axis=2)
        gaps -= self._form(deviations, self.moving_point, moved - gaps[..., None] * self.normal)
        at_rim = rim_gaps - self._form(deviations, across, self.nominal.reference_rim)
        gaps[~_are_over(self.nominal.reference_face, moved)] = np.inf
        at_rim[~_are_over(self.nominal.moving_face, across)] = np.inf
        return np.concatenate([gaps, at_rim], axis=1)


def _are_over(face: Surface | None, places: np.ndarray) -> np.ndarray:
    """Return whether points (n, point, 3) are over a face, according to their nearest points on its triangles."""
    assert face is not None
    return np.asarray(face.project(places.reshape(-1, 3))[2].reshape(places.shape[:2]))


def _products(matrix: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a . matrix b (..., point) for matrices (..., 3, 3) and vectors (point, 3)."""
    entries = a[:, :, None] * b[:, None, :]
    return matrix.reshape(*matrix.shape[:-2], 9) @ entries.reshape(-1, 9).T


def _pose(rows: Rows, piece: slice, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Return R (realization, state, 3, 3) and t (realization, state, 3) [mm]; the identity for the ground, part -1."""
    if part < 0:
        return np.eye(3)[None, None], np.zeros((1, 1, 3))
    return _needed(rows, terms.ROTATION.name, piece)[:, :, part], _needed(rows, terms.TRANSLATION.name, piece)[:, :, part]


def _needed(rows: Rows, name: str, piece: slice) -> np.ndarray:
    if name not in rows:
        raise AssertionError(f'gaps cannot be computed again without "{name}", which was not kept: tc.run(..., keep="all")')
    return np.asarray(rows[name][piece].values)
