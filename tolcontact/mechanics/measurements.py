"""Measurements as expressions of poses and deviations: heights over walls, axis distances, angles, and combinations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from tolcontact.discretization.measured_geometry import (
    AxisPair,
    Combined,
    Crossing,
    DirectionPair,
    FaceGap,
    Heights,
    LinearForm,
    MeasuredFace,
    MeasuredPoint,
    MeshClearance,
    NominalMeasurement,
    PlaneClearance,
    RoundClearance,
    Wall,
)
from tolcontact.features import FaceDeviation
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane, Sphere, Torus
from tolcontact.mechanics.group_equations import face_height, face_pose
from tolcontact.mechanics.mesh_clearance import mesh_clearance, minimum, segment_distance
from tolcontact.mechanics.plane_clearance import plane_clearance
from tolcontact.mechanics.pose import ENTRIES, Pose, relative
from tolcontact.mechanics.round_gap import round_gaps


@dataclass(frozen=True, eq=False)
class Observed:
    """The arguments of measurements: poses of the parts, deviations (contributor, 1), and the preceding measures."""

    poses: Sequence[Pose]
    deviations: ca.SX
    measures: Sequence[ca.SX]

    def pose(self, part: int, face: FaceDeviation | None) -> Pose:
        """Return the pose that moves points of a nominal face to the actual face in the assembly."""
        X_face = face_pose(face, self.deviations)
        return self.poses[part] if X_face is None else self.poses[part] @ X_face

    def position(self, point: MeasuredPoint) -> ca.SX:
        """Return the position (3, 1) [mm] of a point, which moves with its face."""
        height = face_height(point.deviation, self.deviations, point.position)
        return self.pose(point.part, point.deviation).apply(ca.DM(point.position) + height * ca.DM(point.outward))


def value_of(measurement: NominalMeasurement, observed: Observed) -> ca.SX:
    """Return the value of a measurement in its units."""
    return EXPRESSIONS[type(measurement)](measurement, observed)


def _least_height(heights: Heights, observed: Observed) -> ca.SX:
    over_walls = [_height(point, wall, observed) for point, wall in heights.points]
    return minimum([*over_walls, *(_edge_height(crossing, observed) for crossing in heights.crossings)])


def _face_gap(gap: FaceGap, observed: Observed) -> ca.SX:
    """Return the largest gap of all points, or their area-weighted mean [mm]."""
    heights = ca.vertcat(*(_height(point, wall, observed) for point, wall in gap.points))
    return ca.mmax(heights) if gap.is_largest else ca.dot(ca.DM(gap.weights), heights)


def _plane_clearance(clearance: PlaneClearance, observed: Observed) -> ca.SX:
    X_21 = _relative(clearance.moving, clearance.reference, observed)
    return plane_clearance(clearance, X_21, _least_height(clearance.heights, observed))


def _relative(moving: MeasuredFace, reference: MeasuredFace, observed: Observed) -> Pose:
    """Return the pose of a moving face in the frame of a reference one."""
    return relative(observed.pose(moving.part, moving.deviation), observed.pose(reference.part, reference.deviation))


def _edge_height(crossing: Crossing, observed: Observed) -> ca.SX:
    """Return the height of an edge over one that it crosses: the distance of their lines along their common normal [mm]."""
    moving, reference = (
        [observed.pose(face.part, face.deviation).apply(ca.DM(end)) for end in edge]
        for face, edge in zip((crossing.moving, crossing.reference), crossing.edges, strict=True)
    )
    n = crossing.sense * ca.cross(moving[1] - moving[0], reference[1] - reference[0])
    return ca.dot(n, moving[0] - reference[0]) / ca.norm_2(n)


def _height(point: MeasuredPoint, wall: Wall, observed: Observed) -> ca.SX:
    """Return the height of a point over a wall, less the growth of the wall [mm]."""
    X = observed.pose(wall.part, wall.deviation)
    p = X.R.T @ (observed.position(point) - X.t)
    height = face_height(wall.deviation, observed.deviations, wall.foot(point.position))
    return wall.side * distance(wall.surface, p) - height


def distance(surface: AnalyticSurface, p: ca.SX) -> ca.SX:
    """Return the signed distance [mm] of a point p (3, 1) from a surface: AnalyticSurface.distance as an expression."""
    offset, axis = p - ca.DM(surface.origin), ca.DM(surface.axis)
    along = ca.dot(axis, offset)
    across = offset - along * axis
    if isinstance(surface, Plane):
        return surface.height(0.0, along)  # type: ignore[no-any-return]
    if isinstance(surface, Sphere):
        return surface.height(ca.norm_2(offset), 0.0)  # type: ignore[no-any-return]
    if isinstance(surface, Torus):
        tube = ca.norm_2(ca.vertcat(ca.norm_2(across) - surface.radius, along))
        return surface.height(tube, along)  # type: ignore[no-any-return]
    return surface.height(ca.norm_2(across), along)  # type: ignore[no-any-return]


def _round_clearance(clearance: RoundClearance, observed: Observed) -> ca.SX:
    moving, reference = clearance.moving, clearance.reference
    X_RM = _relative(moving, reference, observed)
    growths = ca.vertcat(*(face_height(face.deviation, observed.deviations) for face in (moving, reference)))
    points = clearance.points
    gaps = round_gaps(points, X_RM.vector(), growths, ca.SX(len(points), 1), ca.SX(ENTRIES, 0)).gaps
    return minimum(ca.vertsplit(gaps))


def _mesh_clearance(clearance: MeshClearance, observed: Observed) -> ca.SX:
    faces = (clearance.moving, clearance.reference)
    growth = sum(face_height(face.deviation, observed.deviations) for face in faces)
    return mesh_clearance(clearance, _relative(*faces, observed)) - growth


def _axis_distance(pair: AxisPair, observed: Observed) -> ca.SX:
    moving, reference = (
        [observed.pose(axis.part, axis.deviation).apply(ca.DM(end)) for end in axis.ends]
        for axis in (pair.moving, pair.reference)
    )
    a, b = (moving[0] + moving[1]) / 2, (reference[0] + reference[1]) / 2
    v = observed.pose(pair.reference.part, pair.reference.deviation).R @ ca.DM(pair.reference.direction)
    if pair.along is not None:
        return ca.dot(ca.DM(pair.along), b - a + ca.dot(a - b, v) * v)
    if pair.across is not None:
        n = ca.SX(ca.DM(pair.across))
        v = v if pair.reference.direction.any() else n
        return ca.norm_2(b - a + ca.dot(a - b, n) / ca.dot(v, n) * v)
    shortest = segment_distance(moving, reference)
    if not pair.is_between_surfaces:
        return shortest
    radii = sum(axis.radius + face_height(axis.deviation, observed.deviations) for axis in (pair.moving, pair.reference))
    return shortest - radii


def _angle(pair: DirectionPair, observed: Observed) -> ca.SX:
    """Return the angle [rad] by atan2 of sine and cosine, which remains accurate where the cosine is 1."""
    faces = (pair.moving, pair.reference)
    u, v = (
        observed.pose(face.part, face.deviation).R @ ca.DM(direction)
        for face, direction in zip(faces, pair.directions, strict=True)
    )
    if pair.about is None:
        return ca.atan2(ca.norm_2(ca.cross(u, v)), ca.dot(u, v))
    n = ca.DM(pair.about)
    return ca.atan2(ca.dot(n, ca.cross(u, v)), ca.dot(u, v) - ca.dot(u, n) * ca.dot(v, n))


def _linear_form(form: LinearForm, observed: Observed) -> ca.SX:
    return form.constant + ca.dot(ca.DM(form.factors), observed.deviations[form.columns.tolist()])


def _combined(combined: Combined, observed: Observed) -> ca.SX:
    values = [
        value_of(operand, observed) if isinstance(operand, NominalMeasurement) else observed.measures[operand]
        for operand in combined.operands
    ]
    return COMBINATIONS[combined.kind](ca.vertcat(*values))


EXPRESSIONS: Mapping[type[NominalMeasurement], Callable[[Any, Observed], ca.SX]] = {
    Heights: _least_height, FaceGap: _face_gap, PlaneClearance: _plane_clearance, RoundClearance: _round_clearance,
    MeshClearance: _mesh_clearance, AxisPair: _axis_distance, DirectionPair: _angle, Combined: _combined,
    LinearForm: _linear_form,
}  # fmt: skip
COMBINATIONS: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "minimum": ca.mmin, "maximum": ca.mmax, "mean": lambda values: ca.sum1(values) / values.numel(), "sum": ca.sum1,
    "difference": lambda values: values[0] - values[1],
}  # fmt: skip
