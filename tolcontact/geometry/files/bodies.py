"""The bodies of a STEP file: their triangles and their places. A part is one body. Lengths in mm.

A product structure places shapes; a shape may hold several solids. Triangles are ordered by B-rep faces, and these by solids:
a solid ends at the face that closes its surface.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tolcontact.errors import clipped
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import edges
from tolcontact.geometry.files.step_text import NamedFace, Solid

MAX_LISTED = 12  # bodies that a message lists
POSITION_TOLERANCE = 1e-6  # [mm], beyond 1 mm from the origin a share: between a surface and its place in the file's text


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its place.

    name          a name that no other body of the file has; "" if the file states none
    path          names of the products that contain the body, from the root on
    place         (4, 4): from its own frame to the frame of the file [mm]
    triangles     (face,) its triangles among those of the file; none if they are unknown
    lower, upper  (3,) corners of the box around the body in its place; None if its triangles are unknown
    face_names    of its B-rep faces, "" for a face without a name; empty if no face has one, or names and faces do not match
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
        title = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        if self.lower is None or self.upper is None:
            return title
        size = " x ".join(f"{length:.4g}" for length in self.upper - self.lower)
        return f"{title}, {size} mm at ({', '.join(f'{x:.4g}' for x in (self.lower + self.upper) / 2)})"


@dataclass(frozen=True)
class StepMesh:
    """The triangles of a STEP file: `corners` (face, 3, 3), and `faces` (face, 3) that share vertices wherever corners meet.

    shape, brep  (face,) the shape of each triangle, in the frame of which it is, and the B-rep face within the shape
    products     (shape,) the name of each shape in the file
    coloured     (shape,) bool: whether a shape has several colours, by which its B-rep faces are ordered instead of by solids
    surfaces     (shape,): the surface of each B-rep face, None if it is unknown
    unit         [mm] of length in the file's text
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
class ShapePlace:
    """A `shape` at a `place` (4, 4) [mm]; `path` has the names of the products that contain it, and its own name."""

    shape: int
    place: np.ndarray
    path: tuple[str, ...]


def bodies(mesh: StepMesh, places: Sequence[ShapePlace], solids: Sequence[Solid]) -> list[Body]:
    """Return the bodies of a file in its order; its text states some `solids`."""
    if len(places) == 1 and (stated := _stated_bodies(mesh, places[0], solids)) is not None:
        return list(_uniquely_named(stated))
    runs: dict[int, list[tuple[np.ndarray, bool]]] = {}  # of a shape
    placed: list[Body] = []
    for place in places:
        if place.shape not in runs:
            runs[place.shape] = _runs(mesh, np.flatnonzero(mesh.shape == place.shape))
        name = place.path[-1] if place.path and place.path[-1] else str(mesh.products[place.shape])
        placed.extend(_body(mesh, place, name, triangles, solids, is_open) for triangles, is_open in runs[place.shape])
    if len(places) == 1 and len(placed) < len(solids):
        placed = [Body(solid.name) for solid in solids]
    return list(_uniquely_named(placed))


def _stated_bodies(mesh: StepMesh, place: ShapePlace, solids: Sequence[Solid]) -> list[Body] | None:
    """Return the bodies of a file with one shape at one place, None if counts of faces do not tell which they are."""
    count = int(mesh.brep.max()) + 1
    if len(solids) == 1 and len(solids[0].faces) >= count:
        name = solids[0].name or str(mesh.products[place.shape])
        return [_body(mesh, place, name, np.arange(len(mesh.faces)), solids)]
    if sum(len(solid.faces) for solid in solids) == count and not mesh.coloured[place.shape]:
        start = np.cumsum([0, *(len(solid.faces) for solid in solids)])
        label = np.searchsorted(start, mesh.brep, side="right") - 1
        return [_body(mesh, place, solid.name, np.flatnonzero(label == k), [solid]) for k, solid in enumerate(solids)]
    return None


def _uniquely_named(bodies: Sequence[Body]) -> Iterator[Body]:
    """Yield the bodies with different names: repeated names are numbered in the file's order."""
    names = {body.name for body in bodies}
    used: set[str] = set()
    for body in bodies:
        name, number = body.name, 1
        while name and (name in used or (number > 1 and name in names)):
            number += 1
            name = f"{body.name} ({number})"
        used.add(name)
        yield replace(body, name=name)


