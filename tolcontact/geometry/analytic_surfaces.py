"""Surfaces that are known exactly: planes, cylinders, cones, spheres and tori, in double precision. Lengths in mm."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tolcontact.vocabulary import SURFACE_KINDS

NUMBERS = ("origin", "axis", "radius", "minor", "angle")
METRE = 1e3  # [mm], the reader's unit
ROUNDS = 4  # of Newton's method: as many as bring vertices off by micrometres to the last digit
PARALLEL = 0.05  # smallest relative singular value of the normals in a vertex whose surfaces count as different ones


@dataclass(frozen=True, eq=False)
class Form:
    """A surface without ends.

    kind     one of `SURFACE_KINDS`
    origin   a point of a plane or of the axis (3,) [mm]: a cone's apex, the centre of a sphere or torus
    axis     normal of a plane, or unit vector along the axis (3,): from a cone's apex into it; of a sphere it has no meaning
    radius   [mm] of a cylinder or sphere, or of the circle in a torus' middle; else 0
    minor    [mm] radius of a torus' tube; else 0
    angle    [rad] between axis and surface of a cone; else 0
    residual [mm] how far the vertices that it was fitted to lie off it at most
    is_fitted  whether it was; else a file states it
    """

    kind: str
    origin: np.ndarray
    axis: np.ndarray
    radius: float = 0.0
    minor: float = 0.0
    angle: float = 0.0
    residual: float = 0.0
    is_fitted: bool = False

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distances (point,) [mm] of `points` (point, 3) [mm], and their gradients (point, 3): unit vectors.

        Positive in front of a plane, and outside of anything round. Where the nearest point is not unique (on an axis) the
        gradient is 0.
        """
        apart = points - self.origin
        if self.kind == "plane":
            return apart @ self.axis, np.broadcast_to(self.axis, points.shape)
        if self.kind == "sphere":
            r, outward = _length_and_direction(apart)
            return r - self.radius, outward
        along = apart @ self.axis
        r, outward = _length_and_direction(apart - along[:, None] * self.axis)
        if self.kind == "cylinder":
            return r - self.radius, outward
        if self.kind == "cone":
            cos, sin = np.cos(self.angle), np.sin(self.angle)
            # The nearest of the two nappes' lines, which are one line through the apex for each side.
            side = np.where(along < 0, -1.0, 1.0)
            return r * cos - side * along * sin, cos * outward - (side * sin)[:, None] * self.axis
        tube, away = _length_and_direction((r - self.radius)[:, None] * outward + along[:, None] * self.axis)
        return tube - self.minor, away

    def placed(self, R: np.ndarray, t: np.ndarray) -> "Form":
        """It turned by R (3, 3), then moved by t (3,) [mm]."""
        return replace(self, origin=R @ self.origin + t, axis=R @ self.axis)

    def project(self, points: np.ndarray) -> np.ndarray:
        """The nearest points of the surface (point, 3) [mm]."""
        for _ in range(2):  # once is exact but for rounding
            value, slope = self.distance(points)
            points = points - value[:, None] * slope
        return points


def form_arrays(of: Sequence[Form | None]) -> dict[str, np.ndarray]:
    """Surfaces as arrays (surface, ...) by name, as an archive has them; `kind` is its number in SURFACE_KINDS, -1 of None."""
    known = [form or Form("plane", np.zeros(3), np.zeros(3)) for form in of]
    kinds = np.array([-1 if form is None else SURFACE_KINDS.index(form.kind) for form in of])
    return {"kind": kinds} | {name: np.array([getattr(form, name) for form in known]) for name in NUMBERS}


def forms_of(arrays: Mapping[str, np.ndarray]) -> list[Form | None]:
    """Surfaces from such arrays."""
    numbers = {name: values for name, values in arrays.items() if name != "kind"}
    return [
        None if kind < 0 else Form(SURFACE_KINDS[kind], **{name: values[k] for name, values in numbers.items()})
        for k, kind in enumerate(arrays["kind"])
    ]


def forms(text: str) -> list[Form | None]:
    """The surface of each B-rep face, from what the reader said of them; None of those that are none of these."""
    return [_form(said) if said and said.get("type") in SURFACE_KINDS else None for said in json.loads(text)]


def _form(said: dict[str, Any]) -> Form | None:
    kind = said["type"]
    origin = METRE * np.array(said[{"cone": "apex", "sphere": "center", "torus": "center"}.get(kind, "origin")], dtype=float)
    axis = np.array(said.get("normal" if kind == "plane" else "axis", (0.0, 0.0, 1.0)), dtype=float)
    sizes = [METRE * float(said.get(word, 0.0)) for word in (("major_radius" if kind == "torus" else "radius"), "minor_radius")]
    angle = float(said.get("semi_angle", 0.0))
    numbers = np.concatenate([origin, axis, sizes, [angle]])
    if not (np.isfinite(numbers).all() and np.linalg.norm(axis) > 0):
        return None
    # The kernel's cones may open against their axis.
    return Form(kind, origin, np.sign(angle or 1.0) * axis / np.linalg.norm(axis), sizes[0], sizes[1], abs(angle))


def believed(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, of: Sequence[Form | None], most: float
) -> list[Form | None]:
    """The surfaces `of` a shape's B-rep faces, but for those that its own vertices are farther from than `most` [mm]."""
    kept = list(of)
    for number, form in enumerate(of):
        own = np.unique(faces[brep == number]) if form is not None else ()
        if form is not None and not (len(own) and np.abs(form.distance(vertices[own])[0]).max() <= most):
            kept[number] = None
    return kept


def onto(vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, of: Sequence[Form | None], most: float) -> np.ndarray:
    """`vertices` (vertex, 3) [mm], moved the shortest way onto all analytic surfaces that meet in them, by `most` at most.

    faces   (face, 3), each of the B-rep face `brep` (face,) whose surface is one of those `of` the shape
    """
    known = np.array([form is not None for form in of])
    meetings = np.unique(np.column_stack([faces.ravel(), np.repeat(brep, 3)]), axis=0)
    meetings = meetings[known[meetings[:, 1]]]
    moved = np.array(vertices)
    for _ in range(ROUNDS):
        moved -= _steps(moved, meetings, of)
    is_near = np.linalg.norm(moved - vertices, axis=1) <= most
    return np.where(is_near[:, None], moved, vertices)


def _steps(vertices: np.ndarray, meetings: np.ndarray, of: Sequence[Form | None]) -> np.ndarray:
    """Shortest steps (vertex, 3) that end, to first order, on all surfaces that meet there: `meetings` (meeting, 2)."""
    value, slope = np.zeros(len(meetings)), np.zeros((len(meetings), 3))
    for number in np.unique(meetings[:, 1]):
        form, own = of[number], np.flatnonzero(meetings[:, 1] == number)
        if form is not None:
            value[own], slope[own] = form.distance(vertices[meetings[own, 0]])
    step = np.zeros_like(vertices)
    vertex, first, count = np.unique(meetings[:, 0], return_index=True, return_counts=True)
    for size in np.unique(count):
        own, at = vertex[count == size], first[count == size]
        rows = at[:, None] + np.arange(size)
        if size == 1:
            step[own] = value[at][:, None] * slope[at]
        else:
            step[own] = np.einsum("nij,nj->ni", np.linalg.pinv(slope[rows], rcond=PARALLEL), value[rows])
    return step


def _length_and_direction(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    length = np.linalg.norm(vectors, axis=1)
    return length, vectors / np.maximum(length, 1e-300)[:, None]
