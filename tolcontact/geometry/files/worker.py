"""The program of the process that reads shape files for `reader`, so that no file can end or stall that one.

`python -P worker.py FOLDER` writes FOLDER/ready once it has started, and works through the list in FOLDER/jobs.json. For job
k it writes FOLDER/k.npz with the arrays it read, or FOLDER/k.txt with the fault of the file. Of tolcontact it imports only
`child`, `stored_coordinates`, and `kernel` when a STEP file comes, so that it starts quickly. Without FOLDER it loads the
kernel first, and then waits for a line with the folder on its standard input.
"""

import contextlib
import gc
import io
import json
import os
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import lazy_loader
import numpy as np

from tolcontact.child import Refusal, limit_resources
from tolcontact.stored_coordinates import is_binary_stl, is_single, printed_spacing, single_spacing

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
            pieces.append((trimesh.transform_points(geometry.vertices, transform), np.asarray(geometry.faces)))
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


def read_step(path: Path, chord: float, angle: float) -> Arrays:
    """Return the shapes of a STEP file [mm] with the arrays that `step_bodies.read` describes, and their chord [mm].

    vertices, faces, piece  as from `join`; a piece is a shape
    """
    pieces, arrays = step_bodies().read(path, chord, angle)
    return {**join(pieces), **arrays, "chord": np.array(chord)}


@cache
def step_bodies() -> Any:
    """Return the module that reads STEP files. The CAD kernel takes 230 MB and 1 s: only STEP files load it."""
    gc.disable()  # it finds nothing in what is imported, and takes a tenth of the time
    try:
        return import_module("tolcontact.kernel.step_bodies")
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


def work(folder: Path) -> None:
    """Read the files that the list in `folder` names."""
    jobs = json.loads((folder / "jobs.json").read_text())
    limit_resources(jobs["memory"], file_size=jobs["memory"], seconds=jobs["seconds"])
    (folder / "ready").touch()
    for k, job in enumerate(jobs["files"]):
        path = Path(job["path"])
        try:
            is_step = job["kind"] == "step"
            arrays = read_step(path, job["chord"], job["angle"]) if is_step else read_mesh(path, job["kind"])
            count = len(arrays["faces"])
            write_arrays(folder, k, arrays if count <= jobs["max_triangles"] else {"count": np.array(count)})
        except MemoryError:
            gigabytes = f"{jobs['memory'] / 2**30:.3g} GiB"
            write_fault(folder, k, f"takes more than {gigabytes} of memory to read; it is damaged, or far too fine")
        except Refusal as refusal:
            write_fault(folder, k, str(refusal))
        except Exception as error:  # any error is reported as a fault of the file
            write_fault(folder, k, f"is damaged, or of an unknown kind ({type(error).__name__}: {error}); export it again")


def write_arrays(folder: Path, k: int, arrays: Arrays) -> None:
    """Write the arrays of job `k`. Their file appears only when it is complete."""
    with (folder / "part").open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    (folder / "part").replace(folder / f"{k}.npz")


def write_fault(folder: Path, k: int, message: str) -> None:
    """Write the fault of job `k`. Its file appears only when it is complete."""
    (folder / "part").write_text(message, encoding="utf-8", errors="replace")
    (folder / "part").replace(folder / f"{k}.txt")


def awaited_folder() -> Path:
    """Load the CAD kernel, and return the folder that a line of standard input names; its file `errors` gets all output.

    The process ends if there is no such line: nobody needs it.
    """
    with contextlib.suppress(Refusal):  # the fault of a STEP file, if one comes
        step_bodies()
    name = sys.stdin.readline().rstrip("\n")
    if not name:
        os._exit(0)
    folder = Path(name)
    with (folder / "errors").open("wb") as errors:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(errors.fileno(), stream.fileno())
    return folder


if __name__ == "__main__":
    work(Path(sys.argv[1]) if len(sys.argv) > 1 else awaited_folder())
    os._exit(0)  # compiled libraries may crash when they tidy up after a damaged file
