"""Contact points: points of the moving face of a pair, projected onto the reference face; and locators as pairs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tolcontact.declaration import Assembly, ContactPair, Part
from tolcontact.declaration.contact_pair import MAX_POINTS
from tolcontact.discretization import form_points
from tolcontact.discretization.fixed_contact import ContactPoints, Offsets
from tolcontact.discretization.locators import NominalPart
from tolcontact.discretization.round_contact import RoundContact
from tolcontact.discretization.scenes import Scene
from tolcontact.elasticity import MAX_OFFSET, node_table
from tolcontact.errors import GeometryFault
from tolcontact.features import Features
from tolcontact.geometry.curvature import CHORD_SHARE, curvature_points, distinct, facet_error, sampling_error
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.overlap import overlap_corners, rim_points
from tolcontact.geometry.spreading import spread, unique_points
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ROUNDING
from tolcontact.geometry.triangle_mesh import coordinate_error

DEFAULT_REACH = 0.1  # of the moving part's size
DEFAULT_POINTS = 200
FORM_POINTS = 10_000  # with form, if that resolves it
DEFAULT_SPRINGS = 40  # which may all be active at once, so that a QP has a row for each


def contact_points(
    scene: Scene, pair: ContactPair, placed: Mapping[Part, NominalPart], meshes: Meshes, features: Features
) -> ContactPoints:
    """Return the contact points of a declared pair of a scene, between the parts in `placed`.

    Raises GeometryFault if its faces are nowhere within reach, or have the same direction.
    """
    moving, reference = placed[pair.moving.part], placed[pair.reference.part]
    unplaced = patch(pair.moving, meshes)
    moving_face = unplaced.placed(*moving.placement)
    reference_face = patch(pair.reference, meshes).placed(*reference.placement)
    reach = pair.within if pair.within is not None else DEFAULT_REACH * moving.mesh.scale
    deviating = (
        features.deviation(pair.moving, meshes, moving.placement),
        features.deviation(pair.reference, meshes, reference.placement),
    )
    lengths = form_points.form_lengths(deviating)
    if lengths:
        triangles = form_points.facing_triangles(moving_face, reference_face, deviating[1])
        unplaced, moving_face = unplaced.part(triangles), moving_face.part(triangles)
        reference_face = reference_face.part(form_points.facing_triangles(reference_face, moving_face, deviating[0]))
        form_points.check_facing(moving_face, reference_face, deviating)
    rounding = coordinate_error(moving.mesh) + coordinate_error(reference.mesh)
    common: dict[str, Any] = {
        "name": pair.name,
        "moving": scene.index(moving.part),
        "reference": scene.index(reference.part),
        "reference_face": reference_face,
        "moving_face": moving_face,
        "within": reach,
        "facets": facet_error(moving_face, reference_face, reach),
        "deviating": deviating,
        "elastic": _bends(pair),
    }
    points: ContactPoints | None = None
    if _is_open(pair) and not lengths:
        points = RoundContact.between(moving_face, reference_face, reach, rounding, common)
    if points is None:
        undetected = None
        candidates = form_points.coaxial_points(moving_face, reference_face, deviating) if _is_open(pair) and lengths else None
        if candidates is None and _is_open(pair):
            candidates = _retained_nodes((moving, reference), moving_face)
        if candidates is None:
            faces = moving_face, reference_face
            candidates, undetected = _candidates(scene.assembly, pair, moving, unplaced.mesh, faces, reach, lengths)
        P_m, P_r, n_r = _touching(pair, candidates, moving_face, reference_face, reach)
        points = ContactPoints(
            P_m=P_m,
            P_r=P_r - rounding * n_r if rounding else P_r,
            n_r=n_r,
            offsets=Offsets.joined([], len(P_m)),
            coordinate_error=rounding,
            sampling_error=undetected,
            **common,
        ).with_heights()
    return points if pair.stiffness is None else replace(points, stiffness=pair.stiffness * points.stiffness_shares())


def _bends(pair: ContactPair) -> bool:
    """Return whether one of the parts of a pair is elastic."""
    return any(side.part.elasticity is not None for side in (pair.moving, pair.reference))


def _is_open(pair: ContactPair) -> bool:
    """Return whether the model leaves the choice of points open."""
    return pair.points is None and pair.spacing is None


def _retained_nodes(parts: Sequence[NominalPart], face: Surface) -> np.ndarray | None:
    """Return the nodes (node, 3) of an imported stiffness matrix, where forces can act, on the `face` or projected onto it.

    They belong to the first part that has a matrix; None if no part has one. Raises GeometryFault if they cannot be read.
    """
    for number, part in enumerate(parts):
        elastic = part.part.elasticity
        if elastic is not None and elastic.nodes is not None:
            nodes = part.placed(node_table(Path(elastic.nodes))[0])
            on_face, _, is_over = face.project(nodes)
            return on_face[is_over] if number else nodes[np.linalg.norm(nodes - on_face, axis=1) <= MAX_OFFSET]
    return None


def _candidates(
    assembly: Assembly,
    pair: ContactPair,
    moving: NominalPart,
    mesh: trimesh.Trimesh,
    faces: tuple[Surface, Surface],
    reach: float,
    lengths: Sequence[float],
) -> tuple[np.ndarray, float | None]:
    """Return points (point, 3) of the moving face that become contact points if they lie over the reference face.

    The second result is the penetration [mm] that they may leave undetected on curved faces; None for flat ones. `mesh` is the
    moving face in its part's own frame, `faces` are both faces in their nominal poses, `lengths` their correlation lengths.
    """
    moving_face, reference_face = faces
    undetected = None
    if isinstance(pair.points, str):
        points = unique_points(np.asarray(mesh.vertices))
    else:
        is_fine = lengths and _is_open(pair)
        spacing = form_points.affordable_spacing(lengths, float(mesh.area), FORM_POINTS) if is_fine else pair.spacing
        open_count = DEFAULT_POINTS if pair.stiffness is None and not _bends(pair) else DEFAULT_SPRINGS
        count = open_count if _is_open(pair) else pair.points
        if spacing is not None:
            _check_number(mesh.area / spacing**2, f"a spacing of {spacing:g} mm gives")
        points = spread(mesh, count if spacing is None else None, spacing)
    if lengths:
        form_points.check_resolved(points, mesh, lengths)
    P_m, finest = moving.placed(points), assembly.smallest_zone()
    if moving_face.is_flat and reference_face.is_flat:
        if _is_open(pair):
            P_m = np.concatenate([P_m, overlap_corners(moving_face, reference_face)])
            if lengths:
                P_m = form_points.with_rims(P_m, moving_face, reference_face, form_points.form_spacing(lengths), reach)
    elif math.isfinite(finest):
        P_m, undetected = _with_curvature(moving_face, reference_face, P_m, finest, reach, is_open=_is_open(pair))
    P_m = distinct(P_m, ROUNDING * moving.mesh.scale)
    if moving_face.surfaces:
        P_m, _, _ = moving_face.project(P_m)
    return P_m, undetected


def _touching(
    pair: ContactPair, P_m: np.ndarray, moving_face: Surface, reference_face: Surface, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return P_m, P_r and n_r (point, 3) of the points over the reference face and within reach of it."""
    P_r, n_r, is_over = reference_face.project(P_m)
    distance = np.linalg.norm(P_m - P_r, axis=1)
    is_touching = is_over & (distance <= reach)
    if not is_touching.any():
        raise GeometryFault(
            f"its faces never come within {reach:g} mm of each other; the nearest of {len(P_m)} points is "
            f"{distance.min():g} mm away"
            + (" and overhangs the rim" if not is_over.any() else "")
            + "; check the placement of the parts and the faces, or raise within="
        )
    _, normals, _ = moving_face.project(P_m[is_touching])
    if ((normals * n_r[is_touching]).sum(axis=1) > 0).all():
        raise GeometryFault(
            f"its faces {pair.moving} and {pair.reference} point the same way, so one cannot rest on the other; "
            "choose faces that face each other"
        )
    _check_number(int(is_touching.sum()), "its faces have")
    return P_m[is_touching], P_r[is_touching], n_r[is_touching]


