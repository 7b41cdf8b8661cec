"""Nominal measurements: faces become walls, axes, directions and gaps; combinations refer to measures by index."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import scipy
import trimesh
from scipy.spatial import ConvexHull, QhullError

from tolcontact import declaration as declared
from tolcontact.discretization import measured_geometry as measured
from tolcontact.discretization.form_points import affordable_spacing, form_lengths, with_rims
from tolcontact.discretization.measured_geometry import MeasuredFace, MeasuredPoint, NominalMeasurement, Wall
from tolcontact.discretization.nominal import Nominal
from tolcontact.discretization.point_weights import point_weights
from tolcontact.discretization.round_contact import round_points
from tolcontact.discretization.round_points import RoundPoints
from tolcontact.errors import Faults, GeometryFault, designation, nearest_name
from tolcontact.features import AxisFeature
from tolcontact.geometry.analytic_surfaces import Cylinder, axes_across
from tolcontact.geometry.faces import patch
from tolcontact.geometry.nearest_elements import nearest_elements
from tolcontact.geometry.overlap import crossing_edges, overlap_corners
from tolcontact.geometry.spreading import spread
from tolcontact.geometry.tolerances import OPPOSING_COSINE, PARALLEL

DEFAULT_PLACES, FORM_PLACES, MAX_PLACES = 200, 600, 4000  # by default, of a face with form if that resolves it, at all
MIN_SHARE = 0.04  # of a face, under the other one: smaller regions have fewer points
MAX_FACING = 0.0  # cosine between the normals of faces that do not face each other
OBTUSE = -1e-9  # cosine of an angle that counts as more than a right one
RIGHT = 1e-6  # cosine of an angle that counts as a right one: axes of meshes are less accurate than planes
MAX_EDGE_PAIRS = 2500  # of two rims, between which crossings are found at every pose; more take longer than contact itself
NO_LINES = np.zeros((0, 2, 3))


def face_gap(moving: MeasuredFace, reference: MeasuredFace, is_largest: bool) -> measured.FaceGap:
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
    weights = point_weights(places, feet, moving.surface, reference.surface)
    points = [
        (MeasuredPoint(moving.part, place, moving.deviation, direction), reference.wall(place))
        for place, direction in zip(places, outward, strict=True)
    ]
    shown = np.abs(places - weights @ places / weights.sum()).sum(axis=1).argmin()
    return measured.FaceGap(np.array([[places[shown], feet[shown]]]), points, weights / weights.sum(), is_largest)


def _places(moving: MeasuredFace, reference: MeasuredFace) -> np.ndarray:
    """Return points (place, 3) of the moving face over the reference face, including the rim of the common region."""
    surface, lengths = moving.surface, form_lengths([moving.deviation, reference.deviation])
    area = surface.mesh.area
    spacing = affordable_spacing(lengths, area, FORM_PLACES) if lengths else (area / DEFAULT_PLACES) ** 0.5
    places = spread(surface.mesh, None, spacing)
    share = float(reference.surface.project(places)[2].mean())
    if not lengths and share < 1:
        spacing *= max(share, MIN_SHARE) ** 0.5
        places = spread(surface.mesh, None, spacing)
    if surface.is_flat and reference.surface.is_flat:
        places = np.concatenate([places, overlap_corners(surface, reference.surface)])
        places = with_rims(places, surface, reference.surface, spacing, _extent(moving, reference))
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


class MeasuredFaces:
    """The measured faces of a model. Faces with the same criteria are made once."""

    def __init__(self, nominal: Nominal) -> None:
        self.nominal = nominal
        self._faces: dict[tuple[Any, ...], MeasuredFace] = {}

    def __getitem__(self, face: declared.Face) -> MeasuredFace:
        """Return a declared face. Raises GeometryFault if it has no triangles, or belongs to a feature only in part."""
        key = (face.part, *face.selections)
        if key not in self._faces:
            part = self.nominal.part_index(face.part)
            surface = patch(face, self.nominal.meshes).placed(*self.nominal.parts[part].placement)
            self._faces[key] = MeasuredFace(face, part, surface, self.nominal.deviation(face))
        return self._faces[key]

    def pair(self, measurement: declared.Measurement) -> tuple[MeasuredFace, MeasuredFace]:
        """Return the two faces of a measurement."""
        moving, reference = (self[face] for face in measurement.faces)
        _check_varies([face.part for face in measurement.faces], [moving.deviation, reference.deviation])
        return moving, reference


def nominal_measurements(nominal: Nominal) -> tuple[NominalMeasurement | None, ...]:
    """Return the measurement of each measure; None for measures of points and expressions.

    Raises ModelError with a fault for each measurement that the faces do not have.
    """
    measurements: dict[str, NominalMeasurement | None] = {}
    faces, faults = MeasuredFaces(nominal), Faults()
    for measure in nominal.measures:
        measurements[measure.name] = None
        if isinstance(measure.of, declared.Measurement):
            place = designation(measure.noun, measure)
            measurements[measure.name] = faults.attempt(place, _with_numbers, measure.of, faces, measurements)
    faults.refuse(nominal.assembly.name)
    return tuple(measurements.values())


def _with_numbers(
    measurement: Any, faces: MeasuredFaces, earlier: Mapping[str, NominalMeasurement | None]
) -> NominalMeasurement:
    """Return a measurement; it may refer to the earlier measures by name."""
    if not isinstance(measurement, declared.Combination):
        return BUILDERS[type(measurement)](measurement, faces)
    numbers = {name: number for number, name in enumerate(earlier)}
    operands = [
        numbers[operand] if isinstance(operand, str) else _with_numbers(operand, faces, earlier)
        for operand in measurement.operands
    ]
    lines = [_lines(faces.nominal, operand, earlier) if isinstance(operand, int) else operand.lines for operand in operands]
    return measured.Combined(np.concatenate(lines), measurement.kind, operands)


def _lines(nominal: Nominal, number: int, measurements: Mapping[str, NominalMeasurement | None]) -> np.ndarray:
    """Return the lines (line, 2, 3) that show a measure; for points, the line from the first to the last."""
    measure = nominal.measures[number]
    if (measurement := measurements[measure.name]) is not None:
        return measurement.lines
    ends = [nominal.position(point) for point in measure.points]
    return np.array([[ends[0], ends[-1]]]) if ends else NO_LINES


def _gap(gap: declared.Gap, faces: MeasuredFaces) -> measured.Heights:
    face, station, nominal = faces[gap.face], gap.station, faces.nominal
    position, deviation = nominal.position(station), nominal.face_at(station)
    _check_varies([station.part, gap.face.part], [deviation, face.deviation])
    point = MeasuredPoint(nominal.part_index(station.part), position, deviation, nominal.outward(station))
    wall = face.wall(position)
    return measured.Heights(np.array([[position, wall.foot(position)]]), [(point, wall)])


def _clearance(clearance: declared.Clearance, faces: MeasuredFaces) -> NominalMeasurement:
    moving, reference = faces.pair(clearance)
    for face in (moving, reference):
        if face.deviation is not None and face.deviation.form is not None:
            raise GeometryFault(
                f"the clearance of {face.face}, which has form, cannot be measured; measure the gaps of points with tc.Gap, "
                "or what is left between the faces with tc.LargestGap, or give its tolerance of form form=None"
            )
    if moving.surface.is_flat and reference.surface.is_flat:
        return _clearance_of_planes(moving, reference)
    if points := round_points(moving.surface, reference.surface, _extent(moving, reference)):
        rows = [point.nominal() for point in points]
        P_m, P_r, _ = min(rows, key=lambda row: float((row[0] - row[1]) @ row[2]))
        return measured.RoundClearance(np.array([[P_m, P_r]]), moving, reference, RoundPoints.of(points))
    pieces = [face.surface.only_piece for face in (moving, reference)]
    if all(piece is not None and isinstance(piece.surface, Cylinder) and not piece.is_hollow for piece in pieces):
        axes = moving.axis, reference.axis
        return measured.AxisPair(_nearest_places(axes[0].ends, axes[1].ends)[None], *axes, is_between_surfaces=True)
    return _clearance_of_meshes(moving, reference)


def _extent(moving: MeasuredFace, reference: MeasuredFace) -> float:
    """Return a distance [mm] that is larger than any between two faces."""
    return float(np.ptp(np.vstack([moving.surface.mesh.bounds, reference.surface.mesh.bounds]), axis=0).sum())


def _clearance_of_meshes(moving: MeasuredFace, reference: MeasuredFace) -> measured.MeshClearance:
    """Return the clearance between triangles. Raises GeometryFault if too many of them are near each other."""
    sides = (reference, moving.surface.vertices), (moving, reference.surface.vertices)
    distances = [np.linalg.norm(target.surface.nearest(corners)[1] - corners, axis=1).min() for target, corners in sides]
    try:
        elements = nearest_elements(moving.surface.mesh, reference.surface.mesh, float(min(distances)))
    except GeometryFault as fault:
        kinds = " and ".join(_kind(face) for face in (moving, reference))
        raise GeometryFault(
            f"the clearance of {kinds} cannot be measured: {fault}; or measure the gaps of points with tc.Gap"
        ) from fault
    corners = trimesh.bounds.corners(moving.surface.mesh.bounds)
    return measured.MeshClearance(elements.line[None], moving, reference, elements, corners)


def _clearance_of_planes(moving: MeasuredFace, reference: MeasuredFace) -> measured.Heights | measured.PlaneClearance:
    """Return the clearance of planes that face each other, within the nominal overlap if their rims have too many edges."""
    if not moving.plane.axis @ reference.plane.axis < OPPOSING_COSINE:
        raise GeometryFault(
            f"its planes {moving.face} and {reference.face} do not face each other; choose planes with material behind both"
        )
    points: list[tuple[MeasuredPoint, Wall]] = []
    for face, target in ((moving, reference), (reference, moving)):
        corners = face.surface.rim_corners
        _, _, is_over = target.surface.project(corners)
        outward, wall = face.plane.axis, Wall(target.part, target.plane, 1.0, target.deviation)
        corners = _outline(corners[is_over], outward)
        points += [(MeasuredPoint(face.part, corner, face.deviation, outward), wall) for corner in corners]
    crossings = []
    for edges in zip(*crossing_edges(moving.surface, reference.surface), strict=True):
        p, q = (end - start for start, end in edges)
        crossings.append(measured.Crossing(moving, reference, edges, float(np.sign(np.cross(p, q) @ reference.plane.axis))))
    lines = [[point.position, wall.foot(point.position)] for point, wall in points]
    lines += [list(_nearest_places(*crossing.edges)) for crossing in crossings]
    if not lines:
        raise GeometryFault(
            f"its planes {moving.face} and {reference.face} lie nowhere over each other; choose faces that overlap, or measure "
            "the gap of a point with tc.Gap"
        )
    shortest = min(lines, key=lambda line: float(np.linalg.norm(line[1] - line[0])))
    heights = measured.Heights(np.array([shortest]), points, crossings)
    outlines = measured.Outline.of(moving.surface), measured.Outline.of(reference.surface)
    if len(outlines[0].edges) * len(outlines[1].edges) > MAX_EDGE_PAIRS:
        return heights
    return measured.PlaneClearance(heights.lines, moving, reference, (moving.plane, reference.plane), outlines, heights)


def _outline(points: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the corners of the convex hull of points (point, 3) of a plane with normal n (3,): the nearest is among them."""
    try:
        return points[ConvexHull(points @ axes_across(n).T).vertices] if len(points) > 3 else points
    except QhullError:  # the points lie on one line
        return points


