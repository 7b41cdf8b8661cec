"""An elastic body of tetrahedra, which a process of its own makes. Meshes are kept in the cache folder of the user."""

import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy import linalg, sparse

from tolcontact import code_cache
from tolcontact.arrays import Array, Float, Int
from tolcontact.child import ChildDiedError, run_child
from tolcontact.code_cache import digest
from tolcontact.elasticity.elastic_body import ElasticBody, rigid_motions
from tolcontact.elasticity.pads import SurfacePads
from tolcontact.elasticity.tetrahedra import Tetrahedra, node_volumes, stiffness_of, straightened
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import edges, triangle_tree
from tolcontact.temporary import temporary_folder

PROGRAM = Path(__file__).with_name("mesher.py")
VOLUME_ERROR = 0.02  # relative, of a mesh: flat facets of round faces
CUBIC_METRES = 1e-9  # in a cubic millimetre
MEMORY, SECONDS = 4 << 30, 300  # [byte] and [s] of processor time for a mesh
RAYS = 600
WALL_COSINE = -0.5  # of normals: a ray that leaves through a face turned further away has crossed no wall
THIN_SHARE = 0.1  # of the surface that may be thinner: edges of wedges, small lips
MAX_RATIO = 5.0  # edge by thickness: clamped sheets under pressure deflect 1.3 % too little there, 25 % at 10
USUAL_RATIO, USUAL_DIVISIONS = 2.5, 25  # edges by thickness, and along the diagonal of the part
MAX_NODES = 60_000
NODES_PER_SQUARE = 7.0  # of the surface of a sheet, for edges of length 1; measured


def meshed_body(
    vertices: Float[Array, "vertex 3"],
    faces: Int[Array, "face 3"],
    young: float,
    poisson: float,
    density: float | None = None,
    step: Path | None = None,
    element_size: float | None = None,
) -> ElasticBody:
    """Return the elastic body of a part of one material, whose tetrahedra are made here.

    vertices, faces   the closed surface of the part, in its frame [mm]
    young, poisson    Young's modulus [MPa] and Poisson's ratio
    density           [kg/m^3]; None if nothing needs the mass
    step              the STEP file of the part, whose true faces are meshed if one of its solids has this surface
    element_size      longest edge [mm]; None for one by the thickness of the part

    Raises GeometryFault if its shape or material cannot be used.
    """
    _check(faces, young, poisson, density)
    vertices, faces = np.ascontiguousarray(vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.int64)
    size = _element_size(vertices, faces, element_size)
    body = body_of(_mesh(vertices, faces, step, size), young, poisson, density)
    return replace(body, finer=lambda share: meshed_body(vertices, faces, young, poisson, density, step, share * size))


def body_of(mesh: Tetrahedra, young: float, poisson: float, density: float | None = None) -> ElasticBody:
    """Return the elastic body of a mesh, with Young's modulus [MPa], Poisson's ratio and density [kg/m^3].

    Its stiffness is assembled and factorized when it is first needed: flexibilities may be in the cache.
    """
    volumes = node_volumes(mesh)
    volume = float(volumes.sum())
    shares = volumes / volume
    mass = np.nan if density is None else CUBIC_METRES * density * volume

    @cache
    def stiffness() -> sparse.csr_array:
        return stiffness_of(mesh, young, poisson)

    @cache
    def solver() -> Callable[[np.ndarray], np.ndarray]:
        return _balanced_solver(stiffness(), rigid_motions(mesh.nodes, shares), mesh.nodes)

    key, pads = digest(mesh.nodes, mesh.elements, np.array([young, poisson])), SurfacePads(mesh, volume)
    return ElasticBody(mesh.nodes, shares, mass, pads, lambda f: solver()(f), lambda u: np.asarray(stiffness() @ u), key)


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return normals (face, 3) whose length is twice the area."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _check(faces: np.ndarray, young: float, poisson: float, density: float | None) -> None:
    if not 0 < young < np.inf:
        raise GeometryFault(f"E is {young!r}; expected Young's modulus [MPa], such as 210e3 for steel")
    if not -1 < poisson < 0.5:
        raise GeometryFault(f"nu is {poisson!r}; expected Poisson's ratio between -1 and 0.5, such as 0.3")
    if density is not None and not 0 < density < np.inf:
        raise GeometryFault(f"density is {density!r}; expected kg/m3, such as 7850 for steel")
    _, _, triangles = edges(faces)
    if (triangles != 2).any():
        raise GeometryFault(
            f"its surface is not closed: {np.count_nonzero(triangles != 2)} edges do not join two triangles; an elastic part "
            "is one solid: mend it, or import a stiffness matrix"
        )
    if find_spec("netgen") is None or find_spec("ngsolve") is None:
        raise GeometryFault(
            "tetrahedra need the packages netgen-mesher and ngsolve; install them with: "
            'pip install "tolcontact[elastic]", or import a stiffness matrix'
        )


