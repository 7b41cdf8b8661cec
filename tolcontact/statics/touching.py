"""The contacts of an assembly at given poses of its parts: locators, and the points where the faces of a pair touch."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.gap import hull_corners

TOUCH_SHARE = 1e-6  # of a face's size: faces at a smaller distance touch
FLATNESS = 1e-9  # of the extent of points: smaller deviations from a plane or a line are rounding
GROUND = -1


class Contact(NamedTuple):
    """A locator, or a touching contact pair.

    moving, reference   indices of the parts; GROUND for the ground; for a joint, the index of its carrier
    points, normals     (point, 3) [mm] and (point, 3): contact points, and unit vectors into the moving part
    is_guide            whether it is a bilateral constraint without friction
    mu                  stated coefficient of friction; None if none is stated
    """

    label: str
    moving: int
    reference: int
    points: Float[Array, "point 3"]
    normals: Float[Array, "point 3"]
    is_guide: bool
    mu: float | None


@dataclass(frozen=True, eq=False)
class Touching:
    """The contacts of an assembly, and its pairs that do not touch.

    loads        (part, 6): the sum of the forces on each part [N], and of their moments about the origin [N mm]
    force        the sum of the magnitudes of all forces [N]
    is_located   (part,): whether a part is located; others are fixed
    """

    contacts: tuple[Contact, ...]
    open_pairs: tuple[str, ...]
    loads: Float[Array, "part 6"]
    force: float
    is_located: Bool[Array, " part"]


class TouchingPoints(NamedTuple):
    """Points (point, 3) [mm] at which a pair touches, and unit vectors (point, 3) there, into the moving part."""

    points: Float[Array, "point 3"]
    normals: Float[Array, "point 3"]


def wrenches(points: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return forces (n, 3) with their moments about the origin, (n, 6), at points (n, 3)."""
    return np.hstack([forces, np.cross(points, forces)])


def across(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two arrays of unit vectors (n, 3), orthogonal to unit vectors (n, 3) and to each other."""
    u = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1)[:, None]
    return u, np.cross(normals, u)


def drawn_contacts(nominal: Nominal) -> Touching:
    """Return the contacts of the nominal assembly, and the loads of its parts."""
    pairs = [pair for pair in nominal.pairs if not pair.is_supports]
    return contacts_at(nominal, np.tile(pose.AT_REST, (len(nominal.parts), 1)), [_nominal_points(pair) for pair in pairs])


def contacts_at(nominal: Nominal, poses: np.ndarray, touching_points: Sequence[TouchingPoints]) -> Touching:
    """Return the contacts and loads at poses (part, 12), with the `touching_points` where each declared pair touches."""
    declared = nominal.assembly.pairs
    loads = np.zeros((len(nominal.parts), 6))
    for force in nominal.assembly.forces:
        part = nominal.part_index(force.at.part, force.station)
        at = pose.apply(poses[part], nominal.position(force.at)[None])
        loads[_body(nominal, part)] += wrenches(at, np.array([force.vector]))[0]
    return Touching(
        (*_locator_contacts(nominal, poses), *_pair_contacts(nominal, touching_points)),
        tuple(pair.name for pair, touching in zip(declared, touching_points, strict=True) if not len(touching.points)),
        loads,
        float(sum(np.linalg.norm(force.vector) for force in nominal.assembly.forces)),
        np.array([nominal.assembly.location_of(part.part) is not None and part.carried is None for part in nominal.parts]),
    )


def _body(nominal: Nominal, part: int) -> int:
    """Return the carrier of a part of a joint, or the part if it is in no joint."""
    entry = nominal.parts[part]
    return part if entry.carried is None or entry.parent is None else entry.parent


def _locator_contacts(nominal: Nominal, poses: np.ndarray) -> Iterator[Contact]:
    """Yield the locators of all parts."""
    for index, part in enumerate(nominal.parts):
        locators, ground = part.locators, GROUND if part.parent is None else part.parent
        points = pose.apply(poses[index], locators.points)
        for locator, owner in enumerate(part.owners):
            points[locator] = pose.apply(poses[owner], locators.points[locator, None])[0]
        directions = locators.directions if ground == GROUND else locators.directions @ pose.rotation(poses[ground]).T
        parent = ground if ground == GROUND else _body(nominal, ground)
        for label, point, direction, one_sided in zip(locators.labels, points, directions, locators.one_sided, strict=True):
            yield Contact(label, index, parent, point[None], direction[None], not one_sided, nominal.assembly.mu)


def _pair_contacts(nominal: Nominal, touching_points: Sequence[TouchingPoints]) -> Iterator[Contact]:
    """Yield the pairs that touch; points that add no further load capacity are omitted."""
    for declared, (points, normals) in zip(nominal.assembly.pairs, touching_points, strict=True):
        sides = (nominal.part_index(face.part, declared.station) for face in (declared.moving, declared.reference))
        moving, reference = (_body(nominal, side) for side in sides)
        corners, mu = supporting_points(points, normals), nominal.assembly.mu if declared.mu is None else declared.mu
        if len(corners):
            yield Contact(declared.name, moving, reference, points[corners], normals[corners], False, mu)


def _nominal_points(pair: ContactPoints) -> TouchingPoints:
    """Return where a pair touches nominally."""
    assert pair.moving_face is not None and pair.reference_face is not None
    size = max(pair.moving_face.mesh.scale, pair.reference_face.mesh.scale)
    nearness = TOUCH_SHARE * size + pair.facets + pair.bulge + pair.coordinate_error
    touches = pair.stays & (np.linalg.norm(pair.P_m - pair.P_r, axis=1) <= nearness)
    return TouchingPoints(pair.P_r[touches], pair.n_r[touches])


def supporting_points(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the indices of points (point, 3) that can balance every load that all of them can, also by friction.

    If all normals (point, 3) are equal and the points lie in one plane, these are the corners of their hull: a force within the
    friction cone of any point is the sum of forces within the cones of the corners, with the same moment.
    """
    if len(points) < 2 or np.ptp(normals, axis=0).max() > FLATNESS:
        return np.arange(len(points))
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    rank = int((sizes > FLATNESS * sizes[0]).sum())
    coordinates = (points - points.mean(axis=0)) @ axes[:rank].T
    return hull_corners(coordinates.T) if rank else np.arange(len(points))
