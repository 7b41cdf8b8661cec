"""Triangle meshes in mm from files and from meshes in memory."""

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import trimesh

from tolcontact.declaration import Geometry, Mesh
from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import screening
from tolcontact.geometry.files.product import (
    BREP,
    STATED_FACES,
    STEP_ANGLE,
    STEP_CHORD,
    Product,
    check_numbers,
    product,
    usual_chord,
)
from tolcontact.geometry.files.step_text import OPERATOR, SOLIDS, USAGES, StepText
from tolcontact.geometry.triangle_mesh import COORDINATE_SPACING, edges, rim
from tolcontact.shape_worker import Job, UnfinishedRead, Worker, taken
from tolcontact.texts import clipped

MAX_ANGLE = 0.5  # [rad] between triangles of round faces
COARSENINGS = (1, 30)  # times the usual chord, tried one after the other
CACHE_SIZE = 4  # STEP files
MIN_RIM = 3  # edges around a missing triangle

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ReadingLimits:
    """The limits for reading a file: processor time, memory [byte] and number of triangles.

    On an idle core a STEP file of 1 MB takes about 2 s, one of 20 MB 41 s. A million triangles take about 0.5 GiB to read, and
    about 3 GiB in a simulation with contact on all of them.
    """

    seconds: float = 30.0
    seconds_per_mb: float = 20.0
    memory: int = 6 * 2**30
    triangles: int = 1_000_000


DEFAULT_LIMITS = ReadingLimits()
Shape: TypeAlias = trimesh.Trimesh  # the surface of a part in mm
Key = tuple[Path, float | None]  # a file and its required chord
Content = Product | Mapping[str, np.ndarray]  # of a STEP file, and of a mesh file as `worker` reads it
Contents = Mapping[Key, Content | GeometryFault]
State = tuple[str, int, int, int, float | None, ReadingLimits]
_cache: dict[State | None, Product] = {}


def read_files(geometries: Iterable[Geometry], limits: ReadingLimits = DEFAULT_LIMITS) -> Contents:
    """Return the content or the fault of each file that the geometries name. Each file is read once."""
    contents: dict[Key, Content | GeometryFault] = {}
    files = (key_of(mesh) for mesh in geometries if isinstance(mesh, Mesh) and isinstance(mesh.source, str | Path))
    with taken() as worker:
        for key in dict.fromkeys(files):
            state = _state(*key, limits)  # before the file is read, since it may change meanwhile
            contents[key] = content = _cache.get(state) or _content(*key, limits, worker)
            if isinstance(content, Product) and state is not None:  # listing, declaring and discretizing bodies each require it
                while len(_cache) >= CACHE_SIZE:
                    _cache.pop(next(iter(_cache)), None)
                _cache[state] = content
    return contents


def key_of(geometry: Mesh) -> Key:
    """Return the file and the chord of a geometry."""
    return Path(geometry.source), geometry.chord


