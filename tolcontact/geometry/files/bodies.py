"""The bodies that a STEP file holds: which triangles are whose, and where they stand. A part is one of them. Lengths in mm.

A shape is what the file's product structure puts in its places; a product may hold several solids. Triangles come B-rep face
by B-rep face, and solid by solid, so that a solid ends where what began with it is closed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tolcontact.errors import clipped
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import edges
from tolcontact.geometry.files.step_text import NamedFace, Solid

MAX_LISTED = 12  # bodies that a message lists
SAME = 1e-6  # [mm], and of what lies farther off than 1 mm its share: a surface and what a text says of it differ by less


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its place.

    name          unlike that of any other body of the file; "" if the file has none
    path          names of the products that it is in, from the root on
    place         (4, 4): from its own frame to that of the file [mm]
    triangles     (face,) those of its shape that are its own; none if they are not known
    lower, upper  (3,) corners in its place; None if its triangles are not known
    face_names    of its B-rep faces, "" of those without one; empty if there are none, or if they cannot be told apart
    """

    name: str
    path: tuple[str, ...] = ()
    place: np.ndarray = field(default_factory=lambda: np.eye(4))
    triangles: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    lower: np.ndarray | None = None
    upper: np.ndarray | None = None
    is_open: bool = False
    face_names: tuple[str, ...] = ()

    def __str__(self) -> str:
        called = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        if self.lower is None or self.upper is None:
            return called
        size = " x ".join(f"{length:.4g}" for length in self.upper - self.lower)
        return f"{called}, {size} mm at ({', '.join(f'{x:.4g}' for x in (self.lower + self.upper) / 2)})"


@dataclass(frozen=True)
class Triangles:
    """Triangles of a STEP file: `corners` (face, 3, 3), and `faces` (face, 3) that share vertices wherever corners meet.

    shape, brep          (face,) the shape, in whose own frame it is, and the B-rep face within it
    products             (shape,) what the file calls each shape
    coloured             (shape,) bool: of several colours, by which its B-rep faces are ordered, and not by solids
    surfaces                (shape,): the surface of each B-rep face, None if it is not known
    unit                 [mm] of length in the file's text
    """

    corners: np.ndarray
    faces: np.ndarray
    shape: np.ndarray
    brep: np.ndarray
    products: np.ndarray
    coloured: np.ndarray
    surfaces: Sequence[Sequence[AnalyticSurface | None]]
    unit: float


@dataclass(frozen=True)
class Place:
    """A `shape` stands at `place` (4, 4) [mm]; `path`: the names of what it is in, and its own."""

    shape: int
    place: np.ndarray
    path: tuple[str, ...]


def bodies(triangles: Triangles, places: Sequence[Place], solids: Sequence[Solid]) -> list[Body]:
    """The bodies of a file whose text names some `solids`, in its order."""
    of_shape: dict[int, list[tuple[np.ndarray, bool]]] = {}
    alone = _of_one_place(triangles, places[0], solids) if len(places) == 1 else None
    if alone is not None:
        return list(_told_apart(alone))
    found: list[Body] = []
    for place in places:
        if place.shape not in of_shape:
            of_shape[place.shape] = _runs(triangles, np.flatnonzero(triangles.shape == place.shape))
        name = place.path[-1] if place.path and place.path[-1] else str(triangles.products[place.shape])
        found.extend(_body(triangles, place, name, own, solids, is_open) for own, is_open in of_shape[place.shape])
    if len(places) == 1 and len(found) < len(solids):
        return list(_told_apart([Body(solid.name) for solid in solids]))
    return list(_told_apart(found))


def _of_one_place(triangles: Triangles, place: Place, solids: Sequence[Solid]) -> list[Body] | None:
    """The bodies of a file in which one shape stands at one place; None if its text does not tell which they are."""
    count = int(triangles.brep.max()) + 1
    if len(solids) == 1 and len(solids[0].faces) >= count:
        name = solids[0].name or str(triangles.products[place.shape])
        return [_body(triangles, place, name, np.arange(len(triangles.faces)), solids)]
    if sum(len(solid.faces) for solid in solids) == count and not triangles.coloured[place.shape]:
        first = np.cumsum([0, *(len(solid.faces) for solid in solids)])
        label = np.searchsorted(first, triangles.brep, side="right") - 1
        return [_body(triangles, place, solid.name, np.flatnonzero(label == k), [solid]) for k, solid in enumerate(solids)]
    return None


def _told_apart(found: Sequence[Body]) -> Iterator[Body]:
    """Bodies whose names differ: those that repeat are numbered in the file's order."""
    names = {body.name for body in found}
    used: set[str] = set()
    for body in found:
        name, number = body.name, 1
        while name and (name in used or (number > 1 and name in names)):
            number += 1
            name = f"{body.name} ({number})"
        used.add(name)
        yield replace(body, name=name)


