"""Trimmed faces as they are read, beside the text of their STEP files: python -m studies.cad.trimmed_faces FILES.

For planes, cylinders, cones, spheres and tori: areas against an integral around the exact edge curves (Green's theorem in the
parameters of the surface), parameters of surfaces, and rims of triangles against the edge curves.
"""

import logging
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.cad.exact_edges import Curve, FaceInText, Missing, Surface, Text
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.files import BREP, STATED_FACES, read_files
from tolcontact.geometry.files.product import Product
from tolcontact.geometry.files.step_text import StepText
from tolcontact.geometry.triangle_mesh import rim

CHORD = 0.02  # [mm]
WITH_RECORDS = b"#999999999=GEOMETRIC_ITEM_SPECIFIC_USAGE('','',$,$,$);"  # for which the reader looks for the records of faces
NEAR = 1e-6  # [mm] of an edge curve from the surface and its vertices, which the file states apart from each other
FRAMES = Rotation.random(20, random_state=1).as_matrix()  # of a sphere


@dataclass(frozen=True)
class ReadFace:
    """A face as it was read: record, surface, area [mm2], triangles (triangle, 3, 3); the file's unit, the body's size [mm]."""

    record: int
    surface: AnalyticSurface | None
    area: float
    corners: np.ndarray
    unit: float
    size: float


@dataclass(frozen=True)
class Comparison:
    """A face that was compared.

    face     name of the file and number of the record
    gap      [mm] largest distance of its edge curves from its surface and from its vertices, all of the file
    area     relative difference
    vertex   [mm] largest distance of a vertex of the triangles' rim from the edge curves
    middle   [mm] largest distance of the middle of a rim's segment from the edge curves
    surface  difference of a plane [mm] or a radius (relative); None where there is none to compare
    """

    face: str
    kind: str
    gap: float
    area: float
    vertex: float
    middle: float
    surface: float | None


def area(face: FaceInText) -> tuple[float, float]:
    """Return the area of a face by Green's theorem, and the area by which it is ambiguous: 0, or a part of a round surface."""
    surface = face.surface
    if surface.kind == "SPHERICAL_SURFACE":
        surface = replace(surface, frame=frame_off_edges(face))
    integrals = [loop_integral(surface, loop) for loop in face.loops if loop]
    total = sum(integrals) if face.is_along else -sum(integrals)
    if surface.kind == "SPHERICAL_SURFACE":
        return total, 2 * np.pi * surface.sizes[0] ** 2
    if surface.kind == "TOROIDAL_SURFACE":
        return total, 4 * np.pi**2 * surface.sizes[0] * surface.sizes[1]
    return abs(total), 0.0


def frame_off_edges(face: FaceInText) -> np.ndarray:
    """Return a frame (3, 3) of a sphere whose poles, where the integral's form is singular, are far from the edges."""
    points = np.concatenate([np.zeros((0, 3)), *(curve.quadrature[0] for loop in face.loops for curve in loop)])
    heights = np.abs((points - face.surface.origin) @ FRAMES[:, 2].T).max(axis=0, initial=0)
    return FRAMES[heights.argmin()]


def loop_integral(surface: Surface, loop: list[Curve]) -> float:
    """Return the integral around a loop of a form whose differential is the surface's area."""
    points, steps = (np.concatenate(parts) for parts in zip(*(curve.quadrature for curve in loop), strict=True))
    (x, y, z), (dx, dy, dz) = ((points - surface.origin) @ surface.frame.T).T, (steps @ surface.frame.T).T
    if surface.kind == "PLANE":
        return float((x * dy - y * dx).sum() / 2)
    turn = (x * dy - y * dx) / np.maximum(x**2 + y**2, 1e-300)
    match surface.kind, surface.sizes:
        case "CYLINDRICAL_SURFACE", (radius,):
            return float(-radius * (z * turn).sum())
        case "CONICAL_SURFACE", (radius, angle):
            slant = z / np.cos(angle) + radius / np.sin(angle)
            return float(-(slant**2 * turn).sum() * np.sin(angle) / 2)
        case "SPHERICAL_SURFACE", (radius,):
            return float(-radius * (z * turn).sum())
    major, minor = surface.sizes
    return torus_integral(major, minor, np.array([x, y, z]), np.array([dx, dy, dz]), turn)


def torus_integral(major: float, minor: float, point: np.ndarray, step: np.ndarray, turn: np.ndarray) -> float:
    """Return the integral for a torus, whose two angles have no beginning: one of them must not go around in the loop."""
    rho = np.hypot(point[0], point[1])
    tube = np.unwrap(np.arctan2(point[2], rho - major))
    rise = ((rho - major) * step[2] - point[2] * (point[0] * step[0] + point[1] * step[1]) / rho) / minor**2
    if abs(rise.sum()) < 1:
        return float(-((major * minor * tube + minor**2 * np.sin(tube)) * turn).sum())
    if abs(turn.sum()) > 1:
        raise Missing("torus around which an edge winds both ways")
    around = np.unwrap(np.arctan2(point[1], point[0]))
    return float((around * (major + minor * np.cos(tube)) * minor * rise).sum())