def listed(bodies: Sequence[Body]) -> str:
    """Return a list of bodies for a message: numbers, names, sizes and places."""
    entries = "; ".join(f"{number}. {body}" for number, body in enumerate(bodies[:MAX_LISTED], start=1))
    return entries + (f"; and {len(bodies) - MAX_LISTED} more" if len(bodies) > MAX_LISTED else "")


def _body(
    mesh: StepMesh, place: ShapePlace, name: str, triangles: np.ndarray, solids: Sequence[Solid], is_open: bool = False
) -> Body:
    """Return the body of some `triangles` (face,), which may be one of the `solids` in the file's text."""
    if not len(triangles):
        return Body(name, place.path, place.place)
    corners = mesh.corners[triangles].reshape(-1, 3) @ place.place[:3, :3].T + place.place[:3, 3]
    surfaces = [mesh.surfaces[place.shape][number] for number in np.unique(mesh.brep[triangles])]
    names = () if mesh.coloured[place.shape] else _face_names(surfaces, solids, mesh.unit)
    return Body(name, place.path, place.place, triangles, corners.min(axis=0), corners.max(axis=0), is_open, names)


def _face_names(surfaces: Sequence[AnalyticSurface | None], solids: Sequence[Solid], unit: float) -> tuple[str, ...]:
    """Return the face names of the solids with these surfaces in this order, none if such solids have different names.

    The order must agree, since the kernel reorders faces where it mends a shell.
    """
    matches = {
        tuple(face.name for face in solid.faces)
        for solid in solids
        if len(solid.faces) == len(surfaces)
        and all(_may_be_on(face, surface, unit) for face, surface in zip(solid.faces, surfaces, strict=True))
    }
    return matches.pop() if len(matches) == 1 else ()


def _may_be_on(face: NamedFace, surface: AnalyticSurface | None, unit: float) -> bool:
    """Return whether a face of the file's text may lie on a surface: kind and place agree as far as they are known."""
    if surface is None:
        return True
    if face.kind != surface.kind or face.location is None:
        return False
    offset = surface.offset(unit * np.array(face.location))
    return float(np.linalg.norm(offset)) < POSITION_TOLERANCE * max(1.0, float(np.abs(surface.origin).max()))


def _runs(mesh: StepMesh, triangles: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Return the `triangles` (face,) of a shape by bodies, cavities included, and whether each body is open.

    Sheets that do not close are one body together: surfaces of a part need not be sewn.
    """
    order = triangles[np.argsort(mesh.brep[triangles], kind="stable")]
    brep = mesh.brep[order]
    ends_at = np.flatnonzero(_open_edges(mesh.faces[order], brep) == 0)
    runs = np.searchsorted(ends_at, brep, side="left")
    closed = [order[runs == k] for k in np.unique(runs[runs < len(ends_at)])]
    sheets = order[runs == len(ends_at)]
    outer = [run for run in closed if _volume(mesh.corners[run]) >= 0]
    for cavity in (run for run in closed if _volume(mesh.corners[run]) < 0):
        enclosing = _enclosing(mesh, cavity, outer)
        if enclosing is None:
            outer.append(cavity)
        else:
            outer[enclosing] = np.concatenate([outer[enclosing], cavity])
    return [*((run, False) for run in outer), *([(sheets, True)] if len(sheets) else [])]


def _open_edges(faces: np.ndarray, brep: np.ndarray) -> np.ndarray:
    """Return the number of edges that the first 1, 2, ... B-rep faces leave open: more run along them in one sense."""
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
    return np.cumsum(change).astype(int)


def _volume(corners: np.ndarray) -> float:
    offset = corners - corners.mean(axis=(0, 1))
    return float(np.einsum("ij,ij->", offset[:, 0], np.cross(offset[:, 1], offset[:, 2])) / 6)


def _enclosing(mesh: StepMesh, cavity: np.ndarray, runs: Sequence[np.ndarray]) -> int | None:
    """Return the number of the smallest of some runs of triangles whose box holds the cavity's box; None if none does."""
    corners, hits = mesh.corners[cavity].reshape(-1, 3), []
    for number, run in enumerate(runs):
        box = mesh.corners[run].reshape(-1, 3)
        if (box.min(axis=0) <= corners.min(axis=0)).all() and (box.max(axis=0) >= corners.max(axis=0)).all():
            hits.append((float(np.prod(np.ptp(box, axis=0))), number))
    return min(hits)[1] if hits else None
