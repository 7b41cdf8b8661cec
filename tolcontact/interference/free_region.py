"""Convex regions that contain one body and no part of another body's surface: a certificate that both are apart.

A region C is the common part of half-spaces and at most one hollow: points whose distance from a segment, taken across an axis,
is below a radius. Each triangle of the outer body is assigned to one of these constraints, and the level of a constraint is
its smallest value at the corners of its triangles. So no triangle reaches into C, however the outer body deviates:

- n . x of a half-space is linear, so its smallest value in a triangle occurs at a corner;
- the distance from the segment is at least e . x - max e . s over its ends s, for any unit vector e across the axis. Each
  triangle has the e along which it is nominally furthest from the segment.

Both are linear in the deviations, as the corners are. If all vertices of the inner body lie in C, which is convex, all of its
triangles do. Then both surfaces have no point in common. No component of the outer body lies in the inner one, since its
surface would lie in C. Nor does one of the inner body lie in the outer one: C contains no point of the outer surface, so it is
inside or outside as a whole. It is outside nominally, and remains so while deviations grow from 0 to their values: levels
are minima of linear functions, so C never becomes empty on the way, as it is not empty at its ends.

Hence such bodies do not interfere, and the complete test need not run.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import igl
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.interference.free_kernel import Region
from tolcontact.interference.kernel import ROUNDED
from tolcontact.interference.solid import Solid

MAX_HALF_SPACES = 64  # that are considered, from the largest facets
MAX_CORES = 16
MAX_CONSTRAINTS = 4
SAME_DIRECTION = 1e-6  # rad; for the radii at the ends of a slot, their relative difference
CORNERS = np.array(np.meshgrid(*[(0, 1)] * 3)).reshape(3, -1).T


class Constraint(NamedTuple):
    """A half-space, or the hollow around a core.

    directions  (t, 3): for each triangle of the outer body the unit vector along which its corners are compared
    offsets     (t,) [mm]: subtracted from these
    values      (v,) [mm]: values that the constraint compares, at the vertices of the inner body
    core        of a hollow (see Region), None for a half-space
    """

    directions: Float[Array, "t 3"]
    offsets: Float[Array, " t"]
    values: Float[Array, " v"]
    core: Float[Array, "3 3"] | None

    @property
    def length(self) -> float:
        """The length of the core [mm]: a slot has more room than a bore at its end."""
        return 0.0 if self.core is None else float(np.linalg.norm(self.core[2]))

    def clearances(self, corners: Float[Array, "t 3 3"]) -> Float[Array, " t"]:
        """Return how far (t,) [mm] triangles with `corners` are outside of what the inner body needs."""
        heights = np.einsum("ti,tci->tc", self.directions, corners).min(axis=1) - self.offsets
        return np.asarray(np.where(np.isfinite(heights), heights, -np.inf) - self.values.max())


def free_region(outer: Solid, inner: Solid, *, is_forward: bool) -> Region | None:
    """Return a region that nominally contains the inner body and that the outer one does not reach; None if there is none.

    The vertices of both bodies lie a little inside their surfaces.
    """
    size = float(max(np.abs(outer.vertices).max(), np.abs(inner.vertices).max()))
    corners, least = outer.corners, 2 * ROUNDED * size
    candidates = [*_half_spaces(outer, inner), *_hollows(outer, inner)]
    clearances = np.array([candidate.clearances(corners) for candidate in candidates])
    chosen = list[int]()
    is_left = np.ones(len(corners), dtype=bool)
    while is_left.any():
        counts = (clearances[:, is_left] > least).sum(axis=1)
        best = max(range(len(candidates)), key=lambda k: (counts[k], candidates[k].length, clearances[k, is_left].min()))
        if not counts[best] or len(chosen) == MAX_CONSTRAINTS:
            return None
        if candidates[best].core is not None:  # there is room for one
            clearances[[k for k in range(len(candidates)) if k != best and candidates[k].core is not None]] = -np.inf
        chosen.append(best)
        is_left &= ~(clearances[best] > least)
    turns = igl.winding_number(outer.vertices, outer.faces, np.ascontiguousarray(inner.vertices[:1]))
    if float(np.atleast_1d(turns)[0]) > 0.5:
        return None
    return _region(outer, inner, [candidates[k] for k in chosen], clearances[chosen].argmax(axis=0), size, is_forward)


def _region(
    outer: Solid, inner: Solid, constraints: Sequence[Constraint], owner: np.ndarray, size: float, is_forward: bool
) -> Region:
    """Return the region of some constraints; `owner` (t,) assigns one of them to each triangle of the outer body."""
    order = sorted(range(len(constraints)), key=lambda k: constraints[k].core is not None)
    half_spaces = [constraints[k].directions[0] for k in order if constraints[k].core is None]
    groups = [_bounds(outer, constraints[k], owner == k) for k in order]
    levels = [float(bounds.min(initial=np.inf)) for bounds, _ in groups]
    core = next((constraint.core for constraint in constraints if constraint.core is not None), None)
    if core is None:
        core = np.zeros((3, 3))
        groups.append((np.zeros(0), np.zeros((0, len(outer.columns)))))
        levels.append(np.inf)
    slopes = np.concatenate([slopes for _, slopes in groups])
    slacks = np.min([levels[place] - constraints[k].values for place, k in enumerate(order)], axis=0)
    moved, motions = inner.motions
    fixed = np.setdiff1d(np.argsort(slacks, kind="stable"), moved, assume_unique=True)
    return Region(
        normals=np.array(half_spaces).reshape(-1, 3),
        core=core,
        starts=np.cumsum([0, *(len(bounds) for bounds, _ in groups)]),
        bounds=np.concatenate([bounds for bounds, _ in groups]),
        slopes=slopes,
        levels=np.array(levels),
        steepest=np.abs(slopes).max(axis=0, initial=0.0),
        fixed=np.ascontiguousarray(inner.vertices[fixed]),
        slacks=slacks[fixed],
        moving=np.ascontiguousarray(inner.vertices[moved]),
        motions=np.ascontiguousarray(motions.swapaxes(1, 2)),
        farthest=np.linalg.norm(motions, axis=1).max(axis=0, initial=0.0),
        box=np.where(CORNERS == 0, inner.vertices.min(axis=0), inner.vertices.max(axis=0)),
        size=size,
        is_forward=is_forward,
    )


def _bounds(outer: Solid, constraint: Constraint, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds (g,) [mm] and slopes (g, k) of the level of a constraint from its assigned triangles.

    Corners whose slopes agree but for rounding, most corners of a face that varies in size, share a bound.
    """
    corners = outer.corners[triangles]
    heights = np.einsum("mi,mci->mc", constraint.directions[triangles], corners) - constraint.offsets[triangles, None]
    motions = outer.motions_of_vertices[outer.faces[triangles]]
    slopes = np.einsum("mi,mcik->mck", constraint.directions[triangles], motions).reshape(heights.size, len(outer.columns))
    unit = ROUNDED * np.maximum(np.abs(slopes).max(axis=0, initial=0.0), 1e-300)
    rounded, group = np.unique(np.round(slopes / unit), axis=0, return_inverse=True)
    bounds = np.full(len(rounded), np.inf)
    np.minimum.at(bounds, group.ravel(), heights.ravel())
    least_first = np.argsort(bounds, kind="stable")
    return bounds[least_first], (rounded * unit)[least_first]


