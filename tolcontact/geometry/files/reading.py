"""Sources of shapes to triangle meshes in mm."""

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration import Box, Mesh
from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.edges import rim
from tolcontact.geometry.files import reader, screening
from tolcontact.geometry.files.product import (
    BREP,
    FACE_NAMES,
    STEP_ANGLE,
    STEP_CHORD,
    STEP_SHARE,
    SURFACES,
    Product,
    check_numbers,
    product,
)
from tolcontact.geometry.files.step_text import StepText

LARGEST_ANGLE = 0.5  # rad: triangles of round faces never turn by more
COARSER = (1, 30)  # times the usual chord, one after the other
MAX_TRIANGLES = 1_000_000  # with contact on all of them some 3 GiB on the way through

REMEMBERED = 4  # STEP files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Shape:
    """A part's surface in mm. `unsure`: its units were not stated, and are those that are usual for its kind of file."""

    mesh: trimesh.Trimesh
    unsure: bool = False


@dataclass(frozen=True)
class Content:
    """What a file holds, as `worker` reads it, or what that means if it is a STEP file."""

    arrays: Mapping[str, np.ndarray]
    product: Product | None


Key = tuple[Path, float | None]  # a file, and its chord if one is asked for
Contents = Mapping[Key, Content | GeometryFault]
State = tuple[str, int, int, int, float | None]
_known: dict[State | None, Content] = {}


def read_files(geometries: Iterable[Box | Mesh]) -> Contents:
    """The contents of all files that some geometries name, or what is wrong with them. Each file is read once."""
    files = [geometry for geometry in geometries if isinstance(geometry, Mesh) and isinstance(geometry.source, str | Path)]
    found: dict[Key, Content | GeometryFault] = {}
    texts: dict[Key, StepText | None] = {}
    states: dict[Key, State | None] = {}
    for key in dict.fromkeys(key_of(geometry) for geometry in files):
        states[key] = _state_of(*key)  # before it is read: it may change meanwhile
        if (known := _known.get(states[key])) is not None:
            found[key] = known
            continue
        try:
            texts[key] = screening.screen(key[0], MAX_TRIANGLES)
        except GeometryFault as fault:
            found[key] = fault
    for key, read_in in _loaded(texts).items():
        path, _ = key
        if isinstance(read_in, GeometryFault):
            found[key] = read_in
        elif "count" in read_in:
            found[key] = GeometryFault(screening.too_many(path, int(read_in["count"]), MAX_TRIANGLES))
        else:
            found[key] = _content(path, read_in, texts[key])
            _remember(states[key], found[key])
    return found


def key_of(geometry: Mesh) -> Key:
    """What of a file a geometry asks for."""
    return Path(geometry.source), geometry.chord


def _state_of(path: Path, chord: float | None) -> State | None:
    """By what one notices that a file has changed; None if there is none."""
    try:
        now = path.stat()
    except OSError:
        return None
    return str(path.absolute()), now.st_mtime_ns, now.st_ino, now.st_size, chord


def _remember(state: State | None, content: Content | GeometryFault) -> None:
    """Keep what was read of a STEP file: its bodies are listed, declared and discretized one after the other."""
    if isinstance(content, Content) and content.product is not None and state is not None:
        while len(_known) >= REMEMBERED:
            _known.pop(next(iter(_known)), None)
        _known[state] = content


def _loaded(texts: Mapping[Key, StepText | None]) -> dict[Key, dict[str, np.ndarray] | GeometryFault]:
    """What the reader makes of some files. STEP files that come out too fine are cut more coarsely, unless a chord is asked."""
    found: dict[Key, dict[str, np.ndarray] | GeometryFault] = {}
    keys = list(texts)
    for coarser in COARSER:
        jobs = [_job(key, texts[key], coarser) for key in keys]
        found |= dict(zip(keys, reader.load(jobs, MAX_TRIANGLES), strict=True)) if keys else {}
        if coarser > 1:
            for key, job in zip(keys, jobs, strict=True):
                if not _is_too_fine(found[key]):
                    log.warning('"%s": triangles within %.2g mm, since finer ones are too many', job.path, job.chord)
        keys = [
            (path, chord) for path, chord in keys if chord is None and texts[path, chord] and _is_too_fine(found[path, chord])
        ]
    return found