def _axis_distance(distance: declared.AxisDistance, faces: MeasuredFaces) -> measured.AxisPair:
    moving, reference = (face.axis for face in faces.pair(distance))
    lines, across, along = [moving.ends, reference.ends], distance.across, distance.along
    if across is not None:
        n = np.array(across)
        for axis, face in zip((moving, reference), distance.faces, strict=True):
            if axis.direction.any() and abs(float(axis.direction @ n)) < PARALLEL:
                raise GeometryFault(
                    f"the axis of {face} is parallel to the plane that is to cut it; choose another direction across"
                )
        slide = reference.direction if reference.direction.any() else n  # along the axis; for a centre, along n
        foot = reference.midpoint + slide * float((moving.midpoint - reference.midpoint) @ n) / float(slide @ n)
        return measured.AxisPair(np.array([*lines, [moving.midpoint, foot]]), moving, reference, across=n)
    if along is not None:
        foot = reference.midpoint + ((moving.midpoint - reference.midpoint) @ reference.direction) * reference.direction
        return measured.AxisPair(np.array([*lines, [moving.midpoint, foot]]), moving, reference, along=np.array(along))
    return measured.AxisPair(np.array([*lines, _nearest_places(*lines)]), moving, reference)


def _angle(angle: declared.Angle, faces: MeasuredFaces) -> measured.DirectionPair:
    moving, reference = faces.pair(angle)
    u, v = moving.direction, reference.direction
    about = None if angle.about is None else np.array(angle.about)
    across = [vector if about is None else vector - (vector @ about) * about for vector in (u, v)]
    for vector, face in zip(across, angle.faces, strict=True):
        if np.linalg.norm(vector) < PARALLEL:
            raise GeometryFault(f"the direction of {face} is parallel to the direction that the angle is about; choose another")
    cosine = float(across[0] @ across[1] / np.prod(np.linalg.norm(across, axis=1)))
    has_axis = any(isinstance(face.geometry, AxisFeature) for face in (moving, reference))
    if about is not None and has_axis and abs(cosine) <= RIGHT:  # an axis has no sense, so that the angle is positive
        is_reversed = float(about @ np.cross(across[0], across[1])) < 0
    else:
        is_reversed = cosine < OBTUSE
    v = -v if is_reversed else v
    length = min(float(face.surface.mesh.scale) for face in (moving, reference)) / 2
    starts = [np.asarray(face.surface.mesh.bounds).mean(axis=0) for face in (moving, reference)]
    lines = np.array([[start, start + length * vector] for start, vector in zip(starts, (u, v), strict=True)])
    return measured.DirectionPair(lines, moving, reference, (u, v), about)