def _mesh(vertices: np.ndarray, faces: np.ndarray, step: Path | None, size: float) -> Tetrahedra:
    """Return the tetrahedra of a part with edges up to `size` [mm], from the cache or from netgen."""
    content = b"" if step is None else step.read_bytes()
    key = "mesh-" + digest(PROGRAM.read_bytes(), vertices, faces, content, np.array(size))
    stored = code_cache.load(key)
    if stored is None:
        stored = _made(vertices, faces, step, size)
        code_cache.store(key, stored)
    with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
        mesh = Tetrahedra(arrays["nodes"], arrays["tetrahedra"])
    if len(mesh.nodes) > MAX_NODES:
        raise GeometryFault(
            f"its mesh has {len(mesh.nodes)} nodes with edges of {size:.3g} mm, and at most {MAX_NODES} are supported; give a "
            "larger element_size, leave small features out, or import a stiffness matrix"
        )
    volume, expected = node_volumes(mesh).sum(), np.einsum("fx,fx->", vertices[faces[:, 0]], _normals(vertices, faces)) / 6
    if abs(volume - expected) > VOLUME_ERROR * expected:
        raise GeometryFault(
            f"netgen fills {volume:.5g} mm3 with tetrahedra, and it encloses {expected:.5g} mm3: cavities are not meshed, nor "
            "surfaces that intersect themselves; mend it, give its STEP file, or import a stiffness matrix"
        )
    if mesh.piece_count > 1:
        raise GeometryFault(f"it consists of {mesh.piece_count} pieces; an elastic part is one: declare a part for each piece")
    return straightened(mesh)


def _made(vertices: np.ndarray, faces: np.ndarray, step: Path | None, size: float) -> bytes:
    """Return the npz file that the program writes. Raises GeometryFault if netgen does not mesh the part."""
    with temporary_folder() as folder:
        source = folder / "part.npz"
        np.savez(source, vertices=vertices, faces=faces, step=str(step.absolute()) if step else "", size=size)
        try:
            run_child(PROGRAM, str(source), memory=MEMORY, seconds=SECONDS)
        except ChildDiedError as error:
            raise GeometryFault(
                f"netgen does not mesh it with edges of {size:.3g} mm ({error}); give another element_size, mend its surface, "
                "or import a stiffness matrix"
            ) from error
        return source.with_suffix(".mesh.npz").read_bytes()


