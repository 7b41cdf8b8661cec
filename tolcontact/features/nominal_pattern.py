"""The features that a declaration tolerances together: their coordinates, and what varies of them. Part's own frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from tolcontact.declaration import Feature, GeometricTolerance, Pattern
from tolcontact.features.datum_frames import DatumFrame, DatumShift
from tolcontact.features.feature_geometry import FeatureGeometry, FeatureOfSize, PlaneFeature
from tolcontact.features.freedoms import Freedom
from tolcontact.features.nominal_feature import NominalFeature
from tolcontact.geometry.tolerances import SAME_SIZE

MIN_LENGTH = 1e-4  # of the coordinates of a motion of 1 mm that affects a pattern
MIXED, RELATIVE = "mixed", "relative"
MOTIONS = ("common shift x", "common shift y", "common shift z", "common turn x", "common turn y", "common turn z")


@dataclass(frozen=True, eq=False)
class Layer:
    """The directions of a pattern that one tolerance controls beyond the tolerances within it.

    rows        for each member (point, component, coordinate of the member) of its zone (see tolerance_kinds)
    controlled  (coordinate, n): orthonormal directions that its datums lock
    added       (coordinate, k): directions that no narrower tolerance controls and that its rule draws; each is a freedom
    columns     of these freedoms in the deviations
    frame       of its datum system
    """

    tolerance: GeometricTolerance
    rows: tuple[np.ndarray, ...]
    controlled: np.ndarray
    added: np.ndarray
    columns: range
    frame: DatumFrame


@dataclass(frozen=True, eq=False)
class NominalPattern:
    """The members of a pattern, or one feature alone. Its coordinates are the coordinates of one member after the other.

    layers    of its geometric tolerances, from the innermost on
    freedoms  the directions that its layers add, shifts of datum planes, sizes of its members, and modes of their forms
    shifts    of the datum planes of its tolerances
    form      the tolerance that draws the form of its members; None if they keep their shape
    """

    declared: Feature | Pattern
    members: tuple[NominalFeature, ...]
    layers: tuple[Layer, ...] = ()
    freedoms: tuple[Freedom, ...] = ()
    shifts: tuple[DatumShift, ...] = ()
    form: GeometricTolerance | None = None

    @property
    def part(self) -> int:
        return self.members[0].part

    @property
    def is_gauge(self) -> bool:
        """Whether it is the gauge element of a datum (see tolerance_layers.mobile)."""
        return self.members[0].mobility is not None

    @property
    def geometries(self) -> tuple[FeatureGeometry, ...]:
        """The geometry of each member."""
        return tuple(member.geometry for member in self.members)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """The coordinates of each member."""
        ends = np.cumsum([0, *(len(geometry.names) for geometry in self.geometries)])
        return tuple(slice(int(start), int(end)) for start, end in pairwise(ends))

    @property
    def count(self) -> int:
        """The number of coordinates."""
        return self.slices[-1].stop

    @cached_property
    def centre(self) -> np.ndarray:
        """The mean (3,) [mm] of the centres of the members."""
        centres = [geometry.centre for geometry in self.geometries]
        return centres[0] if len(centres) == 1 else np.mean(centres, axis=0)

    @cached_property
    def reach(self) -> float:
        """The largest distance [mm] of an extreme of a member from the centre."""
        if len(self.members) == 1:
            return self.geometries[0].reach
        return max(float(np.linalg.norm(geometry.extremes[0] - self.centre, axis=1).max()) for geometry in self.geometries)

    @cached_property
    def values(self) -> np.ndarray:
        """The coordinates (coordinate, 6) of a displacement (tau, rho) of all members about the centre."""
        if len(self.members) == 1:
            return self.geometries[0].values
        return np.vstack([geometry.about(self.centre) for geometry in self.geometries])

    @property
    def turns(self) -> np.ndarray:
        """The rotation of each member (3 * member, coordinate) for coordinates of 1 mm, times its reach."""
        return np.asarray(block_diag(*(geometry.twists[3:] * geometry.reach for geometry in self.geometries)))

    @property
    def offsets(self) -> np.ndarray:
        """The coordinates (coordinate,) if all members that are planes are 1 mm out of the material; 0 for other features."""
        offsets = np.zeros(self.count)
        for geometry, place in zip(self.geometries, self.slices, strict=True):
            offsets[place.start] = isinstance(geometry, PlaneFeature)
        return offsets

    @property
    def common_motions(self) -> np.ndarray:
        """Columns (coordinate, 6): the coordinates as the pattern moves as a whole, in the order of MOTIONS."""
        return self.values @ np.diag([1.0] * 3 + [1 / self.reach] * 3)

    def owner(self, direction: np.ndarray) -> int | None:
        """Return the index of the one member that a direction (coordinate,) moves; None if it moves several."""
        moved = [number for number, place in enumerate(self.slices) if direction[place].any()]
        return moved[0] if len(moved) == 1 else None

    def freedom_name(self, direction: np.ndarray) -> str:
        """Return the name of a direction (coordinate,): of its coordinate, of its motion of the pattern, "relative" or "mixed".

        A relative direction moves members relative to each other, and not the pattern as a whole.
        """
        coordinate = int(np.abs(direction).argmax())
        if abs(direction[coordinate]) > 1 - 1e-6:
            return [name for geometry in self.geometries for name in geometry.names][coordinate]
        if self.owner(direction) is not None:
            return MIXED
        lengths = np.linalg.norm(self.common_motions, axis=0)
        along = np.abs(direction @ self.common_motions) / np.where(lengths > MIN_LENGTH, lengths, np.inf)
        return MOTIONS[int(along.argmax())] if along.max() > 1 - 1e-6 else RELATIVE if along.max() < 1e-6 else MIXED


def unlike_members(members: Sequence[FeatureGeometry]) -> str:
    """Return the fault of members of a pattern that are not of one kind and size; empty if they are."""
    first = members[0]
    for number, member in enumerate(members[1:], start=2):
        is_alike = type(member) is type(first)
        if is_alike and isinstance(member, FeatureOfSize) and isinstance(first, FeatureOfSize):
            is_alike = member.is_inner == first.is_inner and abs(member.size - first.size) <= SAME_SIZE * first.size
        if not is_alike:
            return (
                f"its member 1 is {_described(first)}, and member {number} is {_described(member)}; the members of a pattern "
                "with tolerances are of one kind and size, so declare unlike ones as patterns or features of their own"
            )
    return ""


def _described(geometry: FeatureGeometry) -> str:
    if not isinstance(geometry, FeatureOfSize):
        return geometry.in_words
    return f"{geometry.in_words} of {geometry.size:.9g} mm, {'inner' if geometry.is_inner else 'outer'}"
