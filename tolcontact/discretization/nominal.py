"""The nominal model: every declared thing with its numbers, in the nominal assembly frame W. Lengths in mm."""

import logging
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, ContactPair, Face, Locator, Measure, Part, Point, ThreeTwoOne, Tolerance
from tolcontact.discretization.curvature import CHORD, distinct, facet_error, following, is_flat, sampling_error
from tolcontact.discretization.doubtful_sizes import warn_of_units
from tolcontact.discretization.face_pair import FacePair, side
from tolcontact.discretization.faces import Meshes, patch, triangles
from tolcontact.discretization.fault import GeometryFault
from tolcontact.discretization.overlap import overlap_corners, rim_points
from tolcontact.discretization.shape_files.reading import read_files
from tolcontact.discretization.shapes import field_surface, shape
from tolcontact.discretization.spreading import own_vertices, spread
from tolcontact.discretization.surface import Surface
from tolcontact.discretization.three_two_one import lay_out
from tolcontact.errors import ContactWarning, ModelError, shown

CONDITION_LIMIT = 1e8
DEFAULT_REACH = 0.1
DEFAULT_POINTS = 200
MANY = 100_000  # contact points of a pair; more are announced
SECONDS_PER_POINT = 1e-4
SAME = 1e-9  # of the part's size: points that are no farther apart are one

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class NominalPart:
    """A part in its nominal place.

    vertices, faces      its surface (vertex, 3) [mm], (face, 3), fine enough to show displacement fields
    labels               "part.locator" of its locators, () if it has none
    locator_points       (locator, 3) [mm] and `locator_directions` (locator, 3), unit vectors into the part
    tolerances           one per locator
    stiffness            (locator,) [N/mm]
    one_sided            (locator,) bool: supports that the part may lift off
    parent               index of the part that it is located on; None for the ground
    """

    name: str
    part: Part
    placement: tuple[np.ndarray, np.ndarray]
    mesh: trimesh.Trimesh
    vertices: np.ndarray
    faces: np.ndarray
    labels: tuple[str, ...]
    locator_points: np.ndarray
    locator_directions: np.ndarray
    tolerances: tuple[Tolerance, ...]
    stiffness: np.ndarray
    one_sided: np.ndarray
    parent: int | None
    free: bool

    @cached_property
    def body(self) -> trimesh.Trimesh:
        """Its mesh in its nominal place."""
        return trimesh.Trimesh(self.place(np.asarray(self.mesh.vertices)), self.mesh.faces, process=False)

    def place(self, p: np.ndarray) -> np.ndarray:
        """Own coordinates (..., 3) to nominal assembly coordinates (..., 3) [mm]."""
        R_WP, t_WP = self.placement
        return np.asarray(p @ R_WP.T + t_WP)


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of one pair, fixed for all realizations: P^m, P^r, n^r of the paper, each (point, 3).

    One-sided locators are contact points, too: of their part against what it is located on, a part or (None) the ground.
    `locators` holds the column of the deviation of each such point, by which the support stands out along n^r; it is
    None for a pair of faces, whose `surface` is the reference face in its nominal place, and `own` the moving one.
    `facets` [mm] is how far their triangles may lie off the round faces that they stand for.
    """

    name: str
    moving: int
    reference: int | None
    P_m: np.ndarray
    P_r: np.ndarray
    n_r: np.ndarray
    locators: np.ndarray | None = None
    surface: Surface | None = None
    own: Surface | None = None
    facets: float = 0.0


@dataclass(frozen=True, eq=False)
class Nominal:
    """An assembly with numbers: what everything downstream is built from."""

    assembly: Assembly
    parts: tuple[NominalPart, ...]
    pairs: tuple[ContactPoints, ...]
    measures: tuple[Measure, ...]
    _face_pairs: dict[int, FacePair] = field(default_factory=dict, init=False)

    def face_pair(self, index: int) -> FacePair | None:
        """The faces of a pair as they are; None for one-sided locators, which have none."""
        pair = self.pairs[index]
        if pair.own is None or pair.surface is None or pair.reference is None:
            return None
        if index not in self._face_pairs:
            self._face_pairs[index] = FacePair(
                side(pair.own, self.parts[pair.moving].body, len(pair.P_m)),
                side(pair.surface, self.parts[pair.reference].body, len(pair.P_m)),
            )
        return self._face_pairs[index]

    @property
    def locator_labels(self) -> tuple[str, ...]:
        return tuple(label for part in self.parts for label in part.labels)

    @property
    def tolerances(self) -> tuple[Tolerance, ...]:
        return tuple(tolerance for part in self.parts for tolerance in part.tolerances)

    def part_index(self, part: Part) -> int:
        return self.assembly.parts.index(part)

    def triangles(self, face: Face) -> list[int]:
        """Indices of the triangles, in their part's mesh, of which a face consists or is cut."""
        return [int(k) for k in triangles(face, {part.part: part.mesh for part in self.parts})]

    def place(self, point: Point) -> np.ndarray:
        """Nominal assembly coordinates (3,) [mm] of a declared point."""
        return self.parts[self.part_index(point.part)].place(np.array(point.position))


