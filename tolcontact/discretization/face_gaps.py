"""Gaps between two faces as measurements: the measured points, and the areas that these represent."""

import numpy as np

from tolcontact.discretization.form_points import affordable_spacing, form_lengths, with_rims
from tolcontact.discretization.measured_geometry import FaceGap, MeasuredFace, MeasuredPoint
from tolcontact.discretization.point_weights import point_weights
from tolcontact.errors import GeometryFault
from tolcontact.geometry.overlap import overlap_corners
from tolcontact.geometry.spreading import spread

DEFAULT_PLACES, FORM_PLACES, MAX_PLACES = 200, 600, 4000  # by default, of a face with form if that resolves it, at all
MIN_SHARE = 0.04  # of a face, under the other one: smaller regions have fewer points
MAX_FACING = 0.0  # cosine between the normals of faces that do not face each other


def face_gap(moving: MeasuredFace, reference: MeasuredFace, is_largest: bool) -> FaceGap:
    """Return the largest or the mean gap between two faces.

    Raises GeometryFault if they lie nowhere over each other, do not face each other, or need too many places.
    """
    places = _places(moving, reference)
    feet, normals, is_over = reference.surface.project(places)
    places, feet, normals = places[is_over], feet[is_over], normals[is_over]
    if not len(places):
        raise GeometryFault(f"its faces {moving.face} and {reference.face} lie nowhere over each other; choose faces that do")
    _, outward, _ = moving.surface.project(places)
    if ((outward * normals).sum(axis=1) >= MAX_FACING).any():
        raise GeometryFault(
            f"its faces {moving.face} and {reference.face} do not face each other everywhere; choose faces with material "
            "behind both"
        )
    weights = point_weights(places, float(np.linalg.norm(places - feet, axis=1).max()), moving.surface, reference.surface)
    points = [
        (MeasuredPoint(moving.part, place, moving.deviation, direction), reference.wall(place))
        for place, direction in zip(places, outward, strict=True)
    ]
    shown = np.abs(places - weights @ places / weights.sum()).sum(axis=1).argmin()
    return FaceGap(np.array([[places[shown], feet[shown]]]), points, weights / weights.sum(), is_largest)


def _places(moving: MeasuredFace, reference: MeasuredFace) -> np.ndarray:
    """Return points (place, 3) of the moving face over the reference face, including the rim of the common region."""
    surface, lengths = moving.surface, form_lengths([moving.deviation, reference.deviation])
    spacing = (
        affordable_spacing(lengths, surface.mesh.area, FORM_PLACES) if lengths else (surface.mesh.area / DEFAULT_PLACES) ** 0.5
    )
    places = spread(surface.mesh, None, spacing)
    share = float(reference.surface.project(places)[2].mean())
    if not lengths and share < 1:
        spacing *= max(share, MIN_SHARE) ** 0.5
        places = spread(surface.mesh, None, spacing)
    if surface.is_flat and reference.surface.is_flat:
        places = np.concatenate([places, overlap_corners(surface, reference.surface)])
        reach = float(np.ptp(np.vstack([surface.mesh.bounds, reference.surface.mesh.bounds]), axis=0).sum())
        places = with_rims(places, surface, reference.surface, spacing, reach)
    places = places[reference.surface.project(places)[2]]
    if len(places) and surface.surfaces:
        places, _, _ = surface.project(places)  # from triangles onto the round face that they approximate
    if len(places) > MAX_PLACES:
        raise GeometryFault(
            f"the gap between {moving.face} and {reference.face} needs {len(places)} places, by the correlation length of "
            f"their form, {min(lengths):.3g} mm; expected at most {MAX_PLACES}; choose smaller faces, or a form "
            "that changes over larger lengths"
        )
    return places
