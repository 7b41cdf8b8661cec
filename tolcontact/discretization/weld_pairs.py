"""Welds: points at which a joint holds elastic parts together.

The guns of the station that joins them hold the faces of the parts, which deviate with their features as in contact pairs, at
their nominal distance. What gaps the pads then have, along their normals and across, each later station keeps: rows of
two-sided locators between the parts. The kept gaps are inputs of a realization after its deviations. What guns and welds hold
needs no contact point: rows of the same nodes would contradict each other by the squares of rotations.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.declaration import Assembly, Joint
from tolcontact.discretization.fixed_contact import ContactPoints, Offsets
from tolcontact.discretization.locators import NominalPart
from tolcontact.discretization.scenes import Scene
from tolcontact.elasticity import MAX_OFFSET
from tolcontact.errors import Faults, GeometryFault, designation
from tolcontact.features import FaceDeviation, Features
from tolcontact.geometry.tolerances import ROUNDING

REACH = 0.1  # of the size of the other part: parts that are further apart are not welded
PAD_POINTS = 3
MAX_CONDITION = 1e6  # of the rows of a joint, with lengths in sizes of the part


@dataclass(frozen=True, eq=False)
class Weld:
    """The rows of a joint: gaps n . (x_m - x_r) between two parts.

    station             that joins the parts
    moving, reference   indices of the parts in that station
    P_m, P_r, n_r       (row, 3) points and directions, nominal
    columns             (row,) inputs of a realization that hold the gaps at the end of the station
    """

    station: str
    moving: int
    reference: int
    P_m: Float[Array, "row 3"]
    P_r: Float[Array, "row 3"]
    n_r: Float[Array, "row 3"]
    columns: Int[Array, " row"]


def welds_and_pairs(
    line: Assembly,
    scenes: Sequence[Scene],
    parts: Sequence[NominalPart],
    features: Features,
    pairs: Sequence[ContactPoints],
    inputs: int,
) -> tuple[tuple[Weld, ...], tuple[ContactPoints, ...]]:
    """Return the welds of all joints at points, whose first input is number `inputs`, and all pairs.

    These are the `pairs` without the contact points that guns or welds hold, and the pairs of the welds in all stations.
    Raises ModelError for points where the parts are too far apart, and for a pair without any other contact point.
    """
    faults, welds, holding = Faults(), list[Weld](), list[ContactPoints]()
    for joint in line.joints:
        for number, scene in enumerate(scenes):
            if not joint.at or scene.station != joint.station:
                continue
            made = faults.attempt(designation("joint", joint), _weld, joint, scene, parts, features, inputs)
            if made is not None:
                welds.append(made[0])
                inputs += len(made[0].columns)
                later = [other for other in scenes[number + 1 :] if joint.welded[0] in other.assembly.parts]
                holding += [*made[1], *(_kept(joint, made[0], scene) for scene in later)]
    free = []
    for pair in pairs:
        held = [
            other.P_m if other.moving == pair.moving else other.P_r
            for other in holding
            if {other.moving, other.reference} == {pair.moving, pair.reference}
        ]
        place = f'contact pair "{pair.name}"'
        free.append(faults.attempt(place, pair.without, np.concatenate(held), MAX_OFFSET) if held else pair)
    faults.refuse(line.name)
    return tuple(welds), (*free, *holding)


def _weld(
    joint: Joint, scene: Scene, parts: Sequence[NominalPart], features: Features, first: int
) -> tuple[Weld, list[ContactPoints]]:
    """Return the weld of a joint, and the pairs of its guns in the station that joins the parts."""
    reference, moving = (scene.index(part) for part in joint.welded)
    own, other = parts[reference].body, parts[moving].body
    centres = parts[reference].placed(np.array([point.position for point in joint.at], dtype=float))
    normals = np.array([_facing_normal(own, other, centre) for centre in centres])
    rows = [row for centre, n in zip(centres, normals, strict=True) for row in _pad_rows(centre, n, joint.pad)]
    P_r, n_r = (np.array(values) for values in zip(*rows, strict=True))
    P_m = np.array([_nearest(other, point)[0] for point in np.concatenate([centres, P_r])])
    distance = np.linalg.norm(P_m[: len(centres)] - centres, axis=1)
    if distance.max() > REACH * parts[moving].mesh.scale:
        k = int(distance.argmax())
        raise GeometryFault(
            f'its point {joint.at[k]} is {distance[k]:.3g} mm from part "{parts[moving].name}"; give points where both are'
        )
    arms = (P_r - P_r.mean(axis=0)) / parts[moving].mesh.scale
    if not np.linalg.cond(np.hstack([n_r, np.cross(arms, n_r)])) < MAX_CONDITION:
        raise GeometryFault(
            f'at its points part "{parts[moving].name}" turns on part "{parts[reference].name}" as on a hinge; give points '
            "that do not lie on one line, or a pad"
        )
    columns = first + np.arange(len(P_r))
    weld = Weld(scene.station, moving, reference, P_m[len(centres) :], P_r, n_r, columns)
    deviating = [
        (_face_at(features, parts[moving], point, -n), _face_at(features, parts[reference], centre, n))
        for point, centre, n in zip(P_m, centres, normals, strict=False)
    ]
    return weld, list(_guns(scene.label(joint.name), weld, P_m[: len(centres)], normals, deviating))


def _face_at(features: Features, part: NominalPart, point: np.ndarray, n: np.ndarray) -> FaceDeviation | None:
    """Return how the face of a part at a point [mm], with outward normal n, deviates with its feature and expands."""
    R, t = part.placement
    position = (point - t) @ R
    of_part = (nominal for nominal in features.features.values() if nominal.feature.part is part.part and nominal.varies)
    feature = next((nominal.feature for nominal in of_part if nominal.has_moving_face(position, n @ R)), None)
    deviation = None if feature is None else features.face_of(feature, position, part.placement)
    return features.at_point(deviation, part.part, point, part.placement)


def _guns(
    name: str, weld: Weld, P: np.ndarray, n: np.ndarray, deviating: Sequence[tuple[FaceDeviation | None, FaceDeviation | None]]
) -> Iterator[ContactPoints]:
    """Yield the guns of a weld at points P (gun, 3) with normals n (gun, 3): a pair for each two faces that they hold."""
    for number, faces in enumerate(dict.fromkeys(deviating), 1):
        held = [k for k, other in enumerate(deviating) if other == faces]
        yield ContactPoints(
            f"guns of {name}" + (f" {number}" if number > 1 else ""), weld.moving, weld.reference, P[held], P[held], n[held],
            Offsets.joined([], len(held)), deviating=faces, holds=True, elastic=True,
        ).with_heights()  # fmt: skip


def _pad_rows(centre: np.ndarray, n: np.ndarray, pad: float | None) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return points and directions that hold a pad of a radius [mm] as a rigid body, or a point without a pad."""
    across = np.cross(n, np.eye(3)[np.abs(n).argmin()])
    across /= np.linalg.norm(across)
    along = np.cross(across, n)
    if pad is None:
        return [(centre, direction) for direction in (n, across, along)]
    angles = 2 * np.pi * np.arange(PAD_POINTS) / PAD_POINTS
    points = [centre + pad * (np.cos(angle) * along + np.sin(angle) * across) for angle in angles]
    beside = np.cross(n, points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    return [*((point, n) for point in points), (points[0], across), (points[0], along), (points[1], beside)]


def _kept(joint: Joint, weld: Weld, scene: Scene) -> ContactPoints:
    """Return the pair that keeps the gaps of a weld in a later station."""
    reference, moving = (scene.index(part) for part in joint.welded)
    gaps = Offsets(weld.columns, np.eye(len(weld.columns)))
    return ContactPoints(
        f"welds of {scene.label(joint.name)}", moving, reference, weld.P_m, weld.P_r, weld.n_r, gaps, holds=True, elastic=True
    )


def _facing_normal(own: trimesh.Trimesh, other: trimesh.Trimesh, point: np.ndarray) -> np.ndarray:
    """Return the normal of a body at a point of its surface, towards another body; at an edge, of the face that faces it."""
    normals = []
    for body in (own, other):
        _, distances = _nearest(body, point)
        normals.append(np.asarray(body.face_normals)[distances <= distances.min() + ROUNDING * body.scale])
    k, _ = np.unravel_index(np.argmin(normals[0] @ normals[1].T), (len(normals[0]), len(normals[1])))
    return np.asarray(normals[0][k])


def _nearest(body: trimesh.Trimesh, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the place (3,) [mm] of a body nearest to a point, and the distances (triangle,) [mm] of all triangles."""
    triangles = np.asarray(body.triangles)
    places = trimesh.triangles.closest_point(triangles, np.broadcast_to(point, (len(triangles), 3)))
    distances = np.linalg.norm(places - point, axis=1)
    return places[distances.argmin()], distances
