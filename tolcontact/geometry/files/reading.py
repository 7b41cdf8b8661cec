"""Triangle meshes in mm from files and from meshes in memory."""

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration import Geometry, Mesh
from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.coordinate_error import COORDINATE_SPACING
from tolcontact.geometry.edges import rim
from tolcontact.geometry.files import reader, screening
from tolcontact.geometry.files.product import (
    BREP,
    FACE_NAMES,
    STEP_ANGLE,
    STEP_CHORD,
    SURFACES,
    Product,
    check_numbers,
    product,
    usual_chord,
)
from tolcontact.geometry.files.step_text import StepText

MAX_ANGLE = 0.5  # [rad] between triangles of round faces
COARSENINGS = (1, 30)  # times the usual chord, tried one after the other
CACHE_SIZE = 4  # STEP files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Shape:
    """The surface of a part in mm."""

    mesh: trimesh.Trimesh


@dataclass(frozen=True)
class Content:
    """The content of a file: the arrays that `worker` reads and, for a STEP file, their product."""

    arrays: Mapping[str, np.ndarray]
    product: Product | None


Key = tuple[Path, float | None]  # a file and its required chord
Contents = Mapping[Key, Content | GeometryFault]
State = tuple[str, int, int, int, float | None, reader.ReadingLimits]
_cache: dict[State | None, Content] = {}


def read_files(geometries: Iterable[Geometry], limits: reader.ReadingLimits = reader.DEFAULT_LIMITS) -> Contents:
    """Return the content or the fault of each file that the geometries name. Each file is read once."""
    files = [geometry for geometry in geometries if isinstance(geometry, Mesh) and isinstance(geometry.source, str | Path)]
    contents: dict[Key, Content | GeometryFault] = {}
    texts: dict[Key, StepText | None] = {}
    states: dict[Key, State | None] = {}
    for key in dict.fromkeys(key_of(geometry) for geometry in files):
        states[key] = _state(*key, limits)  # before the file is read, since it may change meanwhile
        if (cached := _cache.get(states[key])) is not None:
            contents[key] = cached
            continue
        try:
            texts[key] = screening.screen(key[0], limits.triangles)
        except GeometryFault as fault:
            contents[key] = fault
    for key, result in _load(texts, limits).items():
        path, _ = key
        if isinstance(result, GeometryFault):
            contents[key] = result
        elif "count" in result:
            contents[key] = GeometryFault(screening.too_many(path, int(result["count"]), limits.triangles))
        else:
            contents[key] = _content(path, result, texts[key])
            _remember(states[key], contents[key])
    return contents


def key_of(geometry: Mesh) -> Key:
    """Return the file and the chord of a geometry."""
    return Path(geometry.source), geometry.chord


def _state(path: Path, chord: float | None, limits: reader.ReadingLimits) -> State | None:
    """Return a value that changes when the file does; None if there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return str(path.absolute()), status.st_mtime_ns, status.st_ino, status.st_size, chord, limits


def _remember(state: State | None, content: Content | GeometryFault) -> None:
    """Keep the content of a STEP file, since listing, declaring and discretizing its bodies each ask for it."""
    if isinstance(content, Content) and content.product is not None and state is not None:
        while len(_cache) >= CACHE_SIZE:
            _cache.pop(next(iter(_cache)), None)
        _cache[state] = content


def _load(
    texts: Mapping[Key, StepText | None], limits: reader.ReadingLimits
) -> dict[Key, dict[str, np.ndarray] | GeometryFault]:
    """Return the arrays or the fault of each file.

    A STEP file without a required chord gets coarser triangles if there would be too many, or if they cannot be made.
    """
    results: dict[Key, dict[str, np.ndarray] | GeometryFault] = {}
    keys = list(texts)
    for coarsening in COARSENINGS:
        jobs = [_job(key, texts[key], coarsening) for key in keys]
        results |= dict(zip(keys, reader.load(jobs, limits), strict=True)) if keys else {}
        if coarsening > 1:
            for key, job in zip(keys, jobs, strict=True):
                if not _is_too_fine(results[key]):
                    log.warning(
                        '"%s": triangles within %.2g mm, since finer ones are too many or cannot be made', job.path, job.chord
                    )
        keys = [
            (path, chord) for path, chord in keys if chord is None and texts[path, chord] and _is_too_fine(results[path, chord])
        ]
    return results


def _job(key: Key, text: StepText | None, coarsening: float) -> reader.Job:
    path, chord = key
    if chord is None:
        chord = coarsening * (usual_chord(text) if text else STEP_CHORD)
    else:
        coarsening = chord / STEP_CHORD
    return reader.Job(path, screening.kind(path), chord, min(math.sqrt(coarsening) * STEP_ANGLE, MAX_ANGLE))


def _is_too_fine(result: dict[str, np.ndarray] | GeometryFault) -> bool:
    return isinstance(result, reader.UnfinishedRead) if isinstance(result, GeometryFault) else "count" in result


def _content(path: Path, arrays: Mapping[str, np.ndarray], text: StepText | None) -> Content | GeometryFault:
    try:
        return Content(arrays, None if text is None else product(path, arrays, text))
    except GeometryFault as fault:
        return fault


def read(geometry: Mesh, contents: Contents) -> Shape:
    """Return the shape of a mesh geometry. If it comes from a file, `contents` have the content of that file.

    Raises GeometryFault if the file cannot be read, is too large or holds several bodies, if coordinates are not finite or
    too large, or if its units are unknown.
    """
    source = geometry.source
    if not isinstance(source, str | Path):
        return Shape(_in_memory(geometry))
    content = contents[key_of(geometry)]
    if isinstance(content, GeometryFault):
        raise content
    if content.product is not None:
        return Shape(content.product.part(geometry.body))
    mesh = trimesh.Trimesh(content.arrays["vertices"], content.arrays["faces"], process=False)
    scale = _scale(geometry, str(content.arrays["units"]) or None)
    mesh.apply_scale(scale)
    check_numbers(mesh.vertices, str(geometry))
    merged = _merge_vertices(mesh, content.arrays["piece"])
    _state_spacing(merged, scale * content.arrays["spacing"])
    return Shape(merged)


def _in_memory(geometry: Mesh) -> trimesh.Trimesh:
    source = geometry.source
    mesh = trimesh.Trimesh(source.vertices, source.faces, process=False)
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise GeometryFault(f"{geometry}: its triangles refer to vertices beyond the {len(mesh.vertices)} that it has")
    if len(mesh.faces) > reader.DEFAULT_LIMITS.triangles:
        raise GeometryFault(screening.too_many(geometry, len(mesh.faces), reader.DEFAULT_LIMITS.triangles))
    scale = _scale(geometry, getattr(source, "units", None))
    mesh.apply_scale(scale)
    check_numbers(mesh.vertices, str(geometry))
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    _state_spacing(mesh, scale * getattr(source, COORDINATE_SPACING, np.zeros(3)))  # from an archive
    if BREP in getattr(source, "face_attributes", {}):  # from an archive
        mesh.face_attributes[BREP] = source.face_attributes[BREP]
        mesh.metadata |= {name: source.metadata[name] for name in (SURFACES, FACE_NAMES)}
    return mesh


def _state_spacing(mesh: trimesh.Trimesh, spacing: np.ndarray) -> None:
    """Add the spacing (3,) [mm] of stored coordinates to a mesh, unless they are exact."""
    if spacing.any():
        mesh.metadata[COORDINATE_SPACING] = spacing


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
    """Return a mesh whose neighbouring triangles share vertices, from which rims, smooth normals and bodies follow.

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
