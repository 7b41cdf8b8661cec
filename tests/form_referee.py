"""A referee of contact between two planes with form: their gap on a fine grid, from an archive alone, in plain NumPy.

The referee shares no code with the search for contact. Each point of the moving plane is displaced along its normal by its
form, moved with its part, and compared with the height of the reference plane at its foot there.
"""

from typing import NamedTuple

import numpy as np

DECAY = {
    "squared exponential": lambda r: np.exp(-(r**2) / 2),
    "matern 5/2": lambda r: (1 + np.sqrt(5) * r + 5 * r**2 / 3) * np.exp(-np.sqrt(5) * r),
    "matern 3/2": lambda r: (1 + np.sqrt(3) * r) * np.exp(-np.sqrt(3) * r),
}


class Rectangle(NamedTuple):
    """A flat face in the nominal assembly: a corner, two perpendicular edges from there, and the outward normal, each (3,)."""

    corner: np.ndarray
    sides: np.ndarray
    normal: np.ndarray

    def grid(self, step):
        """Points (point, 3) at most a `step` [mm] apart, with the rim among them."""
        shares = [np.linspace(0, 1, int(np.ceil(np.linalg.norm(side) / step)) + 1) for side in self.sides]
        return self.corner + np.stack(np.meshgrid(*shares, indexing="ij"), axis=-1).reshape(-1, 2) @ self.sides

    def rim(self, step):
        """Points (point, 3) of the four edges."""
        points = self.grid(step)
        return points[(np.abs(2 * self.shares(points) - 1) > 1 - 1e-9).any(axis=1)]

    def shares(self, points):
        """Coordinates (point, 2) of points, from 0 to 1 over the face."""
        return (points - self.corner) @ self.sides.T / (self.sides**2).sum(axis=1)

    def holds(self, points):
        """Whether points (point, 3) stand over the face."""
        return (np.abs(2 * self.shares(points) - 1) <= 1 + 1e-9).all(axis=1)


class ArchivedHeights:
    """The heights of one face with form, or of a face without (-1), from the variables of an archive."""

    def __init__(self, contact, face):
        self.has_form = face >= 0 and bool(contact.form_covariance.values[face])
        if not self.has_form:
            return
        assert not np.any(contact.face_twist.values[face]) and not np.any(contact.face_height.values[face])
        mine = contact.face_of_station.values == face
        self.columns = contact.form_contributor.values[face]
        self.length, self.decay = contact.form_length.values[face], DECAY[contact.form_covariance.values[face]]
        self.stations, self.weights = contact.station.values[mine], contact.station_weight.values[mine]
        self.removed, self.normal = contact.form_removed.values[face], contact.form_surface_axis.values[face]

    def modes(self, places):
        """Heights (place, mode) of the modes at places (place, 3) [mm]."""
        n = np.broadcast_to(self.normal, places.shape)
        displaced = np.column_stack([np.ones(len(places)), n, np.cross(places, n)])
        r = np.sqrt(np.maximum(((places[:, None] - self.stations) ** 2).sum(axis=2), 0)) / self.length
        return self.decay(r) @ self.weights - displaced @ self.removed.T

    def factors(self, deviation):
        return np.where(self.columns >= 0, deviation[self.columns], 0.0)


def deepest(run, moving, reference, share=0.1, spacing=None):
    """The depth (realization,) [mm] to which two rectangles lie in each other at corrected poses; below 0 where they do not.

    share     of the usual spacing of contact points: the step of the grid
    spacing   [mm] in its place
    """
    contact = run["contact"].to_dataset()
    heights = [ArchivedHeights(contact, int(contact[f"face_of_{side}"].values[0])) for side in ("moving", "reference")]
    lengths = [form.length for form in heights if form.has_form]
    step = share * (spacing or 0.71 / 5 * min(lengths))
    points = moving.grid(step)
    modes = heights[0].modes(points) if heights[0].has_form else None
    rim = reference.rim(step)
    poses = [
        (run.rotation.sel(state="corrected").values[:, part], run.translation.sel(state="corrected").values[:, part])
        for part in (int(contact.moving_part.values[0]), int(contact.reference_part.values[0]))
    ]
    depths = np.empty(run.sizes["realization"])
    for k, deviation in enumerate(run["sample"].deviation.values):
        (R_m, t_m), (R_r, t_r) = ((R[k], t[k]) for R, t in poses)
        R, t = R_r.T @ R_m, R_r.T @ (t_m - t_r)
        across = _across(R, t, moving, reference.normal, rim)
        P_m = np.concatenate([points, across[moving.holds(across)]])
        of_moving = np.zeros(len(P_m))
        if heights[0].has_form:
            factors = heights[0].factors(deviation)
            of_moving = np.concatenate([modes @ factors, heights[0].modes(P_m[len(points) :]) @ factors])
        moved = (P_m + of_moving[:, None] * moving.normal) @ R.T + t
        level = (moved - reference.corner) @ reference.normal
        feet = moved - level[:, None] * reference.normal
        is_over = reference.holds(P_m @ R.T + t) | (np.arange(len(P_m)) >= len(points))
        gaps = level
        if heights[1].has_form:
            gaps = level - heights[1].modes(feet) @ heights[1].factors(deviation)
        depths[k] = -np.min(gaps[is_over], initial=np.inf)
    return depths


def _across(R, t, moving, normal, rim):
    """The points of the moving plane that stand over points `rim` (point, 3) of the reference face, along its normal."""
    back, along = (rim - t) @ R, normal @ R
    return back + ((moving.corner - back) @ moving.normal / (along @ moving.normal))[:, None] * along
