"""Welds: points at which a joint holds elastic parts together.

The guns of the station that joins them hold the parts at their nominal distance. What gaps the pads then have, along their
normals and across, each later station keeps: rows of two-sided locators between the parts. The kept gaps are inputs of a
realization after its deviations.
"""

from collections.abc import Sequence

import numpy as np

from tolcontact.declaration import Assembly, Face, Joint
from tolcontact.discretization.locators import NominalPart
from tolcontact.discretization.nominal import ContactPoints
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.scenes import Scene
from tolcontact.discretization.weld import Weld
from tolcontact.errors import Faults, GeometryFault, designation
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.surface import Surface

REACH = 0.1  # of the size of the other part: parts that are further apart are not welded
PAD_POINTS = 3


def welds_and_pairs(
    line: Assembly, scenes: Sequence[Scene], parts: Sequence[NominalPart], meshes: Meshes, inputs: int
) -> tuple[tuple[Weld, ...], tuple[ContactPoints, ...]]:
    """Return the welds of all joints at points, whose first input is number `inputs`, and their pairs in all stations.

    Raises ModelError for points where the parts are too far apart.
    """
    faults, welds, pairs = Faults(), list[Weld](), list[ContactPoints]()
    for joint in line.joints:
        for number, scene in enumerate(scenes):
            if not joint.at or scene.station != joint.station:
                continue
            made = faults.attempt(designation("joint", joint), _weld, joint, scene, parts, meshes, inputs)
            if made is not None:
                welds.append(made[0])
                inputs += len(made[0].columns)
                later = [other for other in scenes[number + 1 :] if joint.welded[0] in other.assembly.parts]
                pairs += [made[1], *(_kept(joint, made[0], scene) for scene in later)]
    faults.refuse(line.name)
    return tuple(welds), tuple(pairs)


def _weld(joint: Joint, scene: Scene, parts: Sequence[NominalPart], meshes: Meshes, first: int) -> tuple[Weld, ContactPoints]:
    """Return the weld of a joint, and the pair of its guns in the station that joins the parts."""
    reference, moving = (scene.index(part) for part in joint.welded)
    face = _surface(parts[reference], meshes)
    centres = parts[reference].placed(np.array([point.position for point in joint.at], dtype=float))
    normals = face.normals(*face.nearest(centres))
    rows = [row for centre, n in zip(centres, normals, strict=True) for row in _pad_rows(centre, n, joint.pad)]
    P_r, n_r = (np.array(values) for values in zip(*rows, strict=True))
    _, P_m = _surface(parts[moving], meshes).nearest(np.concatenate([centres, P_r]))
    distance = np.linalg.norm(P_m[: len(centres)] - centres, axis=1)
    if distance.max() > REACH * parts[moving].mesh.scale:
        k = int(distance.argmax())
        raise GeometryFault(
            f'its point {joint.at[k]} is {distance[k]:.3g} mm from part "{parts[moving].name}"; give points where both are'
        )
    columns = first + np.arange(len(P_r))
    weld = Weld(scene.station, moving, reference, P_m[len(centres) :], P_r, n_r, columns)
    at_guns = P_m[: len(centres)]
    none = Offsets.joined([], len(centres))
    guns = ContactPoints(
        f"guns of {scene.label(joint.name)}", moving, reference, at_guns, at_guns, normals, none, holds=True, elastic=True
    )
    return weld, guns


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


def _surface(part: NominalPart, meshes: Meshes) -> Surface:
    return patch(Face(part.part, ()), meshes).placed(*part.placement)
