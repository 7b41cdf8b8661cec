"""The program of the process that reads shape files for `reader`, so that no file can end or stall that one.

`python -P worker.py FOLDER` writes FOLDER/ready once it has started, and works through the list in FOLDER/jobs.json. For job
k it writes FOLDER/k.npz with the arrays it read, or FOLDER/k.txt with the fault of the file. Of tolcontact it imports only
`child`, so that it starts quickly.
"""

import hashlib
import io
import json
import os
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tolcontact.child import limit_resources

try:
    import cascadio
except ImportError:  # an extra: only STEP files need it
    cascadio = None

Arrays = dict[str, np.ndarray]
COMPONENT_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}  # of glTF's accessors
WIDTHS = {"SCALAR": 1, "VEC3": 3}
ENCODING_GUESSERS = ("charset_normalizer", "chardet")  # trimesh would ask one for the encoding of binary content


class Refusal(Exception):
    """The fault of a file, as the rest of a sentence that begins with its name."""


class FolderResolver(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """The files in the folder of a glTF file, which may name no others."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def get(self, name: str) -> bytes:
        path = (self.folder / name).resolve()
        if "://" in name or not path.is_relative_to(self.folder):
            raise Refusal(f'refers to "{name}", which is outside its folder; export it as one file (GLB)')
        if not path.is_file():
            raise Refusal(f'refers to "{name}", which does not exist; put it beside it, or export all as one file (GLB)')
        return path.read_bytes()

    def write(self, name: str, data: Any) -> None:
        raise Refusal("is read only")

    def namespaced(self, namespace: str) -> "FolderResolver":
        return self

    def keys(self) -> list[str]:
        return []


def read_mesh(path: Path, kind: str) -> Arrays:
    """Return the pieces of a mesh file, joined and in their places. Lengths are in the file's units."""
    content = path.read_bytes()
    resolver = None
    if kind == "gltf":
        resolver = FolderResolver(path.parent)
        check_json(content)
    if kind == "obj" or (kind == "stl" and len(content) != 84 + 50 * int.from_bytes(content[80:84], "little")):
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
    pieces = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh):
            pieces.append((trimesh.transform_points(geometry.vertices, transform), np.asarray(geometry.faces)))
    return {**join(pieces), "units": np.array(scene.units or "")}


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


def read_step(path: Path, chord: float, angle: float, folder: Path) -> Arrays:
    """Return the shapes of a STEP file, each in its own frame [m], and the places where they stand.

    vertices, faces, piece  as from `join`; a piece is a shape
    brep                    (face,) the B-rep face of each triangle within its shape
    products                (shape,) names in the file
    coloured                (shape,) whether a shape has several colours: its B-rep faces are out of order then
    surfaces                (shape,) JSON with the surfaces of the B-rep faces
    shape, transforms       (place,), (place, 4, 4) the shape at each place in the file's order, and its motion to there
    paths                   (place,) JSON with the names of the products that contain the shape, and its own name
    """
    if cascadio is None:
        raise Refusal('is a STEP file, which needs the package cascadio; install it with: pip install "tolcontact[step]"')
    converted = folder / "converted.glb"
    converted.unlink(missing_ok=True)
    failed = cascadio.step_to_glb(str(path), str(converted), tol_linear=chord, tol_angular=angle, include_brep=True)
    if failed or not converted.is_file():
        raise Refusal("cannot be read as STEP: it is cut off, damaged, or holds no shape; export it again")
    glb = Glb(converted.read_bytes())
    shape_of_digest: dict[bytes, int] = {}
    shapes: list[tuple[np.ndarray, np.ndarray]] = []
    breps: list[np.ndarray] = []
    products: list[str] = []
    coloured: list[bool] = []
    surfaces: list[str] = []
    places: list[tuple[int, np.ndarray, str]] = []
    for names, transform, mesh in glb.places():
        corners, faces, brep, stated = glb.piece(mesh)
        if not len(faces):
            continue
        content_hash = hashlib.blake2b(json.dumps([mesh.get("name", ""), stated]).encode())  # one shape may have many places
        for array in (corners, faces, brep):
            content_hash.update(np.ascontiguousarray(array).data)
        digest = content_hash.digest()
        if digest not in shape_of_digest:
            shape_of_digest[digest] = len(shapes)
            shapes.append((corners, faces))
            breps.append(brep)
            products.append(mesh.get("name", ""))
            coloured.append(sum(is_surface(primitive) for primitive in mesh["primitives"]) > 1)
            surfaces.append(stated)
        places.append((shape_of_digest[digest], transform, json.dumps(names)))
    return {
        **join(shapes),
        "chord": np.array(chord),
        "brep": np.concatenate([np.zeros(0, dtype=np.int64), *breps]),
        "products": np.array(products, dtype=str),
        "coloured": np.array(coloured, dtype=bool),
        "surfaces": np.array(surfaces, dtype=str),
        "shape": np.array([shape for shape, _, _ in places], dtype=np.int64),
        "transforms": np.array([transform for _, transform, _ in places]).reshape(-1, 4, 4),
        "paths": np.array([names for _, _, names in places], dtype=str),
    }