def discretize(assembly: Assembly) -> Nominal:
    """The nominal model of an assembly.

    Raises ModelError with every fault of the declaration and of its geometry.
    """
    faults = list(assembly.faults())
    clean = not faults
    clear = [part for part in assembly.parts if not any(part.geometry.faults())]
    log.info("reading the shapes of %d parts", len(clear))
    contents = read_files(part.geometry for part in clear)
    attempts = {part: _attempt(faults, _where("part", part), shape, part.geometry, contents) for part in clear}
    shapes = {part: found for part, found in attempts.items() if found is not None}
    meshes = {part: found.mesh for part, found in shapes.items()}
    parts = [_nominal_part(assembly, part, meshes, faults) for part in assembly.parts]
    placed = {part: nominal for part, nominal in zip(assembly.parts, parts, strict=True) if nominal is not None}
    pairs = [
        _attempt(faults, _where("contact pair", pair), _contact_points, assembly, pair, placed, meshes)
        for pair in assembly.pairs
        if not any(pair.faults()) and all(part in placed for part in (*pair.moving.parts, *pair.reference.parts))
    ]
    if clean:
        faults.extend(_immovable(assembly))
    labels = [label for nominal in placed.values() for label in nominal.labels]
    faults.extend(
        f'locator "{label}" is declared {labels.count(label)} times; its draws would be the same, so rename part or locator'
        for label in dict.fromkeys(labels)
        if labels.count(label) > 1 and clean
    )
    faults.extend(
        f"{_where('contact pair', pair)}: its name is that of the one-sided locators of a part; rename it"
        for pair in assembly.pairs
        if any(pair.name == _supports(part) for part in assembly.parts if assembly.supports_of(part))
    )
    if faults:
        raise ModelError(assembly.name, list(dict.fromkeys(faults)))
    warn_of_units(assembly, shapes)
    found = tuple(part for part in parts if part is not None)
    return Nominal(assembly, found, (*(pair for pair in pairs if pair is not None), *_support_pairs(found)), assembly.measures)


def _supports(part: Part) -> str:
    return f"supports of {part.name}"


def _support_pairs(parts: tuple[NominalPart, ...]) -> Iterator[ContactPoints]:
    """The one-sided locators of each free part, as a contact pair."""
    first = 0
    for index, part in enumerate(parts):
        own = np.flatnonzero(part.one_sided)
        if part.free and own.size:
            P, n = part.locator_points[own], part.locator_directions[own]
            yield ContactPoints(_supports(part.part), index, part.parent, P, P, n, first + own)
        first += len(part.labels)


def _attempt(faults: list[str], where: str, build: Callable[..., Any], *arguments: Any) -> Any:
    """What `build` gives; None, and a fault noted, where the geometry does not allow it."""
    try:
        return build(*arguments)
    except GeometryFault as fault:
        faults.append(f"{where}: {fault}")
        return None


def _where(kind: str, thing: Part | ContactPair) -> str:
    return f'{kind} "{thing.name}" ({thing.declared_at})'


