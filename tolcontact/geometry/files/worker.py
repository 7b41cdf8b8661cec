"""The program of the process that reads shape files for `reader`: what they make it do stays there.

`python -P worker.py FOLDER` leaves FOLDER/ready once it has started, and works through the list in FOLDER/jobs.json. Of job
k it leaves FOLDER/k.npz with what it read, or FOLDER/k.txt with what is wrong. It imports nothing of tolcontact, so that it
starts quickly.
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
COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}  # of glTF's accessors
WIDTHS = {"SCALAR": 1, "VEC3": 3}
GUESSERS = ("charset_normalizer", "chardet")  # by which trimesh would guess the alphabet of what is no text


class Refused(Exception):
    """What is wrong with a file, as the rest of a sentence that begins with its name."""


class OwnFolder(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """The files beside a glTF file: it may name no others."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()

    def get(self, name: str) -> bytes:
        path = (self.folder / name).resolve()
        if "://" in name or not path.is_relative_to(self.folder):
            raise Refused(f'refers to "{name}", which is outside its folder; export it as one file (GLB)')
        if not path.is_file():
            raise Refused(f'refers to "{name}", which does not exist; put it beside it, or export all as one file (GLB)')
        return path.read_bytes()

    def write(self, name: str, data: Any) -> None:
        raise Refused("is read only")

    def namespaced(self, namespace: str) -> "OwnFolder":
        return self

    def keys(self) -> list[str]:
        return []


def read_mesh(path: Path, kind: str) -> Arrays:
    """All pieces of a mesh file in their places, in the file's own units."""
    content = path.read_bytes()
    beside = None
    if kind == "gltf":
        beside = OwnFolder(path.parent)
        check_json(content)
    if kind == "obj" or (kind == "stl" and len(content) != 84 + 50 * int.from_bytes(content[80:84], "little")):
        content = plain(content)
    try:
        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, resolver=beside, process=False)
    except (Refused, MemoryError):
        raise
    except Exception as error:  # trimesh's readers raise whatever their format's parser raises
        # Packages that guess encodings, if there are any, read garbled text as some other text.
        garbled = isinstance(error, UnicodeDecodeError | json.JSONDecodeError)
        if garbled or getattr(error, "name", "") in GUESSERS:
            raise Refused("is damaged: it does not contain text where it should; export it again") from error
        raise Refused(
            f"cannot be read as a mesh ({type(error).__name__}: {error}); export it again as STL, OBJ, PLY or GLB"
        ) from error
    found = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh):
            found.append((trimesh.transform_points(geometry.vertices, transform), np.asarray(geometry.faces)))
    return {**joined(found), "units": np.array(scene.units or "")}


def check_json(content: bytes) -> None:
    """Refuse what is not glTF: trimesh would look for another file then."""
    try:
        json.loads(content)
    except (ValueError, RecursionError) as error:
        raise Refused("is not a glTF file: it is not JSON; export it again, preferably as one file (GLB)") from error


def plain(content: bytes) -> bytes:
    """A text in UTF-8. Names in other alphabets, which do not matter here, may get lost; numbers do not."""
    try:
        content.decode()
    except UnicodeDecodeError:
        return content.decode("ascii", errors="replace").encode()
    return content