def _check_varies(parts: Iterable[Any], deviations: Iterable[Any]) -> None:
    part, *others = dict.fromkeys(parts)
    if not others and not any(deviation is not None for deviation in deviations):
        raise GeometryFault(
            f'it is measured within part "{part.name}", whose faces there do not deviate, so it is constant; take faces of two '
            "parts, or features with tolerances"
        )


def _kind(face: MeasuredFace) -> str:
    kinds = dict.fromkeys(piece.surface.kind for piece in face.surface.pieces)
    return f"{face.face} ({' and '.join(kinds) or ('plane' if face.surface.is_flat else 'general surface')})"


def _nearest_places(moving: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the nearest points (2, 3) of two segments, given by their ends (2, 3); any of them if segments are parallel."""
    p, q = moving[1] - moving[0], reference[1] - reference[0]
    nearest = scipy.optimize.lsq_linear(np.column_stack([p, -q]), reference[0] - moving[0], bounds=(0, 1))
    return np.array([moving[0] + nearest.x[0] * p, reference[0] + nearest.x[1] * q])


def _chain(chain: declared.Chain, faces: MeasuredFaces) -> measured.LinearForm:
    """Return a chain with numbers. Raises GeometryFault for a link that is no contributor."""
    labels, nominals = faces.nominal.contributors, {cause.name: cause.nominal for cause in faces.nominal.assembly.variables}
    if unknown := [label for label in chain.sensitivities if label not in labels]:
        raise GeometryFault(f'its link "{unknown[0]}" is no contributor{nearest_name(unknown[0], labels)}')
    constant = chain.nominal + sum(factor * (nominals.get(label) or 0.0) for label, factor in chain.sensitivities.items())
    columns = np.array([labels.index(label) for label in chain.sensitivities])
    return measured.LinearForm(NO_LINES, float(constant), columns, np.array(list(chain.sensitivities.values()), dtype=float))


Builder = Callable[[Any, MeasuredFaces], NominalMeasurement]
BUILDERS: Mapping[type[declared.Measurement], Builder] = {
    declared.Gap: _gap, declared.Flush: _gap, declared.Clearance: _clearance, declared.AxisDistance: _axis_distance,
    declared.Angle: _angle, declared.Chain: _chain,
    declared.LargestGap: lambda gap, faces: face_gap(*faces.pair(gap), is_largest=True),
    declared.MeanGap: lambda gap, faces: face_gap(*faces.pair(gap), is_largest=False),
}  # fmt: skip
