"""The program of the process that meshes a part with netgen, which may crash or stall on a shape.

Its argument is an npz file with `vertices`, `faces`, `size` and `step`, the path of a STEP file or "". It writes the mesh to
the same path with the suffix `.mesh.npz`, and prints what it did.
"""

import os
import sys
from pathlib import Path

import numpy as np
from netgen import occ
from netgen.stl import STLGeometry

from tolcontact.child import limit_resources

MATCH = 1e-3  # relative difference of volumes, and of centroids to the size, between a solid and the triangles of the part


def mesh(source: Path) -> str:
    """Mesh a source of second order, and return what was meshed: the faces of its STEP file, or its triangles."""
    with np.load(source) as content:
        vertices, faces = content["vertices"], content["faces"]
        step, size = str(content["step"]), float(content["size"])
    solid = matching_solid(step, vertices, faces) if step else None
    if solid is not None:
        geometry = occ.OCCGeometry(solid)
    else:
        path = source.with_suffix(".stl")
        path.write_text(ascii_stl(vertices, faces))
        geometry = STLGeometry(os.fspath(path))
    volume = geometry.GenerateMesh(maxh=size)
    volume.SecondOrder()
    tetrahedra = volume.Elements3D().NumPy()["nodes"]
    np.savez(
        source.with_suffix(".mesh.npz"),
        nodes=np.asarray(volume.Coordinates()),
        tetrahedra=tetrahedra.astype(np.int64) - 1,
    )
    return "triangles" if solid is None else "faces"


def matching_solid(path: str, vertices: np.ndarray, faces: np.ndarray) -> "occ.TopoDS_Shape | None":
    """Return the solid of a STEP file that is where the triangles are; None if there is none."""
    corners = vertices[faces]
    parts = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    volume, extent = parts.sum(), np.linalg.norm(np.ptp(vertices, axis=0))
    centroid = parts @ corners.sum(axis=1) / 4 / volume
    for solid in occ.OCCGeometry(path).shape.solids:
        offset = np.linalg.norm(np.array(list(solid.center)) - centroid)
        if abs(solid.mass - volume) <= MATCH * volume and offset <= MATCH * extent:
            return solid
    return None


def ascii_stl(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Return triangles with all digits; binary files have seven."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    rows = np.concatenate([normals, corners.reshape(-1, 9)], axis=1)
    facet = "facet normal {} {} {}\nouter loop\nvertex {} {} {}\nvertex {} {} {}\nvertex {} {} {}\nendloop\nendfacet"
    return "\n".join(["solid part", *(facet.format(*map(repr, row)) for row in rows.tolist()), "endsolid part\n"])


if __name__ == "__main__":
    results = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # netgen prints messages
    limit_resources(int(sys.argv[2]), seconds=float(sys.argv[3]))
    os.write(results, mesh(Path(sys.argv[1])).encode())
    os._exit(0)  # compiled libraries may crash when they tidy up
