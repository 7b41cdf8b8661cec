"""Parts in their nominal poses, and their locators with the locator matrix, which determines the pose of a part."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh

from tolcontact.declaration import Locator, Mesh, Part, ThreeTwoOne, Tolerance
from tolcontact.declaration.locator import BEST_FIT, FIRST_ORDER
from tolcontact.discretization.locating_faces import LocatingFace
from tolcontact.errors import GeometryFault
from tolcontact.features import FaceDeviation, Placement
from tolcontact.geometry.faces import Meshes
from tolcontact.geometry.triangle_mesh import COORDINATE_SPACING, placed_mesh

MAX_CONDITION = 1e8
MIN_DETERMINANT = 0.1  # of the normals of three faces that count as independent
SCHEME_NAMES = ("A1", "A2", "A3", "B1", "B2", "C1")
FACES_OF_SCHEME = (0, 0, 0, 1, 1, 2)  # primary, secondary, tertiary


@dataclass(frozen=True, eq=False)
class Locators:
    """The locators of a part, or of a model, in the nominal assembly frame.

    labels       "part.locator" for each locator
    points       (locator, 3) [mm]
    directions   (locator, 3): unit vectors into the part
    tolerances   one for each locator
    stiffness    (locator,) [N/mm]
    one_sided    (locator,) bool: supports that the part may lift off
    springy      (locator,) bool: locators that are compliant, by their stiffness
    elastic      (locator,) bool: locators at elastic parts, or on them
    faces        for each locator the face of a feature that it touches; None for a nominal face
    grounds      for each locator the feature of another part that it is on; None if it is on no feature
    floating     centre (3,) and size [mm] of a floating part; None for a part that its locators fix
    placing      how the pose follows from them: one of PLACINGS
    """

    labels: tuple[str, ...]
    points: np.ndarray
    directions: np.ndarray
    tolerances: tuple[Tolerance, ...]
    stiffness: np.ndarray
    one_sided: np.ndarray
    springy: np.ndarray
    elastic: np.ndarray
    faces: tuple[FaceDeviation | None, ...]
    grounds: tuple[FaceDeviation | None, ...]
    floating: tuple[np.ndarray, float] | None = None
    placing: str = FIRST_ORDER

    def __len__(self) -> int:
        return len(self.labels)

    @classmethod
    def joined(cls, parts: Iterable["Locators"]) -> "Locators":
        """Return the locators of several parts, one part after the other."""
        parts, values = tuple(parts), dict[str, Any]()
        for name in ("labels", "tolerances", "faces", "grounds"):
            values[name] = tuple(entry for part in parts for entry in getattr(part, name))
        for name in ("points", "directions"):
            values[name] = np.vstack([np.zeros((0, 3)), *(getattr(part, name) for part in parts)])
        for name, dtype in (("stiffness", float), ("one_sided", bool), ("springy", bool), ("elastic", bool)):
            values[name] = np.array([value for part in parts for value in getattr(part, name)], dtype)
        return cls(**values)

    @property
    def exact(self) -> np.ndarray:
        """Whether locators are two-sided and rigid, between rigid parts (locator,)."""
        return ~self.one_sided & ~self.springy & ~self.elastic

    def pushes(self, locator: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the columns (k,) of the deviations of features that displace a locator, and its displacements (k,) per unit.

        The features are the face of the part, which moves out of it, and the feature of another part that the locator is on.
        """
        point, into_part = self.points[locator, None], self.directions[locator, None]
        features = [(self.faces[locator], -into_part), (self.grounds[locator], into_part)]
        pushes = [(face.columns, face.outward(point, outward)[0]) for face, outward in features if face is not None]
        columns, factors = zip((np.zeros(0, dtype=int), np.zeros(0)), *pushes, strict=True)
        return np.concatenate(columns), np.concatenate(factors)

    @property
    def matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """The rows [n', (p - c) x n)'] of the locator matrix J (locator, 6), and their centroid c (3,)."""
        centre = self.points.mean(axis=0) if self.floating is None else self.floating[0]
        return np.hstack([self.directions, np.cross(self.points - centre, self.directions)]), centre

    @property
    def placing_matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """The matrix M (6, locator) of q = M d, and the centroid c (3,), the centre of rotation.

        A floating part moves as little as possible. Six locators give M = J^-1. With more than six the two-sided locators are
        kept exactly, and the one-sided locators by least squares; all by least squares if the part is elastic.
        """
        J, centre = self.matrix
        if self.floating is not None:
            return self._least_motion(J, self.floating[1]), centre
        if len(J) == 6:
            return np.linalg.inv(J), centre
        if self.placing == BEST_FIT or self.elastic.any():
            return np.linalg.pinv(J), centre
        exact, supports = J[~self.one_sided], J[self.one_sided]
        kkt = np.block([[supports.T @ supports, exact.T], [exact, np.zeros((len(exact), len(exact)))]])
        M = np.zeros((6, len(J)))
        inverse = np.linalg.inv(kkt)[:6]
        M[:, self.one_sided], M[:, ~self.one_sided] = inverse[:, :6] @ supports.T, inverse[:, 6:]
        return M, centre

    def _least_motion(self, J: np.ndarray, size: float) -> np.ndarray:
        """Return M (6, locator) of the least motion that keeps two-sided locators exactly and one-sided ones by least squares.

        Rotations [rad] are weighed by the part's `size` [mm].
        """
        to_q = np.diag([1.0] * 3 + [1 / size] * 3)
        exact, supports = (J @ to_q)[~self.one_sided], (J @ to_q)[self.one_sided]
        M = np.zeros((6, len(J)))
        M[:, ~self.one_sided] = np.linalg.pinv(exact)
        free = np.linalg.svd(exact)[2][len(exact) :].T
        by_supports = free @ np.linalg.pinv(supports @ free, rcond=1 / MAX_CONDITION)
        M[:, ~self.one_sided] -= by_supports @ supports @ M[:, ~self.one_sided]
        M[:, self.one_sided] = by_supports
        return to_q @ M

    def _contradicting(self, J: np.ndarray) -> str:
        """Return the names of two-sided locators whose rows J (locator, 6) depend on each other; "" if there are none.

        More than six, which hold an elastic part, always do, and name no culprit.
        """
        U, S, _ = np.linalg.svd(J)
        if not 0 < len(J) <= J.shape[1] or S[-1] * MAX_CONDITION > S[0]:
            return ""
        share = np.abs(U[:, len(S) - 1])
        names = np.array(self.labels)[~self.one_sided]
        return ", ".join(str(name) for name in names[share > 1e-6 * share.max()])

    def check_independent(self) -> None:
        """Raise GeometryFault if the locators do not fix their part, or if two-sided ones contradict each other."""
        J, centre = self.matrix
        if self.floating is not None:
            scaled = J / np.array([1, 1, 1, *[self.floating[1]] * 3])
            if names := self._contradicting(scaled[~self.one_sided]):
                raise GeometryFault(f"it is over-constrained: locators {names} hold the same; leave one of them out")
            return
        size = np.sqrt(((self.points - centre) ** 2).sum(axis=1).mean())
        scaled = J / np.array([1, 1, 1, size, size, size]) if size > 0 else np.zeros_like(J)
        two_sided = scaled[~self.one_sided]
        condition = max(np.linalg.cond(scaled), np.linalg.cond(two_sided) if len(two_sided) else 0.0)
        if not condition < MAX_CONDITION:
            names = self._contradicting(two_sided)
            cause = f"{names} hold the same, so they contradict each other and leave a direction free; " if names else ""
            raise GeometryFault(
                f"its {len(J)} locators do not fix it: {cause}the locator matrix has condition number {condition:.1e}, the "
                f"limit is {MAX_CONDITION:.0e}; the points of the primary face must not lie on a line, and the directions "
                "together must constrain all three translations and all three rotations"
            )


