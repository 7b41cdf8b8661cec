"""Sources of shapes to triangle meshes in mm."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration import Box, Mesh
from tolcontact.declaration.geometry import UNITS
from tolcontact.discretization.edges import rim
from tolcontact.discretization.fault import GeometryFault
from tolcontact.discretization.shape_files import reader, screening
from tolcontact.discretization.shape_files.bodies import Triangles, bodies, listed
from tolcontact.discretization.shape_files.step_text import StepText

MAX_TRIANGLES = 1_000_000  # with contact on all of them some 3 GiB on the way through
STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # how far triangles of a STEP file may stay off its true faces [mm], and turn [rad]
FAR = 1e7  # [mm] no coordinate of a part is as large, and single precision leaves whole millimetres of it
BREP = "brep_index"  # the B-rep face of each triangle


@dataclass(frozen=True)
class Shape:
    """A part's surface in mm. `unsure`: its units were not stated, and are those that are usual for its kind of file."""

    mesh: trimesh.Trimesh
    unsure: bool = False


@dataclass(frozen=True)
class Content:
    """What a file holds, as `worker` reads it, and the content of its text if it is a STEP file."""

    arrays: Mapping[str, np.ndarray]
    text: StepText | None


Contents = Mapping[Path, Content | GeometryFault]


def read_files(geometries: Iterable[Box | Mesh]) -> Contents:
    """The contents of all files that some geometries name, or what is wrong with them. Each file is read once."""
    sources = [geometry.source for geometry in geometries if isinstance(geometry, Mesh)]
    found: dict[Path, Content | GeometryFault] = {}
    texts: dict[Path, StepText | None] = {}
    for path in dict.fromkeys(Path(source) for source in sources if isinstance(source, str | Path)):
        try:
            texts[path] = screening.screen(path, MAX_TRIANGLES)
        except GeometryFault as fault:
            found[path] = fault
    request = reader.Request(tuple((path, screening.kind(path)) for path in texts), STEP_CHORD, STEP_ANGLE, MAX_TRIANGLES)
    for path, read_in in zip(texts, reader.load(request), strict=True):
        if isinstance(read_in, GeometryFault):
            found[path] = read_in
        elif "count" in read_in:
            found[path] = GeometryFault(screening.too_many(path, int(read_in["count"]), MAX_TRIANGLES))
        else:
            found[path] = Content(read_in, texts[path])
    return found


def read(geometry: Mesh, contents: Contents) -> Shape:
    """The triangles of a mesh geometry. `contents` hold that of its file, if it has one.

    Raises GeometryFault if the file cannot be read, is too large or holds several bodies, if coordinates are not finite
    or far off, or if its units are unknown.
    """
    source = geometry.source
    if not isinstance(source, str | Path):
        return Shape(_in_memory(geometry))
    content = contents[Path(source)]
    if isinstance(content, GeometryFault):
        raise content
    if content.text is not None:
        return Shape(_from_step(geometry, content.arrays, content.text))
    own = trimesh.Trimesh(content.arrays["vertices"], content.arrays["faces"], process=False)
    own.apply_scale(_scale(geometry, str(content.arrays["units"]) or None))
    _check_numbers(own, geometry)
    return Shape(_merged(own, content.arrays["piece"]), unsure=not geometry.units)


def _in_memory(geometry: Mesh) -> trimesh.Trimesh:
    source = geometry.source
    own = trimesh.Trimesh(source.vertices, source.faces, process=False)
    if len(own.faces) and not 0 <= own.faces.min() <= own.faces.max() < len(own.vertices):
        raise GeometryFault(f"{geometry}: its triangles refer to vertices beyond the {len(own.vertices)} that it has")
    if len(own.faces) > MAX_TRIANGLES:
        raise GeometryFault(screening.too_many(geometry, len(own.faces), MAX_TRIANGLES))
    own.apply_scale(_scale(geometry, getattr(source, "units", None)))
    _check_numbers(own, geometry)
    own.merge_vertices(merge_tex=True, merge_norm=True)
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


def _check_numbers(mesh: trimesh.Trimesh, geometry: Mesh) -> None:
    if not np.isfinite(mesh.vertices).all():
        raise GeometryFault(f"{geometry} has vertices that are not finite; export it again")
    far = float(np.abs(mesh.vertices).max(initial=0))
    if far > FAR:
        raise GeometryFault(
            f"{geometry} reaches as far as {far:.3g} mm, beyond the limit of {FAR:g} mm; it is damaged, or in other "
            "units: export it again, or state its units"
        )


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


def _from_step(geometry: Mesh, arrays: Mapping[str, np.ndarray], text: StepText) -> trimesh.Trimesh:
    """The one body of a STEP file. Its B-rep faces are the mesh's face attribute BREP."""
    path = Path(geometry.source)
    if not len(arrays["faces"]):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    mesh = trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False)
    mesh.apply_scale(UNITS["m"])
    _check_numbers(mesh, geometry)
    # It has passed through single precision. Rounding to what that resolves brings round lengths back, and flat faces.
    resolved = UNITS["m"] * float(np.spacing(np.float32(np.abs(mesh.vertices).max(initial=0) / UNITS["m"])))
    power = 10.0 ** math.floor(math.log10(resolved))
    step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= resolved)
    mesh.vertices = np.round(np.round(mesh.vertices / step) * step, 12)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    # Of edges shorter than that step, triangles with two corners in one place are left. They are none.
    whole = (mesh.faces != np.roll(mesh.faces, 1, axis=1)).all(axis=1)
    piece, brep = arrays["piece"][whole], arrays["brep"][whole]
    if not whole.all():
        mesh.update_faces(whole)
    found = bodies(Triangles(mesh.triangles, mesh.faces, piece, brep, arrays["names"], arrays["coloured"]), text.solids)
    if len(found) > 1:
        raise GeometryFault(
            f'"{path}" holds {len(found)} bodies, but a part is one body; export each as a file of its own: {listed(found)}'
        )
    gaps = len(rim(mesh.faces)) if text.solids else 0
    if gaps:
        raise GeometryFault(
            f'"{path}" holds a solid whose faces do not close ({gaps} edges have a triangle on one side only; '
            f"{len(np.unique(brep))} of {text.solids[0].faces} faces could be read); repair it in CAD, or export it again"
        )
    mesh.units = "mm"
    mesh.face_attributes[BREP] = brep
    return mesh
