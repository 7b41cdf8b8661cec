"""Files of shapes to triangle meshes in mm."""

import contextlib
import math
import os
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tolcontact.assembly import Mesh
from tolcontact.assembly.geometry import STEP, UNITS
from tolcontact.discretization.fault import GeometryFault

try:
    import cascadio
except ImportError:  # an extra: only STEP files need it
    cascadio = None

MAX_TRIANGLES = 1_000_000  # with contact on all of them some 3 GiB on the way through
STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # how far triangles of a STEP file may stay off its true faces [mm], and turn [rad]
BREP = "brep_index"  # cascadio's word: the B-rep face of each triangle
_MESHES = (".stl", ".obj", ".ply", ".glb", ".gltf")


@dataclass(frozen=True)
class Shape:
    """A part's surface in mm. `unsure`: its units are those that its kind of file counts in by custom; nobody stated them."""

    mesh: trimesh.Trimesh
    unsure: bool = False


def read(geometry: Mesh) -> Shape:
    """The triangles of a mesh geometry.

    Raises GeometryFault where the file cannot be read or is too large, or where its units are unknown.
    """
    source = geometry.source
    if isinstance(source, str | Path):
        path = Path(source)
        loaded = _read_step(path) if path.suffix.lower() in STEP else _read_mesh(path)
    else:
        loaded = trimesh.Trimesh(source.vertices, source.faces, process=False)
        if len(loaded.faces) and not 0 <= loaded.faces.min() <= loaded.faces.max() < len(loaded.vertices):
            raise GeometryFault(
                f"{geometry}: its triangles name vertices that it does not have ({len(loaded.vertices)} in all)"
            )
    if len(loaded.faces) > MAX_TRIANGLES:
        raise GeometryFault(_too_many(geometry, len(loaded.faces)))
    said = geometry.units or getattr(loaded if isinstance(source, str | Path) else source, "units", None)
    if said is not None:
        loaded.apply_scale(UNITS.get(said) or _factor(geometry, said))
    # The vertices of neighbouring triangles are one: rims, smooth normals and bodies are read from what they share.
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    stated = geometry.units or not isinstance(source, str | Path) or Path(source).suffix.lower() in STEP
    return Shape(loaded, unsure=not stated)


def _factor(geometry: Mesh, said: str) -> float:
    try:
        return float(trimesh.units.unit_conversion(said, "mm"))
    except ValueError as error:
        raise GeometryFault(
            f'{geometry} says that it counts in "{said}", which is no known unit; say tc.Mesh(..., units="mm")'
        ) from error


def _read_mesh(path: Path) -> trimesh.Trimesh:
    if path.suffix.lower() not in _MESHES:
        raise GeometryFault(f'"{path}": unknown kind of file; expected one of {", ".join((*_MESHES, *STEP))}')
    count = _announced(path)
    if count > MAX_TRIANGLES:
        raise GeometryFault(_too_many(path, count))
    try:
        loaded = trimesh.load_mesh(path, process=False)
    except Exception as error:  # trimesh's readers raise whatever their format's parser raises
        raise GeometryFault(
            f'"{path}" cannot be read as a mesh ({type(error).__name__}: {error}); export it again as STL, OBJ, PLY or GLB'
        ) from error
    return _one(loaded)


def _announced(path: Path) -> int:
    """How many triangles a file says that it holds, as far as that can be told without reading it all into memory."""
    with path.open("rb") as file:
        head = file.read(10_000)
        if path.suffix.lower() == ".stl" and path.stat().st_size == 84 + 50 * int.from_bytes(head[80:84], "little"):
            return int.from_bytes(head[80:84], "little")
        if path.suffix.lower() == ".ply":
            said = re.search(rb"^element face (\d+)", head, re.MULTILINE)
            return int(said[1]) if said else 0
        file.seek(0)
        mark = {".stl": b"facet", ".obj": b"\nf "}.get(path.suffix.lower())
        if mark is None:
            return 0
        found = sum(chunk.count(mark) for chunk in iter(lambda: file.read(1 << 24), b""))
    return found // 2 if mark == b"facet" else found  # "facet" also ends each one: "endfacet"


def _read_step(path: Path) -> trimesh.Trimesh:
    if cascadio is None:
        raise GeometryFault(f'"{path}": STEP files need the package cascadio; install it with: pip install "tolcontact[step]"')
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "converted.glb"
        with _silence():
            failed = cascadio.step_to_glb(
                str(path), str(converted), tol_linear=STEP_CHORD, tol_angular=STEP_ANGLE, include_brep=True
            )
        if failed or not converted.is_file():
            raise GeometryFault(f'"{path}" cannot be read as STEP: it is cut off, or not STEP at all; export it again')
        mesh = _one(trimesh.load_scene(converted))
    mesh.apply_scale(UNITS["m"])
    mesh.units = "mm"
    # It has passed through single precision. Rounding to what that resolves brings round lengths back, and flat faces.
    resolved = UNITS["m"] * float(np.spacing(np.float32(np.abs(mesh.vertices).max(initial=0) / UNITS["m"])))
    power = 10.0 ** math.floor(math.log10(resolved))
    step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= resolved)
    mesh.vertices = np.round(np.round(mesh.vertices / step) * step, 12)
    return mesh


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Swallow what a compiled library prints; what is wrong is said by what it returns."""
    kept = os.dup(1), os.dup(2)
    with Path(os.devnull).open("wb") as nowhere:
        try:
            for stream in (1, 2):
                os.dup2(nowhere.fileno(), stream)
            yield
        finally:
            for stream, own in zip((1, 2), kept, strict=True):
                os.dup2(own, stream)
                os.close(own)


def _one(loaded: Any) -> trimesh.Trimesh:
    """All bodies of a scene in their places as one mesh, its B-rep faces numbered through."""
    if isinstance(loaded, trimesh.Trimesh):
        return loaded
    vertices, faces, breps = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=int)], [np.zeros(0, dtype=int)]
    corners = numbers = 0
    for node in loaded.graph.nodes_geometry:
        transform, name = loaded.graph[node]
        body = loaded.geometry[name]
        if not isinstance(body, trimesh.Trimesh):
            continue
        brep = np.asarray(body.face_attributes.get(BREP, np.zeros(len(body.faces))), dtype=int).ravel()
        vertices.append(trimesh.transform_points(body.vertices, transform))
        faces.append(body.faces + corners)
        breps.append(brep + numbers)
        corners += len(body.vertices)
        numbers += int(brep.max(initial=-1)) + 1
    mesh = trimesh.Trimesh(np.concatenate(vertices), np.concatenate(faces), process=False)
    mesh.units = loaded.units
    if any(BREP in getattr(body, "face_attributes", {}) for body in loaded.geometry.values()):
        mesh.face_attributes[BREP] = np.concatenate(breps)
    return mesh


def _too_many(what: object, count: int) -> str:
    return (
        f'"{what}" holds {count} triangles, more than the limit of {MAX_TRIANGLES}; contact points need no finer mesh than '
        "their spacing, so simplify it"
    )
