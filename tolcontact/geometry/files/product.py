"""What a STEP file holds: shapes, put back onto the surfaces that the file knows, and bodies in their places. Lengths in mm."""

import json
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import rim
from tolcontact.geometry.files.bodies import Body, ShapePlace, StepMesh, bodies, listed
from tolcontact.geometry.files.step_surfaces import credible, onto, stated_surfaces
from tolcontact.geometry.files.step_text import StepText

STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # how far triangles of a STEP file may stay off its true faces [mm], and turn [rad]
STEP_SHARE = 5e-6  # the former of larger files, in shares of their extent: more than 0.4 m
FAR = 1e7  # [mm] no coordinate of a part is as large, and single precision leaves whole millimetres of it
RIGID = 1e-5  # how far a motion may stretch lengths, having passed through single precision
OFF = 3.0  # times that: vertices that are farther off the surface of their B-rep face are not moved onto it
BREP = "brep_index"  # attribute of a mesh: the B-rep face of each triangle
SURFACES = "surfaces"  # and the surface of each B-rep face, None if the file states none
FACE_NAMES = "face_names"  # and what the file calls each; none if it calls no face anything

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Product:
    """All shapes in one mesh, each in its own frame, and the bodies that they are at their places.

    shape, brep   (face,) the shape of each triangle, and the B-rep face within it
    surfaces       (shape,): what is known of the surface of each B-rep face
    """

    path: Path
    mesh: trimesh.Trimesh
    shape: np.ndarray
    brep: np.ndarray
    surfaces: tuple[list[AnalyticSurface | None], ...]
    bodies: tuple[Body, ...]
    text: StepText

    def body(self, wanted: str | int | None) -> Body:
        """The body of that name, or number from 1; the only one, if none is named.

        Raises GeometryFault if there is none, or more than one.
        """
        if wanted is None:
            if len(self.bodies) > 1:
                raise GeometryFault(
                    f'"{self.path}" holds {len(self.bodies)} bodies, but a part is one body; name one, '
                    'tc.Mesh(..., body="..."), '
                    f"or declare all with tc.parts_from: {listed(self.bodies)}"
                )
            return self.bodies[0]
        number = wanted - 1 if isinstance(wanted, int) else next((k for k, b in enumerate(self.bodies) if b.name == wanted), -1)
        if not 0 <= number < len(self.bodies):
            raise GeometryFault(f'"{self.path}" holds no body {wanted!r}; it holds {len(self.bodies)}: {listed(self.bodies)}')
        if not len(self.bodies[number].triangles):
            raise GeometryFault(f'"{self.path}": the triangles of body {wanted!r} cannot be told from others; export it alone')
        return self.bodies[number]

    def part(self, wanted: str | int | None) -> trimesh.Trimesh:
        """The triangles of a body: in its own frame if it is named, in its place if it is the only one.

        B-rep faces are numbered from 0 within the body, in the file's order: attribute BREP of its triangles; SURFACES in the
        metadata is what is known of each, FACE_NAMES what the file calls them.
        """
        body = self.body(wanted)
        own = body.triangles
        used, faces = np.unique(self.mesh.faces[own], return_inverse=True)
        vertices = np.asarray(self.mesh.vertices)[used]
        numbers, brep = np.unique(self.brep[own], return_inverse=True)
        known = self.surfaces[int(self.shape[own[0]])]
        surfaces = [known[number] if number < len(known) else None for number in numbers]
        if wanted is None and not np.array_equal(body.place, np.eye(4)):
            vertices = vertices @ body.place[:3, :3].T + body.place[:3, 3]
            surfaces = [
                None if surface is None else surface.placed(body.place[:3, :3], body.place[:3, 3]) for surface in surfaces
            ]
        mesh = trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)
        mesh.units = "mm"
        mesh.face_attributes[BREP] = brep.ravel()
        mesh.metadata[SURFACES] = surfaces
        mesh.metadata[FACE_NAMES] = body.face_names if any(body.face_names) else ()
        self._check_closed(mesh, brep)
        return mesh

    def _check_closed(self, mesh: trimesh.Trimesh, brep: np.ndarray) -> None:
        gaps = len(rim(mesh.faces)) if self.text.solids and len(self.bodies) == 1 else 0
        if gaps:
            raise GeometryFault(
                f'"{self.path}" holds a solid whose faces do not close ({gaps} edges have a triangle on one side only; '
                f"{len(np.unique(brep))} of {len(self.text.solids[0].faces)} faces could be read); repair it in CAD, or "
                "export it again"
            )