def is_surface(primitive: dict[str, Any]) -> bool:
    """Return whether a primitive of a GLB consists of triangles, and not of lines or points."""
    return bool(primitive.get("mode", 4) == 4)


class Glb:
    """The GLB that cascadio writes."""

    def __init__(self, content: bytes) -> None:
        (length,) = struct.unpack_from("<I", content, 12)
        self.tree = json.loads(content[20 : 20 + length])
        self.binary = content[28 + length :]

    def places(self) -> list[tuple[list[str], np.ndarray, dict[str, Any]]]:
        """Return names from the root on, transform (4, 4) and mesh of each node with a mesh, in the file's order."""
        nodes, places = self.tree.get("nodes", []), []
        stack: list[tuple[int, np.ndarray, list[str]]] = [
            (k, np.eye(4), []) for k in reversed(self.tree["scenes"][0].get("nodes", []))
        ]
        while stack:
            index, parent_transform, parents = stack.pop()
            node = nodes[index]
            transform = parent_transform @ np.reshape(node.get("matrix", np.eye(4)), (4, 4)).T
            name = node.get("name", "")
            names = parents if name.startswith("=>[") else [*parents, name]  # the kernel's label of a nameless shape
            if "mesh" in node:
                places.append((names, transform, self.tree["meshes"][node["mesh"]]))
            stack.extend((k, transform, names) for k in reversed(node.get("children", [])))
        return places

    def piece(self, mesh: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
        """Return vertices (vertex, 3) [m], faces (face, 3), B-rep faces (face,) and JSON with the surfaces of a mesh.

        Each of its primitives has the faces of one colour.
        """
        corners, faces, breps = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        count = 0
        surfaces: list[dict[str, Any] | None] = []
        for primitive in mesh["primitives"]:
            if not is_surface(primitive):
                continue
            vertices = self.array(primitive["attributes"]["POSITION"]).astype(float)
            triangles = self.array(primitive["indices"]).astype(np.int64).reshape(-1, 3)
            extension = primitive.get("extensions", {}).get("TM_brep_faces")
            brep = self.array(extension["faceIndices"]).astype(np.int64).ravel() if extension else np.zeros(0, dtype=np.int64)
            if len(brep) != len(triangles):  # cascadio may give a colour of a product the extension of another colour
                extension, brep = None, connected_faces(triangles, len(vertices))
            corners.append(vertices)
            faces.append(triangles + count)
            breps.append(brep + len(surfaces))
            count += len(vertices)
            stated = extension["faces"] if extension else []
            surfaces.extend([*stated, *[None] * (int(brep.max(initial=-1)) + 1 - len(stated))])
        return np.concatenate(corners), np.concatenate(faces), np.concatenate(breps), json.dumps(surfaces)

    def array(self, index: int) -> np.ndarray:
        """Return the numbers (row, column) of an accessor."""
        accessor = self.tree["accessors"][index]
        view = self.tree["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(COMPONENT_TYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(self.binary, dtype, accessor["count"] * width, start)
        return flat.reshape(-1, width)


def connected_faces(triangles: np.ndarray, count: int) -> np.ndarray:
    """Return the B-rep face (face,) of each of `triangles` (face, 3) with `count` vertices.

    Triangles of one B-rep face share vertices; triangles of two do not.
    """
    links = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    label = trimesh.graph.connected_component_labels(links, node_count=count)
    _, start, number = np.unique(label[triangles[:, 0]], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(start))[number.ravel()].astype(np.int64)


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
            if job["kind"] == "step":
                arrays = read_step(path, job["chord"], job["angle"], folder)
            else:
                arrays = read_mesh(path, job["kind"])
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


if __name__ == "__main__":
    work(Path(sys.argv[1]))
    os._exit(0)  # compiled libraries may crash when they tidy up after a damaged file
