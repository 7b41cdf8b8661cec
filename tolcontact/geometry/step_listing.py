"""What a STEP file holds, before anything is declared of it; and all of its bodies as parts. Lengths in mm."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.declaration.vectors import Vector
from tolcontact.errors import STEERING, GeometryFault, ModelError, OptionError, shown
from tolcontact.geometry.brep_face import FaceInFile, described, in_words
from tolcontact.geometry.files import key_of, read_files
from tolcontact.geometry.files.bodies import SHOWN
from tolcontact.geometry.files.product import Product
from tolcontact.readable import Readable


@dataclass(frozen=True, repr=False)
class BodyInFile(Readable):
    """A body of a STEP file.

    number, name   from 1 in the file's order; unlike that of any other body of it
    path           names of the products that it is in, from the root on
    lower, upper   corners of the box around it in its place [mm]; None if its triangles cannot be told from others
    at, rotation   where its own frame stands, as of a Part [mm, rad]
    faces          number of its B-rep faces
    is_open        whether its faces do not close
    units          of length in the file, in its words; empty if it states none. All lengths here are in mm
    """

    number: int
    name: str
    path: tuple[str, ...]
    lower: Vector | None
    upper: Vector | None
    at: Vector
    rotation: Vector
    faces: int
    is_open: bool
    units: str

    def __str__(self) -> str:
        called = f"{self.number}. {shown(self.name) or 'without a name'}"
        if self.lower is None or self.upper is None:
            return f"{called}: its faces cannot be told from those of others"
        size = " x ".join(f"{up - low:.4g}" for low, up in zip(self.lower, self.upper, strict=True))
        return f"{called}: {'open, ' if self.is_open else ''}{size} mm, {self.faces} faces"


def bodies_in(path: str | Path) -> tuple[BodyInFile, ...]:
    """The bodies of a STEP file, in its order. Raises OptionError if it cannot be read."""
    held = _product(path)
    return tuple(_body(held, number) for number in range(1, len(held.bodies) + 1))


def faces_in(path: str | Path, body: str | int | None = None) -> tuple[FaceInFile, ...]:
    """The B-rep faces of a body of a STEP file, of the only one if none is named. Raises OptionError as `bodies_in`."""
    held = _product(path)
    try:
        mesh = held.part(body)
    except GeometryFault as fault:
        raise OptionError(str(fault)) from fault
    return described(mesh)


def parts_from(
    model: Assembly,
    path: str | Path,
    names: Sequence[str] | None = None,
    *,
    fixed: bool | None = None,
    chord: float | None = None,
) -> dict[str, Part]:
    """Declare the bodies of a STEP file as parts of a model, each in its place: all, or those named. By their names.

    A part is called like the body in the file, without the signs that no part may have in its name; where names repeat, the
    second is called "name (2)" and so on. The part's own frame is that of its product, the same for all of its places.
    `fixed` is as of a Part, `chord` [mm] as of a Mesh.
    Raises ModelError if the file cannot be read, or holds no body of a name; TypeError if the names are one text.
    """
    if isinstance(names, str):
        raise TypeError(f"names is {names!r}; expected a list of the names of bodies")
    try:
        found = bodies_in(path)
    except OptionError as error:
        raise ModelError(model.name, [str(error)]) from error
    wanted = list(names) if names is not None else [body.name for body in found]
    known = {body.name: body for body in found}
    if missing := [name for name in wanted if name not in known]:
        listed = ", ".join(f'"{body.name}"' for body in found[:SHOWN]) + (", ..." if len(found) > SHOWN else "")
        raise ModelError(model.name, [f'"{path}" holds no body "{name}"; it holds {listed}' for name in missing])
    chosen = found if names is None else [known[name] for name in wanted]
    return {
        name: model.part(name, Mesh(path, body=body.number, chord=chord), at=body.at, rotation=body.rotation, fixed=fixed)
        for body in chosen
        if (name := _part_name(body))
    }


def _part_name(body: BodyInFile) -> str:
    plain = re.sub(r"[/\t\n]", "_", STEERING.sub("_", body.name)).strip()
    return plain if re.match(r"\w", plain) else f"body {body.number} {plain}".strip()


def _product(path: str | Path) -> Product:
    geometry = Mesh(path)
    for fault in geometry.faults():
        raise OptionError(fault)
    content = read_files([geometry])[key_of(geometry)]
    if isinstance(content, GeometryFault):
        raise OptionError(str(content))
    if content.product is None:
        raise OptionError(f'"{path}" is not a STEP file; only these hold bodies and faces that have numbers')
    return content.product


def _body(held: Product, number: int) -> BodyInFile:
    body = held.bodies[number - 1]
    lower, upper = (None if corner is None else in_words(corner) for corner in (body.lower, body.upper))
    rotation = Rotation.from_matrix(body.place[:3, :3]).as_rotvec()
    faces = len(np.unique(held.brep[body.triangles]))
    place = in_words(body.place[:3, 3]), in_words(rotation)
    return BodyInFile(number, body.name, body.path, lower, upper, *place, faces, body.is_open, shown(held.text.units))
