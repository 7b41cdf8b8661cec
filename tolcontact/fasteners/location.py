"""Locations of fasteners: in a hole that holds them, or floating."""

import math
from collections.abc import Iterator

import numpy as np

from tolcontact.declaration import Assembly, Face, Feature, Locator, Part, Station
from tolcontact.fasteners.fit import INTO, Fit
from tolcontact.fasteners.placed_faces import PlacedCylinder, PlacedPlane, meshes_of, placement
from tolcontact.geometry.faces import face_area
from tolcontact.geometry.shapes import HEAD_WIDTH

DIGITS = 12  # of places [mm]: what is beyond is rounding
SAME_FACE = 1 - 1e-6  # share of its area that a face has in common with the face of its feature


def locate(scene: Assembly | Station, name: str, part: Part, fit: Fit) -> None:
    """Locate a fastener in the hole that holds it, or let it float: with its head on its seat, or held at an end alone."""
    if INTO in fit.holes:
        ground = _feature_of(fit.holes[INTO].face, f"{name} hole")
        scene.locate(part, list(_hole_locators(part, fit, fit.holes[INTO])), on=ground)
    elif fit.seat is not None:
        ground = _feature_of(fit.seat.face, f"{name} seat")
        scene.locate(part, list(_seat_locators(part, fit, fit.seat)), on=ground, floating=True)
    else:
        first = next(iter(fit.holes.values()))
        end = _locator(part, "end", fit.axis.at(fit.reach[1]), fit.axis.head)
        scene.locate(part, [end], on=first.face.part, floating=True)


def _hole_locators(part: Part, fit: Fit, hole: PlacedCylinder) -> Iterator[Locator]:
    """Yield locators at both ends of the axis of the hole that holds a fastener, along it, and against turning."""
    x, y = fit.axis.across
    low, high = hole.extent(fit.axis)
    for number, station in enumerate((low, high), start=1):
        for letter, direction in (("x", x), ("y", y)):
            yield _locator(part, f"{letter}{number}", fit.axis.at(station), direction)
    yield _locator(part, "end", fit.axis.at(low), fit.axis.head)
    # Within the material: on its surface, along which it points, it would look like a mistake (see tolcontact.plausibility).
    yield _locator(part, "turn", fit.axis.at((low + high) / 2) + fit.radius / 2 * x, y)


def _seat_locators(part: Part, fit: Fit, seat: PlacedPlane) -> Iterator[Locator]:
    """Yield supports under the head of a fastener, and above it: it slides on its seat, and neither lifts off nor tilts."""
    x, y = fit.axis.across
    middle, arm = fit.axis.at(fit.axis.station(seat.point)), HEAD_WIDTH * fit.radius
    for number in range(3):
        angle = 2 * math.pi * number / 3
        foot = middle + arm * (math.cos(angle) * x + math.sin(angle) * y)
        for name, direction in (("seat", fit.axis.head), ("clamp", -fit.axis.head)):
            yield _locator(part, f"{name} {number + 1}", foot, direction, one_sided=True)


def _locator(part: Part, name: str, point: np.ndarray, direction: np.ndarray, *, one_sided: bool = False) -> Locator:
    R, _ = placement(part)
    return Locator(name, in_part(part, point), direction @ R, 0.0, one_sided=one_sided)


def in_part(part: Part, point: np.ndarray) -> np.ndarray:
    """Return a point (3,) of the nominal assembly in the frame of a part."""
    R, t = placement(part)
    return np.round((point - t) @ R, DIGITS) + 0.0


def _feature_of(face: Face, name: str) -> Feature:
    """Return the feature of its part that a face belongs to, or declare one with this name, which has no tolerances."""
    meshes = meshes_of(face)
    area, mesh = face_area(face, meshes), meshes[face.part]
    for feature in face.part.features:
        if len(feature.faces) == 1 and area.share(face_area(feature.faces[0], meshes), mesh) > SAME_FACE:
            return feature
    return face.part.feature(name, face)