def surface_difference(face: FaceInText, read: ReadFace) -> float | None:
    """Return the difference of a plane as it was read from that of the text [mm], or of a radius (relative)."""
    stated, surface = face.surface, read.surface
    if surface is None or stated.kind == "CONICAL_SURFACE":
        return None
    if stated.kind == "PLANE":
        offset = abs((stated.origin * read.unit - surface.origin) @ stated.frame[2])
        return max(offset, read.size * float(np.linalg.norm(np.cross(stated.frame[2], surface.axis))))
    return abs(surface.radius / (stated.sizes[0] * read.unit) - 1)


def rim_distances(curves: list[Curve], read: ReadFace) -> tuple[float, float]:
    """Return the largest distances [mm] of the rim of a face's triangles from the edges: its vertices, and its middles."""
    mesh = trimesh.Trimesh(read.corners.reshape(-1, 3), np.arange(3 * len(read.corners)).reshape(-1, 3), process=False)
    mesh.merge_vertices()
    edges = np.asarray(mesh.vertices)[rim(mesh.faces)] / read.unit
    if not curves or not len(edges):
        return 0.0, 0.0
    ends, middles = edges.reshape(-1, 3), edges.mean(axis=1)
    vertex, middle = (
        float(np.min([curve.distance(points) for curve in curves], axis=0).max()) * read.unit for points in (ends, middles)
    )
    return vertex, middle


def compare(path: Path, read: ReadFace, text: Text) -> Comparison:
    """Compare a face with the text. Raises Missing if the text states it in another way."""
    face = text.face(read.record)
    expected, period = (number * read.unit**2 for number in area(face))
    difference = expected - read.area
    if period:
        difference -= period * round(difference / period)
    curves = [curve for loop in face.loops for curve in loop]
    points = np.concatenate([np.zeros((0, 3)), *(curve.quadrature[0] for curve in curves)]) * read.unit
    gap = 0.0 if read.surface is None else float(np.abs(read.surface.distance(points)[0]).max(initial=0))
    gap = max([gap, *(curve.gap * read.unit for curve in curves)])
    name, kind = f"{path.stem} #{read.record}", face.surface.kind.lower().replace("_", " ")
    return Comparison(
        name, kind, gap, abs(difference) / read.area, *rim_distances(curves, read), surface_difference(face, read)
    )


def faces_of(path: Path) -> Iterator[ReadFace]:
    """Yield the faces of a file, each once."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        content = path.read_bytes().replace(b"DATA;", b"DATA;\n" + WITH_RECORDS, 1)
        copy.write_bytes(content)
        (product,) = read_files([tc.Mesh(copy, chord=CHORD)]).values()
    if not isinstance(product, Product):
        raise product if isinstance(product, GeometryFault) else ValueError(f"{path} is not a STEP file")
    unit, visited = StepText(content).unit, set()
    for number in range(1, len(product.bodies) + 1):
        mesh = product.part(number)
        brep, triangles = np.asarray(mesh.face_attributes[BREP]), np.asarray(mesh.triangles)
        for k, face in enumerate(mesh.metadata[STATED_FACES]):
            record = face.records[0]
            if record not in visited and face.measure is not None:
                visited.add(record)
                yield ReadFace(record, face.surface, face.measure.area, triangles[brep == k], unit, float(mesh.scale))


def main() -> None:
    """Print tables over all files."""
    logging.disable(logging.WARNING)
    rows: list[Comparison] = []
    left_out: Counter[str] = Counter()
    for path in map(Path, sys.argv[1:]):
        text = Text(path.read_text(encoding="latin-1"))
        for read in faces_of(path):
            try:
                rows.append(compare(path, read, text))
            except Missing as reason:
                left_out[str(reason).lower().replace("_", " ")] += 1
    for is_exact, title in (
        (True, f"edges within {NEAR:g} mm of their surfaces"),
        (False, "edges farther from their surfaces"),
    ):
        print(f"\n| {title} | faces | median | 99 % | largest difference of areas | vertices [mm] | middles [mm] |")
        print("|---|---:|---:|---:|---:|---:|---:|")
        for kind in dict.fromkeys(row.kind for row in rows):
            print_row(kind, [row for row in rows if row.kind == kind and (row.gap <= NEAR) == is_exact])
    print(f"\nnot compared: {', '.join(f'{count} with {kind}' for kind, count in left_out.items()) or 'none'}")
    planes = [row.surface for row in rows if row.surface is not None and row.kind == "plane"]
    radii = [row.surface for row in rows if row.surface is not None and row.kind != "plane"]
    print(f"{len(planes)} planes within {max(planes, default=0):.1g} mm, {len(radii)} radii within {max(radii, default=0):.1g}")


def print_row(kind: str, rows: list[Comparison]) -> None:
    """Print the row of a table for the faces of a kind."""
    if rows:
        median, high = np.quantile([row.area for row in rows], [0.5, 0.99])
        worst = max(rows, key=lambda row: row.area)
        vertex, middle = max(row.vertex for row in rows), max(row.middle for row in rows)
        areas = f"{median:.1g} | {high:.1g} | {worst.area:.1g} ({worst.face}, gap {worst.gap:.1g} mm)"
        print(f"| {kind} | {len(rows)} | {areas} | {vertex:.2g} | {middle:.2g} |")


if __name__ == "__main__":
    main()