def _half_spaces(outer: Solid, inner: Solid) -> Iterator[Constraint]:
    """Yield half-spaces along the largest facets of both bodies."""
    normals = np.concatenate([-outer.normals, inner.normals])
    corners = np.concatenate([outer.corners, inner.corners])
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    _, first, group = np.unique(np.round(normals / SAME_DIRECTION), axis=0, return_index=True, return_inverse=True)
    largest = np.argsort(-np.bincount(group.ravel(), weights=areas), kind="stable")[:MAX_HALF_SPACES]
    for n in normals[first[largest]]:
        directions = np.broadcast_to(n, (len(outer.faces), 3))
        yield Constraint(directions, np.zeros(len(directions)), inner.vertices @ n, None)


def _hollows(outer: Solid, inner: Solid) -> Iterator[Constraint]:
    """Yield the hollows around the axes of cylinders of both bodies, and between two axes at the ends of a slot."""
    centre = (inner.vertices.min(axis=0) + inner.vertices.max(axis=0)) / 2
    bulge = float(outer.bulges.max(initial=0.0))
    cores = [
        core
        for core, radius in _cores([*outer.cylinders, *inner.cylinders], bulge)
        if float(_distances(centre[None], core)[0]) < radius
    ]
    for core in cores[:MAX_CORES]:
        yield _hollow(outer.corners, inner.vertices, core)


