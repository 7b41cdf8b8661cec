"""Where the faces of a contact pair may touch: points of the moving face, and their feet on the reference face."""

import functools
import logging
import math
import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tolcontact.declaration import Assembly, ContactPair, Face, Part
from tolcontact.discretization.nominal import ContactPoints, NominalPart
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.round_contact import round_points
from tolcontact.discretization.round_points import RoundPoints
from tolcontact.errors import ContactWarning, GeometryFault, designation, shown
from tolcontact.features import FaceDeviation, Features
from tolcontact.geometry.curvature import CHORD, distinct, facet_error, following, is_flat, sampling_error
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.overlap import overlap_corners, rim_points
from tolcontact.geometry.spreading import own_vertices, spread
from tolcontact.geometry.surface import Surface

DEFAULT_REACH = 0.1
DEFAULT_POINTS = 200
MANY = 100_000  # contact points of a pair; more are announced
SECONDS_PER_POINT = 1e-4
SAME = 1e-9  # of the part's size: points that are no farther apart are one

log = logging.getLogger(__name__)


def contact_points(
    assembly: Assembly, pair: ContactPair, placed: Mapping[Part, NominalPart], meshes: Meshes, features: Features
) -> ContactPoints:
    """The contact points of a declared pair, between the parts as `placed`.

    Raises GeometryFault if its faces are nowhere within reach, or point the same way.
    """
    moving, reference = placed[pair.moving.part], placed[pair.reference.part]
    own = patch(pair.moving, meshes)
    reach = pair.within if pair.within is not None else DEFAULT_REACH * moving.mesh.scale
    target = patch(pair.reference, meshes).placed(*reference.placement)
    placed_own = own.placed(*moving.placement)
    deviating = _deviating(pair.moving, moving, meshes, features), _deviating(pair.reference, reference, meshes, features)
    made = functools.partial(
        ContactPoints,
        pair.name,
        assembly.parts.index(moving.part),
        assembly.parts.index(reference.part),
        surface=target,
        own=placed_own,
        facets=facet_error(placed_own, target, reach),
        deviating=deviating,
    )
    if pair.points is None and pair.spacing is None and (found := round_points(placed_own, target, reach)):
        touching, feet, normals = (np.array(each) for each in zip(*(point.nominal() for point in found), strict=True))
        return made(touching, feet, normals, Offsets.none(len(found)), round=RoundPoints.of(found))
    if isinstance(pair.points, str):
        sampled = own_vertices(own.mesh)
    else:
        evenly = DEFAULT_POINTS if pair.points is None and pair.spacing is None else pair.points
        _announce(pair, own.mesh.area, evenly)
        sampled = spread(own.mesh, evenly, pair.spacing)
    P_m, finest = moving.placed(sampled), assembly.finest()
    if is_flat(placed_own) and is_flat(target):
        if pair.points is None and pair.spacing is None:
            P_m = np.concatenate([P_m, overlap_corners(placed_own, target)])
    elif math.isfinite(finest):
        P_m = _by_curvature(pair, placed_own, target, P_m, finest, reach)
    P_m = distinct(P_m, SAME * moving.mesh.scale)
    if placed_own.surfaces:
        P_m, _, _ = placed_own.project(P_m)
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
            f"its faces {pair.moving} and {pair.reference} point the same way, so one cannot rest on the other; "
            "choose faces that face each other"
        )
    points = made(P_m[kept], P_r[kept], n_r[kept], Offsets.none(int(kept.sum())))
    return replace(points, offsets=_heights(deviating, points.facing)) if any(deviating) else points


def _deviating(face: Face, part: NominalPart, meshes: Meshes, features: Features) -> FaceDeviation | None:
    """What a face deviates by, if it is of a feature."""
    if not part.part.features:
        return None
    return features.face_at(face, meshes, part.placement)


def _heights(deviating: tuple[FaceDeviation | None, FaceDeviation | None], facing: np.ndarray) -> Offsets:
    """What points stand out by as faces grow; `facing` (point,): 1 where they face each other."""
    of_side = zip(deviating, (facing, np.ones_like(facing)), strict=True)
    grown = [
        Offsets(face.columns[face.height != 0], np.outer(face.height[face.height != 0], share))
        for face, share in of_side
        if face is not None and face.grows
    ]
    return Offsets.joined(grown, len(facing)) if grown else Offsets.none(len(facing))


def _announce(pair: ContactPair, area: float, count: int | None) -> None:
    points = count if pair.spacing is None else area / pair.spacing**2
    log.log(
        logging.WARNING if points and points > MANY else logging.INFO,
        'contact pair "%s": about %d contact points, about %.0f s',
        shown(pair.name), points or 0, SECONDS_PER_POINT * (points or 0),
    )  # fmt: skip


def _by_curvature(pair: ContactPair, own: Surface, target: Surface, P_m: np.ndarray, finest: float, reach: float) -> np.ndarray:
    """The contact points P_m (point, 3) of curved faces, with what curvature adds if the model leaves the choice open.

    Warns of what they, or the triangles, leave unseen of more than CHORD times `finest`, the smallest tolerance range.
    """
    every = following(own, target, chord=CHORD * finest, within=reach)
    if is_flat(target) and own.curvature > 0:
        every = np.concatenate([every, rim_points(own, target, math.sqrt(8 * CHORD * finest / own.curvature), reach)])
    if pair.points is None and pair.spacing is None:
        P_m = np.concatenate([P_m, every])
    errors = {
        "between its contact points": sampling_error(P_m, every, target, unit=finest, within=reach),
        "between flat triangles and the round faces that they approximate": facet_error(own, target, reach),
    }
    advice = ("give it more points, or leave points and spacing out", "use a finer mesh")
    for (seen, error), what in zip(errors.items(), advice, strict=True):
        if error > CHORD * finest:
            warnings.warn(
                f"{designation('contact pair', pair)}: parts may be off by up to {error:.2g} mm {seen}, "
                f"{error / finest:.2g} of the smallest tolerance range ({finest:.4g} mm); {what}",
                ContactWarning,
                stacklevel=6,
            )
    return P_m
