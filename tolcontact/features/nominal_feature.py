"""A feature with numbers: how it deviates with the freedoms of a model, and its faces with it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact import poses as pose
from tolcontact.declaration import Feature
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import placed_twist
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, SlabFeature
from tolcontact.features.form_field import FormField
from tolcontact.geometry.faces import FaceArea
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ON_FACE

Placement = tuple[np.ndarray, np.ndarray]  # R (3, 3) and t (3,) [mm] of a part in the nominal assembly
ALONG_NORMAL = 0.999  # cosine of the angle between the direction of a locator or gun and the normal of the face that it is on


@dataclass(frozen=True, eq=False)
class FaceDeviation:
    """The deviation of a face: a small rigid displacement and a height, both linear in what varies. Nominal assembly frame.

    name      "part.feature"
    columns   (k,) of the deviations that displace the face
    centre    (3,) [mm]: a point p of the face goes to p + tau + rho x (p - centre)
    twist     (6, k): tau [mm] and rho [rad] per unit deviation
    height    (k,) [mm]: uniform outward offset of the displaced face per unit deviation
    form      form deviation of the face in its nominal place; None if it keeps its shape
    modes     (mode,) indices of the coefficients of the form in `columns`
    """

    name: str
    columns: np.ndarray
    centre: np.ndarray
    twist: np.ndarray
    height: np.ndarray
    form: FormField | None = None
    modes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))

    @property
    def form_columns(self) -> np.ndarray:
        """The columns (mode,) of the deviations that are coefficients of the form."""
        return self.columns[self.modes]

    @property
    def grows(self) -> bool:
        """Whether the height varies."""
        return bool(self.height.any())

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """Return the heights (row,) [mm] for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(len(deviations))
        for column, factor in zip(self.columns, self.height, strict=True):
            heights += factor * deviations[:, column]
        return heights

    def poses(self, deviations: np.ndarray) -> np.ndarray:
        """Return the poses (row, 12) that move the nominal to the actual face, for deviations (row, column)."""
        motions = np.zeros((len(deviations), 6))
        for column, motion in zip(self.columns, self.twist.T, strict=True):  # in a fixed order
            motions += deviations[:, [column]] * motion
        R = Rotation.from_rotvec(motions[:, 3:]).as_matrix()
        return pose.pose(R, motions[:, :3] + self.centre - (R * self.centre).sum(axis=2))

    def outward(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the motion (point, k) of `points` (point, 3) of the face along `normals` (point, 3) per unit deviation."""
        turned = np.cross(points - self.centre, normals)
        outward = np.hstack([normals, turned]) @ self.twist + self.height
        if self.form is not None:
            outward[:, self.modes] += self.form.heights(points)
        return outward


@dataclass(frozen=True, eq=False)
class Expansion:
    """The thermal expansion of a part away from the origin of its frame: a point p goes to (1 + strain) p, and sizes grow.

    columns       (cause,) of the temperatures among the deviations
    coefficients  (cause,) strain per unit of each temperature
    """

    columns: np.ndarray
    coefficients: np.ndarray

    def added_to(
        self, deviation: FaceDeviation | None, name: str, position: np.ndarray, placement: Placement, height: float = 0.0
    ) -> FaceDeviation:
        """Return a deviation with this expansion of a point (3,) [mm] of the part, and of a height [mm]."""
        R, t = placement
        if deviation is None:
            deviation = FaceDeviation(name, np.zeros(0, dtype=int), R @ position + t, np.zeros((6, 0)), np.zeros(0))
        motion = np.outer(np.concatenate([R @ position, np.zeros(3)]), self.coefficients)
        return replace(
            deviation,
            columns=np.concatenate([deviation.columns, self.columns]),
            twist=np.hstack([deviation.twist, motion]),
            height=np.concatenate([deviation.height, height * self.coefficients]),
        )


@dataclass(frozen=True, eq=False)
class NominalFeature:
    """A feature in its part, alone or as a member of a pattern. A datum target is a feature at one point of another.

    surfaces     its faces, in the part's own frame
    areas        its faces on the part's mesh
    coordinates  (coordinate, column) per unit deviation of the freedoms of its pattern and of all freedoms before
    size_column  the column of its size; None if its size is not toleranced
    mobility     (coordinate, column) of its gauge element as a datum at its material boundary; None without play
    form         of its face; None if the feature keeps its shape
    form_columns the columns of the coefficients of the form
    """

    feature: Feature
    part: int
    geometry: FeatureGeometry
    surfaces: tuple[Surface, ...]
    areas: tuple[FaceArea, ...]
    coordinates: np.ndarray
    size_column: int | None = None
    mobility: np.ndarray | None = None
    form: FormField | None = None
    form_columns: range = range(0)

    @property
    def label(self) -> str:
        return self.feature.label

    @property
    def varies(self) -> bool:
        """Whether the feature deviates at all."""
        return self.size_column is not None or self.form is not None or bool(self.coordinates.any())

    def at_gauge(self, columns: int) -> "NominalFeature":
        """Return the datum as its gauge element has it, with a number of columns."""
        if self.mobility is None:
            return self
        return replace(self, coordinates=padded(self.coordinates, columns) + padded(self.mobility, columns))

    def face_with(self, position: np.ndarray) -> int | None:
        """Return the index of the face that a point (3,) [mm] is on; None, for the centre, if it is on none.

        A point beyond the rim of one of two planes is on this plane, too. A point that is nearer to the axis of a cylinder, or
        to the centre of a sphere, than to its surface is on none.
        """
        geometry = self.geometry
        if isinstance(geometry, SlabFeature):
            tolerance = ON_FACE * max(surface.mesh.scale for surface in self.surfaces)
            distances = [abs((position - surface.vertices.mean(axis=0)) @ geometry.normal) for surface in self.surfaces]
            nearest = int(np.argmin(distances))
            return nearest if distances[nearest] <= tolerance else None
        arm = position - geometry.centre
        if isinstance(geometry, AxisFeature):
            arm = arm - (arm @ geometry.axis) * geometry.axis
        return 0 if not isinstance(geometry, FeatureOfSize) or np.linalg.norm(arm) > geometry.size / 4 else None

    def has_moving_face(self, position: np.ndarray, normal: np.ndarray) -> bool:
        """Return whether a face that deviates lies at a point (3,) [mm], with this outward `normal` (3,)."""
        for surface, moves in zip(self.surfaces, moving_faces(self.feature), strict=True):
            (place,), normals, is_over = surface.project(position[None])
            is_on_face = is_over[0] and np.linalg.norm(place - position) <= ON_FACE * surface.mesh.scale
            if moves and is_on_face and normals[0] @ normal > ALONG_NORMAL:
                return True
        return False

    def face_under(self, position: np.ndarray, direction: np.ndarray) -> int | None:
        """Return the index of the face of a size that a locator at a point (3,) [mm] stands on; None for the centre.

        On a round face it stands where it points along the outward normal: a pin rests in its hole, or follows its axis.
        """
        index = None if self.size_column is None else self.face_with(position)
        if index is None or isinstance(self.geometry, SlabFeature):
            return index
        normal = self.surfaces[0].normals(*self.surfaces[0].nearest(position[None]))[0]
        return index if normal @ direction > ALONG_NORMAL else None

    def target(self, position: np.ndarray) -> "NominalFeature":
        """Return the datum that touches the feature at a point (3,) [mm]. Raises GeometryFault for a point elsewhere."""
        index = self.face_with(position)
        surface = self.surfaces[index or 0]
        triangle, projection = surface.nearest(position[None])
        if index is None or np.linalg.norm(projection[0] - position) > ON_FACE * surface.mesh.scale:
            place = ", ".join(f"{coordinate:g}" for coordinate in position)
            raise GeometryFault(f'its target at ({place}) is not on feature "{self.feature.name}"; move it there')
        normal = surface.normals(triangle, projection)[0]
        deviation = self.deviation(index, (np.eye(3), np.zeros(3)))
        coordinates = np.zeros((1, self.coordinates.shape[1]))
        coordinates[:, deviation.columns] = deviation.outward(position[None], normal[None])
        row = np.concatenate([normal, np.zeros(3)])[None]
        geometry = FeatureGeometry(position, ("height",), row.T, row, (position[None], normal[None, None]))
        return replace(self, geometry=geometry, coordinates=coordinates, form=None, form_columns=range(0))

    def deviation(self, index: int | None, placement: Placement) -> FaceDeviation:
        """Return how a face deviates in a part at `placement`; with `index` None the centre, which no size moves."""
        geometry, size_column = self.geometry, self.size_column
        twist, height = geometry.twists @ self.coordinates, np.zeros(self.coordinates.shape[1])
        centre = geometry.centre
        if index is not None and isinstance(geometry, FeatureOfSize):
            centre = geometry.middle(index)
            if size_column is not None:
                motion, height[size_column] = geometry.growth(index, moving_faces(self.feature))
                twist[:3, size_column] += motion
        displacing, (R, t) = np.flatnonzero(twist.any(axis=0) | (height != 0)), placement
        form = self.form if index is not None else None
        columns = np.array([*displacing, *(self.form_columns if form else ())], dtype=int)
        return FaceDeviation(
            name=self.label,
            columns=columns,
            centre=R @ centre + t,
            twist=placed_twist(twist[:, columns], R),
            height=height[columns],
            form=form and form.placed(R, t),
            modes=np.arange(len(displacing), len(columns)),
        )


def moving_faces(feature: Feature) -> Sequence[bool]:
    """Return whether each face of a feature deviates with it: the fixed face of a size does not."""
    if feature.size is None or feature.size.moves == "both":
        return [True] * len(feature.faces)
    return [feature.size.moves == "first", feature.size.moves == "second"]


def padded(coordinates: np.ndarray, columns: int) -> np.ndarray:
    """Return coordinates (coordinate, column) with zeros for the columns after theirs."""
    return np.pad(coordinates, ((0, 0), (0, columns - coordinates.shape[1])))