def _check_number(points: float, subject: str) -> None:
    """Raise GeometryFault if there are too many contact points."""
    if points > MAX_POINTS:
        raise GeometryFault(
            f"{subject} {points:.3g} contact points; expected at most {MAX_POINTS}; choose fewer with points=..."
        )


def _with_curvature(
    moving_face: Surface, reference_face: Surface, P_m: np.ndarray, finest: float, reach: float, *, is_open: bool
) -> tuple[np.ndarray, float]:
    """Return points P_m (point, 3) of curved faces, and the penetration [mm] that may lie undetected between them.

    If their choice `is_open`, points are added that follow curvature, by CHORD_SHARE of the `finest` tolerance range.
    """
    dense = curvature_points(moving_face, reference_face, chord=CHORD_SHARE * finest, within=reach)
    if reference_face.is_flat and moving_face.curvature > 0:
        step = math.sqrt(8 * CHORD_SHARE * finest / moving_face.curvature)
        dense = np.concatenate([dense, rim_points(moving_face, reference_face, step, reach)])
    if is_open:
        P_m = np.concatenate([P_m, dense])
    return P_m, sampling_error(P_m, dense, reference_face, unit=finest, within=reach)


def support_pairs(parts: tuple[NominalPart, ...], scenes: Sequence[Scene]) -> Iterator[ContactPoints]:
    """Yield the one-sided locators of each free part, or of each part of a free joint, as a contact pair.

    Two-sided locators that hold an elastic part follow, each a pair of one point, which pushes and pulls; then compliant ones.
    """
    start = 0
    for index, part in enumerate(parts):
        locators, first = part.locators, start
        start += len(locators)
        if not part.free:
            continue
        owners = np.array(part.owners or (index,) * len(locators), dtype=int)
        scene = next(scene for scene in scenes if scene.station == part.station)
        for owner in np.unique(owners[locators.one_sided]):
            supports = np.flatnonzero(locators.one_sided & (owners == owner))
            name, elastic = scene.supports_name(parts[owner].part), bool(locators.elastic.any())
            yield _locator_pair(part, name, int(owner), first, supports, elastic=elastic)
        for number in np.flatnonzero(locators.elastic & ~locators.one_sided):
            label, owner, point = locators.labels[number], int(owners[number]), np.array([number])
            yield _locator_pair(part, label, owner, first, point, holds=True, elastic=True)
        for number in np.flatnonzero(locators.springy & ~locators.one_sided & ~locators.elastic):
            # A compliant two-sided locator is a spring that pushes and one that pulls, at the same point.
            locator = _locator_pair(part, locators.labels[number], int(owners[number]), first, np.array([number]))
            pair, signs = locator.take(np.array([0, 0])), np.array([1.0, -1.0])
            offsets = Offsets(pair.offsets.columns, pair.offsets.matrix * signs)
            yield replace(pair, n_r=signs[:, None] * pair.n_r, offsets=offsets, pulls=signs < 0)


def _locator_pair(
    part: NominalPart, name: str, owner: int, start: int, numbers: np.ndarray, *, holds: bool = False, elastic: bool = False
) -> ContactPoints:
    """Return some locators of a part, by their numbers, as a pair."""
    locators = part.locators
    P, n, stiffness = locators.points[numbers], locators.directions[numbers], locators.stiffness[numbers]
    terms = [Offsets(start + numbers, np.eye(len(numbers)))]  # their own deviations, and deviations of the faces they touch
    for place, number in enumerate(numbers):
        columns, factors = locators.pushes(number)
        if columns.size:
            terms.append(Offsets(columns, np.outer(factors, np.arange(len(numbers)) == place)))
    return ContactPoints(
        name, owner, part.parent, P, P, n, Offsets.joined(terms, len(numbers)), locators=start + numbers,
        stiffness=np.where(locators.springy[numbers], stiffness, np.inf), holds=holds, elastic=elastic,
    )  # fmt: skip