def listed(found: Sequence[Body]) -> str:
    """Some bodies with their numbers, names, sizes and places."""
    first = "; ".join(f"{number}. {body}" for number, body in enumerate(found[:MAX_LISTED], start=1))
    return first + (f"; and {len(found) - MAX_LISTED} more" if len(found) > MAX_LISTED else "")


def _body(
    triangles: Triangles, place: Place, name: str, chosen: np.ndarray, solids: Sequence[Solid], is_open: bool = False
) -> Body:
    """The body of the `chosen` triangles, which is one of the `solids` of the file's text if it is any."""
    if not len(chosen):
        return Body(name, place.path, place.place)
    corners = triangles.corners[chosen].reshape(-1, 3) @ place.place[:3, :3].T + place.place[:3, 3]
    surfaces = [triangles.surfaces[place.shape][number] for number in np.unique(triangles.brep[chosen])]
    names = () if triangles.coloured[place.shape] else _face_names(surfaces, solids, triangles.unit)
    return Body(name, place.path, place.place, chosen, corners.min(axis=0), corners.max(axis=0), is_open, names)


def _face_names(surfaces: Sequence[AnalyticSurface | None], solids: Sequence[Solid], unit: float) -> tuple[str, ...]:
    """What the only solid calls its faces that has as many, with these surfaces in this order; of several such, if all agree.

    The kernel puts faces in another order where it mends a shell.
    """
    alike = {
        tuple(face.name for face in solid.faces)
        for solid in solids
        if len(solid.faces) == len(surfaces)
        and all(_is_on(f, surface, unit) for f, surface in zip(solid.faces, surfaces, strict=True))
    }
    return alike.pop() if len(alike) == 1 else ()


def _is_on(face: NamedFace, surface: AnalyticSurface | None, unit: float) -> bool:
    """Whether a face of the file's text may have a surface: nothing that is known of both contradicts it."""
    if surface is None:
        return True
    if face.kind != surface.kind or face.location is None:
        return False
    offset = surface.offset(unit * np.array(face.location))
    return float(np.linalg.norm(offset)) < SAME * max(1.0, float(np.abs(surface.origin).max()))


def _runs(triangles: Triangles, own: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """The bodies in the shape that consists of its `own` triangles, by their indices, cavities included. Is the body open?

    Sheets that do not close are one body together: surfaces of a part need not be sewn.
    """
    order = own[np.argsort(triangles.brep[own], kind="stable")]
    brep = triangles.brep[order]
    ends_at = np.flatnonzero(_open_edges(triangles.faces[order], brep) == 0)
    runs = np.searchsorted(ends_at, brep, side="left")
    closed = [order[runs == k] for k in np.unique(runs[runs < len(ends_at)])]
    rest = order[runs == len(ends_at)]
    outer = [run for run in closed if _volume(triangles.corners[run]) >= 0]
    for run in closed:
        if _volume(triangles.corners[run]) < 0:
            around = _around(triangles, run, outer)
            if around is None:
                outer.append(run)
            else:
                outer[around] = np.concatenate([outer[around], run])
    return [*((run, False) for run in outer), *([(rest, True)] if len(rest) else [])]


def _open_edges(faces: np.ndarray, brep: np.ndarray) -> np.ndarray:
    """How many edges the first 1, 2, ... B-rep faces leave open: those that they run along more often in one sense."""
    ends, edge, _ = edges(faces)
    order = np.lexsort((np.repeat(brep, 3), edge))
    edge, at = edge[order], np.repeat(brep, 3)[order]
    sense = np.where(ends[order, 0] < ends[order, 1], 1, -1)
    new = np.r_[True, edge[1:] != edge[:-1]]
    total = np.cumsum(sense)
    total -= np.repeat((total - sense)[new], np.diff(np.r_[np.flatnonzero(new), len(edge)]))
    is_open = total != 0
    was_open = np.r_[False, is_open[:-1]] & ~new
    change = np.bincount(at, is_open.astype(int) - was_open.astype(int), int(brep.max()) + 1)
    return np.asarray(np.cumsum(change).astype(int))


def _volume(corners: np.ndarray) -> float:
    about = corners - corners.mean(axis=(0, 1))
    return float(np.einsum("ij,ij->", about[:, 0], np.cross(about[:, 1], about[:, 2])) / 6)


def _around(triangles: Triangles, run: np.ndarray, others: Sequence[np.ndarray]) -> int | None:
    """The smallest of some other runs of triangles whose box holds that of a run; None if none does."""
    own, found = triangles.corners[run].reshape(-1, 3), []
    for k, other in enumerate(others):
        box = triangles.corners[other].reshape(-1, 3)
        if (box.min(axis=0) <= own.min(axis=0)).all() and (box.max(axis=0) >= own.max(axis=0)).all():
            found.append((float(np.prod(np.ptp(box, axis=0))), k))
    return min(found)[1] if found else None