def scheme_locators(scheme: ThreeTwoOne, meshes: Meshes, placements: Sequence[Placement] = ()) -> tuple[Locator, ...]:
    """Return the six locators of a 3-2-1 scheme, in the part's own frame; directions point into the part.

    Each face of a joint belongs to a part of its own, with these `placements`; so do its locators.

    Each face is taken as its bounding rectangle along the edges that it shares with the other two. A point of it that lies
    outside the material of the face moves to where the support is widest (see LocatingFace). Raises GeometryFault if the three
    faces are not independent, or the inset leaves no room.
    """
    of_faces: Sequence[Placement | None] = placements or [None] * 3
    faces = [LocatingFace.of(face, meshes, placement) for face, placement in zip(scheme.faces, of_faces, strict=True)]
    outward = np.array([face.outward for face in faces])
    if abs(np.linalg.det(outward)) < MIN_DETERMINANT:
        raise GeometryFault(
            "the three faces of its 3-2-1 scheme are not independent; choose faces at wide angles to each other"
        )
    # Coordinates a, b, c along edge directions: dual to the normals, so that a step along one stays on the other two.
    edges = -np.linalg.inv(outward).T
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    a, b, c = edges
    primary, secondary, tertiary = (face.vertices for face in faces)
    inset, geometry = scheme.inset, scheme.primary.part.geometry
    has_own_units = not isinstance(geometry, Mesh) or geometry.units or geometry.is_step
    advice = "make it smaller" + ("" if has_own_units else ', or state the units of the mesh: tc.Mesh(..., units="m") or "in"')
    near_c, far_c = _support_coordinates(primary, c, inset, advice)
    near_b, far_b = _support_coordinates(primary, b, inset, advice)
    side_near, side_far = _support_coordinates(secondary, c, inset, advice)
    coordinates: tuple[tuple[int, dict[int, float]], ...] = (  # of points on faces, along the edges of the other two
        (0, {1: near_b, 2: near_c}),
        (0, {1: near_b, 2: far_c}),
        (0, {1: far_b, 2: (near_c + far_c) / 2}),
        (1, {0: _midpoint(secondary, a), 2: side_near}),
        (1, {0: _midpoint(secondary, a), 2: side_far}),
        (2, {0: _midpoint(tertiary, a), 1: _midpoint(tertiary, b)}),
    )
    rectangular = []
    for k, along in coordinates:
        rows, level = np.array([outward[k], *(edges[axis] for axis in along)]), float((faces[k].vertices @ outward[k]).max())
        rectangular.append(np.linalg.solve(rows, np.array([level, *along.values()])))
    sides = ((0, slice(0, 3), None), (1, slice(3, 5), c), (2, slice(5, 6), None))  # face, its points, what spreads them
    points = np.vstack([faces[k].on_material(np.array(rectangular[rows]), scheme.inset, along) for k, rows, along in sides])
    directions = -outward[list(FACES_OF_SCHEME)]
    if not placements:
        return tuple(Locator(name, p, n) for name, p, n in zip(SCHEME_NAMES, points, directions, strict=True))
    return tuple(
        Locator(name, (p - placements[face][1]) @ placements[face][0], n @ placements[face][0], part=scheme.faces[face].part)
        for name, p, n, face in zip(SCHEME_NAMES, points, directions, FACES_OF_SCHEME, strict=True)
    )