def _nominal_part(assembly: Assembly, part: Part, meshes: Meshes, faults: list[str]) -> NominalPart | None:
    if part not in meshes or any(part.faults()):
        return None
    mesh = meshes[part]
    R_WP = Rotation.from_rotvec(part.rotation).as_matrix()
    t_WP = np.array(part.at)
    vertices, faces = field_surface(mesh)
    location = assembly.location_of(part)
    locators: tuple[Locator, ...] = ()
    if location is not None and not any(location.faults()):
        if isinstance(location.scheme, ThreeTwoOne):
            if all(mentioned in meshes for mentioned in location.mentioned):
                locators = _attempt(faults, _where("part", part), lay_out, location.scheme, meshes) or ()
        else:
            locators = location.scheme
    points = np.array([locator.point for locator in locators]).reshape(-1, 3) @ R_WP.T + t_WP
    directions = np.array([locator.direction for locator in locators]).reshape(-1, 3) @ R_WP.T
    one_sided = np.array([locator.one_sided for locator in locators], dtype=bool)
    if locators:
        _attempt(faults, _where("part", part), _check_independent, points, directions, one_sided)
    common = location.tolerance if location else None
    parent = location.on if location else None
    return NominalPart(
        name=part.name,
        part=part,
        placement=(R_WP, t_WP),
        mesh=mesh,
        vertices=vertices @ R_WP.T + t_WP,
        faces=faces,
        labels=tuple(f"{part.name}.{locator.name}" for locator in locators),
        locator_points=points,
        locator_directions=directions,
        tolerances=tuple(locator.tolerance or common or Tolerance(0.0) for locator in locators),
        stiffness=np.array([float(locator.stiffness) for locator in locators]),
        one_sided=one_sided,
        parent=assembly.parts.index(parent) if parent in assembly.parts else None,
        free=assembly.is_free(part),
    )