def _state(path: Path, chord: float | None, limits: ReadingLimits) -> State | None:
    """Return a value that changes when the file does; None if there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return str(path.absolute()), status.st_mtime_ns, status.st_ino, status.st_size, chord, limits


def _content(path: Path, chord: float | None, limits: ReadingLimits, worker: Worker) -> Content | GeometryFault:
    """Return the content or the fault of a file."""
    try:
        text = screening.screen(path, limits.triangles)
        result, chord = _result(path, chord, text, limits, worker)
        return result if text is None else product(path, result, text, chord)
    except GeometryFault as fault:
        return fault


def _result(path: Path, chord: float | None, text: StepText | None, limits: ReadingLimits, worker: Worker) -> tuple[Any, float]:
    """Return what the worker reads from a file, and the chord [mm] of its triangles. Raises GeometryFault.

    A STEP file without a required chord gets coarser triangles if there would be too many, or if they cannot be made.
    """
    for coarsening in COARSENINGS:
        job = _job(path, chord, text, coarsening, limits)
        try:
            result = worker.read(path, job)
        except UnfinishedRead as fault:
            result = fault
        is_too_fine = isinstance(result, UnfinishedRead | int)
        if coarsening > 1 and not is_too_fine:
            log.warning('"%s": triangles within %.2g mm, since finer ones are too many or cannot be made', path, job.chord)
        if not is_too_fine or chord is not None or text is None:
            break
    match result:
        case UnfinishedRead():
            raise result
        case str():
            raise GeometryFault(f'"{path}" {clipped(result)}')
        case int():
            raise GeometryFault(screening.too_many(path, result, limits.triangles))
    return result, job.chord


def _job(path: Path, chord: float | None, text: StepText | None, coarsening: float, limits: ReadingLimits) -> Job:
    if chord is None:
        chord = coarsening * (usual_chord(text) if text else STEP_CHORD)
    else:
        coarsening = chord / STEP_CHORD
    return Job(
        path=str(path.absolute()),
        kind=screening.kind(path),
        chord=chord,
        angle=min(math.sqrt(coarsening) * STEP_ANGLE, MAX_ANGLE),
        seconds=limits.seconds + limits.seconds_per_mb * path.stat().st_size / 1e6,
        memory=limits.memory,
        triangles=limits.triangles,
        encoding="utf-8" if text is None else text.encoding,
        has_face_names=text is not None and text.has_face_names,
        has_solids=text is not None and text.has_any(SOLIDS),
        has_pmi=text is not None and text.has_any(USAGES),
        operators=0 if text is None else len(text.numbers.get(OPERATOR, ())),
    )


def read(geometry: Mesh, contents: Contents) -> Shape:
    """Return the shape of a mesh geometry. If it comes from a file, `contents` have the content of that file.

    Raises GeometryFault if the file cannot be read, is too large or holds several bodies, if coordinates are not finite or
    too large, or if its units are unknown.
    """
    source = geometry.source
    if isinstance(source, str | Path):
        content = contents[key_of(geometry)]
        if isinstance(content, GeometryFault):
            raise content
        if isinstance(content, Product):
            return content.part(geometry.body)
        mesh = trimesh.Trimesh(content["vertices"], content["faces"], process=False)
        piece, unit, spacing = content["piece"], str(content["units"]) or None, content["spacing"]
        _check_triangles(mesh, str(geometry))
    else:
        mesh = trimesh.Trimesh(source.vertices, source.faces, process=False)
        if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
            raise GeometryFault(f"{geometry}: its triangles refer to vertices beyond the {len(mesh.vertices)} that it has")
        if len(mesh.faces) > DEFAULT_LIMITS.triangles:
            raise GeometryFault(screening.too_many(geometry, len(mesh.faces), DEFAULT_LIMITS.triangles))
        piece, unit = np.zeros(len(mesh.faces), dtype=np.int64), getattr(source, "units", None)
        spacing = getattr(source, COORDINATE_SPACING, np.zeros(3))  # from an archive
    scale = _scale(geometry, unit)
    mesh.apply_scale(scale)
    check_numbers(mesh.vertices, str(geometry))
    mesh = _merge_vertices(mesh, piece)
    if spacing.any():  # otherwise coordinates are exact
        mesh.metadata[COORDINATE_SPACING] = scale * spacing
    if BREP in getattr(source, "face_attributes", {}):  # from an archive
        mesh.face_attributes[BREP] = source.face_attributes[BREP]
        mesh.metadata[STATED_FACES] = source.metadata[STATED_FACES]
    return mesh


def _check_triangles(mesh: trimesh.Trimesh, name: str) -> None:
    """Raise GeometryFault for a mesh of a file that is open at a triangle that occurs twice, or that is missing.

    Bodies that touch, and sheets with two sides, may share triangles: an even number of triangles meets at each edge.
    """
    whole = mesh.copy()
    whole.merge_vertices(merge_tex=True, merge_norm=True)
    ends, edge, counts = edges(whole.faces)
    is_open = counts[edge] % 2 == 1
    if not is_open.any():
        return
    corners = np.sort(whole.faces, axis=1)
    doubtful = corners[is_open.reshape(-1, 3).any(axis=1) & (np.diff(corners, axis=1) > 0).all(axis=1)]
    distinct, repeats = np.unique(doubtful, axis=0, return_counts=True)
    once = ends[counts[edge] == 1]
    pieces = trimesh.graph.connected_components(once, min_len=MIN_RIM) if len(once) else []
    holes = [np.sort(piece) for piece in pieces if len(piece) == np.isin(once, piece).all(axis=1).sum() == MIN_RIM]
    for fault, triangles in (
        ("occurs more than once", distinct[repeats > 1]),
        ("is missing", [hole for hole in holes if not (corners == hole).all(axis=1).any()]),
    ):
        if len(triangles):
            place = ", ".join(f"{coordinate:.5g}" for coordinate in whole.vertices[triangles[0]].mean(axis=0))
            raise GeometryFault(
                f"{name}: a triangle {fault}, near ({place}) in the units of the file; mend the mesh in CAD, or with trimesh: "
                "mesh.update_faces(mesh.unique_faces()), mesh.fill_holes()"
            )


def _scale(geometry: Mesh, source_unit: str | None) -> float:
    """Return the length [mm] of the unit of a geometry, which may declare another one than its source."""
    unit = geometry.units or source_unit
    if unit is None:
        return 1.0
    try:
        return UNITS.get(unit) or float(trimesh.units.unit_conversion(unit, "mm"))
    except ValueError as error:
        raise GeometryFault(
            f'{geometry} declares the unit "{unit}", which is not known; state another one: tc.Mesh(..., units="mm")'
        ) from error


def _merge_vertices(mesh: trimesh.Trimesh, piece: np.ndarray) -> trimesh.Trimesh:
    """Return a mesh whose neighbouring triangles share vertices: rims, smooth normals and bodies depend on this.

    Each closed piece (face,) is a body and shares no vertices with the pieces that it touches. Open pieces may be parts of one
    body.
    """
    group = np.zeros(len(mesh.faces), dtype=np.int64)
    for k in range(1, int(piece.max(initial=0)) + 1):
        faces = mesh.faces[piece == k]
        part = trimesh.Trimesh(mesh.vertices, faces, process=False)
        part.merge_vertices(merge_tex=True, merge_norm=True)
        group[piece == k] = k if len(faces) and not len(rim(part.faces)) else 0
    vertices, faces, count = [np.zeros((0, 3))], np.array(mesh.faces), 0
    for k in np.unique(group):
        body = trimesh.Trimesh(mesh.vertices, mesh.faces[group == k], process=False)
        body.merge_vertices(merge_tex=True, merge_norm=True)
        faces[group == k] = body.faces + count
        vertices.append(body.vertices)
        count += len(body.vertices)
    return trimesh.Trimesh(np.concatenate(vertices), faces, process=False)
