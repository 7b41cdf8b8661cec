"""The program of the process that reads shape files (see shape_worker), so that no file can end or stall another process.

It takes jobs from its standard input, and writes the result of each to its standard output: arrays by their names, the number
of triangles if these are too many, or the fault of the file as a text. Of tolcontact it imports only `shape_worker`,
`stored_coordinates`, and `kernel` when a STEP file comes, so that it starts quickly.
"""

import contextlib
import gc
import io
import json
import os
import pickle
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import lazy_loader
import numpy as np

from tolcontact.child import Refusal
from tolcontact.shape_worker import LOAD_KERNEL, Job
from tolcontact.stored_coordinates import is_binary_stl, is_single, printed_spacing, single_spacing
from tolcontact.system.machine import limit_resources

Arrays = dict[str, np.ndarray]
ENCODING_GUESSERS = ("charset_normalizer", "chardet")  # trimesh would ask one for the encoding of binary content


trimesh = lazy_loader.load("trimesh")  # when a mesh file comes: STEP files do not need it


class FolderResolver:
    """The files in the folder of a glTF file, which may name no others: one of trimesh's resolvers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def get(self, name: str) -> bytes:
        path = (self.folder / name).resolve()
        if "://" in name or not path.is_relative_to(self.folder):
            raise Refusal(f'refers to "{name}", which is outside its folder; export it as one file (GLB)')
        if not path.is_file():
            raise Refusal(f'refers to "{name}", which does not exist; put it beside it, or export all as one file (GLB)')
        return path.read_bytes()

    __getitem__ = get

    def write(self, name: str, data: Any) -> None:
        raise Refusal("is read only")

    def namespaced(self, namespace: str) -> "FolderResolver":
        return self

    def keys(self) -> list[str]:
        return []


def read_mesh(path: Path, kind: str) -> Arrays:
    """Return the pieces of a mesh file, joined and in their places, with the `spacing` (3,) of coordinates that it can store.

    Lengths are in the file's units.
    """
    content = path.read_bytes()
    resolver = None
    if kind == "gltf":
        resolver = FolderResolver(path.parent)
        check_json(content)
    if kind == "obj" or (kind == "stl" and not is_binary_stl(content)):
        content = in_utf8(content)
    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, resolver=resolver, process=False)
    except (Refusal, MemoryError):
        raise
    except Exception as error:  # trimesh's readers pass on the exceptions of many parsers
        # Where a package guesses encodings, binary content would be read as some text.
        garbled = isinstance(error, UnicodeDecodeError | json.JSONDecodeError)
        if garbled or getattr(error, "name", "") in ENCODING_GUESSERS:
            raise Refusal("is damaged: it does not contain text where it should; export it again") from error
        raise Refusal(
            f"cannot be read as a mesh ({type(error).__name__}: {error}); export it again as STL, OBJ, PLY or GLB"
        ) from error
    pieces, spacing = [], np.zeros(3)
    single, printed = is_single(content, kind), printed_spacing(content, kind)
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh):
            faces = np.asarray(geometry.faces)
            if np.linalg.det(transform[:3, :3]) < 0:  # of a mirrored node (glTF 2.0, 3.7.4)
                faces = faces[:, ::-1]
            pieces.append((trimesh.transform_points(geometry.vertices, transform), faces))
            stored = np.maximum(single_spacing(np.asarray(geometry.vertices)) if single else 0.0, np.full(3, printed))
            spacing = np.maximum(spacing, np.abs(transform[:3, :3]) @ stored)
    return {**join(pieces), "units": np.array(scene.units or ""), "spacing": spacing}


def check_json(content: bytes) -> None:
    """Refuse content that is not JSON, for which trimesh would look for another file."""
    try:
        json.loads(content)
    except (ValueError, RecursionError) as error:
        raise Refusal("is not a glTF file: it is not JSON; export it again, preferably as one file (GLB)") from error


def in_utf8(content: bytes) -> bytes:
    """Return a text in UTF-8. Names in other encodings, which nobody needs here, may get lost; numbers do not."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("ascii", errors="replace").encode()
    return content


@cache
def step_document() -> Any:
    """Return the module that reads STEP files. The CAD kernel takes 230 MB and 1 s: only STEP files load it."""
    gc.disable()  # it finds nothing in what is imported, and takes a tenth of the time
    try:
        return import_module("tolcontact.kernel.step_document")
    except ModuleNotFoundError as error:
        raise Refusal(
            'is a STEP file, which needs the package cadquery-ocp-novtk; install it with: pip install "tolcontact[step]"'
        ) from error
    finally:
        gc.enable()


def join(pieces: list[tuple[np.ndarray, np.ndarray]]) -> Arrays:
    """Return the vertices (vertex, 3) and faces (face, 3) of all pieces, and the piece (face,) of each triangle."""
    vertices, faces, piece = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    count = 0
    for k, (corners, triangles) in enumerate(pieces):
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(corners):
            raise Refusal(f"is damaged: its triangles refer to vertices beyond the {len(corners)} that it has; export it again")
        vertices.append(corners)
        faces.append(triangles + count)
        piece.append(np.full(len(triangles), k))
        count += len(corners)
    return {"vertices": np.concatenate(vertices), "faces": np.concatenate(faces), "piece": np.concatenate(piece)}


def result(job: Job) -> Arrays | dict[str, Any] | int | str:
    """Return what a file holds, the number of its triangles if these are too many, or its fault."""
    limit_resources(job.memory, seconds=job.seconds)
    path = Path(job.path)
    try:
        if job.kind == "step":
            flags = {name: getattr(job, name) for name in ("encoding", "has_face_names", "has_solids", "has_pmi", "operators")}
            content = step_document().read(path, job.chord, job.angle, **flags)
            count = sum(len(shape["triangles"]) for shape in content["shapes"])
        else:
            content = read_mesh(path, job.kind)
            count = len(content["faces"])
        return content if count <= job.triangles else count
    except MemoryError:
        return job.memory_fault
    except Refusal as refusal:
        return str(refusal)
    except Exception as error:  # any error is reported as a fault of the file
        return f"is damaged, or of an unknown kind ({type(error).__name__}: {error}); export it again"


def work() -> None:
    """Work through the jobs on the standard input."""
    results = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # the kernel prints messages
    if LOAD_KERNEL in sys.argv:
        with contextlib.suppress(Refusal):  # the fault of a STEP file, if one comes
            step_document()
    with contextlib.suppress(EOFError):
        while True:
            job = pickle.load(sys.stdin.buffer)
            try:
                content = pickle.dumps(result(job), protocol=pickle.HIGHEST_PROTOCOL)
            except MemoryError:
                content = pickle.dumps(job.memory_fault)
            results.write(content)
            results.flush()


if __name__ == "__main__":
    work()
    os._exit(0)  # compiled libraries may crash when they tidy up after a damaged file