def product(path: Path, arrays: Mapping[str, np.ndarray], text: StepText) -> Product:
    """What `worker` read of a STEP file, in double precision.

    Raises GeometryFault if it holds no surfaces, or coordinates are not finite or far off.
    """
    if not len(arrays["faces"]):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    mesh = trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False)
    mesh.apply_scale(UNITS["m"])
    check_numbers(mesh.vertices, f'"{path}"')
    mesh.vertices = _resolved(np.asarray(mesh.vertices))
    own = np.zeros(len(mesh.vertices), dtype=np.int64)
    own[np.asarray(mesh.faces).ravel()] = np.repeat(arrays["piece"], 3)
    mesh = _merged(mesh, own)
    whole = _mended(path, mesh.faces)
    mesh.update_faces(whole)
    shape, brep = arrays["piece"][whole], arrays["brep"][whole]
    vertices, off = np.array(mesh.vertices), OFF * float(arrays["chord"])
    known: list[list[AnalyticSurface | None]] = []
    for k, said in enumerate(arrays["surfaces"]):
        chosen = np.flatnonzero(shape == k)
        used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
        own, faces = vertices[used], faces.reshape(-1, 3)
        known.append(credible(own, faces, brep[chosen], stated_surfaces(str(said)), off))
        vertices[used] = onto(own, faces, brep[chosen], known[-1], off)
    mesh = trimesh.Trimesh(vertices, mesh.faces, process=False)
    places = [
        ShapePlace(int(stands), _in_mm(path, transform), tuple(json.loads(str(names))))
        for stands, transform, names in zip(arrays["shape"], arrays["transforms"], arrays["paths"], strict=True)
    ]
    step_mesh = StepMesh(
        np.asarray(mesh.triangles), np.asarray(mesh.faces), shape, brep, arrays["products"], arrays["coloured"],
        known, text.unit,
    )  # fmt: skip
    return Product(path, mesh, shape, brep, tuple(known), tuple(bodies(step_mesh, places, text.solids)), text)


def _mended(path: Path, faces: np.ndarray) -> np.ndarray:
    """Indices of the triangles (face, 3) that are one, and once; what is left out is mentioned.

    Of edges shorter than coordinates resolve, triangles with two corners in one place are left; of a face that stands twice in
    its shell, triangles that stand twice.
    """
    whole = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(axis=1))
    lowest = np.argmin(faces[whole], axis=1)
    turned = np.take_along_axis(faces[whole], (lowest[:, None] + np.arange(3)) % 3, axis=1)
    first, _ = trimesh.grouping.unique_rows(turned)
    for count, what in ((len(faces) - len(whole), "on edges of no length"), (len(whole) - len(first), "that stand twice")):
        if count:
            log.info('"%s": %d triangles %s are left out', path, count, what)
    return np.asarray(whole[np.sort(first)])


def check_numbers(vertices: np.ndarray, who: str) -> None:
    """Raise GeometryFault if coordinates [mm] are not finite, or far off."""
    if not np.isfinite(vertices).all():
        raise GeometryFault(f"{who} has vertices that are not finite; export it again")
    far = float(np.abs(vertices).max(initial=0))
    if far > FAR:
        raise GeometryFault(
            f"{who} reaches as far as {far:.3g} mm, beyond the limit of {FAR:g} mm; it is damaged, or in other "
            "units: export it again, or state its units"
        )


def _resolved(vertices: np.ndarray) -> np.ndarray:
    """Vertices that passed through single precision [m]: rounding to what that resolves brings round lengths back."""
    resolved = UNITS["m"] * float(np.spacing(np.float32(np.abs(vertices).max(initial=0) / UNITS["m"])))
    power = 10.0 ** math.floor(math.log10(resolved))
    step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= resolved)
    return np.asarray(np.round(np.round(vertices / step) * step, 12))


def _merged(mesh: trimesh.Trimesh, shape: np.ndarray) -> trimesh.Trimesh:
    """A mesh in which the vertices of one shape that stand in one place are one."""
    _, first, place = np.unique(
        np.column_stack([shape, np.asarray(mesh.vertices)]), axis=0, return_index=True, return_inverse=True
    )
    return trimesh.Trimesh(np.asarray(mesh.vertices)[first], place.ravel()[np.asarray(mesh.faces)], process=False)


def _in_mm(path: Path, transform: np.ndarray) -> np.ndarray:
    """A rigid motion (4, 4) [mm] from one [m] that passed through single precision: a rotation again, and round lengths.

    Raises GeometryFault if it mirrors or scales.
    """
    place = np.eye(4)
    U, scales, V = np.linalg.svd(transform[:3, :3])
    if np.abs(scales - 1).max() > RIGID or np.linalg.det(transform[:3, :3]) < 0:
        raise GeometryFault(
            f'"{path}" places a body mirrored or scaled, which bodies of a rigid assembly are not; export it as it is'
        )
    place[:3, :3] = U @ V
    place[:3, 3] = _resolved(UNITS["m"] * transform[:3, 3]) if transform[:3, 3].any() else 0.0
    return place
