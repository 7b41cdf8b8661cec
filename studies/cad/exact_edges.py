"""The faces of a STEP file from its text alone: surfaces, and the exact curves of their edges. Lengths in the file's unit.

Nothing here uses the CAD kernel, or the reader of shape files.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.interpolate
import scipy.spatial

GAUSS_POINTS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(16)
ARCS = 8  # pieces of a conic
SAMPLES = 24  # of a piece of a curve, from which the search for a nearest point starts
TOKEN = re.compile(r"\s*(?:([A-Z_]\w*)?\s*(\()|(\))|,|#(\d+)|('(?:[^']|'')*')|(\.\w+\.)|([-+]?\d[-+.\dEe]*)|([$*]))")
RECORD = re.compile(r"#(\d+)\s*=\s*((?:'[^']*'|[^';])*);")
SURFACES = ("PLANE", "CYLINDRICAL_SURFACE", "CONICAL_SURFACE", "SPHERICAL_SURFACE", "TOROIDAL_SURFACE")
CLOSED = 1e-6  # in units of the file: ends of an edge that are closer are one

Points = np.ndarray  # (point, 3)


class Missing(Exception):
    """A face has an edge or a surface that is not read here; the message names it."""


class Reference(int):
    """The number of a record, to which a parameter refers."""


@dataclass(frozen=True)
class Curve:
    """A curve with its derivative, over `knots` in the direction of travel. Between two knots it is smooth.

    Its ends are vertices of the file, or the points of the curve that are nearest to them. `gap` is the distance in between.
    """

    at: Callable[[np.ndarray], Points]
    slope: Callable[[np.ndarray], Points]
    knots: np.ndarray
    gap: float = 0.0

    def reversed(self) -> "Curve":
        return replace(self, knots=self.knots[::-1])

    def with_gap(self, ends: Sequence[np.ndarray]) -> "Curve":
        """Return the curve with its gap from the vertices at its `ends`."""
        return replace(self, gap=float(np.linalg.norm(self.at(self.knots[[0, -1]]) - ends, axis=1).max()))

    @cached_property
    def quadrature(self) -> tuple[Points, Points]:
        """The points of Gauss's rule, and the steps `dx` by which a form is multiplied there."""
        starts, lengths = self.knots[:-1, None], np.diff(self.knots)[:, None]
        t = (starts + lengths * (GAUSS_POINTS + 1) / 2).ravel()
        weights = (lengths * GAUSS_WEIGHTS / 2).reshape(-1, 1)
        return self.at(t), self.slope(t) * weights

    def distance(self, points: Points) -> np.ndarray:
        """Return the distances of points from the curve, by Newton's method from the nearest sample."""
        low, high = sorted((self.knots[0], self.knots[-1]))
        t = np.concatenate([np.linspace(a, b, SAMPLES) for a, b in zip(self.knots[:-1], self.knots[1:], strict=True)])
        tree = scipy.spatial.cKDTree(self.at(t))
        nearest, index = tree.query(points)
        best, step = t[index], 1e-6 * (high - low)
        for _ in range(6):
            gap, slope = self.at(best) - points, self.slope(best)
            bend = (self.slope(np.minimum(best + step, high)) - self.slope(np.maximum(best - step, low))) / (2 * step)
            curvature = (slope**2).sum(axis=1) + (gap * bend).sum(axis=1)
            moved = best - (gap * slope).sum(axis=1) / np.where(curvature > 0, curvature, (slope**2).sum(axis=1) + 1e-300)
            best = np.clip(moved, low, high)
        return np.minimum(nearest, np.linalg.norm(self.at(best) - points, axis=1))


@dataclass(frozen=True)
class Surface:
    """A simple surface with its `frame` (3, 3), whose rows are x, y and the axis, and its `sizes` in the file's order."""

    kind: str
    origin: np.ndarray
    frame: np.ndarray
    sizes: tuple[float, ...]


@dataclass(frozen=True)
class FaceInText:
    """A face: its record, its surface, the curves of its edges in loops, and whether it looks along its surface."""

    record: int
    surface: Surface
    loops: list[list[Curve]]
    is_along: bool