def _job(key: Key, text: StepText | None, coarser: float) -> reader.Job:
    path, chord = key
    if chord is None:
        chord = coarser * (usual_chord(text) if text else STEP_CHORD)
    else:
        coarser = chord / STEP_CHORD
    return reader.Job(path, screening.kind(path), chord, min(math.sqrt(coarser) * STEP_ANGLE, LARGEST_ANGLE))


def usual_chord(text: StepText) -> float:
    """How far triangles of a STEP file may stay off its true faces [mm], if nothing else is asked."""
    return max(STEP_CHORD, STEP_SHARE * text.extent * text.unit)


def _is_too_fine(read_in: dict[str, np.ndarray] | GeometryFault) -> bool:
    return isinstance(read_in, reader.TooSlow) if isinstance(read_in, GeometryFault) else "count" in read_in


def _content(path: Path, arrays: Mapping[str, np.ndarray], text: StepText | None) -> Content | GeometryFault:
    try:
        return Content(arrays, None if text is None else product(path, arrays, text))
    except GeometryFault as fault:
        return fault


def read(geometry: Mesh, contents: Contents) -> Shape:
    """The triangles of a mesh geometry. `contents` hold that of its file, if it has one.

    Raises GeometryFault if the file cannot be read, is too large or holds several bodies, if coordinates are not finite
    or far off, or if its units are unknown.
    """
    source = geometry.source
    if not isinstance(source, str | Path):
        return Shape(_in_memory(geometry))
    content = contents[key_of(geometry)]
    if isinstance(content, GeometryFault):
        raise content
    if content.product is not None:
        return Shape(content.product.part(geometry.body))
    own = trimesh.Trimesh(content.arrays["vertices"], content.arrays["faces"], process=False)
    own.apply_scale(_scale(geometry, str(content.arrays["units"]) or None))
    check_numbers(own.vertices, str(geometry))
    return Shape(_merged(own, content.arrays["piece"]), unsure=not geometry.units)


def _in_memory(geometry: Mesh) -> trimesh.Trimesh:
    source = geometry.source
    own = trimesh.Trimesh(source.vertices, source.faces, process=False)
    if len(own.faces) and not 0 <= own.faces.min() <= own.faces.max() < len(own.vertices):
        raise GeometryFault(f"{geometry}: its triangles refer to vertices beyond the {len(own.vertices)} that it has")
    if len(own.faces) > MAX_TRIANGLES:
        raise GeometryFault(screening.too_many(geometry, len(own.faces), MAX_TRIANGLES))
    own.apply_scale(_scale(geometry, getattr(source, "units", None)))
    check_numbers(own.vertices, str(geometry))
    own.merge_vertices(merge_tex=True, merge_norm=True)
    if BREP in getattr(source, "face_attributes", {}):  # from an archive
        own.face_attributes[BREP] = source.face_attributes[BREP]
        own.metadata |= {name: source.metadata[name] for name in (SURFACES, FACE_NAMES)}
    return own


def _scale(geometry: Mesh, own: str | None) -> float:
    """How many mm the unit of a geometry has, whose source states its `own`."""
    said = geometry.units or own
    if said is None:
        return 1.0
    try:
        return UNITS.get(said) or float(trimesh.units.unit_conversion(said, "mm"))
    except ValueError as error:
        raise GeometryFault(
            f'{geometry} declares the unit "{said}", which is not known; state another one: tc.Mesh(..., units="mm")'
        ) from error


def _merged(own: trimesh.Trimesh, piece: np.ndarray) -> trimesh.Trimesh:
    """A mesh in which the vertices of neighbouring triangles are one: rims, smooth normals and bodies are read from them.

    A piece (face,) that is closed by itself is a body, and keeps its vertices if it touches others; open ones may be
    parts of one body.
    """
    group = np.zeros(len(own.faces), dtype=np.int64)
    for k in range(1, int(piece.max(initial=0)) + 1):
        faces = own.faces[piece == k]
        alone = trimesh.Trimesh(own.vertices, faces, process=False)
        alone.merge_vertices(merge_tex=True, merge_norm=True)
        group[piece == k] = k if len(faces) and not len(rim(alone.faces)) else 0
    vertices, faces, count = [np.zeros((0, 3))], np.array(own.faces), 0
    for k in np.unique(group):
        body = trimesh.Trimesh(own.vertices, own.faces[group == k], process=False)
        body.merge_vertices(merge_tex=True, merge_norm=True)
        faces[group == k] = body.faces + count
        vertices.append(body.vertices)
        count += len(body.vertices)
    return trimesh.Trimesh(np.concatenate(vertices), faces, process=False)