def _wall_thickness(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the thickness [mm] that nine tenths of the surface exceed: rays go inward from points even in area."""
    corners, normals = vertices[faces], _normals(vertices, faces)
    areas = np.linalg.norm(normals, axis=1)
    triangle = np.searchsorted(np.cumsum(areas), (np.arange(RAYS) + 0.5) / RAYS * areas.sum())
    normals = normals / np.maximum(areas, np.finfo(float).tiny)[:, None]
    u, v = np.modf(np.outer([0.7548776662466927, 0.5698402909980532], np.arange(1, RAYS + 1)))[0]  # even in the unit square
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    weights = np.stack([1 - u - v, u, v], axis=1)
    origins = np.einsum("rc,rcx->rx", weights, corners[triangle])
    hits = triangle_tree(vertices, faces).intersect_ray(vertices, faces, origins, -normals[triangle])
    walls = np.full(RAYS, np.inf)
    for k, crossed in enumerate(hits):
        lengths = [t for face, t, *_ in crossed if face != triangle[k] and normals[face] @ normals[triangle[k]] < WALL_COSINE]
        walls[k] = min(lengths, default=np.inf)
    thickness = float(np.quantile(walls, THIN_SHARE))
    return thickness if np.isfinite(thickness) else float(np.linalg.norm(np.ptp(vertices, axis=0)))


def _element_size(vertices: np.ndarray, faces: np.ndarray, required: float | None) -> float:
    """Return the edge length [mm] of tetrahedra, `required` or by thickness.

    Raises GeometryFault if they would be too coarse to bend, or too many.
    """
    area = float(np.linalg.norm(_normals(vertices, faces), axis=1).sum() / 2)
    thickness = _wall_thickness(vertices, faces)
    finest = float(np.sqrt(NODES_PER_SQUARE * area / MAX_NODES))
    largest = MAX_RATIO * thickness
    if required is not None:
        if required > largest:
            raise GeometryFault(
                f"element_size is {required:g} mm, and walls are {thickness:.3g} mm thick: sheets of such tetrahedra are "
                f"far too stiff; give at most {largest:.3g} mm (5 times the thickness), or import a stiffness matrix"
            )
        if required < finest:
            raise GeometryFault(
                f"element_size is {required:g} mm, which gives more than {MAX_NODES} nodes on {area:.3g} mm2; give at least "
                f"{finest:.3g} mm"
            )
        return required
    if finest > largest:
        raise GeometryFault(
            f"its walls are {thickness:.3g} mm thick, too thin for its {area:.3g} mm2: tetrahedra that can bend would have "
            f"more than {MAX_NODES} nodes; import a stiffness matrix of shells (stiffness=, nodes=)"
        )
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return max(min(USUAL_RATIO * thickness, diagonal / USUAL_DIVISIONS), min(1.5 * finest, largest))


def _balanced_solver(stiffness: sparse.csr_array, motions: np.ndarray, nodes: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that solves K u = f for balanced forces (3 node, load) [N], by the sparse factor of ngsolve.

    Six freedoms of three distant nodes are held, so that no rigid motion is left. Balanced forces leave them without reactions:
    any other six give the same u up to a rigid motion.
    """
    ngsolve = import_module("ngsolve")
    held = _held_freedoms(motions, nodes)
    free = np.setdiff1d(np.arange(stiffness.shape[0]), held)
    block = sparse.tril(stiffness[free][:, free]).tocoo()
    matrix = ngsolve.la.SparseMatrixd.CreateFromCOO(
        block.row.astype(np.int32), block.col.astype(np.int32), block.data, *block.shape
    )
    inverse = matrix.Inverse(inverse="sparsecholesky")

    def solve(forces: np.ndarray) -> np.ndarray:
        right, left = matrix.CreateColVector(), matrix.CreateColVector()
        displacements = np.zeros(forces.shape)
        for k in range(forces.shape[1]):
            right.FV().NumPy()[:] = forces[free, k]
            left.data = inverse * right
            displacements[free, k] = left.FV().NumPy()
        return displacements

    return solve


def _held_freedoms(motions: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Return six freedoms (6,) of three nodes far apart that hold a body best."""
    first = int(np.argmax(np.linalg.norm(nodes - nodes.mean(axis=0), axis=1)))
    second = int(np.argmax(np.linalg.norm(nodes - nodes[first], axis=1)))
    line = nodes[second] - nodes[first]
    third = int(np.argmax(np.linalg.norm(np.cross(nodes - nodes[first], line), axis=1)))
    candidates = (3 * np.array([[first], [second], [third]]) + np.arange(3)).ravel()
    _, _, order = linalg.qr(motions[candidates].T, pivoting=True)
    return candidates[order[:6]]