class Text:
    """The records of a STEP file, parsed when they are needed."""

    def __init__(self, content: str) -> None:
        self.bodies = {int(number): body for number, body in RECORD.findall(re.sub(r"/\*.*?\*/", "", content, flags=re.DOTALL))}
        contexts = [
            body for body in self.bodies.values() if re.search("GEOMETRIC_REPRESENTATION_CONTEXT.*GLOBAL_UNIT_ASS", body, re.S)
        ]
        assigned = {int(number) for body in contexts for number in re.findall(r"#(\d+)", body)}
        angles = [self.bodies[number] for number in assigned if "PLANE_ANGLE_UNIT" in self.bodies.get(number, "")]
        self.angle_units = {np.pi / 180 if "CONVERSION_BASED_UNIT" in body else 1.0 for body in angles}

    def record(self, number: int) -> dict[str, list[Any]]:
        """Return the entities of a record with their parameters."""
        stack: list[list[Any]] = [[]]
        for name, opening, closing, reference, string, word, figure, unset in TOKEN.findall(self.bodies[number]):
            if opening:
                stack.append([name])
            elif closing:
                values = stack.pop()
                stack[-1].append((values[0], values[1:]) if values[0] else values[1:])
            elif reference:
                stack[-1].append(Reference(reference))
            elif string or word or unset:
                stack[-1].append(string or word or None)
            elif figure:
                stack[-1].append(float(figure))
        (instance,) = stack[0]
        return dict([instance] if isinstance(instance, tuple) else instance)

    def entity(self, number: int) -> tuple[str, list[Any]]:
        """Return the name and the parameters of a simple record."""
        return next(iter(self.record(number).items()))

    def vector(self, number: int) -> np.ndarray:
        return np.array(self.entity(number)[1][1])

    def placement(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the origin and the frame (3, 3) of an AXIS2_PLACEMENT_3D."""
        _, origin, axis, reference = self.entity(number)[1]
        z = np.array([0.0, 0.0, 1.0]) if axis is None else self.vector(axis)
        z = z / np.linalg.norm(z)
        x = np.eye(3)[int(abs(z[0]) == 1)] if reference is None else self.vector(reference)
        x = x - x @ z * z
        x = x / np.linalg.norm(x)
        return self.vector(origin), np.array([x, np.cross(z, x), z])

    def face(self, number: int) -> FaceInText:
        """Return a face. Raises Missing if its surface or an edge is of another kind."""
        _, bounds, surface, is_along = self.entity(number)[1]
        record = self.record(surface)
        kind = next((name for name in record if name not in ("BOUNDED_SURFACE", "SURFACE")), "")
        if kind not in SURFACES:
            raise Missing(kind)
        values = record[kind]
        sizes = [*values[2:]]
        if kind == "CONICAL_SURFACE":
            if len(self.angle_units) != 1:
                raise Missing("a cone, for which units of angles differ")
            sizes[1] *= next(iter(self.angle_units))
        loops = [[*self._loop(bound)] for bound in bounds]
        return FaceInText(number, Surface(kind, *self.placement(values[1]), tuple(sizes)), loops, is_along == ".T.")

    def _loop(self, bound: int) -> Iterator[Curve]:
        _, loop, is_forward = self.entity(bound)[1]
        kind, values = self.entity(loop)
        if kind == "VERTEX_LOOP":
            return
        if kind != "EDGE_LOOP":
            raise Missing(kind)
        for edge in values[1] if is_forward == ".T." else reversed(values[1]):
            *_, curve, direction = self.entity(edge)[1]
            yield self._edge(curve) if direction == is_forward else self._edge(curve).reversed()

    def _edge(self, number: int) -> Curve:
        """Return the curve of an edge from its first vertex to its second."""
        _, first, second, curve, is_along = self.entity(number)[1]
        ends = [self.vector(self.entity(vertex)[1][1]) for vertex in (first, second)]
        piece = self._curve(curve, *ends) if is_along == ".T." else self._curve(curve, *ends[::-1]).reversed()
        return piece if piece.gap else piece.with_gap(ends)

    def _curve(self, number: int, start: np.ndarray, end: np.ndarray) -> Curve:
        """Return the piece of a curve from `start` to `end`, in the curve's direction."""
        record = self.record(number)
        kind = next(iter(record))
        if kind in ("SURFACE_CURVE", "SEAM_CURVE", "INTERSECTION_CURVE"):
            return self._curve(record[kind][1], start, end)
        if kind == "LINE":
            point, along = self.vector(record[kind][1]), self.vector(self.entity(record[kind][2])[1][1])
            off = [np.linalg.norm(np.cross(end_point - point, along)) / np.linalg.norm(along) for end_point in (start, end)]
            return replace(line(start, end), gap=float(max(off)))
        if kind in ("CIRCLE", "ELLIPSE"):
            values = record[kind]
            return conic(*self.placement(values[1]), values[2], values[-1], start, end)
        if "B_SPLINE_CURVE_WITH_KNOTS" in record:
            return self._spline(record, start, end)
        raise Missing(kind)

    def _spline(self, record: dict[str, list[Any]], start: np.ndarray, end: np.ndarray) -> Curve:
        values = record["B_SPLINE_CURVE_WITH_KNOTS"]
        shape = values[1:] if "B_SPLINE_CURVE" not in record else [*record["B_SPLINE_CURVE"], *values]
        degree, poles, counts, knots = int(shape[0]), shape[1], shape[5], shape[6]
        weights = record.get("RATIONAL_B_SPLINE_CURVE", [[1.0] * len(poles)])[0]
        return spline(
            degree, np.array([self.vector(pole) for pole in poles]), weights, np.repeat(knots, np.int64(counts)), start, end
        )


def line(start: np.ndarray, end: np.ndarray) -> Curve:
    """Return a straight edge."""
    span = end - start
    return Curve(lambda t: start + t[:, None] * span, lambda t: np.tile(span, (len(t), 1)), np.array([0.0, 1.0]))


def conic(origin: np.ndarray, frame: np.ndarray, a: float, b: float, start: np.ndarray, end: np.ndarray) -> Curve:
    """Return an arc of a circle or an ellipse."""
    x, y = a * frame[0], b * frame[1]
    first, last = (np.arctan2((point - origin) @ frame[1] / b, (point - origin) @ frame[0] / a) for point in (start, end))
    turn = (last - first) % (2 * np.pi)
    if np.linalg.norm(end - start) < CLOSED:
        turn = 2 * np.pi
    return Curve(
        lambda t: origin + np.outer(np.cos(t), x) + np.outer(np.sin(t), y),
        lambda t: np.outer(np.cos(t), y) - np.outer(np.sin(t), x),
        first + np.linspace(0, turn, ARCS + 1),
    )


def spline(
    degree: int, poles: Points, weights: Sequence[float], knots: np.ndarray, start: np.ndarray, end: np.ndarray
) -> Curve:
    """Return a piece of a B-spline curve, whose `weights` are 1 if it is not rational."""
    curve = scipy.interpolate.BSpline(knots, np.column_stack([poles * np.array(weights)[:, None], weights]), degree)
    derivative = curve.derivative()

    def at(t: np.ndarray) -> Points:
        value = curve(t)
        return value[:, :3] / value[:, 3:]

    def slope(t: np.ndarray) -> Points:
        value, rate = curve(t), derivative(t)
        return (rate[:, :3] - at(t) * rate[:, 3:]) / value[:, 3:]

    low, high = knots[degree], knots[-degree - 1]
    inner = np.unique(knots[(knots > low) & (knots < high)])
    whole = Curve(at, slope, np.array([low, *inner, high]))
    first, last = (nearest_parameter(whole, point) for point in (start, end))
    if np.linalg.norm(end - start) < CLOSED or np.linalg.norm(at(np.array([low, high])) - [start, end], axis=1).max() < CLOSED:
        return whole
    if first > last:
        raise Missing("B-spline curve over its seam")
    return Curve(at, slope, np.array([first, *inner[(inner > first) & (inner < last)], last]))


def nearest_parameter(curve: Curve, point: np.ndarray) -> float:
    """Return the parameter of the point of a curve that is nearest to another."""
    t = np.concatenate([np.linspace(a, b, SAMPLES) for a, b in zip(curve.knots[:-1], curve.knots[1:], strict=True)])
    best = float(t[np.linalg.norm(curve.at(t) - point, axis=1).argmin()])
    for _ in range(20):
        gap, slope = curve.at(np.array([best]))[0] - point, curve.slope(np.array([best]))[0]
        best = float(np.clip(best - gap @ slope / (slope @ slope), curve.knots[0], curve.knots[-1]))
    return best