def _cores(cylinders: Sequence[Cylinder], bulge: float) -> Iterator[tuple[np.ndarray, float]]:
    """Yield cores (see Region) and radii: of single cylinders, and of two with parallel axes and equal radii.

    Where a flat wall of a slot meets a round one, triangles protrude into the hollow by up to `bulge` [mm]. A core that
    ends a little before has its full radius, since points there are no nearer to it.
    """
    for k, cylinder in enumerate(cylinders):
        u = cylinder.axis / np.linalg.norm(cylinder.axis)
        yield np.array([u, cylinder.origin, np.zeros(3)]), cylinder.radius
        for other in cylinders[:k]:
            span = other.origin - cylinder.origin
            span = span - (span @ u) * u
            length, end = float(np.linalg.norm(span)), 2 * math.sqrt(2 * bulge * cylinder.radius)
            is_slot = abs(other.radius - cylinder.radius) < SAME_DIRECTION * cylinder.radius and length > 2 * end
            if is_slot and float(np.linalg.norm(np.cross(u, other.axis))) < SAME_DIRECTION:
                share = end / length
                yield np.array([u, cylinder.origin + share * span, (1 - 2 * share) * span]), cylinder.radius


def _arms(points: np.ndarray, core: np.ndarray) -> np.ndarray:
    """Return the vectors (..., 3) [mm] across the axis from the nearest point on a core to points (..., 3)."""
    u, start, span = core
    arms = points - start
    arms = arms - (arms @ u)[..., None] * u
    share = np.clip(arms @ span / max(float(span @ span), 1e-300), 0.0, 1.0)
    return np.asarray(arms - share[..., None] * span)


def _distances(points: np.ndarray, core: np.ndarray) -> np.ndarray:
    return np.linalg.norm(_arms(points, core), axis=-1)


def _hollow(corners: np.ndarray, vertices: np.ndarray, core: np.ndarray) -> Constraint:
    """Return the hollow around a core, for triangles with `corners` (t, 3, 3) and vertices of the inner body (v, 3).

    A segment and a triangle are nearest to each other at an end of the segment or a corner of the triangle.
    """
    u, start, span = core
    flat = corners - (corners @ u)[..., None] * u
    sides = np.roll(flat, -1, axis=1) - flat
    squares = np.maximum((sides**2).sum(axis=2), 1e-300)
    arms = [_arms(flat, core)]
    ends = [end - (end @ u) * u for end in (start, start + span)]
    for end in ends:
        share = np.clip(((end - flat) * sides).sum(axis=2) / squares, 0.0, 1.0)
        arms.append(flat + share[..., None] * sides - end)
    candidates = np.concatenate(arms, axis=1)
    lengths = np.linalg.norm(candidates, axis=2, keepdims=True)
    directions = candidates / np.maximum(lengths, 1e-300)
    offsets = np.maximum(directions @ ends[0], directions @ ends[1])
    heights = np.einsum("tei,tci->tec", directions, flat).min(axis=2) - offsets
    best = np.arange(len(flat)), np.where(lengths[..., 0] > 0, heights, -np.inf).argmax(axis=1)
    return Constraint(directions[best], offsets[best], _distances(vertices, core), core)