def _support_coordinates(points: np.ndarray, along: np.ndarray, inset: float, advice: str) -> tuple[float, float]:
    """Return the coordinates [mm] along a direction at an inset from both ends of a face."""
    places = points @ along
    lower, upper = places.min() + inset, places.max() - inset
    if not lower < upper:
        length = places.max() - places.min()
        raise GeometryFault(f"an inset of {inset:g} mm leaves no room on a face that is {length:g} mm long; {advice}")
    return lower, upper


def _midpoint(points: np.ndarray, along: np.ndarray) -> float:
    places = points @ along
    return float(places.min() + places.max()) / 2


@dataclass(frozen=True, eq=False)
class NominalPart:
    """A part in its nominal pose.

    vertices, faces      its surface (vertex, 3) [mm], (face, 3), fine enough to show displacement fields
    locators             as `scheme` declares them; none if the part is fixed
    parent               index of the part that it is located on, or of the first part of its joint; None for the ground
    located              name of what its locators locate: its own, or "station.part" or "station.joint"
    movers               indices of the free parts whose corrections move it: parts that it is located on come first
    station              name of the station; empty in an assembly without stations
    carried              indices of the first part of its joint and of itself, in the station that joined them; None without a
                         joint
    owners               indices of the parts at whose points its locators are, if it is the first part of a joint
    """

    name: str
    part: Part
    placement: tuple[np.ndarray, np.ndarray]
    mesh: trimesh.Trimesh
    vertices: np.ndarray
    faces: np.ndarray
    locators: Locators
    scheme: ThreeTwoOne | tuple[Locator, ...] | None
    parent: int | None
    free: bool
    located: str
    movers: tuple[int, ...] = ()
    station: str = ""
    carried: tuple[int, int] | None = None
    owners: tuple[int, ...] = ()

    @cached_property
    def body(self) -> trimesh.Trimesh:
        """The mesh in its nominal pose."""
        body = placed_mesh(self.mesh.vertices, self.mesh.faces, *self.placement)
        body.metadata |= {name: self.mesh.metadata[name] for name in (COORDINATE_SPACING,) if name in self.mesh.metadata}
        return body

    def placed(self, p: np.ndarray) -> np.ndarray:
        """Return nominal assembly coordinates (..., 3) [mm] of points (..., 3) in the part's own frame."""
        R_WP, t_WP = self.placement
        return p @ R_WP.T + t_WP
