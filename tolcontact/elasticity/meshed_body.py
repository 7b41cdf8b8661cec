"""An elastic body of tetrahedra, which a process of its own makes. Meshes are kept in the cache folder of the user."""

import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy import sparse

from tolcontact import code_cache
from tolcontact.child import ChildDiedError, run_child
from tolcontact.code_cache import digest
from tolcontact.elasticity.cholesky import balanced_solver
from tolcontact.elasticity.elastic_body import ElasticBody, rigid_motions
from tolcontact.elasticity.pads import SurfacePads
from tolcontact.elasticity.sources import MeshSource
from tolcontact.elasticity.tetrahedra import Tetrahedra, node_volumes, stiffness_of, straightened
from tolcontact.elasticity.thickness import MAX_NODES, element_size
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import edges
from tolcontact.temporary import temporary_folder

PROGRAM = Path(__file__).with_name("mesher.py")
VOLUME_ERROR = 0.02  # relative, of a mesh: flat facets of round faces
CUBIC_METRES = 1e-9  # in a cubic millimetre
MEMORY, SECONDS = 4 << 30, 300  # [byte] and [s] of processor time for a mesh


def meshed_body(source: MeshSource) -> ElasticBody:
    """Return the elastic body of a part that is meshed here. Raises GeometryFault if its shape or material cannot be used."""
    _check(source)
    vertices, faces = np.ascontiguousarray(source.vertices, dtype=float), np.ascontiguousarray(source.faces, dtype=np.int64)
    area = float(np.linalg.norm(_normals(vertices, faces), axis=1).sum() / 2)
    size = element_size(vertices, faces, area, source.element_size)
    mesh = _mesh(vertices, faces, source.step, size)
    body = body_of(mesh, source.young, source.poisson, source.density)
    return replace(body, finer=lambda share: meshed_body(replace(source, element_size=share * size)))


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
        return balanced_solver(stiffness(), rigid_motions(mesh.nodes, shares), mesh.nodes)

    key, pads = digest(mesh.nodes, mesh.elements, np.array([young, poisson])), SurfacePads(mesh, volume)
    return ElasticBody(mesh.nodes, shares, mass, pads, lambda f: solver()(f), lambda u: np.asarray(stiffness() @ u), key)


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return normals (face, 3) whose length is twice the area."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _check(source: MeshSource) -> None:
    if not 0 < source.young < np.inf:
        raise GeometryFault(f"E is {source.young!r}; expected Young's modulus [MPa], such as 210e3 for steel")
    if not -1 < source.poisson < 0.5:
        raise GeometryFault(f"nu is {source.poisson!r}; expected Poisson's ratio between -1 and 0.5, such as 0.3")
    if source.density is not None and not 0 < source.density < np.inf:
        raise GeometryFault(f"density is {source.density!r}; expected kg/m3, such as 7850 for steel")
    _, _, triangles = edges(source.faces)
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