def locator_matrix(points: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows [n', (p - c) x n)'] of the locator matrix J (locator, 6), and the locators' centroid c (3,) that it turns about."""
    centre = points.mean(axis=0)
    return np.hstack([directions, np.cross(points - centre, directions)]), centre


def placing_matrix(part: NominalPart) -> tuple[np.ndarray, np.ndarray]:
    """The matrix M (6, locator) of q = M d, and the centroid c (3,) about which the part turns.

    Six locators give M = J^-1. Of more than six the two-sided ones are kept exactly, and the one-sided ones as well as
    it goes, in the sense of least squares.
    """
    J, centre = locator_matrix(part.locator_points, part.locator_directions)
    if len(J) == 6:
        return np.linalg.inv(J), centre
    held, supports = J[~part.one_sided], J[part.one_sided]
    kkt = np.block([[supports.T @ supports, held.T], [held, np.zeros((len(held), len(held)))]])
    M = np.zeros((6, len(J)))
    inverse = np.linalg.inv(kkt)[:6]
    M[:, part.one_sided], M[:, ~part.one_sided] = inverse[:, :6] @ supports.T, inverse[:, 6:]
    return M, centre


def _check_independent(points: np.ndarray, directions: np.ndarray, one_sided: np.ndarray) -> None:
    J, centre = locator_matrix(points, directions)
    size = np.sqrt(((points - centre) ** 2).sum(axis=1).mean())
    scaled = J / np.array([1, 1, 1, size, size, size]) if size > 0 else np.zeros_like(J)
    condition = max(np.linalg.cond(scaled), np.linalg.cond(scaled[~one_sided]) if not one_sided.all() else 0.0)
    if not condition < CONDITION_LIMIT:
        raise GeometryFault(
            f"its {len(J)} locators do not fix it: the locator matrix has condition number {condition:.1e}, the limit is "
            f"{CONDITION_LIMIT:.0e}; no three points of the primary face may lie on a line, and the directions "
            "together must hold all three translations and all three rotations"
        )


def _contact_points(assembly: Assembly, pair: ContactPair, placed: Mapping[Part, NominalPart], meshes: Meshes) -> ContactPoints:
    moving, reference = placed[pair.moving.part], placed[pair.reference.part]
    own = patch(pair.moving, meshes)
    reach = pair.within if pair.within is not None else DEFAULT_REACH * moving.mesh.scale
    target = patch(pair.reference, meshes).placed(*reference.placement)
    placed_own = own.placed(*moving.placement)
    if isinstance(pair.points, str):
        sampled = own_vertices(own.mesh)
    else:
        evenly = DEFAULT_POINTS if pair.points is None and pair.spacing is None else pair.points
        _announce(pair, own.mesh.area, evenly)
        sampled = spread(own.mesh, evenly, pair.spacing)
    P_m, finest = moving.place(sampled), assembly.finest()
    if is_flat(placed_own) and is_flat(target):
        if pair.points is None and pair.spacing is None:
            P_m = np.concatenate([P_m, overlap_corners(placed_own, target)])
    elif math.isfinite(finest):
        P_m = _by_curvature(pair, placed_own, target, P_m, finest, reach)
    P_m = distinct(P_m, SAME * moving.mesh.scale)
    P_r, n_r, over = target.project(P_m)
    distance = np.linalg.norm(P_m - P_r, axis=1)
    kept = over & (distance <= reach)
    if not kept.any():
        raise GeometryFault(
            f"its faces never come within {reach:g} mm of each other; the nearest of {len(P_m)} points is "
            f"{distance.min():g} mm away"
            + (" and overhangs the rim" if not over.any() else "")
            + "; check the placement of the parts and the faces, or raise within="
        )
    _, normals, _ = placed_own.project(P_m[kept])
    if ((normals * n_r[kept]).sum(axis=1) > 0).all():
        raise GeometryFault(
            f"its faces {pair.moving} and {pair.reference} look the same way, so one cannot rest on the other; "
            "choose faces that look at each other"
        )
    return ContactPoints(
        pair.name,
        assembly.parts.index(moving.part),
        assembly.parts.index(reference.part),
        P_m[kept],
        P_r[kept],
        n_r[kept],
        surface=target,
        own=placed_own,
        facets=facet_error(placed_own, target, reach),
    )


def _announce(pair: ContactPair, area: float, count: int | None) -> None:
    points = count if pair.spacing is None else area / pair.spacing**2
    log.log(
        logging.WARNING if points and points > MANY else logging.INFO,
        'contact pair "%s": some %d contact points, some %.0f s',
        shown(pair.name), points or 0, SECONDS_PER_POINT * (points or 0),
    )  # fmt: skip


def _by_curvature(pair: ContactPair, own: Surface, target: Surface, P_m: np.ndarray, finest: float, reach: float) -> np.ndarray:
    """The contact points P_m (point, 3) of curved faces, with what curvature adds where the model leaves the choice open.

    Warns of what they, or the triangles, leave unseen of more than CHORD times `finest`, the smallest tolerance range.
    """
    every = following(own, target, chord=CHORD * finest, within=reach)
    if is_flat(target) and own.curvature > 0:
        every = np.concatenate([every, rim_points(own, target, math.sqrt(8 * CHORD * finest / own.curvature), reach)])
    if pair.points is None and pair.spacing is None:
        P_m = np.concatenate([P_m, every])
    errors = {
        "between its contact points": sampling_error(P_m, every, target, unit=finest, within=reach),
        "between the flat triangles and the round faces that they stand for": facet_error(own, target, reach),
    }
    advice = ("give it more points, or leave points and spacing out", "use a finer mesh")
    for (where, error), what in zip(errors.items(), advice, strict=True):
        if error > CHORD * finest:
            warnings.warn(
                f"{_where('contact pair', pair)}: parts may be off by up to {error:.2g} mm {where}, "
                f"{error / finest:.2g} of the smallest tolerance range, {finest:.4g} mm; {what}",
                ContactWarning,
                stacklevel=6,
            )
    return P_m


def _immovable(assembly: Assembly) -> list[str]:
    """Pairs that no free part could ever open."""
    return [
        f"{_where('contact pair', pair)}: contact can move neither side against the other; "
        f'declare part "{pair.moving.part.name}" free (fixed=False)'
        for pair in assembly.pairs
        if movers(assembly, pair.moving.part) == movers(assembly, pair.reference.part)
    ]


def movers(assembly: Assembly, part: Part) -> tuple[Part, ...]:
    """The free parts whose corrections move `part`: those that it is located on, and itself last."""
    location = assembly.location_of(part)
    below = movers(assembly, location.on) if location and location.on else ()
    touches = any(part in (pair.moving.part, pair.reference.part) for pair in assembly.pairs) or assembly.supports_of(part)
    return (*below, part) if touches and assembly.is_free(part) else below