def read_step(path: Path, chord: float, angle: float, folder: Path) -> Arrays:
    """The shapes of a STEP file, each in its own frame [m], and the places where they stand.

    Of the shapes: `joined`, where a piece is a shape, and `brep` (face,) the B-rep face within it; `products` (shape,) are the
    file's names; `coloured` (shape,) marks those of several colours, which have their B-rep faces out of order; `surfaces`
    (shape,) is what is known of their B-rep faces, in JSON.
    Of the places, in the file's order: `shape` (place,) stands there, moved by `transforms` (place, 4, 4); `paths` (place,)
    name the products that it is in, and itself, in JSON.
    """
    if cascadio is None:
        raise Refused('is a STEP file, which needs the package cascadio; install it with: pip install "tolcontact[step]"')
    converted = folder / "converted.glb"
    converted.unlink(missing_ok=True)
    failed = cascadio.step_to_glb(str(path), str(converted), tol_linear=chord, tol_angular=angle, include_brep=True)
    if failed or not converted.is_file():
        raise Refused("cannot be read as STEP: it is cut off, damaged, or holds no shape; export it again")
    glb = Glb(converted.read_bytes())
    known: dict[bytes, int] = {}
    shapes: list[tuple[np.ndarray, np.ndarray]] = []
    breps: list[np.ndarray] = []
    products: list[str] = []
    coloured: list[bool] = []
    surfaces: list[str] = []
    places: list[tuple[int, np.ndarray, str]] = []
    for names, transform, mesh in glb.places():
        corners, faces, brep, said = glb.piece(mesh)
        if not len(faces):
            continue
        same = hashlib.blake2b(json.dumps([mesh.get("name", ""), said]).encode())  # if it stands elsewhere, too
        for array in (corners, faces, brep):
            same.update(np.ascontiguousarray(array).data)
        digest = same.digest()
        if digest not in known:
            known[digest] = len(shapes)
            shapes.append((corners, faces))
            breps.append(brep)
            products.append(mesh.get("name", ""))
            coloured.append(sum(is_surface(primitive) for primitive in mesh["primitives"]) > 1)
            surfaces.append(said)
        places.append((known[digest], transform, json.dumps(names)))
    return {
        **joined(shapes),
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
    """Whether a primitive of a GLB consists of triangles, and not of lines or points."""
    return bool(primitive.get("mode", 4) == 4)


class Glb:
    """The GLB that cascadio writes."""

    def __init__(self, content: bytes) -> None:
        (length,) = struct.unpack_from("<I", content, 12)
        self.tree = json.loads(content[20 : 20 + length])
        self.binary = content[28 + length :]

    def places(self) -> list[tuple[list[str], np.ndarray, dict[str, Any]]]:
        """Names from the root on, transform (4, 4) and mesh of each node that has a mesh, in the file's order."""
        nodes, found = self.tree.get("nodes", []), []
        waiting: list[tuple[int, np.ndarray, list[str]]] = [
            (k, np.eye(4), []) for k in reversed(self.tree["scenes"][0].get("nodes", []))
        ]
        while waiting:
            index, above, parents = waiting.pop()
            node = nodes[index]
            transform = above @ np.reshape(node.get("matrix", np.eye(4)), (4, 4)).T
            name = node.get("name", "")
            names = parents if name.startswith("=>[") else [*parents, name]  # the kernel's label of a nameless shape
            if "mesh" in node:
                found.append((names, transform, self.tree["meshes"][node["mesh"]]))
            waiting.extend((k, transform, names) for k in reversed(node.get("children", [])))
        return found

    def piece(self, mesh: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
        """Vertices (vertex, 3) [m], faces (face, 3), B-rep faces (face,) of a mesh, whose colours stand apart; and theirs."""
        corners, faces, breps = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        count = 0
        surfaces: list[dict[str, Any] | None] = []
        for primitive in mesh["primitives"]:
            if not is_surface(primitive):
                continue
            own = self.array(primitive["attributes"]["POSITION"]).astype(float)
            triangles = self.array(primitive["indices"]).astype(np.int64).reshape(-1, 3)
            told = primitive.get("extensions", {}).get("TM_brep_faces")
            brep = self.array(told["faceIndices"]).astype(np.int64).ravel() if told else np.zeros(0, dtype=np.int64)
            if len(brep) != len(triangles):  # cascadio gives one of several colours of a product what is another one's
                told, brep = None, sharing(triangles, len(own))
            corners.append(own)
            faces.append(triangles + count)
            breps.append(brep + len(surfaces))
            count += len(own)
            known = told["faces"] if told else []
            surfaces.extend([*known, *[None] * (int(brep.max(initial=-1)) + 1 - len(known))])
        return np.concatenate(corners), np.concatenate(faces), np.concatenate(breps), json.dumps(surfaces)

    def array(self, index: int) -> np.ndarray:
        """An accessor's numbers (row, column)."""
        accessor = self.tree["accessors"][index]
        view = self.tree["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(COMPONENTS[accessor["componentType"]]), WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(self.binary, dtype, accessor["count"] * width, start)
        return flat.reshape(-1, width)


def sharing(triangles: np.ndarray, count: int) -> np.ndarray:
    """Which B-rep face each of `triangles` (face, 3) belongs to: the triangles of one share vertices, those of two do not."""
    links = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    label = trimesh.graph.connected_component_labels(links, node_count=count)
    _, first, place = np.unique(label[triangles[:, 0]], return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[place.ravel()], dtype=np.int64)


def joined(found: list[tuple[np.ndarray, np.ndarray]]) -> Arrays:
    """Pieces as one: vertices (vertex, 3), faces (face, 3), and the piece (face,) that each triangle is from."""
    vertices, faces, piece = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    count = 0
    for k, (own, triangles) in enumerate(found):
        if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(own):
            raise Refused(f"is damaged: its triangles refer to vertices beyond the {len(own)} that it has; export it again")
        vertices.append(own)
        faces.append(triangles + count)
        piece.append(np.full(len(triangles), k))
        count += len(own)
    return {"vertices": np.concatenate(vertices), "faces": np.concatenate(faces), "piece": np.concatenate(piece)}


def work(folder: Path) -> None:
    """Read what the list in `folder` names."""
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
            save(folder, k, arrays if count <= jobs["most"] else {"count": np.array(count)})
        except MemoryError:
            say(
                folder, k, f"takes more than {jobs['memory'] / 2**30:.3g} GiB of memory to read; it is damaged, or far too fine"
            )
        except Refused as refused:
            say(folder, k, str(refused))
        except Exception as error:  # whatever a file causes is reported as its fault
            say(folder, k, f"is damaged, or of an unknown kind ({type(error).__name__}: {error}); export it again")


def save(folder: Path, k: int, arrays: Arrays) -> None:
    """Leave what was read; it appears at once, when it is whole."""
    with (folder / "part").open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    (folder / "part").replace(folder / f"{k}.npz")


def say(folder: Path, k: int, words: str) -> None:
    """Leave what is wrong."""
    (folder / "part").write_text(words, encoding="utf-8", errors="replace")
    (folder / "part").replace(folder / f"{k}.txt")


if __name__ == "__main__":
    work(Path(sys.argv[1]))
    os._exit(0)  # a damaged file's leftovers in compiled libraries are not tidied up
